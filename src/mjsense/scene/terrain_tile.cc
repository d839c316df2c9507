// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scene/terrain_tile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

namespace mjsense::scene {
namespace {

constexpr double kThickness = 1.0;  // m, of the ground below its lowest point

double at(const std::array<double, 2>& range, double difficulty) {
  return range[0] + (range[1] - range[0]) * difficulty;
}

std::array<float, 4> colour(double difficulty) {
  const float x = static_cast<float>(difficulty);
  return {0.45f + 0.25f * x, 0.55f - 0.1f * x, 0.45f - 0.1f * x, 1.0f};
}

// Adds numbered boxes to one tile.
class Boxes {
 public:
  explicit Boxes(Tile& tile) : tile_(tile) {}
  void add(double x, double y, double wx, double wy, double bottom, double top) {
    add_box(tile_.body, count_ == 0 ? tile_.name : fmt::format("{}_{}", tile_.name, count_),
            {tile_.centre[0] + x, tile_.centre[1] + y}, {wx, wy}, bottom, top,
            colour(tile_.difficulty));
    ++count_;
  }

 private:
  Tile& tile_;
  int count_ = 0;
};

// Adds a height field z = height(x, y), with x and y (m) relative to the tile's centre.
void add_height_field(Tile& tile, const std::function<double(double, double)>& height) {
  const int nx = static_cast<int>(std::lround(tile.size[0] / tile.resolution)) + 1;
  const int ny = static_cast<int>(std::lround(tile.size[1] / tile.resolution)) + 1;
  std::vector<float> z(static_cast<std::size_t>(nx) * ny);
  for (int j = 0; j < ny; ++j) {
    for (int i = 0; i < nx; ++i) {
      z[j * nx + i] = static_cast<float>(
          height(tile.size[0] * (i / (nx - 1.0) - 0.5), tile.size[1] * (j / (ny - 1.0) - 0.5)));
    }
  }
  const auto [low, high] = std::minmax_element(z.begin(), z.end());
  const double bottom = *low, range = std::max(1e-4, static_cast<double>(*high) - *low);

  mjsHField* field = mjs_addHField(tile.spec);
  mjs_setName(field->element, tile.name.c_str());
  field->nrow = ny;
  field->ncol = nx;
  field->size[0] = tile.size[0] / 2;
  field->size[1] = tile.size[1] / 2;
  field->size[2] = range;
  field->size[3] = kThickness;
  mjs_setFloat(field->userdata, z.data(), static_cast<int>(z.size()));

  mjsGeom* geom = mjs_addGeom(tile.body, nullptr);
  mjs_setName(geom->element, tile.name.c_str());
  geom->type = mjGEOM_HFIELD;
  mjs_setString(geom->hfieldname, tile.name.c_str());
  geom->pos[0] = tile.centre[0];
  geom->pos[1] = tile.centre[1];
  geom->pos[2] = bottom;
  const auto rgba = colour(tile.difficulty);
  std::copy(rgba.begin(), rgba.end(), geom->rgba);
}

double flat(const SubTerrainCfg&, Tile& tile) {
  Boxes(tile).add(0, 0, tile.size[0], tile.size[1], -kThickness, 0);
  return 0;
}

double rough(const SubTerrainCfg& cfg, Tile& tile) {
  const double amplitude = at(cfg.amplitude, tile.difficulty);
  const int nx = static_cast<int>(std::ceil(tile.size[0] / cfg.spacing)) + 2;
  const int ny = static_cast<int>(std::ceil(tile.size[1] / cfg.spacing)) + 2;
  std::vector<double> knots(static_cast<std::size_t>(nx) * ny);
  for (double& z : knots) z = tile.rng.uniform(-amplitude, amplitude);
  const auto height = [&](double x, double y) {  // bilinear interpolation of the grid values
    const double u = (x + tile.size[0] / 2) / cfg.spacing, v = (y + tile.size[1] / 2) / cfg.spacing;
    const int i = std::clamp(static_cast<int>(u), 0, nx - 2),
              j = std::clamp(static_cast<int>(v), 0, ny - 2);
    const double a = u - i, b = v - j;
    const double* z = knots.data() + j * nx + i;
    return (1 - b) * ((1 - a) * z[0] + a * z[1]) + b * ((1 - a) * z[nx] + a * z[nx + 1]);
  };
  add_height_field(tile, height);
  return height(0, 0);
}

double waves(const SubTerrainCfg& cfg, Tile& tile) {
  const double amplitude = at(cfg.amplitude, tile.difficulty);
  const auto height = [&](double x, double y) {
    const double k = 2 * std::numbers::pi * cfg.waves;
    return amplitude * std::sin(k * (x / tile.size[0] + 0.5)) *
           std::sin(k * (y / tile.size[1] + 0.5));
  };
  add_height_field(tile, height);
  return height(0, 0);
}

double slope(const SubTerrainCfg& cfg, Tile& tile) {
  const double rise = at(cfg.slope, tile.difficulty) * (cfg.inverted ? -1 : 1);
  const double reach = std::min(tile.size[0], tile.size[1]) / 2 - cfg.platform_width / 2;
  const auto height = [&](double x, double y) {
    const double inside = std::min(tile.size[0] / 2 - std::abs(x), tile.size[1] / 2 - std::abs(y));
    return rise * std::clamp(inside, 0.0, reach);
  };
  add_height_field(tile, height);
  return height(0, 0);
}

double stairs(const SubTerrainCfg& cfg, Tile& tile) {
  const double step = at(cfg.step_height, tile.difficulty);
  const double room = (std::min(tile.size[0], tile.size[1]) - cfg.platform_width) / 2;
  const int steps = static_cast<int>(room / cfg.step_width);
  Boxes boxes(tile);
  if (!cfg.inverted) {  // each step is a box on top of the previous one
    for (int k = 0; k <= steps; ++k) {
      const double in = 2 * k * cfg.step_width;
      boxes.add(0, 0, tile.size[0] - in, tile.size[1] - in, k == 0 ? -kThickness : (k - 1) * step,
                k * step);
    }
    return steps * step;
  }
  for (int k = 0; k < steps; ++k) {  // each step is a ring of four boxes
    const double wx = tile.size[0] - 2 * k * cfg.step_width,
                 wy = tile.size[1] - 2 * k * cfg.step_width;
    const double bottom = -steps * step - kThickness, top = -k * step, w = cfg.step_width;
    boxes.add(-(wx - w) / 2, 0, w, wy, bottom, top);
    boxes.add((wx - w) / 2, 0, w, wy, bottom, top);
    boxes.add(0, -(wy - w) / 2, wx - 2 * w, w, bottom, top);
    boxes.add(0, (wy - w) / 2, wx - 2 * w, w, bottom, top);
  }
  const double in = 2 * steps * cfg.step_width;
  boxes.add(0, 0, tile.size[0] - in, tile.size[1] - in, -steps * step - kThickness, -steps * step);
  return -steps * step;
}

double stepping_stones(const SubTerrainCfg& cfg, Tile& tile) {
  const double stone = at(cfg.stone_width, tile.difficulty), gap = at(cfg.gap, tile.difficulty);
  const double uneven = at(cfg.stone_height, tile.difficulty), bottom = -cfg.pit_depth;
  // Along each axis, n stones of at least the configured width divide the tile; the platform
  // replaces m of them. All gaps are therefore equal, including those around the platform; gaps at
  // the edges of the tile are half as wide.
  struct Row {
    int n, m;
    double pitch;
    double at(int i) const { return (i - (n - 1) / 2.0) * pitch; }
    bool in_platform(int i) const { return std::abs(2 * i - (n - 1)) < m; }
  };
  const auto share = [&](double size) {
    const int n = std::max(1, static_cast<int>(size / (stone + gap)));
    const double pitch = size / n;
    const int m = static_cast<int>(std::ceil((cfg.platform_width + gap) / pitch));
    return Row{n, std::min(n, m + ((n - m) & 1)), pitch};
  };
  const Row x = share(tile.size[0]), y = share(tile.size[1]);
  Boxes boxes(tile);
  boxes.add(0, 0, tile.size[0], tile.size[1], bottom - kThickness, bottom);
  boxes.add(0, 0, x.m * x.pitch - gap, y.m * y.pitch - gap, bottom, 0);
  for (int j = 0; j < y.n; ++j) {
    for (int i = 0; i < x.n; ++i) {
      const double top = tile.rng.uniform(-uneven, uneven);
      if (x.in_platform(i) && y.in_platform(j)) continue;
      boxes.add(x.at(i), y.at(j), x.pitch - gap, y.pitch - gap, bottom, top);
    }
  }
  return 0;
}

}  // namespace

void add_box(mjsBody* body, const std::string& name, std::array<double, 2> centre,
             std::array<double, 2> size, double bottom, double top,
             const std::array<float, 4>& rgba) {
  mjsGeom* geom = mjs_addGeom(body, nullptr);
  mjs_setName(geom->element, name.c_str());
  geom->type = mjGEOM_BOX;
  const double pos[] = {centre[0], centre[1], (bottom + top) / 2};
  const double half[] = {size[0] / 2, size[1] / 2, (top - bottom) / 2};
  std::copy(pos, pos + 3, geom->pos);
  std::copy(half, half + 3, geom->size);
  std::copy(rgba.begin(), rgba.end(), geom->rgba);
}

double build_tile(const SubTerrainCfg& cfg, Tile& tile) {
  using Build = double (*)(const SubTerrainCfg&, Tile&);
  constexpr Build kBuild[] = {flat, rough, waves, slope, stairs, stepping_stones};
  static_assert(std::size(kBuild) == kEnumNames<SubTerrain>.size());
  return kBuild[static_cast<std::size_t>(static_cast<SubTerrain>(cfg.kind))](cfg, tile);
}

}  // namespace mjsense::scene
