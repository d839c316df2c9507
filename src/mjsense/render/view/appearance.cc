// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/appearance.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "mjsense/render/light/environment_source.h"
#include "mjsense/render/view/physical_light.h"

namespace mjsense::render {
namespace {

// MuJoCo's visualiser uses a geom's own colour, unless that is the default grey and the geom has a
// material.
void resolve_rgba(const mjModel* m, int material, const float* own, float* out) {
  const bool is_default = own[0] == 0.5f && own[1] == 0.5f && own[2] == 0.5f && own[3] == 1.0f;
  std::copy_n(material >= 0 && is_default ? m->mat_rgba + 4 * material : own, 4, out);
}

// A light without any colour contributes nothing, so that its shadows need not be computed.
bool is_black(const ViewLight& light) {
  const auto black = [](const float* rgb) { return rgb[0] <= 0 && rgb[1] <= 0 && rgb[2] <= 0; };
  return black(light.ambient) && black(light.diffuse) && black(light.specular);
}

}  // namespace

Appearance::Appearance(const mjModel* m, int max_lights, const WarpLook& warp)
    : max_lights_(max_lights),
      warp_(warp),
      flex_parts_(rays::flex_parts(m)),
      rgba_(4 * (m->ngeom + flex_parts_.size() + m->nskin)),
      materials_(m->nmat),
      lights_(max_lights),
      light_ids_(max_lights),
      light_radii_(max_lights),
      light_intensities_(max_lights),
      light_ranges_(max_lights) {
  copy(m);
}

void Appearance::copy(const mjModel* m) {
  for (int i = 0; i < m->ngeom; ++i)
    resolve_rgba(m, m->geom_matid[i], m->geom_rgba + 4 * i, &rgba_[4 * i]);
  float* next = rgba_.data() + 4 * m->ngeom;
  for (const rays::FlexPart& part : flex_parts_) {
    resolve_rgba(m, m->flex_matid[part.element], m->flex_rgba + 4 * part.flex, next);
    next += 4;
  }
  for (int i = 0; i < m->nskin; ++i, next += 4)
    resolve_rgba(m, m->skin_matid[i], m->skin_rgba + 4 * i, next);
  for (int i = 0; i < m->nmat; ++i)
    materials_[i] = {.specular = m->mat_specular[i],
                     .shininess = m->mat_shininess[i],
                     .emission = m->mat_emission[i],
                     .reflectance = m->mat_reflectance[i],
                     .metallic = m->mat_metallic[i],
                     .roughness = m->mat_roughness[i],
                     .texture = m->mat_texid[mjNTEXROLE * i + mjTEXROLE_RGB],
                     .repeat = {m->mat_texrepeat[2 * i], m->mat_texrepeat[2 * i + 1]},
                     .uniform = m->mat_texuniform[i] != 0,
                     .textures = textures_of(m, i)};
  if (warp_.on) apply_warp_look(m);
  sky_.distance = static_cast<float>(0.7 * m->vis.map.zfar * m->stat.extent);
  sky_.haze_width = m->vis.map.haze;
  std::copy_n(m->vis.rgba.haze, 3, sky_.haze_rgb);
  copy_lights(m);
}

void Appearance::apply_warp_look(const mjModel* m) {
  for (int i = 0; i < m->ngeom; ++i) {
    float* rgba = &rgba_[4 * i];
    if (!warp_.series_4) {
      const int material = m->geom_matid[i];
      std::copy_n(material < 0 ? m->geom_rgba + 4 * i : m->mat_rgba + 4 * material, 3, rgba);
    }
    if (!warp_.series_4 || rgba[3] != 0) rgba[3] = 1;
  }
  for (Material& material : materials_) material.reflectance = 0;
}

// MuJoCo assigns each active light one of OpenGL's light slots, the headlight first. Image lights
// take a slot but have no effect.
void Appearance::copy_lights(const mjModel* m) {
  num_lights_ = 0;
  environment_tint_ = {1, 1, 1};
  if (const int i = image_light_of(m); i >= 0)
    environment_tint_ = environment_factors(m->light_diffuse + 3 * i, m->light_intensity[i]);
  int places = 0;
  const auto add = [&](int id, const float* ambient, const float* diffuse,
                       const float* specular) -> ViewLight& {
    light_ids_[num_lights_] = id;
    light_radii_[num_lights_] = id < 0 ? 0 : m->light_bulbradius[id];
    light_intensities_[num_lights_] = id < 0 ? 0 : m->light_intensity[id];
    light_ranges_[num_lights_] = id < 0 ? 0 : m->light_range[id];
    ViewLight& light = lights_[num_lights_++];
    light = {};
    std::copy_n(ambient, 3, light.ambient);
    std::copy_n(diffuse, 3, light.diffuse);
    std::copy_n(specular, 3, light.specular);
    light.attenuation[0] = 1;
    return light;
  };
  const auto& head = m->vis.headlight;
  if (head.active && ++places <= max_lights_) add(-1, head.ambient, head.diffuse, head.specular);
  for (int i = 0; i < m->nlight; ++i) {
    if (!m->light_active[i] || ++places > max_lights_ || m->light_type[i] == mjLIGHT_IMAGE)
      continue;
    ViewLight& light =
        add(i, m->light_ambient + 3 * i, m->light_diffuse + 3 * i, m->light_specular + 3 * i);
    light.casts_shadows = m->light_castshadow[i] && !is_black(light);
    light.kind = m->light_type[i] == mjLIGHT_DIRECTIONAL ? LightKind::kDirectional
                 : m->light_type[i] == mjLIGHT_SPOT      ? LightKind::kSpot
                                                         : LightKind::kPoint;
    if (light.kind == LightKind::kDirectional) continue;
    std::copy_n(m->light_attenuation + 3 * i, 3, light.attenuation);
    light.exponent = m->light_exponent[i];
    const double cutoff = m->light_cutoff[i];
    light.cos_cutoff = static_cast<float>(std::cos(cutoff * std::numbers::pi / 180));
    if (cutoff >= 180) light.kind = LightKind::kPoint;
  }
}

}  // namespace mjsense::render
