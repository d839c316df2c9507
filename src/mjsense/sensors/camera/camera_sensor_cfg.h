// SPDX-License-Identifier: Apache-2.0
#pragma once
// CameraSensor: images of every world from one camera, by ray casting on the CPU. It needs no
// OpenGL, display or GPU.
//
// Fields, only those in data_types; row 0 is the top of the image:
//
//   rgb           uint8   [B, H, W, 3]  MuJoCo's classic look
//   hdr           float32 [B, H, W, 3]  cd/m^2, linear; only with physically based shading
//   depth         float32 [B, H, W, 1]  m; planar: distance to the camera plane; ray: along the
//                                       pixel's ray; 0 where nothing is seen
//   segmentation  int32   [B, H, W, 2]  (id, type): mjOBJ_GEOM, _FLEX, _SKIN, _SITE, _TENDON;
//                                       (-1, -1) where nothing is seen
//   body_segmentation, entity_segmentation
//                 int32   [B, H, W, 1]  body id; index in Scene::entities(); -1 where there is none
//   normals       float32 [B, H, W, 3]  unit, outward, camera frame; 0 where nothing is seen
//   point_cloud   float32 [B, H, W, 3]  m, camera frame; NaN where nothing is seen
//   flow          float32 [B, H, W, 2]  pixels, u right, v down: image point in the previous image
//                                       of the surface point that a pixel sees, minus the pixel's
//                                       own (optical_flow.h); NaN where nothing is seen
//
// and always
//
//   intrinsics    float32 [B, 3, 3]     K in pixels, OpenCV's: x right, y down, z forward; pixel
//                                       centres at +0.5
//   pose          float32 [B, 4, 4]     X_WC of the image; C is MuJoCo's camera frame: x right,
//                                       y up, looking along -z

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/fields/named_enum.h"
#include "mjsense/core/sensor.h"
#include "mjsense/sensors/camera/image_cfg.h"

namespace mjsense::sensors {

struct CameraIntrinsics {
  double fx = 0, fy = 0, cx = 0, cy = 0;
};
template <class V>
void visit_fields(V& v, CameraIntrinsics& c) {
  v.object("CameraIntrinsics",
           "Focal lengths and principal point in pixels of the image; they replace fovy and the "
           "parameters of the model.")
      .frozen();
  v("fx", c.fx, "Horizontal focal length.").unit("pixels").positive().required();
  v("fy", c.fy, "Vertical focal length.").unit("pixels").positive().required();
  v("cx", c.cx, "Principal point, from the left border.").unit("pixels").required();
  v("cy", c.cy, "Principal point, from the top border.").unit("pixels").required();
}

enum class LensKind { kNone, kBrownConrady, kFisheye };
constexpr std::array<std::string_view, 3> enum_names(LensKind) {
  return {"none", "brown_conrady", "fisheye"};
}

// x = X/Z, y = Y/Z (OpenCV camera frame), r = |(x, y)|, theta = atan r.
struct LensDistortion {
  NamedEnum<LensKind> model;
  std::vector<double> coefficients;
};
template <class V>
void visit_fields(V& v, LensDistortion& c) {
  v.object(
       "LensDistortion",
       "Where a lens puts the image of a direction (X, Y, Z), z forward, y down: OpenCV's "
       "models.\n\n"
       "brown_conrady: x = X/Z, y = Y/Z, ``x' = x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 "
       "(r^2 + 2 x^2)``, y' alike.\n"
       "fisheye: ``r' = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 + k4 theta^8)``, theta "
       "the angle to the axis, up to 89 degrees.")
      .frozen();
  v("model", c.model, "The distortion model.");
  v("coefficients", c.coefficients, "brown_conrady: k1 k2 p1 p2 k3; fisheye: k1 k2 k3 k4.");
}

// Throws ValueError unless there are as many coefficients as the model needs.
void validate(const LensDistortion& lens, std::string_view context);

// Of an image sensor and its lens; camera_response.h has the formulas.
struct ImagerCfg {
  double full_well = 4300;
  double read_noise = 1.7;
  int bits = 10;
  double f_number = 2;
  double exposure_time = 1.0 / 30;
  double readout_time = 0;
  double vignetting = 0;
};
template <class V>
void visit_fields(V& v, ImagerCfg& c) {
  v.object("ImagerCfg",
           "The image sensor of a camera: noise, quantisation, vignetting and shutter.")
      .frozen();
  v("full_well", c.full_well, "Electrons of a saturated pixel.").unit("electrons").positive();
  v("read_noise", c.read_noise, "Standard deviation of the noise of reading a pixel.")
      .unit("electrons")
      .at_least(0);
  v("bits", c.bits, "Bits of a value of the analogue-to-digital converter.").within(1, 16);
  v("f_number", c.f_number, "Focal length divided by the diameter of the aperture.").positive();
  v("exposure_time", c.exposure_time,
    "Longest exposure; darker images than it allows are amplified.")
      .unit("s")
      .positive();
  v("readout_time", c.readout_time,
    "Time from the end of the exposure of the first row to that of the last: a rolling shutter. 0: "
    "all rows are exposed at once.")
      .unit("s")
      .at_least(0);
  v("vignetting", c.vignetting,
    "Share of natural vignetting, cos^4 of the angle to the optical axis, that is not corrected.")
      .within(0, 1);
}

struct CameraVizCfg {
  bool show_frustum = true, show_frame = true;
  double frustum_depth = 0;
  std::array<float, 4> frustum_color{1, 0.6f, 0, 1};
  double line_width = 2;
  double axis_length = 5.0;
};
template <class V>
void visit_fields(V& v, CameraVizCfg& c) {
  v.object("CameraVizCfg",
           "The debug drawing of a camera: its view frustum, starting at ``near`` (or at the "
           "camera), and its axes (it looks along -z, the blue axis is +z).");
  v("show_frustum", c.show_frustum, "Draw the view frustum.");
  v("show_frame", c.show_frame, "Draw the axes.");
  v("frustum_depth", c.frustum_depth,
    "Length of the frustum from the camera plane (with a lens model: along the rays); 0: ``far``, "
    "or 10 ``stat.meansize`` without one.")
      .unit("m")
      .at_least(0);
  v("frustum_color", c.frustum_color, "Colour of the frustum, rgba.").within(0, 1);
  v("line_width", c.line_width, "Line width of the frustum.").unit("pixels").at_least(0);
  v("axis_length", c.axis_length, "Length of the axes, in units of ``stat.meansize``.").at_least(0);
}

enum class DepthKind { kPlanar, kRay };
constexpr std::array<std::string_view, 2> enum_names(DepthKind) { return {"planar", "ray"}; }

enum class DepthNoise { kNone, kD405, kD435 };
constexpr std::array<std::string_view, 3> enum_names(DepthNoise) {
  return {"none", "d405", "d435"};
}

enum class ClipPlane { kNone, kModel };
constexpr std::array<std::string_view, 2> enum_names(ClipPlane) { return {"none", "model"}; }

enum class CameraRenderer { kRays, kOpenGl };
constexpr std::array<std::string_view, 2> enum_names(CameraRenderer) { return {"rays", "opengl"}; }

inline constexpr std::array<std::string_view, 9> kCameraDataTypes{
    "rgb",         "depth", "segmentation", "body_segmentation", "entity_segmentation", "normals",
    "point_cloud", "flow",  "hdr"};

struct CameraSensorCfg : SensorCfg, RgbCfg {
  std::string camera_name;
  std::string parent_body;
  std::array<double, 3> pos{0, 0, 1};
  std::array<double, 4> quat{1, 0, 0, 0};
  std::optional<double> fovy;
  int width = 160, height = 120;
  std::vector<std::string> data_types{"rgb"};
  bool use_textures = true;
  bool use_shadows = false;
  std::vector<int> enabled_geom_groups{0, 1, 2};
  bool orthographic = false;
  bool clone_data = false;  // used by the Python package

  // Beyond mjlab.
  std::vector<int> enabled_site_groups, enabled_tendon_groups;
  int max_lights = 8;
  double near = 0, far = 0;
  NamedEnum<ClipPlane> clip_near, clip_far;
  double update_period = 0, phase = 0;
  NamedEnum<DepthKind> depth_kind;
  std::optional<CameraIntrinsics> intrinsics;
  LensDistortion distortion;
  std::optional<ImagerCfg> imager_values;
  NamedEnum<DepthNoise> depth_noise;
  NamedEnum<CameraRenderer> renderer;
  bool debug_vis = false;
  CameraVizCfg viz;

  std::unique_ptr<Sensor> build() const override;
};
template <class V>
void visit_fields(V& v, CameraSensorCfg& c) {
  v.object("CameraSensorCfg",
           "A camera of the model (``camera_name``) or a new camera. ``data`` is a "
           ":class:`mjsense.sensors.CameraData`.",
           "camera");
  v.extends(static_cast<SensorCfg&>(c));
  v("camera_name", c.camera_name,
    "Full name of an existing camera, such as ``robot/wrist``; empty: a new camera with the "
    "sensor's name is added.")
      .or_none();
  v("parent_body", c.parent_body,
    "Full name of the body that carries a new camera; empty: the world.")
      .or_none();
  v("pos", c.pos, "Position of a new camera in the frame of its parent body.").unit("m");
  v("quat", c.quat,
    "Orientation (wxyz) of a new camera in the frame of its parent body: x right, y up, looking "
    "along -z.");
  v("fovy", c.fovy,
    "Vertical field of view in degrees; with orthographic: height of the image in m. None: that of "
    "the camera, 45 for a new one. With ``camera_name`` only this sensor is affected.")
      .positive();
  v("width", c.width, "Width of the image; the resolution in the MJCF is not used.")
      .unit("pixels")
      .within(1, 16384);
  v("height", c.height, "Height of the image; the resolution in the MJCF is not used.")
      .unit("pixels")
      .within(1, 16384);
  v("data_types", c.data_types, "The image types to compute.").one_of(kCameraDataTypes).not_empty();
  v("use_textures", c.use_textures, "Draw the textures of materials and the skybox.");
  v("use_shadows", c.use_shadows, "Draw the shadows of lights that cast shadows.");
  v("enabled_geom_groups", c.enabled_geom_groups, "Geom groups (0 to 5) that are visible.")
      .within(0, 5)
      .not_empty();
  v("orthographic", c.orthographic,
    "Use an orthographic projection. With ``camera_name`` only this sensor is affected.");
  v("clone_data", c.clone_data, "Return a copy of ``data`` at every read.");
  v("enabled_site_groups", c.enabled_site_groups,
    "Groups (0 to 5) of sites that are drawn, as MuJoCo draws them.")
      .within(0, 5);
  v("enabled_tendon_groups", c.enabled_tendon_groups,
    "Groups (0 to 5) of tendons that are drawn, as MuJoCo draws them.")
      .within(0, 5);
  v("max_lights", c.max_lights,
    "Maximum number of active lights, the headlight first. MuJoCo's OpenGL renderer has 8.")
      .within(0, 32);
  v("near", c.near,
    "Distance of the near plane from the camera plane; nearer surfaces are invisible.")
      .unit("m")
      .at_least(0);
  v("far", c.far, "Distance of the far plane from the camera plane; 0: no limit.")
      .unit("m")
      .at_least(0)
      .may_be_infinite();
  v("clip_near", c.clip_near,
    "model: clip at the near plane of MuJoCo's renderers, ``visual/map/znear`` times the model's "
    "extent.");
  v("clip_far", c.clip_far,
    "model: clip at the far plane of MuJoCo's renderers, ``visual/map/zfar`` times the model's "
    "extent.");
  v("update_period", c.update_period, "Time between images; 0: a new image at every read.")
      .unit("s")
      .within(0, 1e6);  // larger values are mistakes, and steps are counted as integers
  v("phase", c.phase,
    "Images are taken at the first control step at or after phase + k * update_period, and at a "
    "reset.")
      .unit("s")
      .within(0, 1e6);
  v.include(static_cast<RgbCfg&>(c));
  v("depth_kind", c.depth_kind,
    "planar: distance to the camera plane; ray: distance along the pixel's ray.");
  v("intrinsics", c.intrinsics,
    "Intrinsic parameters; they replace fovy and the parameters of the MJCF.");
  v("distortion", c.distortion, "Lens distortion; the image is not rectified.");
  v("imager_values", c.imager_values, "An image sensor of other values than those of ``imager``.");
  v("depth_noise", c.depth_noise,
    "Error model of a stereo camera, applied to ``depth``; the other fields stay exact.");
  v("renderer", c.renderer, "opengl: MuJoCo's own renderer, if it was built in.");
  v("debug_vis", c.debug_vis,
    "Include this sensor when ``Simulation.draw(scene)`` is called without a list of sensors.");
  v("viz", c.viz, "Appearance of the debug drawing.");
}

}  // namespace mjsense::sensors
