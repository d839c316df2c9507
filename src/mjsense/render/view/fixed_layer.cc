// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/fixed_layer.h"

#include <algorithm>
#include <span>
#include <utility>

#include "mjsense/render/view/view_builder.h"

namespace mjsense::render {
namespace {

std::size_t count_tiles(int width, int height) {
  return static_cast<std::size_t>((width + kTileSize - 1) / kTileSize) *
         ((height + kTileSize - 1) / kTileSize);
}

}  // namespace

bool is_fixed_body(const mjModel* m, int body) {
  for (; body > 0; body = m->body_parentid[body]) {
    if (m->body_jntnum[body] > 0) return false;
    const bool parent = body + 1 < m->nbody && m->body_parentid[body + 1] == body;
    if (m->body_mocapid[body] >= 0 && !parent) return false;
  }
  return true;
}

bool FixedLayer::possible(const mjModel* m, int camera) {
  if (m->cam_mode[camera] != mjCAMLIGHT_FIXED || !is_fixed_body(m, m->cam_bodyid[camera]))
    return false;
  for (int i = 0; i < m->nlight; ++i)
    if (m->light_mode[i] != mjCAMLIGHT_FIXED || !is_fixed_body(m, m->light_bodyid[i])) return false;
  return true;
}

std::size_t FixedLayer::bytes(int width, int height) {
  return sizeof(FixedTile) * count_tiles(width, height);
}

FixedLayer::FixedLayer(const mjModel* m, int width, int height)
    : tiles_(std::make_unique_for_overwrite<FixedTile[]>(count_tiles(width, height))) {
  geoms_.reserve(ViewBuilder::max_geoms(m));
  lights_.reserve(kMaxLights);
}

bool FixedLayer::settles(const View& view) {
  if (same(view)) return !std::exchange(made_, true);
  made_ = false;
  grid_ = view.grid;
  physical_ = view.physical;
  geoms_.clear();
  for (int i = 0; i < view.num_geoms; ++i)
    if (view.geoms[i].fixed) geoms_.push_back(view.geoms[i]);
  lights_.assign(view.lights, view.lights + view.num_lights);
  return false;
}

bool FixedLayer::same(const View& view) const {
  if (grid_ != view.grid || physical_ != view.physical) return false;
  if (!std::ranges::equal(lights_, std::span(view.lights, view.num_lights))) return false;
  std::size_t next = 0;
  for (int i = 0; i < view.num_geoms; ++i) {
    const ViewGeom& g = view.geoms[i];
    if (!g.fixed) continue;
    if (next == geoms_.size() || geoms_[next] != g) return false;
    ++next;
  }
  return next == geoms_.size();
}

FixedLayers::FixedLayers(const mjModel* m, int width, int height, int num_worlds,
                         std::size_t max_bytes)
    : common_(m, width, height) {
  const std::size_t maximum = max_bytes / FixedLayer::bytes(width, height);
  const std::size_t count = num_worlds > 1 ? std::min<std::size_t>(num_worlds, maximum) : 0;
  own_.reserve(count);
  for (std::size_t i = 0; i < count; ++i) own_.emplace_back(m, width, height);
}

const FixedTile* FixedLayers::find(int world, const View& view) {
  FixedLayer* layer = own(world);
  if (layer && layer->shows(view)) return layer->tiles();
  return common_.shows(view) ? common_.tiles() : nullptr;
}

// Worlds that look different would evict each other from the common layer, so a world that has its
// own layer does not use it.
FixedTile* FixedLayers::settle_common(int world, const View& view) {
  FixedLayer* layer = own(world);
  if (layer && layer->shows(view)) return nullptr;
  return common_.settles(view) ? common_.tiles() : nullptr;
}

FixedTile* FixedLayers::settle(int world, const View& view) {
  FixedLayer* layer = own(world);
  return layer && layer->settles(view) ? layer->tiles() : nullptr;
}

}  // namespace mjsense::render
