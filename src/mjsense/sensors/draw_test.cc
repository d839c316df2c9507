// SPDX-License-Identifier: Apache-2.0
// Debug drawings of sensors (Simulation::draw). For ray sensors see raycast_sensor_test.cc.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/testing/error_of.h"
#include "mjsense/sensors/builtin/builtin_sensor.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"
#include "mjsense/sensors/contact/contact_sensor.h"
#include "mjsense/sensors/imu/imu_sensor.h"
#include "mjsense/sensors/lidar/lidar_sensor.h"
#include "mjsense/sensors/raycast/raycast_sensor.h"
#include "mjsense/sensors/testing/every_sensor.h"
#include "mjsense/sensors/testing/lab.h"
#include "mjsense/sim/simulation.h"

namespace mjsense::sensors {
namespace {

using ::testing::HasSubstr;

// A box of 1 kg on the floor, a camera 2 m above the origin that looks down with x to the right,
// and a tilted site.
constexpr char kWorld[] = R"(
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <body name="box" pos="0 0 .1"><freejoint/>
      <geom name="box" type="box" size=".1 .1 .1" mass="1"/>
      <site name="tilted" pos="0 0 .2" euler="90 0 0"/>
      <body name="wheel"><joint name="hinge"/><geom size=".01" mass=".001" contype="0" conaffinity="0"/></body>
    </body>
    <camera name="top" pos="0 0 2" fovy="90"/>
  </worldbody>
</mujoco>)";

struct DrawnScene : testing::Lab {
  explicit DrawnScene(std::vector<std::shared_ptr<const SensorCfg>> sensors, int worlds = 1)
      : Lab(scene_with(std::move(sensors)), {.num_worlds = worlds}) {}

  static scene::SceneCfg scene_with(std::vector<std::shared_ptr<const SensorCfg>> sensors) {
    scene::SceneCfg s = scene_of("w", kWorld, std::move(sensors));
    s.spec_fn = [](mjSpec* spec) {
      spec->stat.meansize = 0.1;
      spec->visual.map.force = 0.01;
    };
    return s;
  }
  DebugShapes draw(std::string_view name, int world = 0) {
    Sensor* sensor[] = {&scene->sensor(name)};
    return sim->draw(world, sensor);
  }
};

template <class Cfg>
std::shared_ptr<Cfg> sensor(const char* name) {
  auto cfg = std::make_shared<Cfg>();
  cfg->name = name;
  return cfg;
}

std::shared_ptr<CameraSensorCfg> top_camera() {
  auto cfg = sensor<CameraSensorCfg>("cam");
  cfg->camera_name = "w/top";
  cfg->width = 40;
  cfg->height = 20;  // fovy is 90 degrees: at depth d the image is 2 d high and 4 d wide
  cfg->debug_vis = true;
  return cfg;
}

void expect_at(Vec3 p, double x, double y, double z) {
  EXPECT_NEAR(p.x, x, 1e-5);
  EXPECT_NEAR(p.y, y, 1e-5);
  EXPECT_NEAR(p.z, z, 1e-5);
}

// Lines of the frustum: the far rim, the near rim if there is one, then the four edges.
std::vector<DebugShape> lines(const DebugShapes& shapes) {
  std::vector<DebugShape> found;
  for (const DebugShape& s : shapes.list())
    if (s.kind == mjGEOM_LINE) found.push_back(s);
  return found;
}

TEST(Draw, FrustumReachesFromTheCameraToFar) {
  auto cfg = top_camera();
  cfg->far = 0.5;
  DrawnScene lab({cfg});
  const DebugShapes shapes = lab.sim->draw(0);
  ASSERT_EQ(shapes.list().size(), 3u + 8u);
  EXPECT_EQ(shapes.list()[0].label, "cam_x");
  expect_at(shapes.list()[0].pos, 0, 0, 2);
  expect_at(shapes.list()[0].vector, 0.5, 0, 0);  // 5 meansize
  expect_at(shapes.list()[2].vector, 0, 0, 0.5);  // the camera looks along -z
  const auto l = lines(shapes);
  ASSERT_EQ(l.size(), 8u);
  expect_at(l[0].pos, -1, 0.5, 1.5);  // top left
  expect_at(l[0].vector, 2, 0, 0);
  expect_at(l[1].vector, 0, -1, 0);
  expect_at(l[4].pos, 0, 0, 2);
  expect_at(l[4].vector, -1, 0.5, -0.5);
  EXPECT_EQ(l[4].label, "cam_frustum");
  EXPECT_EQ(l[4].width, 2);
}

TEST(Draw, FrustumHasTheGivenDepthAndTheNearPlane) {
  auto cfg = top_camera();
  cfg->near = 0.1;
  cfg->viz.show_frame = false;
  cfg->viz.frustum_depth = 1;
  DrawnScene lab({cfg});
  const auto l = lines(lab.sim->draw(0));
  ASSERT_EQ(l.size(), 12u);
  expect_at(l[0].pos, -2, 1, 1);
  expect_at(l[4].pos, -0.2, 0.1, 1.9);
  expect_at(l[8].pos, -0.2, 0.1, 1.9);
  expect_at(l[8].vector, -1.8, 0.9, -0.9);
}

TEST(Draw, OrthographicFrustumIsABox) {
  auto cfg = top_camera();
  cfg->orthographic = true;
  cfg->fovy = 1.0;
  DrawnScene lab({cfg});
  const auto l = lines(lab.draw("cam"));
  ASSERT_EQ(l.size(), 12u);
  expect_at(l[0].pos, -1, 0.5, 1);  // 10 meansize below the camera
  expect_at(l[8].pos, -1, 0.5, 2);
  expect_at(l[8].vector, 0, 0, -1);
}

TEST(Draw, FrustumOfALensIsBentWithItsRimAtOneDistance) {
  auto cfg = top_camera();
  cfg->intrinsics = CameraIntrinsics{15, 15, 20, 10};
  cfg->distortion = {"fisheye", {0, 0, 0, 0}};
  DrawnScene lab({cfg});
  const auto l = lines(lab.draw("cam"));
  ASSERT_EQ(l.size(), 4u * 8 + 4);
  for (const DebugShape& s : l) EXPECT_NEAR(norm(s.pos + s.vector - Vec3{0, 0, 2}), 1, 1e-5);
  // The corner pixel's centre is r = hypot(19.5, 9.5) / 15 rad from the axis.
  EXPECT_NEAR(l[0].pos.z, 2 - std::cos(std::hypot(19.5, 9.5) / 15), 1e-5);
}

TEST(Draw, FrustumIsAtThePoseOfTheImage) {
  auto moving = sensor<CameraSensorCfg>("cam");
  moving->parent_body = "w/box";
  moving->update_period = 0.1;
  DrawnScene lab({moving});
  lab.sim->refresh(lab.scene->sensor("cam"));
  const ArrayView v = lab.sim->worlds().state_component("qpos");
  reinterpret_cast<double*>(v.data)[0] = 3;
  lab.sim->step();
  expect_at(lab.draw("cam").list()[0].pos, 0, 0, 1.1);
}

TEST(Draw, ContactsInTheSlotsAndTheirForces) {
  auto cfg = sensor<ContactSensorCfg>("touch");
  cfg->primary = {"geom", {"box"}, "w", {}};
  cfg->fields = {"found"};  // the drawing does not depend on the fields
  cfg->num_slots = 3;
  cfg->debug_vis = true;
  DrawnScene lab({cfg}, 2);
  for (int i = 0; i < 1000; ++i) lab.sim->step();
  const DebugShapes shapes = lab.sim->draw(1);
  ASSERT_EQ(shapes.list().size(), 3u * (1 + 3 + 1));
  double force = 0;
  for (int k = 0; k < 3; ++k) {
    const DebugShape* s = shapes.list().data() + 5 * k;
    EXPECT_EQ(s[0].kind, mjGEOM_SPHERE);
    EXPECT_EQ(s[0].label, "touch_box_" + std::to_string(k));
    EXPECT_NEAR(std::abs(s[0].pos.x), 0.1, 1e-3);
    EXPECT_NEAR(std::abs(s[0].pos.y), 0.1, 1e-3);
    EXPECT_NEAR(s[0].pos.z, 0, 1e-3);
    EXPECT_EQ(s[1].label, "touch_box_" + std::to_string(k) + "_x");
    expect_at(s[1].vector, 0, 0, -0.2);  // the normal, pointing away from the box
    EXPECT_NEAR(dot(s[1].vector, s[2].vector), 0, 1e-9);
    EXPECT_NEAR(norm(cross(s[1].vector, s[2].vector) - 0.2 * s[3].vector), 0, 1e-9);
    EXPECT_EQ(s[4].label, "touch_box_" + std::to_string(k) + "_force");
    // The arrow ends at the contact point.
    EXPECT_NEAR(norm(s[4].pos + s[4].vector - s[0].pos), 0, 1e-9);
    force += s[4].vector.z / 0.01;  // vis.map.force
  }
  EXPECT_NEAR(force, -9.81 * 1.001 * 3 / 4, 1e-2);
}

TEST(Draw, NetForceIsOneArrowWithItsOwnScale) {
  auto cfg = sensor<ContactSensorCfg>("touch");
  cfg->primary = {"geom", {"box"}, "w", {}};
  cfg->reduce = "netforce";
  cfg->viz.force_scale = 0.1;
  cfg->viz.show_points = false;
  DrawnScene lab({cfg});
  for (int i = 0; i < 1000; ++i) lab.sim->step();
  const DebugShapes shapes = lab.draw("touch");
  ASSERT_EQ(shapes.list().size(), 1u);
  EXPECT_NEAR(norm(shapes.list()[0].vector - Vec3{0, 0, -0.9819}), 0, 1e-3);
  EXPECT_NEAR(norm(shapes.list()[0].pos - Vec3{0, 0, 0.9819}), 0, 1e-3);
}

TEST(Draw, BuiltinSensorIsDrawnAsItsFrame) {
  auto site = sensor<BuiltinSensorCfg>("gyro");
  site->sensor_type = "gyro";
  site->obj = {"site", "tilted", "w"};
  auto joint = sensor<BuiltinSensorCfg>("turn");
  joint->sensor_type = "jointpos";
  joint->obj = {"joint", "hinge", "w"};
  auto imu = sensor<ImuSensorCfg>("imu");
  imu->site = site->obj;
  DrawnScene lab({site, joint, imu});
  for (const char* name : {"w/gyro", "imu"}) {
    const DebugShapes shapes = lab.draw(name);
    ASSERT_EQ(shapes.list().size(), 3u) << name;
    expect_at(shapes.list()[0].pos, 0, 0, 0.3);
    expect_at(shapes.list()[1].vector, 0, 0, 0.5);
    expect_at(shapes.list()[2].vector, 0, -0.5, 0);
    EXPECT_EQ(shapes.list()[2].label, std::string(name) + "_z");
  }
  EXPECT_THAT(error_of<ValueError>([&] { lab.draw("w/turn"); }),
              HasSubstr("sensor 'w/turn': nothing to draw: this jointpos sensor is "
                        "attached to a joint, which has no frame"));
}

TEST(Draw, DrawingComputesOneWorldAndIsNotARead) {
  auto cfg = top_camera();
  DrawnScene lab({cfg}, 2);
  (void)lab.sim->draw(1);
  const Array& pose = lab.scene->sensor("cam").field("pose").data;
  EXPECT_EQ(pose.row<float>(0)[15], 0);
  EXPECT_EQ(pose.row<float>(1)[15], 1);
  lab.sim->step();
  EXPECT_EQ(pose.row<float>(0)[15], 0);
  EXPECT_THROW((void)lab.sim->draw(2), ValueError);
}

TEST(Draw, EverySensorDrawsOrThrows) {
  sim::Simulation sim(std::make_shared<scene::Scene>(every_sensor_scene()),
                      {.num_worlds = 2, .decimation = 3});
  sim.step(3);
  for (const auto& s : sim.scene().sensors()) {
    Sensor* sensor[] = {s.get()};
    try {
      EXPECT_FALSE(sim.draw(1, sensor).list().empty() && s->kind() != "contact") << s->name();
    } catch (const ValueError& e) {
      EXPECT_THAT(e.what(), HasSubstr(s->name()));
      EXPECT_THAT(e.what(), HasSubstr("nothing to draw"));
    }
  }
}

}  // namespace
}  // namespace mjsense::sensors
