// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/texture.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <string_view>
#include <utility>
#include <vector>

#include "mjsense/core/files/png.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr int kFast = 1;  // level of compression: 3 times as fast as the default, files 15 % larger

std::uint32_t hash(std::uint32_t x, std::uint32_t y, std::uint32_t seed) {
  std::uint32_t h = x * 0x9E3779B1u ^ (y * 0x85EBCA77u) ^ (seed * 0xC2B2AE3Du);
  h = (h ^ (h >> 15)) * 0x2C1B3C6Du;
  h = (h ^ (h >> 12)) * 0x297A2D39u;
  return h ^ (h >> 15);
}

// Random number in [0, 1) of a grid cell.
double cell(int x, int y, std::uint32_t seed) {
  return hash(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y), seed) * 0x1.0p-32;
}

// Smooth noise in [0, 1) with `nx` x `ny` cells; u and v in [0, 1). Periodic.
double noise(double u, double v, int nx, int ny, std::uint32_t seed) {
  const double x = u * nx, y = v * ny;
  const int x0 = static_cast<int>(std::floor(x)), y0 = static_cast<int>(std::floor(y));
  const auto ease = [](double t) { return t * t * (3 - 2 * t); };
  const double s = ease(x - x0), t = ease(y - y0);
  const auto wrap = [](int i, int n) { return (i % n + n) % n; };
  const int xa = wrap(x0, nx), ya = wrap(y0, ny);
  const int xb = xa + 1 == nx ? 0 : xa + 1, yb = ya + 1 == ny ? 0 : ya + 1;
  return std::lerp(std::lerp(cell(xa, ya, seed), cell(xb, ya, seed), s),
                   std::lerp(cell(xa, yb, seed), cell(xb, yb, seed), s), t);
}

// Sum of several noises with increasing frequency and decreasing weight; about [0, 1].
double cloud(double u, double v, int nx, int ny, int octaves, std::uint32_t seed) {
  double sum = 0, weight = 0.5, total = 0;
  for (int i = 0; i < octaves; ++i) {
    sum += weight * noise(u, v, nx << i, ny << i, seed + 17u * i);
    total += weight;
    weight *= 0.5;
  }
  return sum / total;
}

// Wood grain in [-1, 1], with lines along u.
double grain(double u, double v, std::uint32_t seed) {
  const double bend = 0.06 * (noise(u, v, 2, 6, seed) - 0.5);
  const double rings =
      std::sin(2 * std::numbers::pi * (14 * (v + bend) + 3 * noise(u, v, 1, 4, seed + 1)));
  const double fibre = noise(u, v, 6, 128, seed + 2) - 0.5;
  const double pores = noise(u, v, 16, 256, seed + 3) > 0.86 ? -0.5 : 0.0;
  return 0.35 * rings + 0.9 * fibre + pores;
}

// Pixels of a PNG file, from colours in [0, 1].
std::string png_of(const std::vector<Colour>& colours, int size) {
  std::vector<std::uint8_t> pixels;
  pixels.reserve(3 * colours.size());
  for (const Colour& c : colours)
    for (const double x : c)
      pixels.push_back(static_cast<std::uint8_t>(std::lround(255 * std::clamp(x, 0.0, 1.0))));
  const std::vector<std::uint8_t> png = encode_png(pixels, size, size, 3, kFast);
  return {png.begin(), png.end()};
}

// The normals of a surface whose dark parts are its joints and pores. relief: the height of what is as
// bright as the mean, in units of the picture's width.
std::string normals_of(const std::vector<Colour>& colours, int size, double relief) {
  const int half = size / 2;
  std::vector<double> heights(static_cast<std::size_t>(half) * half);
  double mean = 0;
  for (int y = 0; y < 2 * half; ++y)
    for (int x = 0; x < 2 * half; ++x) {
      const Colour& c = colours[static_cast<std::size_t>(y) * size + x];
      const double bright = c[0] + c[1] + c[2];
      heights[static_cast<std::size_t>(y / 2) * half + x / 2] += bright;
      mean += 4 * bright / (4.0 * half * half);
    }
  const auto height = [&](int x, int y) {
    return heights[static_cast<std::size_t>((y + half) % half) * half + (x + half) % half];
  };
  const double scale = relief / std::max(mean, 1e-6) * half / 2;  // of a difference over two pixels
  std::vector<Colour> normals;
  for (int y = 0; y < half; ++y)
    for (int x = 0; x < half; ++x) {
      // Green points to the top of the picture, where y is smaller.
      const double dx = scale * (height(x + 1, y) - height(x - 1, y)),
                   dy = scale * (height(x, y + 1) - height(x, y - 1));
      const double length = std::sqrt(dx * dx + dy * dy + 1);
      normals.push_back({0.5 - 0.5 * dx / length, 0.5 + 0.5 * dy / length, 0.5 + 0.5 / length});
    }
  return png_of(normals, half);
}

template <class F>
Picture draw_picture(int size, double relief, F colour_at) {
  std::vector<Colour> colours;
  for (int y = 0; y < size; ++y)
    for (int x = 0; x < size; ++x) colours.push_back(colour_at((x + 0.5) / size, (y + 0.5) / size));
  return {png_of(colours, size), relief > 0 ? normals_of(colours, size, relief) : std::string()};
}

// Keeps the files of the last houses, because a program often makes the same scene many times.
// `key` must determine the pixels.
template <class F>
Picture picture(std::string key, int size, double relief, F colour_at) {
  static std::mutex mutex;
  static std::map<std::string, Picture> kept;
  constexpr std::size_t kKept = 128;
  {
    const std::lock_guard lock(mutex);
    if (const auto found = kept.find(key); found != kept.end()) return found->second;
  }
  Picture made = draw_picture(size, relief, colour_at);
  const std::lock_guard lock(mutex);
  if (kept.size() >= kKept) kept.clear();
  return kept[std::move(key)] = std::move(made);
}

// The arguments of a function as a key.
template <class... Args>
std::string key_of(std::string_view function, const Args&... args) {
  std::string key(function);
  const auto add = [&](const auto& value) {
    key.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  (add(args), ...);
  return key;
}

}  // namespace

Colour mix(Colour a, Colour b, double t) {
  Colour out;
  for (int i = 0; i < 3; ++i) out[i] = std::lerp(a[i], b[i], t);
  return out;
}

Colour brighter(Colour c, double factor) {
  for (double& x : c) x = std::clamp(x * factor, 0.0, 1.0);
  return c;
}

Picture wood_picture(Colour colour, std::uint32_t seed, int size) {
  return picture(key_of("wood_picture", colour, seed, size), size, 0, [&](double u, double v) {
    return brighter(colour, 1 + 0.16 * grain(u, v, seed));
  });
}

Picture boards_picture(Colour colour, int boards, std::uint32_t seed, int size) {
  return picture(key_of("boards_picture", colour, boards, seed, size), size, 0.0015,
                 [&](double u, double v) {
                   const int row = std::min(boards - 1, static_cast<int>(v * boards));
                   const double side = std::min(v * boards - row, row + 1 - v * boards) / boards;
                   const double tone = 0.90 + 0.2 * cell(row, 1, seed);
                   const double joint = side * size < 0.6 ? 0.75 : 1.0;
                   const double line =
                       grain(u + cell(row, 2, seed), v * 2 / boards + cell(row, 3, seed), seed + 7);
                   return brighter(colour, tone * joint * (1 + 0.14 * line));
                 });
}

Picture planks_picture(Colour colour, int boards, std::uint32_t seed, int size) {
  return picture(
      key_of("planks_picture", colour, boards, seed, size), size, 0.002, [&](double u, double v) {
        const int row = std::min(boards - 1, static_cast<int>(v * boards));
        // Two boards per row, whose ends are shifted by a different amount in each row.
        double along = u + cell(row, 0, seed);
        along -= std::floor(along);
        const int half = along < 0.5 ? 0 : 1;
        const double end = std::min(std::abs(along - 0.5), std::min(along, 1 - along));
        const double side = std::min(v * boards - row, row + 1 - v * boards) / boards;
        const double tone = 0.86 + 0.26 * cell(row, 1 + half, seed);
        const double joint = std::min(end, side) * size < 0.9 ? 0.55 : 1.0;
        const double line = grain(u, v * 2 / boards + cell(row, 3 + half, seed), seed + 7);
        return brighter(colour, tone * joint * (1 + 0.13 * line));
      });
}

Picture tiles_picture(Colour colour, Colour joint, int count, bool bricks, std::uint32_t seed,
                      int size) {
  return picture(key_of("tiles_picture", colour, joint, count, bricks, seed, size), size, 0.004,
                 [&](double u, double v) {
                   const int rows = bricks ? 2 * count : count;
                   const int row = std::min(rows - 1, static_cast<int>(v * rows));
                   double x = u * count + (bricks && row % 2 == 1 ? 0.5 : 0.0);
                   const int column = static_cast<int>(x) % count;
                   x -= std::floor(x);
                   const double y = v * rows - row;
                   const double wide = 1.0 / count, high = 1.0 / rows;
                   const double edge =
                       std::min(std::min(x, 1 - x) * wide, std::min(y, 1 - y) * high);
                   const double width = 0.012 / std::sqrt(static_cast<double>(count));
                   const double rough = cloud(u, v, 24, 24, 3, seed) - 0.5;
                   if (edge < width) return brighter(joint, 1 + 0.15 * rough);
                   const double tone = 0.94 + 0.10 * cell(column, row, seed + 1) + 0.06 * rough;
                   return brighter(colour, edge < 1.8 * width ? 0.9 * tone : tone);
                 });
}

Picture stone_picture(Colour colour, std::uint32_t seed, int size) {
  return picture(key_of("stone_picture", colour, seed, size), size, 0, [&](double u, double v) {
    const double large = cloud(u, v, 4, 4, 4, seed) - 0.5, speck = noise(u, v, 96, 96, seed + 9);
    const double grain = speck > 0.83 ? 0.22 : speck < 0.14 ? -0.2 : 0.0;
    return brighter(colour, 1 + 0.3 * large + grain);
  });
}

Picture plaster_picture(Colour colour, std::uint32_t seed, int size) {
  return picture(key_of("plaster_picture", colour, seed, size), size, 0, [&](double u, double v) {
    return brighter(colour, 1 + 0.05 * (cloud(u, v, 8, 8, 5, seed) - 0.5) +
                                0.025 * (noise(u, v, 128, 128, seed + 3) - 0.5));
  });
}

Picture cloth_picture(Colour colour, std::uint32_t seed, int size) {
  return picture(key_of("cloth_picture", colour, seed, size), size, 0.012, [&](double u, double v) {
    const double weave =
        0.5 * (std::sin(2 * std::numbers::pi * 48 * u) + std::sin(2 * std::numbers::pi * 48 * v));
    return brighter(colour, 1 + 0.07 * weave + 0.12 * (cloud(u, v, 6, 6, 4, seed) - 0.5));
  });
}

Picture brushed_picture(Colour colour, std::uint32_t seed, int size) {
  return picture(key_of("brushed_picture", colour, seed, size), size, 0, [&](double u, double v) {
    return brighter(colour, 1 + 0.10 * (noise(u, v, 4, 128, seed) - 0.5) +
                                0.06 * (cloud(u, v, 3, 3, 3, seed + 5) - 0.5));
  });
}

Picture landscape_picture(std::uint32_t seed, int size) {
  const auto draw = [&](int i, double low, double high) {
    return std::lerp(low, high, cell(i, 0, seed));
  };
  const Colour sky = brighter({0.66, 0.78, 0.88}, draw(0, 0.9, 1.1));
  const Colour far = brighter({0.45, 0.56, 0.62}, draw(1, 0.8, 1.2));
  const Colour near = brighter({0.42, 0.50, 0.30}, draw(2, 0.7, 1.3));
  const Colour field = mix({0.80, 0.70, 0.42}, {0.58, 0.62, 0.38}, draw(3, 0, 1));
  const double ridges = draw(4, 0.42, 0.52), hills = draw(5, 0.60, 0.70);
  const double sun_u = draw(6, 0.2, 0.8), sun_v = draw(7, 0.15, 0.3);
  return picture(key_of("landscape_picture", seed, size), size, 0, [&](double u, double v) {
    const double stroke = 0.96 + 0.08 * noise(u, v, 64, 64, seed);
    const auto edge = [&](int n, std::uint32_t which) {
      return noise(u, 0, n, 1, seed + which) - 0.5;
    };
    if (v > 0.86 + 0.05 * edge(4, 1)) return brighter(field, stroke);
    if (v > hills + 0.14 * edge(3, 2)) return brighter(near, stroke * (1.1 - 0.4 * (v - hills)));
    if (v > ridges + 0.16 * edge(6, 3)) return brighter(far, stroke);
    if (std::hypot(u - sun_u, v - sun_v) < 0.06) return Colour{0.98, 0.93, 0.75};
    return brighter(sky, stroke * (0.90 + 0.35 * v + 0.10 * cloud(u, v, 3, 8, 3, seed + 4)));
  });
}

Picture outdoors_picture(const Outdoors& look, int size) {
  const auto key = key_of("outdoors_picture", look.sky, look.horizon, look.land, size);
  return picture(key, size, 0, [&](double u, double v) {
    const double hills = 0.66 + 0.10 * (noise(u, 0, 3, 1, 5) - 0.5);
    if (v > hills) return brighter(look.land, 0.8 + 0.4 * cloud(u, v, 8, 8, 2, 7));
    return mix(look.sky, look.horizon, v / hills);
  });
}

}  // namespace mjsense::tasks::scenes
