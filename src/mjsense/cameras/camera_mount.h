// SPDX-License-Identifier: Apache-2.0
#pragma once
// A camera of an episode, as data: where it is mounted, and how that differs from episode to
// episode.

#include <array>
#include <optional>
#include <string>
#include <string_view>

#include "mjsense/core/fields.h"

namespace mjsense {

enum class MountKind { kMjcf, kBody, kLookAt, kFixed, kOrbit };
template <>
inline constexpr std::array<std::string_view, 5> kWords<MountKind>{"mjcf", "body", "look_at",
                                                                   "fixed", "orbit"};

// C: MuJoCo's camera frame, x right, y up, looking along -z. Noise is uniform in [-x, x], drawn
// once an episode.
struct CameraMountCfg {
  std::string name;
  Word<MountKind> mount;
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

  // Its pose or its lens is another in every episode, or its lens not that of the model.
  bool varies() const;
  bool has_noise() const;
};
template <class V>
void visit_fields(V& v, CameraMountCfg& c) {
  v.object("CameraMountCfg",
           "A camera of an episode: where it is mounted, and how that differs from episode to "
           "episode. Noise is uniform in [-x, x] and drawn once an episode.");
  v("name", c.name, "Of its streams and videos.").required();
  v("mount", c.mount,
    "mjcf: a camera of the robot's MJCF; body: on a body of the robot, turned by ``quat``; "
    "look_at: "
    "on a body, looking at a point of it; fixed: in the world, looking at a point; orbit: in the "
    "world, somewhere around what the episode is about.");
  v("camera", c.camera, "mjcf: its name there, without the robot's prefix.").or_none();
  v("of_scene", c.of_scene, "mjcf: ``camera`` is a full name in the scene.");
  v("body", c.body, "body, look_at: which one, without the robot's prefix; its base without one.")
      .or_none();
  v("pos", c.pos, "body, look_at: in the body; fixed: in the world.").unit("m");
  v("quat", c.quat, "body: wxyz in the body, x right, y up, looking along -z.");
  v("target", c.target,
    "look_at: the point in the body, fixed: in the world; orbit: offset from the centre.")
      .unit("m");
  v("up", c.up, "look_at, fixed: what is up in the image, in the body or the world.");
  v("fovy", c.fovy, "Vertical, degrees; mjcf: the MJCF's, others: 45.").positive();
  v("distance_range", c.distance_range, "orbit: from the centre, on the ground, least and most.")
      .unit("m")
      .at_least(0);
  v("height_range", c.height_range, "orbit: above the centre, least and most.").unit("m");
  v("azimuth_range", c.azimuth_range, "orbit: least and most, degrees, 0 along the world's x.");
  v("min_visible", c.min_visible,
    "Share of the pixels that each object of the task must cover at the start. Where the pose of "
    "another mount than "
    "orbit does not show that much, the camera is moved to one that orbit would choose.")
      .within(0, 1);
  v("max_attempts", c.max_attempts, "Poses of an orbit to try for that.").at_least(1);
  v("relaxed", c.relaxed,
    "If none of them shows that much, the best is taken; otherwise the episode fails.");
  v("fovy_noise", c.fovy_noise, "Degrees.").at_least(0);
  v("pos_noise", c.pos_noise,
    "mjcf: along the camera's axes; body, look_at: the body's; fixed: right, down, forward.")
      .unit("m")
      .at_least(0);
  v("rot_noise", c.rot_noise,
    "Degrees about x, y, z in turn; mjcf, fixed: the camera's axes; body: the body's.")
      .at_least(0);
  v("target_noise", c.target_noise, "look_at, fixed, orbit: of the point, along its axes.")
      .unit("m")
      .at_least(0);
  v("width", c.width, "Of its pictures; without one the system's.").unit("pixels").at_least(1);
  v("height", c.height, "Of its pictures; without one the system's.").unit("pixels").at_least(1);
  v("depth", c.depth, "Also its depth is recorded, losslessly.");
  v("segmentation", c.segmentation, "Also which geom each pixel shows is recorded.");
  v("image_points", c.image_points, "``object_image_points`` looks through it.");
  v("erosion", c.erosion, "Image points keep off an object's rim.");
}

// What its fields say of each other. Throws ValueError.
void validate(const CameraMountCfg& cfg, std::string_view place);

}  // namespace mjsense
