// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/physical_options.h"

#include "mjsense/render/light/environment_source.h"
#include "mjsense/render/view/texture_maps.h"

namespace mjsense::sensors {

render::PhysicalOptions physical_options(const RgbCfg& cfg, const mjModel* model) {
  render::PhysicalOptions out;
  out.on = cfg.shading == Shading::kPbr;
  if (!out.on) return out;
  render::check_texture_maps(model);
  out.exposure = cfg.exposure;
  out.tone_mapping = static_cast<render::ToneMapping>(static_cast<ToneMap>(cfg.tone_mapping));
  out.white_balance = cfg.white_balance;
  out.environment = render::environment(model, cfg.environment);
  out.hides_skybox = render::is_environment_file(cfg.environment);
  out.environment_intensity = cfg.environment_intensity;
  out.environment_rotation = cfg.environment_rotation;
  if (!cfg.ambient_occlusion) out.occlusion_reach = 0;
  return out;
}

}  // namespace mjsense::sensors
