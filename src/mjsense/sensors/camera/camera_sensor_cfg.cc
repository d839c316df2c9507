// What a camera's configuration may say.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mjsense/core/checks.h"
#include "mjsense/core/error.h"
#include "mjsense/sensors/camera/camera_sensor.h"

namespace mjsense {
namespace {

void check_choice(const std::string& place, std::string_view field, const std::string& value,
                  std::span<const std::string> choices) {
  if (std::find(choices.begin(), choices.end(), value) != choices.end()) return;
  throw ValueError(fmt::format("{}: invalid {} '{}'; expected one of: {}", place, field, value,
                               fmt::join(choices, ", ")));
}

// s; more would be a mistake, and physics steps are counted in whole numbers.
constexpr double kLongest = 1e6;

template <class Fail>
void check_pose(const CameraSensorCfg& cfg, Fail&& fail) {
  const CameraSensorCfg made;
  if (!cfg.camera_name.empty() && (cfg.pos != made.pos || cfg.quat != made.quat))
    fail(
        fmt::format("camera_name '{}' wraps an existing camera, which stays where it is: leave pos "
                    "and quat alone",
                    cfg.camera_name));
  double length = 0;
  for (double x : cfg.quat) length += x * x;
  if (!std::isfinite(cfg.pos[0] + cfg.pos[1] + cfg.pos[2]) || !std::isfinite(length) ||
      length < 1e-12)
    fail(fmt::format("pos {} and quat {}: must be finite, quat not 0", cfg.pos, cfg.quat));
}

}  // namespace

void check_fovy(double degrees, std::string_view place) {
  if (degrees < 180) return;
  throw ValueError(fmt::format("{}: fovy is {} degrees: a perspective camera sees less than 180",
                               place, degrees));
}

void validate(const CameraIntrinsics& k, std::string_view place) {
  const bool finite = std::isfinite(k.fx + k.fy + k.cx + k.cy);
  if (!finite || k.fx <= 0 || k.fy <= 0)
    throw ValueError(fmt::format(
        "{}: intrinsics fx {} fy {} cx {} cy {} (pixels): all must be finite, fx and fy "
        "positive",
        place, k.fx, k.fy, k.cx, k.cy));
}

void validate(const LensDistortion& lens, std::string_view place) {
  check_choice(std::string(place), "distortion model", lens.model,
               std::array<std::string, 3>{"none", "brown_conrady", "fisheye"});
  const std::size_t needed = lens.model == "none" ? 0 : lens.model == "fisheye" ? 4 : 5;
  if (lens.coefficients.size() != needed)
    throw ValueError(fmt::format("{}: distortion '{}' takes {} coefficients, got {}", place,
                                 lens.model, needed, lens.coefficients.size()));
  for (double k : lens.coefficients)
    if (!std::isfinite(k))
      throw ValueError(
          fmt::format("{}: distortion has the coefficient {}: must be finite", place, k));
}

void validate(const CameraVizCfg& viz, std::string_view place) {
  require_not_negative(viz.frustum_depth, place, "frustum_depth");
  require_color(viz.frustum_color, place, "frustum_color");
  require_not_negative(viz.line_width, place, "line_width");
  require_not_negative(viz.axis_length, place, "axis_length");
}

void validate(const CameraSensorCfg& cfg) {
  const std::string place = fmt::format("camera '{}'", cfg.name);
  const auto fail = [&](const std::string& what) {
    throw ValueError(fmt::format("{}: {}", place, what));
  };
  if (cfg.name.empty()) throw ValueError("a camera needs a name");
  const std::array<std::string, 8> types{
      "rgb",     "depth",       "segmentation", "body_segmentation", "entity_segmentation",
      "normals", "point_cloud", "flow"};
  if (cfg.data_types.empty())
    fail(fmt::format("data_types is empty; choose from: {}", fmt::join(types, ", ")));
  for (const std::string& type : cfg.data_types) {
    if (std::find(types.begin(), types.end(), type) == types.end())
      fail(fmt::format("Invalid camera data types: '{}'{}", type, suggest(type, types)));
    if (std::count(cfg.data_types.begin(), cfg.data_types.end(), type) > 1)
      fail(fmt::format("data type '{}' twice", type));
  }
  if (cfg.width < 1 || cfg.height < 1 || cfg.width > 16384 || cfg.height > 16384)
    fail(fmt::format("width x height is {} x {}: each must be 1..16384", cfg.width, cfg.height));
  if (cfg.enabled_geom_groups.empty())
    fail("enabled_geom_groups is empty: nothing would be seen; choose from 0..5");
  const auto check_groups = [&](const char* kind, const std::vector<int>& groups) {
    for (int g : groups)
      if (g < 0 || g >= mjNGROUP)
        fail(fmt::format("{} group {}: groups are 0..{}", kind, g, mjNGROUP - 1));
  };
  check_groups("geom", cfg.enabled_geom_groups);
  check_groups("site", cfg.enabled_site_groups);
  check_groups("tendon", cfg.enabled_tendon_groups);
  if (cfg.max_lights < 0 || cfg.max_lights > View::kMaxLights)
    fail(fmt::format("max_lights is {}: must be 0..{}", cfg.max_lights, View::kMaxLights));
  check_pose(cfg, fail);
  if (cfg.fovy) {
    if (!(*cfg.fovy > 0) || !std::isfinite(*cfg.fovy))
      fail(fmt::format("fovy is {}: must be positive", *cfg.fovy));
    if (!cfg.orthographic && cfg.camera_name.empty()) check_fovy(*cfg.fovy, place);
    if (cfg.intrinsics)
      fail("both fovy and intrinsics are given: intrinsics say all that fovy does");
  }
  if (!(cfg.near >= 0) || !std::isfinite(cfg.near) || !(cfg.far >= 0) ||
      (cfg.far > 0 && cfg.far <= cfg.near))
    fail(fmt::format("near {} and far {}: need 0 <= near < far, or far 0 for no limit", cfg.near,
                     cfg.far));
  check_choice(place, "clip_near", cfg.clip_near, std::array<std::string, 2>{"none", "model"});
  if (cfg.near > 0 && cfg.clip_near == "model")
    fail(fmt::format("near is {} m and clip_near is 'model': one of them says where to clip",
                     cfg.near));
  if (!(cfg.update_period >= 0) || !(cfg.phase >= 0) || cfg.update_period > kLongest ||
      cfg.phase > kLongest)
    fail(fmt::format("update_period {} s and phase {} s: each must be 0 to {:g} s",
                     cfg.update_period, cfg.phase, kLongest));
  if (cfg.phase > 0 && cfg.update_period == 0)
    fail(fmt::format("phase {} s without an update_period: every reading is a new image",
                     cfg.phase));
  if (cfg.samples < 1 || cfg.samples > 64)
    fail(fmt::format("samples is {}: must be 1..64", cfg.samples));
  check_choice(place, "depth_kind", cfg.depth_kind, std::array<std::string, 2>{"planar", "ray"});
  check_choice(place, "renderer", cfg.renderer, std::array<std::string, 2>{"rays", "opengl"});
  if (cfg.renderer == "opengl") {
    for (const std::string& type : cfg.data_types)
      if (type == "normals" || type == "point_cloud")
        fail(fmt::format("renderer 'opengl' has no {}", type));
    if (cfg.near > 0 || cfg.far > 0 || cfg.intrinsics || cfg.distortion.model != "none" ||
        cfg.depth_kind != "planar")
      fail(
          "renderer 'opengl' takes clip range and intrinsics from the model, has no lens "
          "distortion, and measures planar depth");
    if (cfg.max_lights > kClassicLights)
      fail(fmt::format("renderer 'opengl' has no more than {} lights; max_lights is {}",
                       kClassicLights, cfg.max_lights));
  }
  check_choice(place, "depth_noise", cfg.depth_noise,
               std::array<std::string, 3>{"none", "d405", "d435"});
  const auto has_depth = std::count(cfg.data_types.begin(), cfg.data_types.end(), "depth") > 0;
  if (cfg.depth_noise != "none" && (!has_depth || cfg.depth_kind != "planar" || cfg.orthographic))
    fail("depth_noise is for planar depth of a perspective camera");
  validate(cfg.distortion, place);
  if (cfg.intrinsics) validate(*cfg.intrinsics, place);
  validate(cfg.viz, place);
  if (cfg.orthographic && (cfg.intrinsics || cfg.distortion.model != "none"))
    fail("an orthographic camera has no intrinsics and no lens distortion");
  if (!cfg.camera_name.empty() && !cfg.parent_body.empty())
    fail(
        fmt::format("camera_name '{}' wraps an existing camera, which stays on its body: leave "
                    "parent_body empty",
                    cfg.camera_name));
}

namespace {

std::vector<std::string> names_of(const mjSpec* spec, mjtObj type) {
  std::vector<std::string> names;
  for (mjsElement* e = mjs_firstElement(spec, type); e; e = mjs_nextElement(spec, e))
    names.emplace_back(mjs_getString(mjs_getName(e)));
  return names;
}

}  // namespace

std::unique_ptr<Sensor> CameraSensorCfg::build() const {
  return std::make_unique<CameraSensor>(*this);
}

void CameraSensor::edit_spec(mjSpec* spec) {
  const std::string place = fmt::format("camera '{}'", name());
  if (!cfg_.camera_name.empty()) {
    mjsElement* element = mjs_findElement(spec, mjOBJ_CAMERA, cfg_.camera_name.c_str());
    if (!element) throw_unknown(place, "camera", cfg_.camera_name, names_of(spec, mjOBJ_CAMERA));
    return;  // what this sensor changes about it, others do not see
  }
  mjsBody* body = mjs_findBody(spec, cfg_.parent_body.empty() ? "world" : cfg_.parent_body.c_str());
  if (!body) throw_unknown(place, "body", cfg_.parent_body, names_of(spec, mjOBJ_BODY));
  if (mjs_findElement(spec, mjOBJ_CAMERA, name().c_str()))
    throw ValueError(fmt::format(
        "{}: repeated name: the model has a camera of this name; set camera_name to use it",
        place));
  mjsCamera* camera = mjs_addCamera(body, nullptr);
  mjs_setName(camera->element, name().c_str());
  std::copy(cfg_.pos.begin(), cfg_.pos.end(), camera->pos);
  std::copy(cfg_.quat.begin(), cfg_.quat.end(), camera->quat);
  camera->fovy = cfg_.fovy.value_or(45.0);
  camera->proj = cfg_.orthographic ? mjPROJ_ORTHOGRAPHIC : mjPROJ_PERSPECTIVE;
}

}  // namespace mjsense
