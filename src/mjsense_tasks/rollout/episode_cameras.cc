// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/rollout/episode_cameras.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/named.h"
#include "mjsense_tasks/cameras/frozen_cameras.h"
#include "mjsense_tasks/cameras/load_cameras.h"
#include "mjsense_tasks/rollout/rollout.h"

namespace mjsense::tasks::rollout {
namespace {

cameras::CameraMountCfg of_model(const robots::CameraMount& mount, bool of_scene) {
  cameras::CameraMountCfg out;
  out.name = mount.name;
  out.mount = cameras::MountKind::kMjcf;
  out.camera = mount.mjcf_camera;
  out.of_scene = of_scene;
  out.depth = mount.record_depth;
  out.image_points = mount.image_points;
  out.min_visible = mount.min_visible;
  out.relaxed = true;
  out.distance_range = {0.6, 1.1};
  out.height_range = {0.35, 0.8};
  return out;
}

// The other side of an image with the same aspect ratio, rounded to an even number as videos
// require.
int scaled(int side, int other, int of) {
  return std::max(2, 2 * static_cast<int>(std::lround(0.5 * side * other / of)));
}

}  // namespace

cameras::CameraSystem choose_cameras(const episode::Task& task, const RolloutCfg& cfg) {
  const robots::RobotCfg& robot = task.cfg().robot;
  cameras::CameraSystemCfg system;
  system.width = robot.image_width;
  system.height = robot.image_height;
  const episode::GivenStarts& starts = task.cfg().starts;
  const bool given = !starts.empty() && !starts.begin()->second.cameras.empty();
  if (given) {
    system.cameras =
        cameras::read_frozen(starts.begin()->second.cameras, robots::Robot::kPrefix, "starts")
            .cameras;
  } else if (!cfg.camera_system.empty()) {
    system = cameras::load_camera_system(cfg.camera_system, robot.file, robots::Robot::kPrefix);
  } else {
    for (const robots::CameraMount& mount : robot.cameras)
      system.cameras.push_back(of_model(mount, false));
  }
  for (const robots::CameraMount& mount :
       given ? std::vector<robots::CameraMount>() : task.cameras())
    system.cameras.push_back(of_model(mount, true));

  if (cfg.cameras) {
    const std::string owner = !cfg.camera_system.empty()
                                  ? fmt::format("camera system '{}'", system.name)
                              : robot.name.empty() ? fmt::format("task '{}'", task.name())
                                                   : fmt::format("robot '{}'", robot.name);
    std::vector<cameras::CameraMountCfg> chosen;
    for (const std::string& name : *cfg.cameras) {
      constexpr auto kName = &cameras::CameraMountCfg::name;
      const cameras::CameraMountCfg& mount =
          find_named(system.cameras, kName, name, owner, "camera");
      if (std::ranges::find(chosen, name, kName) != chosen.end())
        throw ValueError(fmt::format("camera '{}' is given twice", name));
      chosen.push_back(mount);
    }
    system.cameras = std::move(chosen);
  }
  for (cameras::CameraMountCfg& camera : system.cameras) {
    const int width = camera.width.value_or(system.width);
    const int height = camera.height.value_or(system.height);
    if (cfg.width || cfg.height) {
      camera.width = cfg.width.value_or(0);
      camera.height = cfg.height.value_or(0);
      if (!cfg.width) camera.width = scaled(*cfg.height, width, height);
      if (!cfg.height) camera.height = scaled(*cfg.width, height, width);
    }
    camera.depth = camera.depth || cfg.depth;
    camera.segmentation = camera.segmentation || cfg.segmentation;
  }
  return {std::move(system), std::string(robots::Robot::kPrefix), robot.base_body};
}

std::vector<RecordedCamera> recorded_cameras(const cameras::CameraSystem& system) {
  std::vector<RecordedCamera> cameras;
  for (std::size_t i = 0; i < system.cfg().cameras.size(); ++i) {
    const cameras::CameraMountCfg& mount = system.cfg().cameras[i];
    const int camera = static_cast<int>(i);
    cameras.push_back({.name = mount.name,
                       .mjcf_camera = system.mounted(camera).camera,
                       .width = system.width(camera),
                       .height = system.height(camera),
                       .depth = mount.depth,
                       .segmentation = mount.segmentation,
                       .image_points = mount.image_points,
                       .erosion = mount.erosion});
  }
  return cameras;
}

sensors::CameraSensorCfg camera_sensor_cfg(const cameras::CameraSystem& system, int camera,
                                           const RecordedCamera& recorded, const RolloutCfg& cfg) {
  const cameras::CameraSystem::Mounted& mounted = system.mounted(camera);
  sensors::CameraSensorCfg out;
  out.name = recorded.name;
  if (mounted.is_new) {
    out.parent_body = mounted.body;
    write_vec(mounted.pose.p, out.pos.data());
    write_quat(mounted.pose.q, out.quat.data());
    out.fovy = mounted.fovy;
  } else {
    out.camera_name = mounted.camera;
  }
  out.width = recorded.width;
  out.height = recorded.height;
  out.data_types = {"rgb", "segmentation"};
  if (recorded.depth) out.data_types.push_back("depth");
  out.use_shadows = cfg.shadows;
  static_cast<sensors::RgbCfg&>(out) = cfg;
  return out;
}

cameras::CameraSystem default_view(const episode::Task& task, const RolloutCfg& cfg) {
  const robots::RobotCfg& robot = task.cfg().robot;
  cameras::CameraMountCfg view;
  view.name = kDefaultView;
  if (robot.name.empty()) {
    view.mount = cameras::MountKind::kFixed;
    view.target = {1, 0, 0};
  } else {
    view.mount = cameras::MountKind::kLookAt;
    view.pos = {1.5, -1.2, 1.5};
    view.target = {0.4, 0, 0.6};
    view.min_visible = 0.0005;  // 12 by 12 pixels of 640 x 480
    view.distance_range = {1.0, 2.5};
    view.max_attempts = 50;
    view.height_range = {0.1, 1.0};
  }
  cameras::CameraSystemCfg system{.name = std::string(kDefaultView), .cameras = {view}};
  system.width = cfg.width.value_or(robot.image_width);
  system.height = cfg.height.value_or(robot.image_height);
  return {std::move(system), std::string(robots::Robot::kPrefix), robot.base_body};
}

Vec3 middle_of(const episode::Task& task, const World& world) {
  Vec3 sum;
  int count = 0;
  for (const episode::TaskObject& object : task.objects(world.id)) {
    if (object.body < 0) continue;
    sum = sum + vec3(world.data->xpos + 3 * object.body);
    ++count;
  }
  const auto groups = task.robot().groups();
  for (std::size_t g = 0; g < groups.size(); ++g) {
    if (groups[g].kind != robots::GroupKind::kGripper) continue;
    sum = sum + task.robot().leaf_pose(world, static_cast<int>(g)).p;
    ++count;
  }
  return count > 0 ? (1.0 / count) * sum : sum;
}

}  // namespace mjsense::tasks::rollout
