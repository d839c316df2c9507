// SPDX-License-Identifier: Apache-2.0
#include "mjsense/tasks/pick/pick.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/scene/resolve.h"

namespace mjsense {
namespace {

using std::numbers::pi;

// What lies on the table, and how people refer to it.
struct Kind {
  const char* name;  // of its model, entity and body
  const char* text;
  std::array<const char*, 2> others;
  bool lies = false;    // may also lie on its side
  bool on_end = false;  // may also stand on an end
};
constexpr Kind kKinds[] = {
    {"red_block", "red block", {"wooden block", "brick"}, true, true},
    {"blue_cube", "blue cube", {"cube", "blue block"}},
    {"soup_can", "soup can", {"can", "tin can"}, true},
    {"yellow_puck", "yellow puck", {"puck", "yellow disc"}},
    {"marker", "green marker", {"marker", "pen"}},
    {"mug", "mug", {"teal mug", "cup"}},
    {"pear", "pear", {"green pear", "fruit"}},
    {"toy_bone", "toy bone", {"dog toy", "orange bone"}},
};

// One of the ways in which an object rests.
Quat draw_rest(const Kind& kind, Rng& rng) {
  const std::uint32_t choice = rng.below(1u + kind.lies + kind.on_end);
  if (choice == 0) return {};
  return choice == 1 ? axis_angle({0, 1, 0}, 0.5 * pi) : axis_angle({1, 0, 0}, 0.5 * pi);
}

// What an object takes up in a resting orientation.
struct Footprint {
  double radius = 0;  // m, about the vertical through the body's origin
  double low = 0;     // m, its lowest point
};

Footprint footprint(const ObjectShape& shape, Quat rest) {
  Footprint print;
  for (Vec3 point : shape.points) {
    const Vec3 p = rotate(rest, point);
    print.radius = std::max(print.radius, std::hypot(p.x, p.y));
    print.low = std::min(print.low, p.z);
  }
  return print;
}

// Where objects may stand: the target where the arm reaches it from above, the others anywhere on
// the table.
struct Area {
  double x0, x1, y0, y1;
};
constexpr Area kTargetArea{0.42, 0.66, -0.25, 0.25};
constexpr Area kTableArea{0.38, 0.98, -0.50, 0.50};
// m, free between two objects; around the target there is room for an open gripper.
constexpr double kGap = 0.02, kTargetGap = 0.07;
constexpr double kDrop = 0.0003;  // m above the table at the start
constexpr double kLift = 0.01;    // m of success
constexpr double kGoal = 0.05;    // m, goal above the start

void add_look(mjSpec* spec) {
  auto& light = spec->visual.headlight;
  for (int i = 0; i < 3; ++i) {
    light.ambient[i] = 0.30f;
    light.diffuse[i] = 0.18f;
    light.specular[i] = 0.05f;
  }
  spec->visual.quality.shadowsize = 4096;
  mjsTexture* sky = mjs_addTexture(spec, nullptr);
  sky->type = mjTEXTURE_SKYBOX;
  sky->builtin = mjBUILTIN_GRADIENT;
  const double top[3] = {0.55, 0.67, 0.80}, bottom[3] = {0.86, 0.89, 0.92};
  std::copy(top, top + 3, sky->rgb1);
  std::copy(bottom, bottom + 3, sky->rgb2);
  sky->width = 256;
  sky->height = 256 * 6;
}

}  // namespace

SceneCfg PickTask::scene_cfg() const {
  SceneCfg scene;
  EntityCfg room;
  room.model.path = "embedded:tasks/pick.xml";
  scene.entities = {{"room", room}, {"robot_0", {}}};  // a place for the robot
  for (const Kind& kind : kKinds) {
    EntityCfg object;
    object.model.path = fmt::format("embedded:objects/{}.xml", kind.name);
    scene.entities.emplace_back(kind.name, object);
  }
  scene.extent = 2.0;
  // An elliptic cone with impratio above 1 keeps a held object from creeping out of the pads.
  scene.options.cone = "elliptic";
  scene.options.impratio = 10;
  scene.spec_fn = add_look;
  return scene;
}

void PickTask::initialize_task() {
  objects_.clear();
  for (const Kind& kind : kKinds) {
    const int body = resolve(model(), mjOBJ_BODY, fmt::format("{0}/{0}", kind.name), "task 'pick'");
    objects_.push_back({body, kind.name, object_shape(model(), body)});
  }
  targets_.assign(num_worlds(), {});
  for (Target& target : targets_) {
    target.object = {std::string(kRole), objects_[0].body, kKinds[0].text};
  }
  robot_root_ = model()->body_rootid[robot().base_body()];
  const int top = resolve(model(), mjOBJ_GEOM, "room/table_top", "task 'pick'");
  table_height_ = model()->body_pos[3 * model()->geom_bodyid[top] + 2] +
                  model()->geom_pos[3 * top + 2] + model()->geom_size[3 * top + 2];
}

void PickTask::place(int object, const Pose& pose, const StateRow& state) const {
  const int joint = model()->body_jntadr[objects_[object].body];
  double* qpos = state.qpos + model()->jnt_qposadr[joint];
  double* qvel = state.qvel + model()->jnt_dofadr[joint];
  write_vec(pose.p, qpos);
  write_quat(pose.q, qpos + 3);
  std::fill(qvel, qvel + 6, 0.0);
}

std::optional<Pose> PickTask::sample_scene(int world, Rng& rng, const StateRow& state) {
  const int n = static_cast<int>(objects_.size());
  const int target = static_cast<int>(rng.below(n));
  targets_[world].index = target;
  targets_[world].object = {std::string(kRole), objects_[target].body, kKinds[target].text};

  struct Spot {
    double x, y;
  };
  std::vector<Spot> spots(n);
  std::vector<Footprint> prints(n);
  std::vector<int> placed;
  // Metres to spare at a spot: negative where objects would stand too close.
  const auto clearance = [&](int object, Spot s) {
    double least = 1.0;
    for (int other : placed) {
      const double gap = object == target || other == target ? kTargetGap : kGap;
      const double distance = std::hypot(s.x - spots[other].x, s.y - spots[other].y);
      least = std::min(least, distance - prints[object].radius - prints[other].radius - gap);
    }
    return least;
  };
  const auto draw = [&](const Area& area) {
    return Spot{rng.uniform(area.x0, area.x1), rng.uniform(area.y0, area.y1)};
  };

  for (int k = 0; k < n; ++k) {
    // The target first, then the others in order.
    const int object = k == 0 ? target : k <= target ? k - 1 : k;
    const Area& area = object == target ? kTargetArea : kTableArea;
    const Quat rest = draw_rest(kKinds[object], rng);
    prints[object] = footprint(objects_[object].shape, rest);
    Spot best = draw(area);
    double room = clearance(object, best);
    for (int attempt = 0; attempt < 200 && room < 0; ++attempt) {
      const Spot spot = draw(area);
      const double r = clearance(object, spot);
      if (r > room) {
        room = r;
        best = spot;
      }
    }
    spots[object] = best;
    placed.push_back(object);
    const Vec3 position{best.x, best.y, table_height_ - prints[object].low + kDrop};
    place(object, {position, axis_angle({0, 0, 1}, rng.uniform(-pi, pi)) * rest}, state);
  }
  return Pose{};
}

void PickTask::begin(const World& world) {
  Task::begin(world);
  Target& target = targets_[world.id];
  const int body = target.object.body;
  target.start = {vec3(world.data->xpos + 3 * body), quat(world.data->xquat + 4 * body)};
}

// True if the first contact that bears the object from below is not the robot's: its point below
// the middle of the object, its normal within 80 degrees of up.
bool PickTask::borne_by_others(const World& world, int body) const {
  const mjModel* m = world.model;
  double low = 1e10, high = -1e10;
  for (int g = m->body_geomadr[body]; g < m->body_geomadr[body] + m->body_geomnum[body]; ++g) {
    const double *r = world.data->geom_xmat + 9 * g, *aabb = m->geom_aabb + 6 * g;
    const double center =
        world.data->geom_xpos[3 * g + 2] + r[6] * aabb[0] + r[7] * aabb[1] + r[8] * aabb[2];
    const double half =
        std::abs(r[6]) * aabb[3] + std::abs(r[7]) * aabb[4] + std::abs(r[8]) * aabb[5];
    low = std::min(low, center - half);
    high = std::max(high, center + half);
  }
  const double steep = std::cos(80.0 / 180.0 * pi);
  for (int i = 0; i < world.data->ncon; ++i) {
    const mjContact& contact = world.data->contact[i];
    if (contact.exclude || contact.geom[0] < 0 || contact.geom[1] < 0) continue;
    const int root0 = m->body_rootid[m->geom_bodyid[contact.geom[0]]];
    const int root1 = m->body_rootid[m->geom_bodyid[contact.geom[1]]];
    if ((root0 == body) == (root1 == body)) continue;
    const double up = root1 == body ? contact.frame[2] : -contact.frame[2];
    if (contact.pos[2] < 0.5 * (low + high) && up >= steep)
      return (root1 == body ? root0 : root1) != robot_root_;
  }
  return false;
}

bool PickTask::lifted(const World& world) const {
  const Target& target = targets_[world.id];
  const int body = target.object.body;
  if (world.data->xpos[3 * body + 2] - target.start.p.z < kLift) return false;
  bool held = false;
  for (int i = 0; i < world.data->ncon; ++i) {
    const mjContact& contact = world.data->contact[i];
    if (contact.exclude || contact.geom[0] < 0 || contact.geom[1] < 0) continue;
    const mjModel* m = world.model;
    const int root0 = m->body_rootid[m->geom_bodyid[contact.geom[0]]];
    const int root1 = m->body_rootid[m->geom_bodyid[contact.geom[1]]];
    if ((root0 == body) == (root1 == body)) continue;
    if ((root0 == body ? root1 : root0) != robot_root_) return false;
    held = true;
  }
  return held;
}

Evaluation PickTask::evaluate(const World& world) const {
  const Target& target = targets_[world.id];
  const int body = target.object.body;
  const double height = world.data->xpos[3 * body + 2] - target.start.p.z;
  const double reward = borne_by_others(world, body) ? 0.0 : std::clamp(height, 0.0, 1000.0);
  return judge(world.id, reward, lifted(world));
}

std::string PickTask::description(int world) const {
  return "Pick up the " + targets_[world].object.name;
}

Task::Referrals PickTask::referrals(int world) const {
  const Kind& kind = kKinds[targets_[world].index];
  return {{std::string(kRole), {{kind.text, 0.5}, {kind.others[0], 0.3}, {kind.others[1], 0.2}}}};
}

Pose PickTask::start_pose(int world, std::string_view role) const {
  if (role != kRole) {
    const std::vector<std::string> roles{std::string(kRole)};
    throw_unknown("task 'pick'", "role", role, roles);
  }
  return targets_[world].start;
}

std::optional<Pose> PickTask::goal_pose(int world, std::string_view role) const {
  Pose pose = start_pose(world, role);
  pose.p.z += kGoal;
  return pose;
}

void PickTask::write_info(const World& world, JsonWriter& json) const {
  const Target& target = targets_[world.id];
  const int body = target.object.body;
  const Vec3 goal = target.start.p + Vec3{0, 0, kGoal};
  json.key("episode_step").value(episode_step(world.id));
  json.key("position_error").value(norm(vec3(world.data->xpos + 3 * body) - goal));
  json.key("rotation_error")
      .value(angle_between(target.start.q, quat(world.data->xquat + 4 * body)));
  json.key("success").value(lifted(world));
}

std::vector<std::pair<std::string, std::string>> PickTask::scene_info(int world) const {
  return {{"text", description(world)}, {"object_name", targets_[world].object.name}};
}

}  // namespace mjsense
