// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/changed_tiles.h"

#include <mujoco/mujoco.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "mjsense/render/view/image_window.h"
#include "mjsense/render/view/tile_kernels.h"

namespace mjsense::render {
namespace {

int tiles_along(int pixels) { return (pixels + kTileSize - 1) / kTileSize; }

// Whether everything is equal but the geoms and what is computed from geoms and lights.
bool same_surroundings(const View& a, const View& b) {
  const auto values = [](const View& v) {
    return std::tie(v.grid, v.near, v.far, v.num_lights, v.shadows, v.physical, v.shows_plane_backs,
                    v.global_ambient, v.skybox, v.sky_distance, v.haze, v.sky_min_depth, v.fog,
                    v.sky_fog_radius, v.mirror_id);
  };
  return values(a) == values(b) && std::ranges::equal(a.r_wc, b.r_wc) &&
         std::equal(a.lights, a.lights + a.num_lights, b.lights) && !a.reflection == !b.reflection;
}

int visible(const View& view) { return view.num_opaque + view.num_transparent; }

// Samples are inside their pixels; this is for rounding, pixels.
constexpr float kSlack = 0.25f;

struct Range {  // of columns or rows of tiles
  int first, last;
};

// `step` may be negative.
Range tiles_of(float low, float high, float origin, float step, int pixels) {
  const auto pixel = [&](float at) {
    return std::clamp((at - origin) / step, -2 * kSlack, pixels + 2 * kSlack);
  };
  const auto [from, to] = std::minmax({pixel(low), pixel(high)});
  return {std::max(static_cast<int>(from - kSlack), 0) / kTileSize,
          std::min(static_cast<int>(to + kSlack), pixels - 1) / kTileSize};
}

// Bands of the image, one along each edge of a geom's bounding box, all of which contain the geom.
class Outline {
 public:
  // There are no bands if the box is not entirely in front of the camera, if it reaches so far out of
  // the image that rounding matters, or if the tiles depend on the geom's window because it is thin.
  Outline(const PixelGrid& grid, const ViewGeom& geom) {
    const float thin = kThin * grid.dx, *w = geom.window;
    if (geom.type == mjGEOM_PLANE || w[1] - w[0] <= thin || w[3] - w[2] <= thin) return;
    float corners[8][3], x[8], y[8];
    box_corners(geom, corners);
    for (int k = 0; k < 8; ++k) {
      const float depth = grid.orthographic ? 1.0f : -corners[k][2];
      if (depth < kNearest) return;
      x[k] = (corners[k][0] / depth - grid.left) / grid.dx;
      y[k] = (corners[k][1] / depth - grid.top) / grid.dy;
      if (std::abs(x[k]) > kFarthest || std::abs(y[k]) > kFarthest) return;
    }
    for (int k = 0; k < 8; ++k) {
      for (int axis = 1; axis < 8; axis *= 2) {
        if (k & axis) continue;
        Band& band = bands_[count_++];
        band = {y[k] - y[k | axis], x[k | axis] - x[k], 0, 0};
        band.low = band.high = band.x * x[0] + band.y * y[0];
        for (int i = 1; i < 8; ++i) {
          const float at = band.x * x[i] + band.y * y[i];
          band.low = std::min(band.low, at);
          band.high = std::max(band.high, at);
        }
      }
    }
  }

  bool known() const { return count_ > 0; }

  // Whether the geom may be in the tile, or so near to it that the tile depends on it.
  bool meets(int column, int row) const {
    constexpr float kHalf = 0.5f * kTileSize, kReach = kHalf + kSlack;
    const float x = column * kTileSize + kHalf, y = row * kTileSize + kHalf;
    return std::all_of(bands_, bands_ + count_, [&](const Band& band) {
      const float at = band.x * x + band.y * y,
                  reach = kReach * (std::abs(band.x) + std::abs(band.y));
      return !(at + reach < band.low || band.high < at - reach);
    });
  }

 private:
  static constexpr float kNearest = 1e-2f;  // m
  static constexpr float kFarthest = 1e5f;  // pixels
  struct Band {
    float x, y, low, high;  // pixels with low <= x * column + y * row <= high
  };
  Band bands_[12];
  int count_ = 0;
};

bool overlap(const LightWindow& shadow, const LightWindow& points) {
  for (int i = 0; i < 2; ++i)
    if (!(shadow.low[i] <= points.high[i] && points.low[i] <= shadow.high[i])) return false;
  return shadow.w < points.w;
}

}  // namespace

const ViewGeom* ChangedTiles::Kept::find(const ViewGeom& geom) const {
  const int at = geom.id < std::ssize(geom_index) ? geom_index[geom.id] : -1;
  return at < 0 ? nullptr : &geoms[at];
}

void ChangedTiles::Kept::assign(const View& from) {
  view = from;
  geoms.assign(from.geoms, from.geoms + from.num_geoms);
  std::ranges::fill(geom_index, -1);
  for (int i = 0; i < from.num_geoms; ++i) {
    const int id = geoms[i].id;
    if (id >= std::ssize(geom_index)) geom_index.resize(id + 1, -1);
    geom_index[id] = i;
  }
}

int ChangedTiles::equal_geoms(const View& view) const {
  if (!complete_ || view.grid.distorted_rays || !same_surroundings(view, shown_.view)) return -1;
  if (view.reflection && !same_surroundings(*view.reflection, reflected_.view)) return -1;
  return static_cast<int>(
      std::count_if(view.geoms, view.geoms + view.num_geoms, [&](const ViewGeom& now) {
        const ViewGeom* before = shown_.find(now);
        return before && *before == now;
      }));
}

void ChangedTiles::compare(const View& view) {
  const bool comparable = equal_geoms(view) > 0;
  complete_ = false;
  changed_.assign(
      static_cast<std::size_t>(tiles_along(view.grid.width)) * tiles_along(view.grid.height),
      !comparable);
  receivers_.resize(changed_.size());
  if (comparable) {
    // The reflected view has the same pixels, and no shadows.
    if (view.reflection) mark_changes(reflected_, *view.reflection);
    mark_changes(shown_, view);
    if (view.shadows) mark_shadows(view);
    if (view.physical.occlusion_reach > 0) mark_occlusion(view);
  }
  for (std::size_t i = 0; i < receivers_.size(); ++i)
    if (changed_[i]) receivers_[i] = {};
}

void ChangedTiles::keep(const View& view) {
  complete_ = true;
  shown_.assign(view);
  if (view.reflection) reflected_.assign(*view.reflection);
}

// Finds the geoms that differ and marks the tiles that may show them.
void ChangedTiles::mark_changes(const Kept& kept, const View& view) {
  changes_.clear();
  present_.assign(kept.geoms.size(), 0);
  for (int i = 0; i < view.num_geoms; ++i) {
    const ViewGeom& now = view.geoms[i];
    const ViewGeom* before = kept.find(now);
    if (before) present_[before - kept.geoms.data()] = 1;
    if (!before || *before != now || now.deforms) changes_.push_back({before, &now});
  }
  for (std::size_t i = 0; i < kept.geoms.size(); ++i)
    if (!present_[i]) changes_.push_back({&kept.geoms[i], nullptr});
  for (const auto& [before, now] : changes_) {
    if (before) mark_geom(kept.view, before - kept.geoms.data(), *before);
    if (now) mark_geom(view, now - view.geoms, *now);
  }
}

// Marks the tiles that may show geom `index` of the view.
void ChangedTiles::mark_geom(const View& view, std::ptrdiff_t index, const ViewGeom& geom) {
  static const MayShow may_show = best_may_show();
  if (index >= visible(view)) return;
  const PixelGrid& grid = view.grid;
  const Range x = tiles_of(geom.window[0], geom.window[1], grid.left, grid.dx, grid.width);
  const Range y = tiles_of(geom.window[2], geom.window[3], grid.top, grid.dy, grid.height);
  if (x.first > x.last || y.first > y.last) return;
  const Outline outline(grid, geom);
  const bool parts =
      outline.known() && index < view.num_opaque && !grid.orthographic && !geom.height_field;
  const int across = tiles_along(grid.width);
  for (int row = y.first; row <= y.last; ++row)
    for (int column = x.first; column <= x.last; ++column) {
      std::uint8_t& changed = changed_[row * across + column];
      if (changed || !outline.meets(column, row)) continue;
      const float left = grid.left + grid.dx * (column * kTileSize - kSlack),
                  right = grid.left + grid.dx * ((column + 1) * kTileSize + kSlack),
                  top = grid.top + grid.dy * (row * kTileSize - kSlack),
                  bottom = grid.top + grid.dy * ((row + 1) * kTileSize + kSlack);
      const float window[4] = {left, right, bottom, top};
      changed = !parts || may_show(geom, window);
    }
}

// Marks the tiles with points so near to a geom that differs that it may hide the environment from them.
void ChangedTiles::mark_occlusion(const View& view) {
  const auto near = [&](const TileBox& box, const ViewGeom* g) {
    if (!g || !hides_environment(*g)) return false;
    if (g->type == mjGEOM_PLANE) return true;
    float square = 0;
    for (int i = 0; i < 3; ++i) {
      const float away = std::max({box.low[i] - g->center[i], g->center[i] - box.high[i], 0.0f});
      square += away * away;
    }
    const float reach = 1.001f * (g->radius + hiding_reach(*g, view.physical.occlusion_reach));
    return square < reach * reach;
  };
  for (std::size_t tile = 0; tile < changed_.size(); ++tile) {
    const TileBox& box = receivers_[tile];
    if (changed_[tile] || box.low[0] > box.high[0]) continue;
    changed_[tile] = std::ranges::any_of(changes_, [&](const Change& change) {
      return near(box, change.before) || near(box, change.now);
    });
  }
}

// Windows of the geoms that differ, as they were and as they are.
std::span<const LightWindow> ChangedTiles::shadow_windows(const View& view,
                                                          const LightFrame& frame) {
  auto& [of, windows] = windows_;
  if (of == &frame) return windows;
  of = &frame;
  windows.clear();
  const LightWindows& all = frame.windows;
  for (const auto& [before, now] : changes_) {
    if (before && before->casts_shadows) windows.push_back(shadow_window(frame, *before));
    if (!now || !now->casts_shadows) continue;
    const std::ptrdiff_t i = now - view.geoms;
    windows.push_back({{all.u_min[i], all.v_min[i]}, {all.u_max[i], all.v_max[i]}, all.w_min[i]});
  }
  return windows;
}

// Marks the tiles whose points may be in the shadow of a geom that differs.
void ChangedTiles::mark_shadows(const View& view) {
  windows_.frame = nullptr;
  for (int light = 0; light < view.num_lights; ++light) {
    const LightFrames& frames = view.light_frames[light];
    for (int k = 0; k < frames.count; ++k) {
      const LightFrame& frame = frames.first[k];
      for (std::size_t tile = 0; tile < changed_.size(); ++tile) {
        const TileBox& box = receivers_[tile];
        if (changed_[tile] || box.low[0] > box.high[0]) continue;
        if (&frame_towards(frames, box.low, box.high) != &frame) continue;
        const LightWindow points = lit_window(frame, box);
        changed_[tile] =
            std::ranges::any_of(shadow_windows(view, frame),
                                [&](const LightWindow& shadow) { return overlap(shadow, points); });
      }
    }
  }
}

}  // namespace mjsense::render
