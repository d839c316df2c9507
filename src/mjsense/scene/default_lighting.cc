// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/default_lighting.h"

#include <algorithm>

#include "mjsense/scene/mj_spec.h"

namespace mjsense::scene {
namespace {

void add_sun(mjSpec* spec) {
  mjsLight* sun = mjs_addLight(mjs_findBody(spec, "world"), nullptr);
  mjs_setName(sun->element, "terrain_sun");
  sun->type = mjLIGHT_DIRECTIONAL;
  const double pos[] = {0, 0, 4}, dir[] = {-0.3, 0.3, -1};
  std::ranges::copy(pos, sun->pos);
  std::ranges::copy(dir, sun->dir);
}

// A light that belongs to the place: a directional one, or one that is fixed in the world. Lights on
// bodies and lights that follow a body come with a robot and leave its surroundings dark.
bool lights_the_place(mjSpec* spec, mjsElement* element) {
  const mjsLight* light = mjs_asLight(element);
  if (light->type == mjLIGHT_DIRECTIONAL) return true;
  return light->mode == mjCAMLIGHT_FIXED && mjs_getParent(element) == mjs_findBody(spec, "world");
}

bool is_sky(mjsElement* texture) { return mjs_asTexture(texture)->type == mjTEXTURE_SKYBOX; }

void add_texture(mjSpec* spec, const char* name, mjtTexture type, mjtBuiltin pattern,
                 const Rgb3& rgb1, const Rgb3& rgb2) {
  mjsTexture* texture = mjs_addTexture(spec, nullptr);
  mjs_setName(texture->element, name);
  texture->type = type;
  texture->builtin = pattern;
  std::ranges::copy(rgb1, texture->rgb1);
  std::ranges::copy(rgb2, texture->rgb2);
  texture->width = 256;
  texture->height = type == mjTEXTURE_SKYBOX ? 6 * 256 : 256;
}

void add_squares(mjSpec* spec, mjsGeom* ground) {
  add_texture(spec, "terrain_squares", mjTEXTURE_2D, mjBUILTIN_CHECKER, {1, 1, 1},
              {0.72, 0.78, 0.84});
  mjsMaterial* material = mjs_addMaterial(spec, nullptr);
  mjs_setName(material->element, "terrain_squares");
  mjs_setInStringVec(material->textures, mjTEXROLE_RGB, "terrain_squares");
  material->texuniform = 1;
  std::ranges::copy(ground->rgba, material->rgba);  // keeps the intensity of lidar returns
  mjs_setString(ground->material, "terrain_squares");
}

}  // namespace

void set_sky(mjSpec* spec, const char* name, const Rgb3& top, const Rgb3& bottom) {
  // MuJoCo draws the first sky only
  for (mjsElement* texture : spec_elements(spec, mjOBJ_TEXTURE)) {
    if (is_sky(texture)) mjs_delete(spec, texture);
  }
  add_texture(spec, name, mjTEXTURE_SKYBOX, mjBUILTIN_GRADIENT, top, bottom);
}

void add_daylight(mjSpec* spec) {
  if (std::ranges::none_of(spec_elements(spec, mjOBJ_LIGHT),
                           [&](mjsElement* light) { return lights_the_place(spec, light); }))
    add_sun(spec);
  if (std::ranges::none_of(spec_elements(spec, mjOBJ_TEXTURE), is_sky))
    set_sky(spec, "terrain_sky", kSkyTop, kSkyBottom);
  mjsElement* ground = mjs_findElement(spec, mjOBJ_GEOM, "terrain");
  if (ground == nullptr || mjs_asGeom(ground)->type != mjGEOM_PLANE) return;
  mjsGeom* plane = mjs_asGeom(ground);
  const float grey[] = {0.5f, 0.5f, 0.5f, 1.0f};  // MuJoCo's default
  if (*mjs_getString(plane->material) == 0 && std::ranges::equal(plane->rgba, grey))
    add_squares(spec, plane);
}

}  // namespace mjsense::scene
