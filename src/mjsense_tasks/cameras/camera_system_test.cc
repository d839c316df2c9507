// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/cameras/camera_system.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>

#include "mjsense/core/error.h"
#include "mjsense/core/model_geometry.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"
#include "mjsense_tasks/cameras/frozen_cameras.h"
#include "mjsense_tasks/cameras/visibility.h"

namespace mjsense::tasks::cameras {
namespace {

using ::testing::HasSubstr;

constexpr double kDeg = std::numbers::pi / 180;

// A robot with a camera on a rotated body, a ball, a wall at larger x, and far away another ball,
// whose parent body has no geom.
constexpr char kXml[] = R"(
<mujoco>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="3 3 .1" pos="0 0 -1"/>
    <body name="wall" pos=".4 0 0"><geom type="box" size=".01 2 2"/></body>
    <body name="ball"><geom type="sphere" size=".1"/></body>
    <body name="stand" pos="-3 0 0"><body name="holder"><geom type="sphere" size=".1"/></body></body>
    <body name="robot_0/base" pos="0 0 .3" euler="0 0 90">
      <geom type="box" size=".01 .01 .01"/>
      <camera name="robot_0/eye" pos=".1 .2 .3" euler="10 20 30" fovy="50"/>
    </body>
  </worldbody>
</mujoco>)";

class Hooks final : public worlds::WorldHooks {
 public:
  explicit Hooks(std::function<void(const World&)> body) : body_(std::move(body)) {}
  void substep(const World& /*world*/) override {}
  void reset(const World& /*world*/) override {}
  void refreshed(const World& world) override { body_(world); }

 private:
  std::function<void(const World&)> body_;
};

struct Bench {
  std::shared_ptr<sim::Simulation> sim;
  CameraSystem cameras;

  explicit Bench(CameraSystemCfg cfg, int worlds = 1)
      : cameras(std::move(cfg), "robot_0/", "base") {
    scene::SceneCfg scene;
    scene.base.xml = kXml;
    for (std::size_t i = 0; i < cameras.cfg().cameras.size(); ++i) {
      const auto& mounted = cameras.mounted(static_cast<int>(i));
      if (!mounted.is_new) continue;
      auto camera = std::make_shared<sensors::CameraSensorCfg>();
      camera->name = mounted.camera;
      camera->parent_body = mounted.body;
      write_vec(mounted.pose.p, camera->pos.data());
      write_quat(mounted.pose.q, camera->quat.data());
      camera->fovy = mounted.fovy;
      scene.sensors.push_back(camera);
    }
    sim = std::make_shared<sim::Simulation>(std::make_shared<scene::Scene>(scene),
                                            sim::SimulationCfg{.num_worlds = worlds});
    cameras.initialize(*sim);
  }
  int body(const char* name) const { return mj_name2id(sim->model(), mjOBJ_BODY, name); }
  // Places the cameras of all worlds. Returns the first reason why a camera has no pose, or "".
  std::string place_cameras(std::uint64_t seed, const std::vector<std::uint64_t>& episodes) {
    std::vector<std::string> why(sim->num_worlds());
    const int objects[] = {body("ball")};
    Hooks hooks([&](const World& w) {
      why[w.id] = cameras.place_cameras(w, seed, episodes[w.id], {0, 0, 0}, objects);
    });
    sim->worlds().visit(worlds::all_worlds, hooks);
    sim->worlds().model_changed();
    sim->forward();
    for (const std::string& text : why) {
      if (!text.empty()) return text;
    }
    return "";
  }
  Pose pose(const char* camera, int world = 0) const {
    Pose found;
    Hooks hooks([&](const World& w) {
      const int id = mj_name2id(w.model, mjOBJ_CAMERA, camera);
      if (w.id == world) found = camera_pose(w.data, id);
    });
    sim->worlds().visit(worlds::all_worlds, hooks);
    return found;
  }
};

CameraMountCfg mount(const char* name, MountKind kind) {
  CameraMountCfg c;
  c.name = name;
  c.mount = kind;
  if (kind == MountKind::kMjcf) c.camera = "eye";
  return c;
}

Vec3 forward(const Pose& pose) { return rotate(pose.q, {0, 0, -1}); }
Vec3 up(const Pose& pose) { return rotate(pose.q, {0, 1, 0}); }

void expect_near(Vec3 a, Vec3 b, double tolerance) {
  EXPECT_NEAR(norm(a - b), 0, tolerance) << a.x << " " << a.y << " " << a.z;
}

TEST(LookAt, LooksAtTheTarget) {
  const Pose pose = look_at({1, 2, 3}, {1, 5, 3}, {0, 0, 1});
  expect_near(forward(pose), {0, 1, 0}, 1e-12);
  expect_near(up(pose), {0, 0, 1}, 1e-12);
  // If `up` is parallel to the viewing direction, x is up; looking along x, y is.
  expect_near(up(look_at({0, 0, 1}, {0, 0, 0}, {0, 0, 1})), {1, 0, 0}, 1e-12);
  expect_near(up(look_at({0, 0, 0}, {1, 0, 0}, {1, 0, 0})), {0, 1, 0}, 1e-12);
}

TEST(CameraSystem, MountsHaveTheConfiguredPoses) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("wrist", MountKind::kMjcf), mount("shoulder", MountKind::kBody),
                 mount("above", MountKind::kLookAt), mount("corner", MountKind::kFixed)};
  cfg.cameras[1].pos = {1, 0, 0};
  cfg.cameras[2].pos = {0, 0, 1};
  cfg.cameras[2].target = {1, 0, 1};
  cfg.cameras[3].pos = {0, -2, 0};
  Bench bench(cfg);
  EXPECT_FALSE(bench.cameras.varies());
  EXPECT_EQ(bench.cameras.mounted(0).camera, "robot_0/eye");
  expect_near(bench.pose("shoulder").p, {0, 1, .3}, 1e-12);  // the base is rotated by 90 degrees
  expect_near(forward(bench.pose("shoulder")), {0, 0, -1}, 1e-12);
  expect_near(bench.pose("above").p, {0, 0, 1.3}, 1e-12);
  expect_near(forward(bench.pose("above")), {0, 1, 0}, 1e-12);
  expect_near(forward(bench.pose("corner")), {0, 1, 0}, 1e-12);
}

TEST(CameraSystem, TheFieldOfViewIsTheConfiguredOneOrThatOfTheCamera) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("wrist", MountKind::kMjcf), mount("shoulder", MountKind::kBody),
                 mount("narrow", MountKind::kBody), mount("narrow_wrist", MountKind::kMjcf)};
  cfg.cameras[2].fovy = 20;
  cfg.cameras[3].fovy = 20;
  Bench bench(cfg);
  const auto frozen = nlohmann::json::parse(bench.cameras.frozen(0));
  EXPECT_EQ(frozen["wrist"]["fovy"], 50);  // of the MJCF camera
  EXPECT_EQ(frozen["shoulder"]["fovy"], 45);
  EXPECT_EQ(frozen["narrow"]["fovy"], 20);
  EXPECT_EQ(frozen["narrow_wrist"]["fovy"], 20);
}

// Before the first episode an orbit camera looks at its target from the largest distance and height.
TEST(CameraSystem, BeforeAnEpisodeAnOrbitCameraShowsItsTarget) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("exo", MountKind::kOrbit)};
  cfg.cameras[0].distance_range = {.6, 1};
  cfg.cameras[0].height_range = {-.1, .2};
  cfg.cameras[0].target = {0, .5, .1};
  Bench bench(cfg);
  const Pose pose = bench.pose("exo");
  expect_near(pose.p, {1, 0, .2}, 1e-9);
  expect_near(forward(pose), normalized(Vec3{-1, .5, -.1}), 1e-9);
  EXPECT_GT(up(pose).z, .9);
}

TEST(CameraSystem, NoiseIsBoundedAndDependsOnTheEpisodeOnly) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("wrist", MountKind::kMjcf), mount("corner", MountKind::kFixed)};
  cfg.cameras[0].pos_noise = {.01, 0, 0};  // along the camera's x axis
  cfg.cameras[0].rot_noise = {0, 0, 5};
  cfg.cameras[0].fovy_noise = 4;
  cfg.cameras[1].pos = {0, -2, 0};
  cfg.cameras[1].pos_noise = {0, 0, .5};  // along the viewing direction
  Bench bench(cfg, 3), other(cfg, 1);
  const Pose rest = bench.pose("robot_0/eye");
  double maximum = 0;
  for (std::uint64_t episode = 0; episode < 40; episode += 2) {
    ASSERT_EQ(bench.place_cameras(7, {episode, episode + 1, episode}), "");
    ASSERT_EQ(other.place_cameras(7, {episode + 1}), "");
    EXPECT_EQ(bench.cameras.frozen(0), bench.cameras.frozen(2));
    EXPECT_EQ(bench.cameras.frozen(1), other.cameras.frozen(0));
    EXPECT_NE(bench.cameras.frozen(0), bench.cameras.frozen(1));
    const Pose now = bench.pose("robot_0/eye");
    const Vec3 moved = rotate(conjugate(rest.q), now.p - rest.p);
    EXPECT_LE(std::abs(moved.x), .01 + 1e-9);
    EXPECT_NEAR(moved.y, 0, 1e-9);
    EXPECT_NEAR(moved.z, 0, 1e-9);
    expect_near(forward(now), forward(rest), 1e-6);  // the rotation is about the viewing axis
    EXPECT_LE(angle_between(rest.q, now.q), 5 * kDeg + 1e-9);
    maximum = std::max(maximum, angle_between(rest.q, now.q));
    const Pose corner = bench.pose("corner");
    EXPECT_NEAR(corner.p.x, 0, 1e-9);
    EXPECT_NEAR(corner.p.y, -2, .5);
    EXPECT_NE(corner.p.y, -2);
    const auto frozen = nlohmann::json::parse(bench.cameras.frozen(0));
    EXPECT_EQ(frozen["wrist"]["body"], "robot_0/base");
    EXPECT_NEAR(frozen["wrist"]["fovy"].get<double>(), 50, 4);
    EXPECT_NEAR(frozen["corner"]["pos"][1].get<double>(), corner.p.y, 1e-12);
    EXPECT_NEAR(frozen["corner"]["forward"][1].get<double>(), 1, 1e-9);
  }
  EXPECT_GT(maximum, 3 * kDeg);
}

// Every kind of mount moves by at most its noise.
TEST(CameraSystem, EveryMountStaysWithinItsNoise) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("body", MountKind::kBody), mount("look", MountKind::kLookAt),
                 mount("fixed", MountKind::kFixed)};
  for (CameraMountCfg& c : cfg.cameras) {
    c.pos_noise = {.1, .1, .1};
    if (c.mount == MountKind::kBody) continue;
    c.pos = {0, -2, 0};
    c.target = {0, 0, 1};
  }
  Bench bench(cfg);
  Pose rest[3];
  double maximum[3] = {0, 0, 0};
  const char* names[] = {"body", "look", "fixed"};
  for (int i = 0; i < 3; ++i) rest[i] = bench.pose(names[i]);
  for (std::uint64_t episode = 0; episode < 60; ++episode) {
    ASSERT_EQ(bench.place_cameras(1, {episode}), "");
    for (int i = 0; i < 3; ++i)
      maximum[i] = std::max(maximum[i], norm(bench.pose(names[i]).p - rest[i].p));
  }
  for (int i = 0; i < 3; ++i) {
    EXPECT_GT(maximum[i], .1) << names[i];
    EXPECT_LE(maximum[i], .1 * std::sqrt(3)) << names[i];
  }
}

TEST(CameraSystem, DrawsDoNotDependOnOtherCameras) {
  CameraSystemCfg one, two;
  CameraMountCfg orbit = mount("exo", MountKind::kOrbit);
  orbit.distance_range = {.5, .8};
  one.cameras = {orbit};
  two.cameras = {mount("wrist", MountKind::kMjcf), orbit};
  two.cameras[0].fovy_noise = 3;
  Bench a(one), b(two);
  ASSERT_EQ(a.place_cameras(1, {5}), "");
  ASSERT_EQ(b.place_cameras(1, {5}), "");
  const Pose pa = a.pose("exo"), pb = b.pose("exo");
  EXPECT_EQ(pa.p.x, pb.p.x);
  EXPECT_EQ(pa.q.w, pb.q.w);
}

// A ball of radius r at distance d on the axis covers a disc with a radius of f tan(asin(r / d))
// pixels.
TEST(Visibility, BallCoversItsDisc) {
  Bench bench(CameraSystemCfg{});
  std::vector<double> shares;
  const int bodies[] = {bench.body("ball"), bench.body("wall")};
  const int width = 640, height = 480;
  for (double distance : {.5, 1.0, 2.0}) {
    Hooks hooks([&](const World& w) {
      bench.sim->rays().update(w);
      shares = visible_shares(bench.sim->rays(), 0,
                              {look_at({0, -distance, 0}, {0, 0, 0}, {0, 0, 1}), 60, width, height},
                              bodies);
    });
    bench.sim->worlds().visit(worlds::all_worlds, hooks);
    const double focal = .5 * height / std::tan(30 * kDeg);
    const double radius = focal * std::tan(std::asin(.1 / distance));
    const double share = std::numbers::pi * radius * radius / (width * height);
    EXPECT_NEAR(shares[0], share, .02 * share + 1e-4);
    EXPECT_GT(shares[1], 0);
  }
}

TEST(Visibility, BodyIsVisibleThroughTheGeomsOfItsChildren) {
  Bench bench(CameraSystemCfg{});
  std::vector<double> shares;
  const int bodies[] = {bench.body("stand"), bench.body("holder"), bench.body("ball")};
  Hooks hooks([&](const World& w) {
    bench.sim->rays().update(w);
    shares = visible_shares(bench.sim->rays(), 0,
                            {look_at({-3, -1, 0}, {-3, 0, 0}, {0, 0, 1}), 60, 160, 120}, bodies);
  });
  bench.sim->worlds().visit(worlds::all_worlds, hooks);
  EXPECT_GT(shares[0], 0.01);
  EXPECT_EQ(shares[0], shares[1]);
  EXPECT_EQ(shares[2], 0);
}

TEST(CameraSystem, OrbitCamerasSeeTheObject) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("exo", MountKind::kOrbit)};
  CameraMountCfg& c = cfg.cameras[0];
  c.distance_range = {.6, 1};
  c.height_range = {-.1, .1};
  c.min_visible = .005;
  Bench bench(cfg);
  for (std::uint64_t episode = 0; episode < 30; ++episode) {
    ASSERT_EQ(bench.place_cameras(0, {episode}), "");
    const Pose pose = bench.pose("exo");
    const Vec3 flat{pose.p.x, pose.p.y, 0};
    EXPECT_GE(norm(flat), .6 - 1e-9);
    EXPECT_LE(norm(flat), 1 + 1e-9);
    EXPECT_LE(std::abs(pose.p.z), .1 + 1e-9);
    expect_near(forward(pose), normalized(-pose.p), 1e-9);
    EXPECT_LT(pose.p.x, .4);  // not behind the wall
  }
}

TEST(CameraSystem, TheFieldOfViewOfAnOrbitCameraVaries) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("exo", MountKind::kOrbit)};
  cfg.cameras[0].fovy = 50;
  cfg.cameras[0].fovy_noise = 4;
  Bench bench(cfg);
  double minimum = 50, maximum = 50;
  for (std::uint64_t episode = 0; episode < 20; ++episode) {
    ASSERT_EQ(bench.place_cameras(0, {episode}), "");
    const double fovy = nlohmann::json::parse(bench.cameras.frozen(0))["exo"]["fovy"];
    minimum = std::min(minimum, fovy);
    maximum = std::max(maximum, fovy);
  }
  EXPECT_GE(minimum, 46);
  EXPECT_LT(minimum, 48);
  EXPECT_GT(maximum, 52);
  EXPECT_LE(maximum, 54);
}

// A recorded episode can be rendered again.
TEST(CameraSystem, FrozenCamerasAreThoseOfTheEpisode) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("shoulder", MountKind::kBody), mount("exo", MountKind::kOrbit)};
  cfg.cameras[0].pos = {.1, .2, .3};
  cfg.cameras[0].quat = {.8, .6, 0, 0};
  cfg.cameras[0].pos_noise = {.05, .05, .05};
  cfg.cameras[0].rot_noise = {5, 5, 5};
  cfg.cameras[0].fovy_noise = 3;
  Bench bench(cfg);
  ASSERT_EQ(bench.place_cameras(0, {4}), "");
  const std::string text = bench.cameras.frozen(0);
  const CameraSystemCfg frozen = read_frozen(text, "robot_0/", "obs_scene");
  EXPECT_EQ(frozen.cameras.at(0).body, "base");
  EXPECT_EQ(frozen.cameras.at(1).body, "");
  const Bench again(frozen);
  for (const char* name : {"shoulder", "exo"}) {
    expect_near(again.pose(name).p, bench.pose(name).p, 1e-9);
    EXPECT_NEAR(angle_between(again.pose(name).q, bench.pose(name).q), 0, 1e-6) << name;
  }
  EXPECT_EQ(nlohmann::json::parse(again.cameras.frozen(0))["shoulder"]["fovy"],
            nlohmann::json::parse(text)["shoulder"]["fovy"]);
}

TEST(CameraSystem, FrozenTextThatIsNotOfCamerasIsRefused) {
  for (const char* text :
       {"", "{}", "[]", "3", R"({"exo": 3})", R"({"exo": {"pos": [0, 0, 0]}})",
        R"({"exo": {"pos": [0, 0], "fovy": 45, "forward": [1, 0, 0], "up": [0, 0, 1]}})",
        R"({"exo": {"pos": [0, 0, 0], "fovy": 45, "body": "robot_1/base", "quat": [1, 0, 0, 0]}})"})
    EXPECT_THROW((void)read_frozen(text, "robot_0/", "obs_scene"), ValueError) << text;
}

TEST(CameraSystem, WithoutAVisiblePoseItFailsOrUsesTheBest) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("exo", MountKind::kOrbit)};
  CameraMountCfg& c = cfg.cameras[0];
  c.distance_range = {.6, 1};
  c.azimuth_range = {-10, 10};  // behind the wall
  c.min_visible = .005;
  c.max_attempts = 5;
  EXPECT_THAT(Bench(cfg).place_cameras(0, {0}),
              HasSubstr("camera 'exo': none of the 5 poses around (0.000, 0.000, 0.000) shows"));
  c.relaxed = true;
  EXPECT_EQ(Bench(cfg).place_cameras(0, {0}), "");
}

TEST(CameraSystem, ErrorsNameTheCamera) {
  const auto fault = [](const std::function<void(CameraMountCfg&)>& change, MountKind kind) {
    CameraSystemCfg cfg;
    cfg.cameras = {mount("eye_1", kind)};
    cfg.cameras[0].pos = {1, 0, 0};
    change(cfg.cameras[0]);
    return error_of<ValueError>([&] { CameraSystem(cfg, "robot_0/", "base"); });
  };
  EXPECT_THAT(fault([](auto& c) { c.camera = ""; }, MountKind::kMjcf), HasSubstr("camera 'eye_1'"));
  EXPECT_THAT(fault([](auto& c) { c.camera = "x"; }, MountKind::kBody),
              HasSubstr("applies to mount 'mjcf' only"));
  EXPECT_THAT(fault([](auto& c) { c.body = "x"; }, MountKind::kOrbit),
              HasSubstr("the mount is 'orbit'"));
  EXPECT_THAT(fault([](auto& c) { c.quat = {}; }, MountKind::kBody), HasSubstr("quat is zero"));
  EXPECT_THAT(fault([](auto& c) { c.target = c.pos; }, MountKind::kFixed),
              HasSubstr("viewing direction"));
  EXPECT_THAT(fault(
                  [](auto& c) {
                    c.distance_range = {2, 1};
                  },
                  MountKind::kOrbit),
              HasSubstr("distance_range is from 2 to 1"));
  EXPECT_THAT(fault([](auto& c) { c.fovy_noise = 50; }, MountKind::kOrbit),
              HasSubstr("is not within"));
  CameraSystemCfg twice;
  twice.cameras = {mount("a", MountKind::kOrbit), mount("a", MountKind::kMjcf)};
  EXPECT_THROW(CameraSystem(twice, "robot_0/", "base"), ValueError);
  CameraSystemCfg unknown;
  unknown.cameras = {mount("wrist", MountKind::kMjcf)};
  unknown.cameras[0].camera = "ey";
  EXPECT_THROW(Bench bench(unknown), KeyError);
}

// A camera that asks for visible objects keeps its pose where it shows them and is moved where it does not.
TEST(CameraSystem, CameraThatDoesNotShowTheObjectIsMoved) {
  CameraSystemCfg cfg;
  cfg.cameras = {mount("sees", MountKind::kFixed), mount("blocked", MountKind::kFixed),
                 mount("turned", MountKind::kLookAt)};
  cfg.cameras[0].pos = {0, -1, 0};
  cfg.cameras[1].pos = {1, 0, 0};  // behind the wall
  cfg.cameras[2].pos = {.1, .2, .3};
  cfg.cameras[2].target = {0, 0, 5};  // the ceiling
  for (CameraMountCfg& c : cfg.cameras) {
    c.min_visible = .002;
    c.distance_range = {.6, 1};
    c.height_range = {.1, .4};
  }
  Bench bench(cfg);
  for (std::uint64_t episode = 0; episode < 10; ++episode) {
    ASSERT_EQ(bench.place_cameras(0, {episode}), "");
    expect_near(bench.pose("sees").p, {0, -1, 0}, 1e-9);
    for (const char* name : {"blocked", "turned"}) {
      const Pose pose = bench.pose(name);
      EXPECT_LT(pose.p.x, .4) << name << " is still behind the wall";
      expect_near(forward(pose), normalized(-pose.p), 1e-9);
    }
  }
  EXPECT_EQ(nlohmann::json::parse(bench.cameras.frozen(0))["turned"]["body"], "robot_0/base");
}

// From inside a box a camera would see out through its walls.
TEST(Visibility, CameraInsideAGeomIsDetected) {
  Bench bench(CameraSystemCfg{});
  Hooks hooks([&](const World& w) {
    bench.sim->rays().update(w);
    const rays::RayScene& rays = bench.sim->rays();
    EXPECT_TRUE(is_inside(rays, 0, look_at({.4, 0, .3}, {0, 0, 0}, {0, 0, 1})));
    EXPECT_FALSE(is_inside(rays, 0, look_at({.3, 0, .3}, {0, 0, 0}, {0, 0, 1})));
    EXPECT_FALSE(is_inside(rays, 0, look_at({0, -1, .3}, {0, 0, 0}, {0, 0, 1})));
  });
  bench.sim->worlds().visit(worlds::all_worlds, hooks);
}

}  // namespace
}  // namespace mjsense::tasks::cameras
