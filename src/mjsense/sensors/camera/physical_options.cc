// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/camera/physical_options.h"

#include "mjsense/render/light/environment_source.h"
#include "mjsense/render/view/texture_maps.h"

namespace mjsense::sensors {

render::PhysicalOptions physical_options(const RgbCfg& cfg, const mjModel* model) {
  render::PhysicalOptions out;
  out.on = cfg.shading != Shading::kClassic;
  if (!out.on) return out;
  render::check_texture_maps(model);
  out.exposure = cfg.exposure;
  out.tone_mapping = static_cast<render::ToneMapping>(static_cast<ToneMap>(cfg.tone_mapping));
  out.white_balance = cfg.white_balance;
  out.environment = render::environment(model, cfg.environment);
  out.hides_skybox = render::is_environment_file(cfg.environment);
  out.follows_image_light = (cfg.environment == "model" || cfg.environment == "auto") &&
                            render::image_light_of(model) >= 0;
  out.environment_intensity = cfg.environment_intensity;
  out.environment_rotation = cfg.environment_rotation;
  if (cfg.shading == Shading::kPath) out.path_samples = cfg.samples_per_pixel;
  if (!cfg.ambient_occlusion || out.path_samples > 0) out.occlusion_reach = 0;
  return out;
}

}  // namespace mjsense::sensors
