// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/cameras/camera_system.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/named.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/cameras/visibility.h"

namespace mjsense::tasks::cameras {
namespace {

constexpr double kDefaultFovy = 45;  // degrees, MuJoCo's default
constexpr double kRad = std::numbers::pi / 180;

Vec3 vec(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

double around(Rng& rng, double half) { return half > 0 ? rng.uniform(-half, half) : 0.0; }
Vec3 around(Rng& rng, const std::array<double, 3>& half) {
  const double x = around(rng, half[0]), y = around(rng, half[1]);
  return {x, y, around(rng, half[2])};
}

// Rotation by the three angles (degrees) about the fixed axes x, then y, then z.
Quat turned(Vec3 degrees) {
  return axis_angle({0, 0, 1}, kRad * degrees.z) * axis_angle({0, 1, 0}, kRad * degrees.y) *
         axis_angle({1, 0, 0}, kRad * degrees.x);
}

// Pose of a mount before its first episode, in the frame of its body.
Pose pose_of(const CameraMountCfg& c) {
  switch (c.mount) {
    case MountKind::kMjcf:
      break;
    case MountKind::kBody:
      return {vec(c.pos), normalized(quat(c.quat.data()))};
    case MountKind::kLookAt:
    case MountKind::kFixed:
      return look_at(vec(c.pos), vec(c.target), vec(c.up));
    case MountKind::kOrbit:
      return look_at({c.distance_range[1], 0, c.height_range[1]}, vec(c.target), {0, 0, 1});
  }
  return {};
}

nlohmann::ordered_json list(Vec3 v) { return {v.x, v.y, v.z}; }

}  // namespace

void validate(const CameraSystemCfg& cfg, std::string_view context) {
  for (std::size_t i = 0; i < cfg.cameras.size(); ++i) {
    validate(cfg.cameras[i], context);
    for (std::size_t k = 0; k < i; ++k) {
      if (cfg.cameras[k].name == cfg.cameras[i].name)
        throw ValueError(fmt::format("{}{}two cameras are named '{}'", context,
                                     context.empty() ? "" : ": ", cfg.cameras[i].name));
    }
  }
}

Pose look_at(Vec3 eye, Vec3 target, Vec3 up) {
  const Vec3 forward = normalized(target - eye);
  if (norm(cross(forward, normalized(up))) < 1e-3)
    up = std::abs(forward.x) > 0.9 ? Vec3{0, 1, 0} : Vec3{1, 0, 0};
  const Vec3 right = normalized(cross(forward, up));
  return {eye, quat_from_columns(right, cross(right, forward), -forward)};
}

CameraSystem::CameraSystem(CameraSystemCfg cfg, const std::string& prefix, const std::string& base)
    : cfg_(std::move(cfg)) {
  validate(cfg_, "");
  for (const CameraMountCfg& c : cfg_.cameras) {
    Mounted m;
    m.camera = c.mount != MountKind::kMjcf ? c.name : c.of_scene ? c.camera : prefix + c.camera;
    m.is_new = c.mount != MountKind::kMjcf;
    m.fovy = c.fovy.value_or(kDefaultFovy);
    if (c.mount == MountKind::kBody || c.mount == MountKind::kLookAt)
      m.body = prefix + (c.body.empty() ? base : c.body);
    m.pose = pose_of(c);
    mounted_.push_back(m);
    varies_ = varies_ || c.varies();
  }
}

void CameraSystem::initialize(sim::Simulation& simulation) {
  simulation_ = &simulation;
  const mjModel* m = simulation.model();
  ids_.clear();
  rest_.clear();
  for (std::size_t i = 0; i < mounted_.size(); ++i) {
    const int id = scene::resolve(m, mjOBJ_CAMERA, mounted_[i].camera,
                                  fmt::format("camera '{}'", cfg_.cameras[i].name));
    ids_.push_back(id);
    rest_.push_back({{vec3(m->cam_pos + 3 * id), quat(m->cam_quat + 4 * id)},
                     cfg_.cameras[i].fovy.value_or(m->cam_fovy[id])});
  }
  now_.clear();
  for (int w = 0; w < simulation.num_worlds(); ++w)
    now_.insert(now_.end(), rest_.begin(), rest_.end());
  if (!varies_) return;
  mjBatch* batch = simulation.worlds().batch();
  pos_ = static_cast<double*>(mjb_expand(batch, "cam_pos", nullptr, nullptr));
  quat_ = static_cast<double*>(mjb_expand(batch, "cam_quat", nullptr, nullptr));
  fovy_ = static_cast<double*>(mjb_expand(batch, "cam_fovy", nullptr, nullptr));
}

CameraSystem::Lens CameraSystem::with_noise(int camera, Rng& rng) const {
  const CameraMountCfg& c = cfg_.cameras[camera];
  Lens lens = rest_[camera];
  if (!c.has_noise()) return lens;
  lens.fovy += around(rng, c.fovy_noise);
  const Vec3 move = around(rng, c.pos_noise);
  const Quat turn = turned(around(rng, c.rot_noise));
  const Vec3 target = vec(c.target) + around(rng, c.target_noise);
  Pose& pose = lens.pose;
  switch (c.mount) {
    case MountKind::kMjcf:
      pose = {pose.p + rotate(pose.q, move), pose.q * turn};
      break;
    case MountKind::kBody:
      pose = {pose.p + move, turn * pose.q};
      break;
    case MountKind::kLookAt:
      pose = look_at(pose.p + move, target, vec(c.up));
      break;
    case MountKind::kFixed: {
      const Vec3 eye = pose.p + rotate(pose.q, Vec3{move.x, -move.y, -move.z});
      pose = look_at(eye, target, vec(c.up));
      pose.q = pose.q * turn;
      break;
    }
    case MountKind::kOrbit:
      break;
  }
  pose.q = normalized(pose.q);
  return lens;
}

// Share of the pixels, of the object that covers the fewest.
double CameraSystem::lowest_visible_share(int camera, const World& world, const Lens& lens,
                                          std::span<const int> objects) const {
  const CameraView from{lens.pose, lens.fovy, width(camera), height(camera)};
  double minimum = 1;
  for (double share : visible_shares(simulation_->rays(), world.id, from, objects))
    minimum = std::min(minimum, share);
  return minimum;
}

std::string CameraSystem::orbit(int camera, const World& world, Rng& rng, Vec3 centre,
                                std::span<const int> objects, double best, Lens& out) const {
  const CameraMountCfg& c = cfg_.cameras[camera];
  // The target of another mount is a point of its body.
  const Vec3 aim = c.mount == MountKind::kOrbit ? centre + vec(c.target) : centre;
  for (int attempt = 0; attempt < c.max_attempts; ++attempt) {
    const double far = rng.uniform(c.distance_range[0], c.distance_range[1]);
    const double angle = kRad * rng.uniform(c.azimuth_range[0], c.azimuth_range[1]);
    const double high = rng.uniform(c.height_range[0], c.height_range[1]);
    const Vec3 eye = centre + Vec3{far * std::cos(angle), far * std::sin(angle), high};
    const Vec3 target = aim + around(rng, c.target_noise);
    if (!(norm(target - eye) > 1e-6)) continue;
    const Lens lens{look_at(eye, target, {0, 0, 1}), out.fovy};
    if (c.min_visible > 0 && is_inside(simulation_->rays(), world.id, lens.pose)) continue;
    const double minimum =
        c.min_visible > 0 ? lowest_visible_share(camera, world, lens, objects) : 1;
    if (minimum > best) {
      best = minimum;
      out = lens;
    }
    if (minimum >= c.min_visible) return "";
  }
  if (c.relaxed && best >= 0) return "";
  return fmt::format(
      "camera '{}': none of the {} poses around ({:.3f}, {:.3f}, {:.3f}) shows every object well "
      "enough: in the best one, the least visible object covers {:.3g} % of the pixels; "
      "min_visible requires {:.3g} %",
      c.name, c.max_attempts, centre.x, centre.y, centre.z, 100 * std::max(best, 0.0),
      100 * c.min_visible);
}

std::string CameraSystem::make_visible(int camera, const World& world, Rng& rng, Vec3 centre,
                                       std::span<const int> objects, Lens& lens) const {
  const double wanted = cfg_.cameras[camera].min_visible;
  if (wanted == 0) return "";
  const int body = world.model->cam_bodyid[ids_[camera]];
  const Pose mount = body_pose(world.data, body);
  Lens in_world{mount * lens.pose, lens.fovy};
  const double shown = lowest_visible_share(camera, world, in_world, objects);
  if (shown >= wanted) return "";
  std::string why = orbit(camera, world, rng, centre, objects, shown, in_world);
  lens.pose = inverse(mount) * in_world.pose;
  return why;
}

std::string CameraSystem::place_cameras(const World& world, std::uint64_t seed,
                                        std::uint64_t episode, Vec3 centre,
                                        std::span<const int> objects) {
  if (!varies_) return "";
  const bool looks =
      std::ranges::any_of(cfg_.cameras, [](const CameraMountCfg& c) { return c.min_visible > 0; });
  if (looks) simulation_->rays().update(world);
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    const CameraMountCfg& c = cfg_.cameras[i];
    if (!c.varies()) continue;
    const int camera = static_cast<int>(i);
    // The stream is that of the camera's name: its draws do not depend on the other cameras.
    Rng rng(seed, 0, stream_of("camera/" + c.name), episode);
    Lens lens = rest_[i];
    std::string why;
    if (c.mount == MountKind::kOrbit) {
      lens.fovy += around(rng, c.fovy_noise);
      why = orbit(camera, world, rng, centre, objects, -1, lens);
    } else {
      lens = with_noise(camera, rng);
      why = make_visible(camera, world, rng, centre, objects, lens);
    }
    write(world.id, camera, lens);
    if (!why.empty()) return why;
  }
  return "";
}

void CameraSystem::write(int world, int camera, const Lens& lens) {
  const std::size_t at =
      static_cast<std::size_t>(world) * simulation_->model()->ncam + ids_[camera];
  write_vec(lens.pose.p, pos_ + 3 * at);
  write_quat(lens.pose.q, quat_ + 4 * at);
  fovy_[at] = lens.fovy;
  now_[world * ids_.size() + camera] = lens;
}

void CameraSystem::set_poses(int world, const CameraSystemCfg& given) {
  for (const CameraMountCfg& camera : given.cameras) {
    const CameraMountCfg& own = find_named(cfg_.cameras, &CameraMountCfg::name, camera.name,
                                           "the episodes' cameras", "camera");
    if (own.mount != camera.mount || own.body != camera.body)
      throw ValueError(
          fmt::format("camera '{}' is mounted on '{}' in one episode and on '{}' in another",
                      camera.name, own.body, camera.body));
    write(world, static_cast<int>(&own - cfg_.cameras.data()),
          {pose_of(camera), camera.fovy.value_or(kDefaultFovy)});
  }
}

std::string CameraSystem::frozen(int world) const {
  nlohmann::ordered_json all = nlohmann::ordered_json::object();
  const mjModel* m = simulation_->model();
  for (std::size_t i = 0; i < ids_.size(); ++i) {
    const auto& [pose, fovy] = now_[world * ids_.size() + i];
    nlohmann::ordered_json& one = all[cfg_.cameras[i].name];
    const int body = m->cam_bodyid[ids_[i]];
    if (body > 0) {
      one["body"] = m->names + m->name_bodyadr[body];
      one["pos"] = list(pose.p);
      one["quat"] = {pose.q.w, pose.q.x, pose.q.y, pose.q.z};
    } else {
      one["pos"] = list(pose.p);
      one["forward"] = list(rotate(pose.q, {0, 0, -1}));
      one["up"] = list(rotate(pose.q, {0, 1, 0}));
    }
    one["fovy"] = fovy;
  }
  return all.dump();
}

}  // namespace mjsense::tasks::cameras
