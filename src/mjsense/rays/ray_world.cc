// SPDX-License-Identifier: Apache-2.0
#include "mjsense/rays/ray_world.h"

#include <algorithm>
#include <cmath>

#include "mjsense/rays/box_list.h"
#include "mjsense/rays/change_detector.h"
#include "mjsense/rays/flex_shapes.h"
#include "mjsense/rays/shared_geometry.h"
#include "mjsense/rays/skin_shapes.h"

namespace mjsense::rays {
namespace {

constexpr float kEndless = 1e30f;

}  // namespace

// Copies of what the last update() read.
struct RayWorld::Last {
  ChangeDetector<int> body, material, group, type, data;
  ChangeDetector<float> rgba, material_rgba;
  ChangeDetector<double> size, pos, mat;

  explicit Last(const mjModel* m)
      : body(m->ngeom),
        material(m->ngeom),
        group(m->ngeom),
        type(m->ngeom),
        data(m->ngeom),
        rgba(4 * m->ngeom),
        material_rgba(4 * m->nmat),
        size(3 * m->ngeom),
        pos(3 * m->ngeom),
        mat(9 * m->ngeom) {}
};

RayWorld::RayWorld(RayWorld&&) noexcept = default;
RayWorld::~RayWorld() = default;

RayWorld::RayWorld(const mjModel* m, const SharedGeometry& shapes)
    : num_geoms_(static_cast<int>(m->ngeom)),
      shapes_(&shapes),
      boxes_(std::make_unique<BoxList>(static_cast<int>(m->ngeom + m->nflex))),
      last_(std::make_unique<Last>(m)) {
  const int count = static_cast<int>(m->ngeom + m->nflex);
  const int padded = boxes_->padded();
  geoms_.resize(count);
  flags_.assign(padded, 0);
  bodies_.assign(padded, -1);
  materials_.assign(count, -1);
  rgba_.assign(4 * count, 0.0f);
  if (m->nflex > 0) flexes_ = std::make_unique<FlexShapes>(shapes.device.get(), shapes.flexes, m);
  if (m->nskin > 0 && m->ncam > 0) skins_ = std::make_unique<SkinShapes>(shapes.device.get(), m);
  lights_.resize(m->nlight);
  cameras_.resize(m->ncam);
}

void RayWorld::update(const mjModel* m, const mjData* d) {
  update_appearance(m);
  update_geoms(m, d);
  if (flexes_) update_flexes(m, d);
  boxes_->update();
  if (skins_) skins_->update(m, d);
  for (int i = 0; i < m->nlight; ++i) {
    std::copy_n(d->light_xpos + 3 * i, 3, lights_[i].pos);
    std::copy_n(d->light_xdir + 3 * i, 3, lights_[i].dir);
  }
  for (int i = 0; i < m->ncam; ++i) {
    std::copy_n(d->cam_xpos + 3 * i, 3, cameras_[i].pos);
    std::copy_n(d->cam_xmat + 9 * i, 9, cameras_[i].mat);
  }
  ++version_;
}

void RayWorld::update_appearance(const mjModel* m) {
  bool changed = version_ == 0;
  changed |= last_->body.changed(m->geom_bodyid);
  changed |= last_->material.changed(m->geom_matid);
  changed |= last_->group.changed(m->geom_group);
  changed |= last_->rgba.changed(m->geom_rgba);
  changed |= last_->material_rgba.changed(m->mat_rgba);
  if (!changed) return;
  for (int i = 0; i < num_geoms_; ++i) {
    bodies_[i] = m->geom_bodyid[i];
    describe(m, i, m->geom_matid[i], m->geom_group[i], m->geom_rgba + 4 * i);
  }
}

void RayWorld::update_geoms(const mjModel* m, const mjData* d) {
  bool all = version_ == 0;
  all |= last_->type.changed(m->geom_type);
  all |= last_->data.changed(m->geom_dataid);
  all |= last_->size.changed(m->geom_size);
  constexpr int kBlock = 16;  // number of geoms per comparison
  for (int first = 0; first < num_geoms_; first += kBlock) {
    const int count = std::min(kBlock, num_geoms_ - first);
    bool moved = last_->pos.changed(d->geom_xpos, 3 * first, 3 * count);
    moved |= last_->mat.changed(d->geom_xmat, 9 * first, 9 * count);
    if (!moved && !all) continue;
    for (int i = first; i < first + count; ++i) update_geom(m, d, i);
  }
}

void RayWorld::update_geom(const mjModel* m, const mjData* d, int i) {
  RayGeom& g = geoms_[i];
  const double* size = m->geom_size + 3 * i;
  const bool same = version_ > 0 && g.type == m->geom_type[i] && g.data == m->geom_dataid[i] &&
                    g.size[0] == static_cast<float>(size[0]) &&
                    g.size[1] == static_cast<float>(size[1]) &&
                    g.size[2] == static_cast<float>(size[2]) &&
                    std::equal(g.pos, g.pos + 3, d->geom_xpos + 3 * i) &&
                    std::equal(g.mat, g.mat + 9, d->geom_xmat + 9 * i);
  if (same) return;
  std::copy_n(d->geom_xpos + 3 * i, 3, g.pos);
  std::copy_n(d->geom_xmat + 9 * i, 9, g.mat);
  std::copy_n(g.mat, 9, g.rot);
  std::copy_n(size, 3, g.size);
  g.type = m->geom_type[i];
  g.data = m->geom_dataid[i];
  set_local_box(g);
  set_world_box(i);
}

void RayWorld::describe(const mjModel* m, int i, int material, int group, const float* own_rgba) {
  const float* rgba = material >= 0 ? m->mat_rgba + 4 * material : own_rgba;
  materials_[i] = material;
  std::copy_n(rgba, 4, &rgba_[4 * i]);
  flags_[i] = 1u << std::clamp(group, 0, 5) | (rgba[3] == 0.0f ? kTransparent : 0u);
}

void RayWorld::update_flexes(const mjModel* m, const mjData* d) {
  flexes_->update(m, d);
  for (int f = 0; f < m->nflex; ++f) {
    const int i = num_geoms_ + f;
    // Rays know one material per flex: that of its first element.
    const int element = m->flex_elemadr[f];
    describe(m, i, m->flex_elemnum[f] > 0 ? m->flex_matid[element] : -1, m->flex_group[f],
             m->flex_rgba + 4 * f);
    RayGeom& g = geoms_[i];
    g = {.mat = {1, 0, 0, 0, 1, 0, 0, 0, 1},
         .rot = {1, 0, 0, 0, 1, 0, 0, 0, 1},
         .type = kFlexType,
         .data = f};
    std::copy_n(flexes_->position(f), 3, g.pos);
    std::copy_n(flexes_->box(f), 3, g.center);
    std::copy_n(flexes_->box(f) + 3, 3, g.half);
    set_world_box(i);
  }
}

void RayWorld::set_local_box(RayGeom& g) const {
  const float* s = g.size;
  float* c = g.center;
  float* h = g.half;
  const auto local = [&](float cz, float hx, float hy, float hz) {
    c[0] = c[1] = 0.0f;
    c[2] = cz;
    h[0] = hx;
    h[1] = hy;
    h[2] = hz;
  };
  const auto shape = [&](const std::array<float, 6>& box) {
    std::copy_n(box.data(), 3, c);
    std::copy_n(box.data() + 3, 3, h);
  };
  switch (g.type) {
    case mjGEOM_PLANE:
      local(0, kEndless, kEndless, kEndless);
      break;
    case mjGEOM_SPHERE:
      local(0, s[0], s[0], s[0]);
      break;
    case mjGEOM_CAPSULE:
      local(0, s[0], s[0], s[0] + s[1]);
      break;
    case mjGEOM_CYLINDER:
      local(0, s[0], s[0], s[1]);
      break;
    case mjGEOM_ELLIPSOID:
    case mjGEOM_BOX:
      local(0, s[0], s[1], s[2]);
      break;
    case mjGEOM_MESH:
    case mjGEOM_SDF:
      shape(shapes_->bounds.meshes[g.data]);
      break;
    case mjGEOM_HFIELD:
      shape(shapes_->bounds.height_fields[g.data]);
      break;
    default:
      break;  // the boxes of flexes are already set
  }
}

// Bounding box of the local box, enlarged by the rounding error of float32.
void RayWorld::set_world_box(int i) {
  const RayGeom& g = geoms_[i];
  const float *c = g.center, *h = g.half;
  float low[3], high[3];
  for (int k = 0; k < 3; ++k) {
    if (g.type == mjGEOM_PLANE) {
      low[k] = -kEndless;
      high[k] = kEndless;
      continue;
    }
    const float* r = g.rot + 3 * k;
    const auto x =
        static_cast<float>(g.pos[k] + static_cast<double>(r[0] * c[0] + r[1] * c[1] + r[2] * c[2]));
    float reach = std::abs(r[0]) * h[0] + std::abs(r[1]) * h[1] + std::abs(r[2]) * h[2];
    reach += 1e-6f + 4e-7f * (std::abs(x) + reach);
    low[k] = x - reach;
    high[k] = x + reach;
  }
  boxes_->set(i, low, high);
}

}  // namespace mjsense::rays
