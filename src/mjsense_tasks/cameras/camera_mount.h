// SPDX-License-Identifier: Apache-2.0
#pragma once
// Configuration of a camera of an episode: its mount, and its random variation between episodes.

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "mjsense/core/fields/named_enum.h"

namespace mjsense::tasks::cameras {

enum class MountKind { kMjcf, kBody, kLookAt, kFixed, kOrbit };
constexpr std::array<std::string_view, 5> enum_names(MountKind) {
  return {"mjcf", "body", "look_at", "fixed", "orbit"};
}

// Poses are those of MuJoCo's camera frame: x right, y up, looking along -z. Noise is uniform in
// [-x, x] and drawn once per episode.
struct CameraMountCfg {
  std::string name;
  NamedEnum<MountKind> mount;
  std::string camera;
  bool of_scene = false;
  std::string body;
  std::array<double, 3> pos{};
  std::array<double, 4> quat{1, 0, 0, 0};
  std::array<double, 3> target{};
  std::array<double, 3> up{0, 0, 1};
  std::optional<double> fovy;
  std::array<double, 2> distance_range{0.5, 0.5}, height_range{0.5, 0.5}, azimuth_range{-180, 180};
  double min_visible = 0;
  int max_attempts = 100;
  bool relaxed = false;
  double fovy_noise = 0;
  std::array<double, 3> pos_noise{}, rot_noise{}, target_noise{};
  std::optional<int> width, height;
  bool depth = false;
  bool segmentation = false;
  bool image_points = true;
  bool erosion = true;

  // True if the pose or the field of view differs between episodes, or if the field of view is not
  // that of the model.
  bool varies() const;
  bool has_noise() const;
};
template <class V>
void visit_fields(V& v, CameraMountCfg& c) {
  v.object("CameraMountCfg",
           "A camera of an episode: where it is mounted, and its random variation. Noise is "
           "uniform in [-x, x] and drawn once per episode.");
  v("name", c.name, "Name of the camera's streams and videos.").required();
  v("mount", c.mount,
    "mjcf: a camera of the robot's MJCF; body: on a body of the robot, oriented by ``quat``; "
    "look_at: on a body, looking at a point in the body's frame; fixed: in the world, looking at a "
    "point; orbit: in the world, at a random place around the objects of the task.");
  v("camera", c.camera, "mjcf: name of the camera in the MJCF, without the robot's prefix.")
      .or_none();
  v("of_scene", c.of_scene, "mjcf: ``camera`` is a full name in the scene.");
  v("body", c.body,
    "body, look_at: name of the body, without the robot's prefix; empty: the robot's base.")
      .or_none();
  v("pos", c.pos, "body, look_at: position in the frame of the body; fixed: position in the world.")
      .unit("m");
  v("quat", c.quat,
    "body: orientation (wxyz) in the frame of the body: x right, y up, looking along -z.");
  v("target", c.target,
    "look_at: the point in the frame of the body; fixed: the point in the world; orbit: offset "
    "from the centre.")
      .unit("m");
  v("up", c.up,
    "look_at, fixed: up direction of the image, in the frame of the body or the world.");
  v("fovy", c.fovy,
    "Vertical field of view, degrees; by default that of the MJCF (mjcf) or 45 (others).")
      .positive();
  v("distance_range", c.distance_range,
    "orbit: minimum and maximum horizontal distance from the centre.")
      .unit("m")
      .at_least(0);
  v("height_range", c.height_range, "orbit: minimum and maximum height above the centre.")
      .unit("m");
  v("azimuth_range", c.azimuth_range,
    "orbit: minimum and maximum azimuth, degrees, 0 along the world's x axis.");
  v("min_visible", c.min_visible,
    "Share of the pixels that each object of the task must cover at the start. If the pose of a "
    "mount other than orbit does not show that much, the camera is moved to a pose of an orbit.")
      .within(0, 1);
  v("max_attempts", c.max_attempts, "Maximum number of poses of an orbit to try.").at_least(1);
  v("relaxed", c.relaxed,
    "Use the best pose if none satisfies min_visible. False: the episode fails.");
  v("fovy_noise", c.fovy_noise, "Noise of the field of view, degrees.").at_least(0);
  v("pos_noise", c.pos_noise,
    "Noise of the position; mjcf: along the camera's axes; body, look_at: along the body's axes; "
    "fixed: right, down, forward.")
      .unit("m")
      .at_least(0);
  v("rot_noise", c.rot_noise,
    "Noise of the rotation about x, y, z in this order, degrees; mjcf, fixed: about the camera's "
    "axes; body: about the body's axes.")
      .at_least(0);
  v("target_noise", c.target_noise,
    "look_at, fixed, orbit: noise of the point, along the axes in which it is given.")
      .unit("m")
      .at_least(0);
  v("width", c.width, "Width of its images; by default the camera system's.")
      .unit("pixels")
      .at_least(1);
  v("height", c.height, "Height of its images; by default the camera system's.")
      .unit("pixels")
      .at_least(1);
  v("depth", c.depth, "Record its depth too, losslessly.");
  v("segmentation", c.segmentation, "Record its segmentation too.");
  v("image_points", c.image_points, "Use it for ``object_image_points``.");
  v("erosion", c.erosion, "Keep image points away from the rim of an object.");
}

// Checks fields that depend on each other. Throws ValueError; `context`, if not empty, starts its
// message.
void validate(const CameraMountCfg& cfg, std::string_view context);

}  // namespace mjsense::tasks::cameras
