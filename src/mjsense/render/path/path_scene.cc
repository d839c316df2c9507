// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/path/path_scene.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "mjsense/rays/box_list.h"

namespace mjsense::render {
namespace {

constexpr std::uint32_t kSeen = 1, kBlocks = 2;
constexpr float kEndless = 1e30f;

rays::RayGeom ray_geom(const ViewGeom& g) {
  rays::RayGeom out{};
  for (int k = 0; k < 3; ++k) {
    out.pos[k] = g.pos[k];
    out.size[k] = g.size[k];
    out.center[k] = g.aabb[k];
    out.half[k] = g.aabb[3 + k];
  }
  for (int k = 0; k < 9; ++k) out.mat[k] = out.rot[k] = g.rot[k];
  out.type = g.type;
  out.data = -1;
  return out;
}

void set_box(const rays::RayGeom& g, int index, rays::BoxList& boxes) {
  float low[3], high[3];
  for (int k = 0; k < 3; ++k) {
    if (g.type == mjGEOM_PLANE) {
      low[k] = -kEndless;
      high[k] = kEndless;
      continue;
    }
    const float *r = g.rot + 3 * k, *c = g.center, *h = g.half;
    const float x = static_cast<float>(g.pos[k]) + r[0] * c[0] + r[1] * c[1] + r[2] * c[2];
    float reach = std::abs(r[0]) * h[0] + std::abs(r[1]) * h[1] + std::abs(r[2]) * h[2];
    reach += 1e-6f + 1e-6f * (std::abs(x) + reach);
    low[k] = x - reach;
    high[k] = x + reach;
  }
  boxes.set(index, low, high);
}

// The axis along which the ray is steepest, and its sign, in the upper bits; the rays of one packet have the
// same, because the kernels then cull geoms. Below them, the place of the direction on that face of a
// cube, of 8 x 8, in Morton's order: rays with near numbers have near directions.
constexpr std::uint32_t kPlaces = 64;
std::uint32_t direction_class(const PathRay& ray) {
  const float x = std::abs(ray.d[0]), y = std::abs(ray.d[1]), z = std::abs(ray.d[2]);
  const std::uint32_t axis = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
  const float steep = std::max({x, y, z, 1e-6f});
  std::uint32_t place = 0;
  for (int k = 1; k < 3; ++k) {
    const float slope = ray.d[(axis + k) % 3] / steep;  // -1..1
    const std::uint32_t step = std::clamp(static_cast<int>(4 * (slope + 1)), 0, 7);
    for (int bit = 0; bit < 3; ++bit) place |= (step >> bit & 1) << (2 * bit + k - 1);
  }
  return kPlaces * (2 * axis + (ray.d[axis] < 0)) + place;
}

}  // namespace

PathScene::PathScene() : kernels_(&rays::kernels_for(cpu_isa())) {}
PathScene::~PathScene() = default;
PathScene::PathScene(PathScene&&) noexcept = default;

void PathScene::build(const View& view) {
  view_ = &view;
  const int count = view.num_geoms;
  index_.resize(count);
  std::iota(index_.begin(), index_.end(), 0);
  std::ranges::sort(index_, std::greater<>(), [&](int i) { return view.geoms[i].id; });
  geoms_.clear();
  triangles_.clear();
  height_fields_.clear();
  boxes_ = std::make_unique<rays::BoxList>(count);
  flags_.assign(boxes_->padded(), 0);
  bodies_.assign(boxes_->padded(), -1);
  for (int i = 0; i < count; ++i) {
    const ViewGeom& g = view.geoms[index_[i]];
    rays::RayGeom& out = geoms_.emplace_back(ray_geom(g));
    if (g.height_field) {
      out.type = mjGEOM_HFIELD;
      out.data = static_cast<int>(height_fields_.size());
      height_fields_.push_back(*g.height_field);
    } else if (g.bvh || g.mesh_on_demand) {
      out.type = mjGEOM_MESH;
      out.data = static_cast<int>(triangles_.size());
      triangles_.push_back(g.mesh_on_demand ? g.mesh_on_demand->bvh() : g.bvh);
    } else if (g.type == mjGEOM_MESH || g.type == mjGEOM_SDF) {
      out.type = mjGEOM_NONE;  // without triangles
    }
    flags_[i] = kSeen | (g.casts_shadows ? kBlocks : 0);
    set_box(out, i, *boxes_);
  }
  boxes_->update();
}

void PathScene::trace(std::span<const PathRay> rays, Stops stops, std::span<PathHit> hits) const {
  std::vector<std::uint64_t> order;  // class << 32 | ray
  order.reserve(rays.size());
  for (const PathRay& ray : rays)
    order.push_back(std::uint64_t{direction_class(ray)} << 32 | order.size());
  std::ranges::sort(order);
  const auto group = [&](std::size_t i) { return (order[i] >> 32) / kPlaces; };
  const auto ray_at = [&](std::size_t i) { return order[i] & 0xffffffffu; };
  std::vector<rays::RayCandidate> candidates(geoms_.size());
  const rays::KernelScene scene{triangles_.data(), height_fields_.data()};
  const rays::KernelWorld world{geoms_.data(),    boxes_->all(), boxes_->box_of_geom(),
                                boxes_->blocks(), flags_.data(), bodies_.data(),
                                nullptr};
  const bool sight = stops == Stops::kSight;
  const rays::KernelFilter filter{sight ? kSeen : kBlocks, -1, false, sight, true, nullptr};
  for (std::size_t first = 0; first < order.size();) {
    std::size_t last = first + 1;
    while (last < order.size() && last < first + rays::kPacket && group(last) == group(first))
      ++last;
    rays::RayPacket packet;
    rays::HitPacket found;
    std::ranges::fill(packet.origin, 0.0);
    for (int lane = 0; lane < rays::kPacket; ++lane) {
      const std::size_t i = std::min(first + lane, last - 1);
      const PathRay& ray = rays[ray_at(i)];
      for (int k = 0; k < 3; ++k) {
        packet.o[k][lane] = ray.o[k];
        packet.d[k][lane] = ray.d[k];
      }
      packet.tmax[lane] = first + lane < last ? ray.tmax : -1;
    }
    const int count = kernels_->gather(world, filter, packet, candidates.data());
    kernels_->trace(scene, world, filter, packet, found, candidates.data(), count);
    for (int lane = 0; first < last; ++first, ++lane) {
      const int geom = found.geom[lane];
      hits[ray_at(first)] = {
          found.t[lane],    geom < 0 ? -1 : index_[geom],
          found.prim[lane], {found.n[0][lane], found.n[1][lane], found.n[2][lane]},
          found.u[lane],    found.v[lane]};
    }
  }
}

}  // namespace mjsense::render
