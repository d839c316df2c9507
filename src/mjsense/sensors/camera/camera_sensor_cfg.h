#pragma once
// CameraSensor: images of every world from one camera, by ray casting on the CPU. No OpenGL, no
// display, no GPU.
//
// Fields, only those asked for in data_types; row 0 is the top of the image:
//
//   rgb           uint8   [B, H, W, 3]  MuJoCo's classic look
//   depth         float32 [B, H, W, 1]  m; planar: distance to the camera plane; ray: along the
//                                       pixel's ray; 0 where nothing is
//   segmentation  int32   [B, H, W, 2]  (id, type): mjOBJ_GEOM, _FLEX, _SKIN, _SITE, _TENDON; (-1, -1)
//                                       where nothing is
//   body_segmentation, entity_segmentation
//                 int32   [B, H, W, 1]  body id; index in Scene::entities(); -1 where there is none
//   normals       float32 [B, H, W, 3]  unit, outward, camera frame; 0 where nothing is
//   point_cloud   float32 [B, H, W, 3]  m, camera frame; NaN where nothing is
//   flow          float32 [B, H, W, 2]  pixels, u right, v down: where the point that a pixel sees was
//                                       in the previous image, minus where it is (optical_flow.h); NaN
//                                       where nothing is
//
// and always
//
//   intrinsics    float32 [B, 3, 3]     K in pixels, OpenCV's: x right, y down, z forward; pixel
//                                       centres at +0.5
//   pose          float32 [B, 4, 4]     X_WC of the image; C is MuJoCo's camera frame: x right, y up,
//                                       looking along -z

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"

namespace mjsense {

// Pixels of the image that is rendered. Replaces fovy and the model's own intrinsics.
struct CameraIntrinsics {
  double fx = 0, fy = 0, cx = 0, cy = 0;
};

// Where a lens puts the image of a direction. x = X/Z, y = Y/Z (OpenCV camera frame), r = |(x, y)|,
// theta = atan r.
//   brown_conrady, coefficients k1 k2 p1 p2 k3:
//     x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
//     y' = y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y
//   fisheye, coefficients k1 k2 k3 k4:
//     r' = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)
struct LensDistortion {
  std::string model = "none";  // none brown_conrady fisheye
  std::vector<double> coefficients;
};

// What a viewer draws of a camera: the pyramid of what it sees, from `near` (or its own place) on,
// and its axes.
struct CameraVizCfg {
  bool show_frustum = true, show_frame = true;
  double frustum_depth = 0;  // m, planar (through a lens: along the rays); 0: `far`, or without one
                             // ten times the model's stat.meansize
  std::array<float, 4> frustum_color{1, 0.6f, 0, 1};
  double line_width = 2;     // pixels
  double axis_length = 5.0;  // of the frame, in units of stat.meansize
};

struct CameraSensorCfg : SensorCfg {
  std::string camera_name;  // an existing camera (full name); empty: a new camera called `name`
  std::string parent_body;  // of a new camera, full name; empty: the world
  std::array<double, 3> pos{0, 0, 1};  // m, in the parent body
  std::array<double, 4> quat{1, 0, 0, 0};
  // Degrees (orthographic: height of the image, m). Not given: the camera's own, 45 for a new one.
  // Of a wrapped camera it is this sensor's alone, as is `orthographic`: others that look through
  // it, and the model, keep theirs.
  std::optional<double> fovy;
  int width = 160, height = 120;  // pixels; the model's own resolution is not used
  // Of rgb depth segmentation body_segmentation entity_segmentation normals point_cloud flow.
  std::vector<std::string> data_types{"rgb"};
  bool use_textures = true;
  bool use_shadows = false;
  std::vector<int> enabled_geom_groups{0, 1, 2};
  bool orthographic = false;
  bool clone_data = false;  // Python only: a copy at every read

  // Beyond mjlab's.
  // Sites and tendons that are drawn, as MuJoCo's visualiser does: none unless groups (0 to 5) are given.
  std::vector<int> enabled_site_groups, enabled_tendon_groups;
  // Of the lights that are on, the headlight first, so many shine, 0 to 32. MuJoCo's OpenGL has 8.
  int max_lights = 8;
  double near = 0, far = 0;  // m, planar; what is nearer or farther is not seen; far 0: no limit
  std::string clip_near = "none";  // none; model: near is where MuJoCo clips, its znear x extent
  // s. An image is taken at the first control step at or after phase + k * update_period.
  double update_period = 0, phase = 0;
  int samples = 1;                    // per pixel of rgb, for anti-aliased edges, 1 to 64
  std::string depth_kind = "planar";  // planar ray
  std::optional<CameraIntrinsics> intrinsics;
  LensDistortion distortion;
  std::string depth_noise = "none";  // none d405 d435: on the field depth only (depth_noise.h)
  std::string renderer = "rays";     // rays opengl (MuJoCo's own renderer, where it was built in)
  bool debug_vis = false;
  CameraVizCfg viz;

  std::unique_ptr<Sensor> build() const override;
};

}  // namespace mjsense
