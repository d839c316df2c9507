// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/markers.h"

#include <algorithm>

namespace mjsense::render {
namespace {

constexpr int kCatenaryPoints = 100;  // MuJoCo's limit

// Maximum number of geoms that mjv_addGeoms() creates for all sites and tendons, and for
// slider-cranks, which it adds as well.
std::size_t max_geoms(const mjModel* m, const MarkerOptions& options) {
  std::size_t maximum = options.site_groups ? m->nsite : 0;
  for (int i = 0; options.tendon_groups && i < m->ntendon; ++i) {
    const bool may_hang = m->tendon_num[i] == 2;
    maximum += std::max(2 * m->tendon_num[i], may_hang ? kCatenaryPoints : 0);
  }
  return maximum == 0 ? 0 : maximum + 2 * m->nactuator;
}

Marker marker_of(const mjvGeom& g) {
  Marker marker{};
  marker.id = g.objid;
  marker.object = g.objtype;
  std::copy_n(g.rgba, 4, marker.rgba);
  marker.material = {.specular = g.specular,
                     .shininess = g.shininess,
                     .emission = g.emission,
                     .reflectance = g.reflectance,
                     .texture = g.matid < 0 ? -1 : g.texid,
                     .repeat = {g.texrepeat[0], g.texrepeat[1]},
                     .uniform = g.texuniform != 0};
  rays::RayGeom& shape = marker.shape;
  shape.type = g.type;
  shape.data = -1;
  std::copy_n(g.pos, 3, shape.pos);
  std::copy_n(g.mat, 9, shape.mat);
  std::copy_n(g.mat, 9, shape.rot);
  std::copy_n(g.size, 3, shape.size);  // half sizes along the axes
  std::copy_n(g.size, 3, shape.half);
  if (g.type == mjGEOM_CAPSULE) shape.half[2] += g.size[0];
  if (g.type == mjGEOM_CAPSULE || g.type == mjGEOM_CYLINDER) {
    shape.size[1] = g.size[2];
    shape.size[2] = 0;
  }
  return marker;
}

}  // namespace

Markers::Markers(const mjModel* model, const MarkerOptions& options)
    : geoms_(max_geoms(model, options)), markers_(geoms_.size()) {
  mjv_defaultOption(&options_);
  options_.flags[mjVIS_TEXTURE] = options.textures;
  options_.flags[mjVIS_TENDON] = options.tendon_groups != 0;
  for (int g = 0; g < mjNGROUP; ++g) {
    options_.geomgroup[g] = options_.flexgroup[g] = options_.skingroup[g] = 0;
    options_.sitegroup[g] = options.site_groups >> g & 1u;
    options_.tendongroup[g] = options.tendon_groups >> g & 1u;
  }
}

void Markers::copy(const mjModel* model, mjData* data) {
  if (geoms_.empty()) return;
  mjvScene scene;
  mjv_defaultScene(&scene);
  scene.geoms = geoms_.data();
  scene.maxgeom = static_cast<int>(geoms_.size());
  mjv_addGeoms(model, data, &options_, nullptr, mjCAT_STATIC | mjCAT_DYNAMIC, &scene);
  count_ = 0;
  for (; count_ < static_cast<std::size_t>(scene.ngeom); ++count_) {
    const mjvGeom& g = geoms_[count_];
    if (g.objtype != mjOBJ_SITE && g.objtype != mjOBJ_TENDON) break;  // slider-cranks come last
    markers_[count_] = marker_of(g);
  }
}

}  // namespace mjsense::render
