// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/geom_surface.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "mjsense/rays/ray_geom.h"
#include "mjsense/render/light/material.h"
#include "mjsense/render/light/tone_map.h"

namespace mjsense::render {
namespace {

constexpr float kFromBehind = 0.3f;  // MuJoCo's factor for the alpha of planes seen from below

bool is_soft(const ViewGeom& g) {
  return g.object_type == mjOBJ_FLEX || g.object_type == mjOBJ_SKIN;
}

// The factors by which MuJoCo's visualiser scales a shape along its axes and, with texuniform, its
// texture.
std::array<float, 3> drawn_extent(const ViewGeom& g, const SurfaceStyle& style) {
  if (is_soft(g) && !style.sized_soft_textures) return {};
  const float* s = g.size;
  switch (g.type) {
    case mjGEOM_SPHERE:
      return {s[0], s[0], s[0]};
    case mjGEOM_CAPSULE:
    case mjGEOM_CYLINDER:
      return {s[0], s[0], s[1]};
    default:
      return {s[0], s[1], s[2]};
  }
}

void set_colors(const SurfaceStyle& style, const Paint& paint, ViewGeom& g) {
  Surface& s = g.surface;
  const Material* material = paint.material;
  std::copy_n(paint.rgba, 4, s.rgba);
  for (int i = 0; i < 3; ++i)
    s.rgba[i] = style.physical ? static_cast<float>(srgb_decode(paint.rgba[i]))
                               : paint.rgba[i] * style.tint;
  if (g.shows_back) s.rgba[3] *= kFromBehind;
  g.transparent = s.rgba[3] < kOpaque || g.shows_back;
  s.specular = 0.5f;
  s.exponent = 128.0f * (material ? material->shininess : 0.5f);
  s.highlight_threshold = highlight_threshold_of(s.exponent);
  if (material) {
    s.specular = material->specular;
    s.emission = material->emission;
  }
  if (!style.physical) return;
  s.specular = static_cast<float>(dielectric_f0(s.specular));
  s.metallic = static_cast<float>(metallic_of(material ? material->metallic : -1));
  s.roughness = static_cast<float>(material ? roughness_of(material->roughness, material->shininess)
                                            : roughness_of(-1, 0.5));
}

// Sets the maps of a physically based view, and the factors that are 1 because of them.
void set_maps(const SurfaceStyle& style, const Paint& paint, Surface& s) {
  const Material& material = *paint.material;
  for (int i = 0; i < kNumTextureMaps; ++i) {
    const Texture* map =
        paint.maps
            ? paint.maps[i]
            : style.assets->texture(texture_of(material.textures, static_cast<TextureMap>(i)));
    if (!map || map->levels == 0 || map->cube) continue;
    s.maps[i] = map;
    s.mapped = true;
  }
  const auto is_in = [&](TextureMap map) { return s.maps[map] || s.maps[kOrmMap]; };
  if (is_in(kRoughnessMap) && material.roughness < 0) s.roughness = 1;
  if (is_in(kMetallicMap) && material.metallic < 0) s.metallic = 1;
  if (s.maps[kEmissiveMap] && s.emission == 0) s.emission = 1;
}

// 2D textures.
void set_uv_scale(const SurfaceStyle& style, const rays::RayGeom& source, const Material& material,
                  const std::array<float, 3>& extent, ViewGeom& g) {
  Surface& s = g.surface;
  const bool endless = g.type == mjGEOM_PLANE && (g.size[0] <= 0 || g.size[1] <= 0);
  for (int i = 0; i < 2; ++i) {
    s.uv_scale[i] = material.repeat[i];
    if (s.uv_scale[i] <= 0 && !s.projected_along_z) s.uv_scale[i] = 1;
    if (material.uniform && extent[i] > 0) s.uv_scale[i] *= extent[i];
    if (style.projected_textures && s.uses_mesh_uvs) s.uv_scale[i] = 1;
    if (s.projected_along_z || endless) s.uv_offset[i] = -0.5f;
    if (s.projected_along_z && g.object_type == mjOBJ_SKIN) {
      if (!style.sized_soft_textures) {
        s.uv_scale[i] = s.uv_offset[i] = 0;
      } else {  // the texture stays fixed in the world; kernels divide by the size
        s.uv_offset[i] += (i ? -0.5f : 0.5f) * s.uv_scale[i] * static_cast<float>(source.pos[i]);
        if (g.size[i] > 0) s.uv_scale[i] *= g.size[i];
      }
    }
  }
  if (style.planes_are_infinite && g.type == mjGEOM_PLANE) {
    for (int i = 0; i < 2; ++i) {
      const float size = std::max(g.size[i], 0.0f);
      s.uv_scale[i] = material.repeat[i] * (size > 0 ? size : 1);
      s.uv_offset[i] = -0.5f - 0.5f * size * material.repeat[i];
    }
  }
}

// Cube maps: MuJoCo uses directions in the unit shape that it scales; for meshes and planes, in
// metres.
void set_cube_scale(bool uniform, const std::array<float, 3>& extent, ViewGeom& g) {
  const bool in_meters = g.mesh || g.height_field || g.type == mjGEOM_PLANE;
  for (int i = 0; i < 3; ++i) {
    float& scale = g.surface.cube_scale[i];
    if (in_meters) {
      scale = uniform && !is_soft(g) ? extent[i] : 1.0f;
    } else {
      scale = uniform || extent[i] <= 0 ? 1.0f : 1.0f / extent[i];
    }
  }
}

}  // namespace

float highlight_threshold_of(float exponent) {
  if (!(exponent >= 4)) return -1;
  const float x = 0.9999f * std::max(0.3f, std::exp(-33 / exponent));
  return x * x;
}

std::array<float, 3> mean_color(const Surface& s) {
  std::array<float, 3> out = {s.rgba[0], s.rgba[1], s.rgba[2]};
  if (!s.texture) return out;
  for (int c = 0; c < 3; ++c) out[c] *= s.texture->mean[c];
  return out;
}

void set_surface(const SurfaceStyle& style, const rays::RayGeom& source, const Paint& paint,
                 ViewGeom& g) {
  Surface& s = g.surface;
  s = {};
  set_colors(style, paint, g);
  if (!paint.material || !style.textures) return;
  const Texture* texture = paint.texture;
  s.texture = texture && texture->levels > 0 && !texture->grey ? texture : nullptr;
  if (style.physical) set_maps(style, paint, s);
  if (s.maps[kOpacityMap]) g.transparent = true;
  if (!s.texture && !s.mapped) return;
  const bool coordinates = g.mesh_on_demand ? g.mesh_on_demand->has_uvs() : g.mesh && g.mesh->uvs;
  s.uses_mesh_uvs = coordinates && (s.mapped || !s.texture->cube);
  // MuJoCo textures flexes by their own coordinates only.
  if (g.object_type == mjOBJ_FLEX && !s.uses_mesh_uvs) {
    s.texture = nullptr;
    s.mapped = false;
    return;
  }
  s.projected_along_z =
      (g.mesh && !s.uses_mesh_uvs) || g.height_field || (style.projected_textures && !g.mesh);
  const std::array<float, 3> extent = drawn_extent(g, style);
  set_uv_scale(style, source, *paint.material, extent, g);
  set_cube_scale(paint.material->uniform, extent, g);
}

}  // namespace mjsense::render
