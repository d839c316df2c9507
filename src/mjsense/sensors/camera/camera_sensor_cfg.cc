// SPDX-License-Identifier: Apache-2.0
// Checks of camera configurations, and the changes that a camera makes to the spec.
#include "mjsense/sensors/camera/camera_sensor_cfg.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/core/fields/sensor_fields.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/sensors/camera/camera_data.h"
#include "mjsense/sensors/camera/camera_response.h"
#include "mjsense/sensors/camera/camera_sensor.h"

namespace mjsense::sensors {
namespace {

template <class Fail>
void check_pose(const CameraSensorCfg& cfg, Fail&& fail) {
  const CameraSensorCfg made;
  if (!cfg.camera_name.empty() && (cfg.pos != made.pos || cfg.quat != made.quat))
    fail(fmt::format(
        "camera_name '{}' wraps an existing camera, which keeps its pose: do not set pos or quat",
        cfg.camera_name));
  double length = 0;
  for (double x : cfg.quat) length += x * x;
  if (length < 1e-12) fail(fmt::format("quat is {}: must not be 0", cfg.quat));
}

}  // namespace

void check_fovy(double degrees, std::string_view context) {
  if (degrees < 180) return;
  throw ValueError(fmt::format(
      "{}: fovy is {} degrees: must be less than 180 for a perspective camera", context, degrees));
}

void validate(const LensDistortion& lens, std::string_view context) {
  const LensKind kind = lens.model;
  const std::size_t needed = kind == LensKind::kNone ? 0 : kind == LensKind::kFisheye ? 4 : 5;
  if (lens.coefficients.size() != needed)
    throw ValueError(fmt::format("{}: '{}' takes {} coefficients, got {}", context, enum_name(kind),
                                 needed, lens.coefficients.size()));
}

void validate(const CameraSensorCfg& cfg) {
  const std::string context = fmt::format("camera '{}'", cfg.name);
  const auto fail = [&](const std::string& what) {
    throw ValueError(fmt::format("{}: {}", context, what));
  };
  if (cfg.name.empty()) throw ValueError("a camera needs a name");
  check_fields(cfg, context);
  check_pose(cfg, fail);
  if (cfg.fovy) {
    if (!cfg.orthographic && cfg.camera_name.empty()) check_fovy(*cfg.fovy, context);
    if (cfg.intrinsics) fail("both fovy and intrinsics are given: set only one of them");
  }
  if (cfg.far > 0 && cfg.far <= cfg.near)
    fail(fmt::format("near {} and far {}: must satisfy 0 <= near < far, or far 0 for no limit",
                     cfg.near, cfg.far));
  if (cfg.near > 0 && cfg.clip_near == ClipPlane::kModel)
    fail(fmt::format("near is {} m and clip_near is 'model': set only one of them", cfg.near));
  if (cfg.far > 0 && cfg.clip_far == ClipPlane::kModel)
    fail(fmt::format("far is {} m and clip_far is 'model': set only one of them", cfg.far));
  if (cfg.phase > 0 && cfg.update_period == 0)
    fail(fmt::format("phase is {} s, but there is no update_period: every reading is a new image",
                     cfg.phase));
  if (cfg.renderer == CameraRenderer::kOpenGl) {
    for (const std::string& type : cfg.data_types)
      if (type == "normals" || type == "point_cloud")
        fail(fmt::format("renderer 'opengl' does not support {}", type));
    if (cfg.near > 0 || cfg.far > 0 || cfg.intrinsics || cfg.distortion.model != LensKind::kNone ||
        cfg.depth_kind != DepthKind::kPlanar)
      fail(
          "renderer 'opengl' takes clip range and intrinsics from the model, has no lens "
          "distortion, and measures planar depth");
    if (cfg.shading != Shading::kClassic) fail("renderer 'opengl' has classic shading only");
    if (cfg.max_lights > render::kClassicLights)
      fail(fmt::format("renderer 'opengl' supports at most {} lights; max_lights is {}",
                       render::kClassicLights, cfg.max_lights));
  }
  if (cfg.shading == Shading::kClassic && std::ranges::count(cfg.data_types, "hdr"))
    fail("data type 'hdr' needs shading 'pbr' or 'path'");
  if (cfg.shading == Shading::kClassic && needs_response(cfg))
    fail(
        "exposure_mode 'auto' and imager need linear radiance, thus shading 'pbr' or 'path'; it is "
        "'classic'");
  if (cfg.imager != Imager::kNone && cfg.imager_values)
    fail(fmt::format("imager is '{}' and imager_values are given: set only one of them",
                     cfg.imager.text()));
  const auto has_depth = std::count(cfg.data_types.begin(), cfg.data_types.end(), "depth") > 0;
  if (cfg.depth_noise != DepthNoise::kNone &&
      (!has_depth || cfg.depth_kind != DepthKind::kPlanar || cfg.orthographic))
    fail("depth_noise applies only to the planar depth of a perspective camera");
  if (cfg.orthographic && (cfg.intrinsics || cfg.distortion.model != LensKind::kNone))
    fail("an orthographic camera has no intrinsics and no lens distortion");
  if (!cfg.camera_name.empty() && !cfg.parent_body.empty())
    fail(
        fmt::format("camera_name '{}' wraps an existing camera, which stays on its body: leave "
                    "parent_body empty",
                    cfg.camera_name));
}

SensorKind camera_kind() { return sensor_kind<CameraSensorCfg>(&kCameraData); }

std::unique_ptr<Sensor> CameraSensorCfg::build() const {
  return std::make_unique<CameraSensor>(*this);
}

void CameraSensor::edit_spec(mjSpec* spec) {
  const std::string context = fmt::format("camera '{}'", name());
  if (!cfg_.camera_name.empty()) {
    mjsElement* element = mjs_findElement(spec, mjOBJ_CAMERA, cfg_.camera_name.c_str());
    if (!element)
      throw_unknown(context, "camera", cfg_.camera_name, scene::spec_names(spec, mjOBJ_CAMERA));
    return;  // this sensor's changes to the camera do not affect other sensors
  }
  mjsBody* body = mjs_findBody(spec, cfg_.parent_body.empty() ? "world" : cfg_.parent_body.c_str());
  if (!body) throw_unknown(context, "body", cfg_.parent_body, scene::spec_names(spec, mjOBJ_BODY));
  if (mjs_findElement(spec, mjOBJ_CAMERA, name().c_str()))
    throw ValueError(fmt::format(
        "{}: repeated name: the model has a camera of this name; set camera_name to use it",
        context));
  mjsCamera* camera = mjs_addCamera(body, nullptr);
  mjs_setName(camera->element, name().c_str());
  std::copy(cfg_.pos.begin(), cfg_.pos.end(), camera->pos);
  std::copy(cfg_.quat.begin(), cfg_.quat.end(), camera->quat);
  camera->fovy = cfg_.fovy.value_or(45.0);
  camera->proj = cfg_.orthographic ? mjPROJ_ORTHOGRAPHIC : mjPROJ_PERSPECTIVE;
}

}  // namespace mjsense::sensors
