#include "mjsense/rays/ray_world.h"

#include <algorithm>
#include <cmath>

namespace mjsense {
namespace {

constexpr int kPad = 16;
constexpr float kEndless = 1e30f;

}  // namespace

RayWorld::RayWorld(const mjModel* m, const ShapeBounds& bounds)
    : num_geoms_(static_cast<int>(m->ngeom)), shapes_(&bounds) {
  const int count = static_cast<int>(m->ngeom + m->nflex);
  const int padded = (count + kPad - 1) / kPad * kPad;
  geoms_.resize(count);
  bounds_ = Array(DType::kFloat32, {6, padded});
  flags_.assign(padded, 0);
  bodies_.assign(padded, -1);
  materials_.assign(count, -1);
  rgba_.assign(4 * count, 0.0f);
  flex_vertices_.assign(3 * m->nflexvert, 0.0f);
  lights_.resize(m->nlight);
  cameras_.resize(m->ncam);
  // Padding never meets a beam: its flags are 0.
}

void RayWorld::update(const mjModel* m, const mjData* d) {
  for (int i = 0; i < num_geoms_; ++i) {
    RayGeom& g = geoms_[i];
    std::copy_n(d->geom_xpos + 3 * i, 3, g.pos);
    std::copy_n(d->geom_xmat + 9 * i, 9, g.mat);
    std::copy_n(g.mat, 9, g.rot);
    std::copy_n(m->geom_size + 3 * i, 3, g.size);
    g.type = m->geom_type[i];
    g.data = m->geom_dataid[i];
    materials_[i] = m->geom_matid[i];
    const float* rgba = materials_[i] >= 0 ? m->mat_rgba + 4 * materials_[i] : m->geom_rgba + 4 * i;
    std::copy_n(rgba, 4, &rgba_[4 * i]);
    bodies_[i] = m->geom_bodyid[i];
    flags_[i] = 1u << std::clamp(m->geom_group[i], 0, 5) | (rgba[3] == 0.0f ? kTransparent : 0u);
  }
  if (m->nflex > 0) {
    std::copy_n(d->flexvert_xpos, 3 * m->nflexvert, flex_vertices_.begin());
    for (int f = 0; f < m->nflex; ++f) {
      const int i = num_geoms_ + f;
      RayGeom& g = geoms_[i];
      g = {};
      for (int k = 0; k < 3; ++k) g.mat[4 * k] = g.rot[4 * k] = 1.0f;
      g.type = kFlexType;
      g.data = f;
      const float* v = &flex_vertices_[3 * m->flex_vertadr[f]];
      for (int k = 0; k < 3; ++k) {
        float low = kEndless, high = -kEndless;
        for (int j = 0; j < m->flex_vertnum[f]; ++j) {
          low = std::min(low, v[3 * j + k]);
          high = std::max(high, v[3 * j + k]);
        }
        g.center[k] = 0.5f * (low + high);
        g.half[k] = 0.5f * (high - low);
      }
      materials_[i] = m->flex_matid[f];
      const float* rgba =
          materials_[i] >= 0 ? m->mat_rgba + 4 * materials_[i] : m->flex_rgba + 4 * f;
      std::copy_n(rgba, 4, &rgba_[4 * i]);
      flags_[i] = 1u << std::clamp(m->flex_group[f], 0, 5) | (rgba[3] == 0.0f ? kTransparent : 0u);
    }
  }
  update_bounds();
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

// Local boxes from the present sizes, then boxes in the world around them, wider by what float32
// may lose.
void RayWorld::update_bounds() {
  float* low[3] = {bounds_.row<float>(0).data(), bounds_.row<float>(1).data(),
                   bounds_.row<float>(2).data()};
  float* high[3] = {bounds_.row<float>(3).data(), bounds_.row<float>(4).data(),
                    bounds_.row<float>(5).data()};
  for (int i = 0; i < num_objects(); ++i) {
    RayGeom& g = geoms_[i];
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
        shape(shapes_->meshes[g.data]);
        break;
      case mjGEOM_HFIELD:
        shape(shapes_->height_fields[g.data]);
        break;
      default:
        break;  // flexes have theirs already
    }
    for (int k = 0; k < 3; ++k) {
      const float* r = g.rot + 3 * k;
      const double center = g.pos[k] + static_cast<double>(r[0] * c[0] + r[1] * c[1] + r[2] * c[2]);
      float reach = std::abs(r[0]) * h[0] + std::abs(r[1]) * h[1] + std::abs(r[2]) * h[2];
      const float x = static_cast<float>(center);
      reach += 1e-6f + 4e-7f * (std::abs(x) + reach);
      low[k][i] = g.type == mjGEOM_PLANE ? -kEndless : x - reach;
      high[k][i] = g.type == mjGEOM_PLANE ? kEndless : x + reach;
    }
  }
}

}  // namespace mjsense
