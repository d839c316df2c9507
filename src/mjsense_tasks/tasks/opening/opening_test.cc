// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/tasks/opening/opening.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <regex>
#include <set>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/core/testing/test_model.h"
#include "mjsense/scene/resolve.h"
#include "mjsense_tasks/episode/testing/played_task.h"

namespace mjsense::tasks {
namespace {

using std::numbers::pi;
using ::testing::HasSubstr;

episode::TaskCfg franka(const std::string& scene = "") {
  return episode::task_cfg("franka", scene);
}

struct Stage : episode::PlayedTask<OpeningTask> {
  Stage(episode::TaskCfg cfg, OpeningKind kind, int worlds = 3)
      : PlayedTask(worlds, std::move(cfg), kind) {}
};

ModelPtr compiled(const std::string& bodies) {
  return compile_mjcf("<mujoco><worldbody>" + bodies + "</worldbody></mujoco>");
}

// A front of 0.4 x 0.2 m at x = 0 that faces -x, with a bar 5 cm in front of it.
std::string box_with_bar(const std::string& name, const std::string& joint,
                         const std::string& more = "") {
  return "<body name='" + name + "' pos='1 0 0.5'>" + joint +
         "<geom type='box' size='.01 .2 .1'/>"
         "<geom type='capsule' fromto='-.05 -.07 .02 -.05 .07 .02' size='.008'/>" +
         more + "</body>";
}

TEST(Articulations, BarInFrontOfThePanelIsTheHandle) {
  const ModelPtr m = compiled(
      box_with_bar("drawer", "<joint type='slide' axis='-1 0 0' range='0 .3' limited='true'/>"));
  const auto found = find_articulations(m.get(), "");
  ASSERT_EQ(found.size(), 1u);
  const Articulation& one = found[0];
  EXPECT_TRUE(one.slide);
  EXPECT_EQ(one.category, "drawer");
  EXPECT_EQ(one.handle.geom, 1);
  EXPECT_NEAR(norm(one.handle.middle - Vec3{-.05, 0, .02}), 0, 1e-6);
  EXPECT_NEAR(std::abs(one.handle.direction.y), 1, 1e-6);
  EXPECT_NEAR(one.handle.outward.x, -1, 1e-9);
  EXPECT_NEAR(one.handle.half_across, .008, 1e-4);
  EXPECT_NEAR(one.handle.half_length, .078, 1e-3);
}

TEST(Articulations, BodiesThatDoNotOpenAreSkipped) {
  const std::string slide = "<joint type='slide' axis='-1 0 0' range='0 .3' limited='true'/>";
  const struct {
    const char* why;
    std::string body;
  } cases[] = {
      {"no range", box_with_bar("a", "<joint type='slide' axis='-1 0 0'/>")},
      {"a button",
       box_with_bar("b", "<joint type='slide' axis='1 0 0' range='0 .02' limited='true'/>")},
      {"a knob: it turns about its handle",
       box_with_bar(
           "c", "<joint type='hinge' axis='1 0 0' pos='0 0 .02' range='0 90' limited='true'/>")},
      {"no handle", "<body name='d'>" + slide + "<geom type='box' size='.1 .1 .1'/></body>"},
      {"two joints: no door", box_with_bar("e", slide + "<joint type='hinge' axis='0 0 1'/>")},
  };
  for (const auto& c : cases)
    EXPECT_TRUE(find_articulations(compiled(c.body).get(), "").empty()) << c.why;
  EXPECT_TRUE(find_articulations(compiled(box_with_bar("robot/x", slide)).get(), "robot/").empty());
}

TEST(Articulations, CategoryFollowsFromTheName) {
  const std::string hinge =
      "<joint type='hinge' axis='0 0 1' pos='0 .2 0' range='-100 0' limited='true'/>";
  const std::string aside = "<joint type='slide' axis='0 1 0' range='0 .3' limited='true'/>";
  const std::string out = "<joint type='slide' axis='1 0 0' range='-.3 .01' limited='true'/>";
  const std::map<std::string, std::string> expected{
      {box_with_bar("Microwave_Door", hinge), "microwave"},
      {box_with_bar("room/fridge_0/door", hinge), "fridge"},
      {box_with_bar("cabinet_top", out), "drawer"},
      {box_with_bar("cabinet_sliding", aside), "cabinet"},
      {box_with_bar("thing", hinge), "door"}};
  for (const auto& [body, category] : expected) {
    const auto found = find_articulations(compiled(body).get(), "");
    ASSERT_EQ(found.size(), 1u) << body;
    EXPECT_EQ(found[0].category, category);
  }
  // A range with negative positions: closed is the end near 0, open the other one.
  const auto found = find_articulations(compiled(box_with_bar("cabinet_top", out)).get(), "");
  EXPECT_EQ(found[0].closed, 0);
  EXPECT_EQ(found[0].open, -.3);
  EXPECT_NEAR(found[0].at(0.5), -.155, 1e-12);
  EXPECT_NEAR(found[0].fraction(-.155), 0.5, 1e-12);
}

TEST(Articulations, MotionEqualsMuJoCo) {
  for (const char* joint :
       {"<joint type='hinge' axis='.2 .1 1' pos='0 .2 0' range='-100 0' limited='true'/>",
        "<joint type='slide' axis='-1 .3 0' range='0 .3' limited='true'/>"}) {
    const ModelPtr m =
        compiled("<body pos='.3 .1 0' euler='0 20 40'>" + box_with_bar("x", joint) + "</body>");
    const auto found = find_articulations(m.get(), "");
    ASSERT_EQ(found.size(), 1u);
    const Articulation& one = found[0];
    const DataPtr d = make_data(m.get());
    const auto pose = [&](double q) {
      d->qpos[one.qpos] = q;
      mj_kinematics(m.get(), d.get());
      return body_pose(d.get(), one.body);
    };
    const Pose before = pose(0.1);
    const Vec3 axis = vec3(d->xaxis + 3 * one.joint), anchor = vec3(d->xanchor + 3 * one.joint);
    const Pose moved = one.motion(0.1, -0.4, axis, anchor) * before, truth = pose(-0.4);
    EXPECT_NEAR(norm(moved.p - truth.p), 0, 1e-12);
    EXPECT_NEAR(angle_between(moved.q, truth.q), 0, 1e-7);
  }
}

TEST(Opening, KitchensHaveAllCategories) {
  for (const char* scene : {"kitchen", "kitchen:1", "kitchen:2"}) {
    const Stage stage(franka(scene), OpeningKind::kOpen);
    std::map<std::string, int> count;
    for (const Articulation& one : stage.task.articulations()) {
      ++count[one.category];
      EXPECT_THAT(scene::name_of(stage.model, mjOBJ_GEOM, one.handle.geom), HasSubstr("/handle"));
    }
    EXPECT_GE(count["drawer"], 5) << scene;
    EXPECT_GE(count["cabinet"], 6) << scene;
    for (const char* one : {"fridge", "freezer", "oven", "microwave"})
      EXPECT_EQ(count[one], 1) << scene << one;
  }
}

TEST(Opening, EpisodeDependsOnItsNumberOnly) {
  Stage stage(franka(), OpeningKind::kClose), other(franka(), OpeningKind::kClose, 1);
  stage.start(5);
  const std::vector<double> qpos = stage.qpos();
  const std::string what = stage.task.description(0);
  stage.start(6, 2);
  EXPECT_NE(qpos, stage.qpos());
  stage.start(5, 2);
  EXPECT_EQ(qpos, stage.qpos());
  other.start(5);  // the first search of this stage: nothing is cached
  EXPECT_EQ(qpos, other.qpos());
  EXPECT_EQ(what, stage.task.description(2));
}

TEST(Opening, StartsAreFeasibleAndDiffer) {
  Stage stage(franka(), OpeningKind::kOpen);
  std::set<std::string> texts;
  std::set<double> places;
  for (int episode = 0; episode < 20; ++episode) {
    const World w = stage.start(episode);
    EXPECT_EQ(stage.task.start_error(w), "");
    for (int i = 0; i < stage.data->ncon; ++i)
      EXPECT_GT(stage.data->contact[i].dist, -0.002) << episode;
    const episode::Evaluation e = stage.task.evaluate(w);
    EXPECT_EQ(e.reward, 0);
    EXPECT_FALSE(e.success);
    texts.insert(stage.task.description(0));
    places.insert(stage.task.robot().base_pose(w).p.y);
  }
  EXPECT_GE(texts.size(), 4u);
  EXPECT_EQ(places.size(), 20u);
}

// The reward of `open` is the maximum over all articulations of the category. The Franka needs 0.15
// of the range.
TEST(Opening, OpenCountsEveryArticulationOfTheCategory) {
  Stage stage(franka(), OpeningKind::kOpen);
  const World w = stage.start(3, 1);
  const Articulation& target = stage.task.target(1);
  for (const Articulation& one : stage.task.articulations()) {
    stage.data->qpos[one.qpos] = one.at(0.149);
    const bool counts = one.category == target.category;
    EXPECT_NEAR(stage.task.evaluate(w).reward, counts ? 0.149 : 0, 1e-12) << one.name;
    EXPECT_EQ(stage.task.evaluate(w).missing, "it is not open far enough");
    stage.data->qpos[one.qpos] = one.at(0.1501);
    EXPECT_EQ(stage.task.evaluate(w).success, counts) << one.name;
    EXPECT_EQ(stage.info()["success"], counts);
    stage.data->qpos[one.qpos] = one.closed;
  }
  stage.data->qpos[target.qpos] = -0.02 * target.range();  // beyond its end: |q|
  EXPECT_NEAR(stage.task.evaluate(w).reward, 0.02, 1e-12);
}

TEST(Opening, CloseCountsOnlyTheTarget) {
  Stage stage(franka(), OpeningKind::kClose);
  for (int episode = 0; episode < 4; ++episode) {
    const World w = stage.start(episode, 1);
    const Articulation& target = stage.task.target(1);
    const episode::Evaluation e = stage.task.evaluate(w);
    EXPECT_GE(e.reward, 0.35);
    EXPECT_LE(e.reward, 0.65);
    for (const Articulation& one : stage.task.articulations()) {
      if (one.joint != target.joint) stage.data->qpos[one.qpos] = one.open;
    }
    EXPECT_EQ(stage.task.evaluate(w).reward, e.reward);
    stage.data->qpos[target.qpos] = target.at(0.149);
    EXPECT_NEAR(stage.task.evaluate(w).reward, 0.851, 1e-12);
    EXPECT_TRUE(stage.task.evaluate(w).success);
    stage.data->qpos[target.qpos] = target.at(0.151);
    EXPECT_EQ(stage.task.evaluate(w).missing, "it is not closed far enough");
    EXPECT_THAT(stage.task.description(1), HasSubstr("Close the " + target.text));
    // The success threshold of `close` corresponds to the pose in obj_end.
    stage.data->qpos[target.qpos] = target.at(0.15);
    mj_kinematics(stage.model, stage.data.get());
    const Pose goal = *stage.task.goal_pose(1, "pickup_obj");
    EXPECT_NEAR(norm(goal.p - vec3(stage.data->xpos + 3 * target.body)), 0, 1e-9);
    EXPECT_NEAR(angle_between(goal.q, quat(stage.data->xquat + 4 * target.body)), 0, 1e-7);
    const auto first =
        std::ranges::find(stage.task.articulations(), target.category, &Articulation::category);
    EXPECT_EQ(stage.info()["joint_position"], stage.data->qpos[first->qpos]);
  }
}

TEST(Opening, RobotDoesNotStartInsideFurniture) {
  Stage stage(franka(), OpeningKind::kOpen);
  const World w = stage.start(0);
  const auto start = stage.task.reach().start_of(w);
  const BaseSearch search(stage.task.robot(), stage.task.reach(), start,
                          stage.task.robot().base_pose(w));
  EXPECT_TRUE(stage.task.reach().is_collision_free(start));
  const auto at = [&](double x) { return search.placed(start, {{x, 0, 0}, {}}); };
  EXPECT_FALSE(
      stage.task.reach().is_collision_free(at(0.1)));  // the pedestal penetrates the fronts
  EXPECT_TRUE(stage.task.reach().is_collision_free(at(-0.9)));
  // The pedestal penetrates a wall.
  const int wall = scene::resolve(stage.model, mjOBJ_GEOM, "room/wall_x0", "test");
  const double inside =
      stage.model->geom_pos[3 * wall] + stage.model->geom_size[3 * wall + 2];  // its face
  EXPECT_FALSE(stage.task.reach().is_collision_free(at(inside + 0.2)));
  EXPECT_TRUE(stage.task.reach().is_collision_free(at(inside + 0.3)));
}

// The arm is interpolated linearly in joint space between the points of the path. The gripper must
// stay on the handle there, too. A path must be found again from the pose of an arm that deviates
// slightly.
TEST(Opening, GripperStaysOnTheHandleAlongThePath) {
  Stage stage(franka(), OpeningKind::kClose);
  const HandleReach& reach = stage.task.reach();
  const robots::Robot& robot = stage.task.robot();
  Rng rng(1, 0, 0, 0);
  int found = 0, again = 0;
  for (int episode = 0; episode < 50; ++episode) {
    const World w = stage.start(episode);
    const Articulation& one = stage.task.target(0);
    const double from = stage.data->qpos[one.qpos], to = stage.task.aim(one);
    HandleReach::Start start = reach.start_of(w);
    const auto path = reach.find(start, one, from, to, 12, false);
    if (!path) continue;  // a start without a path is rejected and sampled again
    ++found;
    const int arm = path->hand.tool;
    const Pose base = robot.base_pose(w);
    for (std::size_t k = 1; k < path->motion_joints.size(); ++k) {
      robots::RobotValues between = path->motion_joints[k];
      for (int i = 0; i < between[arm].size; ++i)
        between[arm].values[i] =
            0.5 * (between[arm].values[i] + path->motion_joints[k - 1][arm].values[i]);
      const double part =
          (static_cast<double>(k) - 0.5) / (static_cast<double>(path->motion_joints.size()) - 1);
      const Pose handle = reach.body_pose(start, one, std::lerp(from, to, part)) * path->on_body;
      EXPECT_LT(norm((base * robot.fk(arm, between)).p - handle.p), 0.0125) << episode << ", " << k;
    }
    const auto& qpos = robot.groups()[arm].qpos;
    for (std::size_t i = 0; i < qpos.size(); ++i)
      start.qpos[qpos[i]] = path->approach_joints.back()[arm].values[i] + rng.uniform(-0.02, 0.02);
    again += reach.again(start, one, from, to, *path).has_value();
  }
  EXPECT_GE(found, 45);
  EXPECT_GE(again, found - 1);
}

// The tool of a floating gripper moves with the handle about the door's hinge. At the start, it
// floats in front of the handle without touching anything.
TEST(Opening, FloatingGripperMovesOnAScrew) {
  Stage stage(episode::task_cfg("floating_rum"), OpeningKind::kOpen, 1);
  const HandleReach& reach = stage.task.reach();
  ASSERT_EQ(reach.hands().size(), 1u);
  EXPECT_TRUE(reach.hands()[0].floats());
  EXPECT_FALSE(reach.drives());
  for (int episode = 0; episode < 6; ++episode) {
    const World w = stage.start(episode);
    ASSERT_EQ(stage.task.start_error(w), "");
    const Articulation& one = stage.task.target(0);
    const double from = w.data->qpos[one.qpos], to = stage.task.aim(one);
    const auto start = reach.start_of(w);
    EXPECT_TRUE(reach.is_collision_free(start));
    const auto path = reach.find(start, one, from, to, 40, false);
    ASSERT_TRUE(path) << episode;
    const Pose tool =
        stage.task.robot().base_pose(w) * stage.task.robot().tcp_pose(w, reach.hands()[0].tool);
    EXPECT_NEAR(norm(path->approach.front().p - tool.p), 0, 1e-9);
    EXPECT_NEAR(norm(path->grasp.p - path->approach.back().p), 0.04, 1e-9) << "of the pregrasp";
    const Pose body = reach.body_pose(start, one, from), later = reach.body_pose(start, one, to);
    const Pose in_it = inverse(body) * path->grasp, then = inverse(later) * path->end;
    EXPECT_NEAR(norm(in_it.p - then.p), 0, 1e-9);
    // A screw motion between the two poses keeps the tool on the handle halfway, too.
    const Pose half = path->grasp * exp6(0.5 * log6(inverse(path->grasp) * path->end));
    const Pose between = inverse(reach.body_pose(start, one, 0.5 * (from + to))) * half;
    EXPECT_NEAR(norm(in_it.p - between.p), 0, 1e-9);
    EXPECT_NEAR(angle_between(in_it.q, between.q), 0, 1e-6);
  }
}

// An obstacle 5 mm from the arm blocks the path. Its pose is taken from the world's own model.
TEST(Opening, CollisionChecksUseTheModelOfTheWorld) {
  Stage stage(franka(), OpeningKind::kOpen);
  const World w = stage.start(0);
  const mjModel* m = stage.model;
  mjData* d = w.data;
  const HandleReach& reach = stage.task.reach();
  EXPECT_TRUE(reach.is_collision_free(reach.start_of(w)));
  const int hand = stage.task.robot().groups()[reach.hands()[0].gripper].root_body;
  const auto touches = [&](int g) { return m->geom_contype[g] || m->geom_conaffinity[g]; };
  const int base = m->body_weldid[stage.task.robot().base_body()];
  const auto of_arm = [&](int g) {
    const int body = m->geom_bodyid[g];
    return m->body_rootid[body] == m->body_rootid[hand] && m->body_weldid[body] != base &&
           touches(g);
  };
  int moved = 0, pad = -1;
  for (int g = 0; g < m->ngeom; ++g) {
    if (observe::is_descendant_or_self(m, m->geom_bodyid[g], hand) && touches(g)) pad = g;
  }
  for (const Articulation& one : stage.task.articulations()) {
    const int top = m->body_parentid[one.body];
    if (top == 0 || one.category == "drawer")
      continue;  // drawers share the body with other drawers
    mjModel other = *m;
    std::vector<double> pos(m->body_pos, m->body_pos + 3 * m->nbody);
    other.body_pos = pos.data();
    const auto nearest = [&] {
      double minimum = 1;
      for (int a = 0; a < m->ngeom; ++a) {
        for (int b = 0; b < m->ngeom && of_arm(a); ++b) {
          if (observe::is_descendant_or_self(m, m->geom_bodyid[b], top) && touches(b))
            minimum = std::min(minimum, mj_geomDistance(m, d, a, b, 1, nullptr));
        }
      }
      return minimum;
    };
    mj_kinematics(m, d);
    // Moves the handle towards a pad.
    const Pose body = body_pose(d, one.body);
    const Vec3 by = vec3(d->geom_xpos + 3 * pad) - body * one.handle.middle;
    const auto gap = [&](double part) {
      for (int i = 0; i < 3; ++i)
        pos[3 * top + i] = m->body_pos[3 * top + i] + part * (i == 0 ? by.x : i == 1 ? by.y : by.z);
      mj_kinematics(&other, d);
      return nearest();
    };
    double low = 0, high = 1;  // find by bisection the fraction at which the gap is 5 mm
    for (int k = 0; k < 30; ++k)
      (gap(0.5 * (low + high)) > 0.005 ? low : high) = 0.5 * (low + high);
    if (std::abs(gap(low) - 0.005) > 1e-3) continue;  // another geom is closer
    const auto near = reach.start_of(World{.id = 0, .model = &other, .data = d});
    EXPECT_FALSE(reach.is_collision_free(near)) << one.name;
    EXPECT_NEAR(norm(reach.body_pose(near, one, one.closed).p - vec3(d->xpos + 3 * one.body)), 0,
                1e-9);
    ++moved;
  }
  EXPECT_GE(moved, 5);
}

TEST(Opening, ErrorsNameWhatIsMissing) {
  EXPECT_THAT(error_of<ValueError>([&] { Stage stage(franka("table"), OpeningKind::kOpen); }),
              HasSubstr("task 'open': scene 'table' has nothing to open"));
}

// The phrase of an instruction fits the target, and no other articulation of the scene unless any
// of them will do.
TEST(Opening, InstructionsDescribeTheTarget) {
  const std::regex phrase(
      "(the|an?|one of the) (?:(left|right|upper|lower|leftmost|rightmost|highest|lowest|open) )?"
      "(drawer|cabinet|microwave|fridge|freezer|oven|dishwasher|door)s?");
  for (OpeningKind kind : {OpeningKind::kOpen, OpeningKind::kClose}) {
    Stage stage(franka(), kind, 1);
    std::set<std::string> sentences;
    for (int episode = 0; episode < 40; ++episode) {
      const World w = stage.start(episode);
      const std::string sentence = stage.task.instruction(0);
      sentences.insert(sentence);
      std::smatch found;
      ASSERT_TRUE(std::regex_search(sentence, found, phrase)) << sentence;
      const Articulation& target = stage.task.target(0);
      EXPECT_EQ(found[3].str(), target.category) << sentence;
      const Pose base = stage.task.robot().base_pose(w);
      const auto handle = [&](const Articulation& one) {
        return inverse(base) * (body_pose(w.data, one.body) * one.handle.middle);
      };
      const auto fits = [&](const Articulation& one) {
        if (one.category != target.category) return false;
        const std::string word = found[2];
        if (word == "open") return one.fraction(w.data->qpos[one.qpos]) > 0.2;
        const Vec3 d = handle(one) - handle(target);
        if (word.starts_with("left")) return d.y > -0.05;
        if (word.starts_with("right")) return d.y < 0.05;
        if (word == "upper" || word == "highest") return d.z > -0.05;
        if (word == "lower" || word == "lowest") return d.z < 0.05;
        return true;
      };
      const auto count = std::ranges::count_if(stage.task.articulations(), fits);
      if (found[1] == "the")
        EXPECT_EQ(count, 1) << sentence;
      else
        EXPECT_GT(count, 1) << sentence;
      EXPECT_EQ(found[1] == "the" || kind == OpeningKind::kOpen, true) << sentence;
    }
    EXPECT_GT(sentences.size(), 20u);
  }
}

}  // namespace
}  // namespace mjsense::tasks
