// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/colour_words.h"

#include <algorithm>
#include <cmath>

#include "mjsense/observe/frame.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr unsigned kAll = (1u << kColourWords.size()) - 1;
constexpr double kMost = 0.7, kSome = 0.1;  // shares of the visible area
constexpr int kHidden = 3;                  // geoms of this group and above are not drawn

// Ranges of hue (degrees), saturation and value in which a word is certain; it is possible in
// ranges that are wider on all sides.
struct Range {
  double hue[2], saturation[2], value[2];
};
constexpr double kHue = 14, kSaturation = 0.15, kValue = 0.15;
constexpr Range kRanges[kColourWords.size()]{
    {{346, 370}, {0.60, 1.01}, {0.45, 1.01}},  // red
    {{19, 37}, {0.65, 1.01}, {0.75, 1.01}},    // orange
    {{44, 57}, {0.55, 1.01}, {0.65, 1.01}},    // yellow
    {{85, 155}, {0.30, 1.01}, {0.25, 1.01}},   // green
    {{170, 190}, {0.45, 1.01}, {0.30, 0.90}},  // teal
    {{207, 245}, {0.45, 1.01}, {0.30, 1.01}},  // blue
    {{265, 295}, {0.30, 1.01}, {0.30, 1.01}},  // purple
    {{318, 342}, {0.30, 0.80}, {0.70, 1.01}},  // pink
    {{15, 38}, {0.35, 0.85}, {0.25, 0.60}},    // brown
    {{0, 360}, {-0.01, 0.06}, {0.88, 1.01}},   // white
    {{0, 360}, {-0.01, 1.01}, {-0.01, 0.14}},  // black
    {{0, 360}, {-0.01, 0.08}, {0.30, 0.65}},   // grey
};

bool within(const double range[2], double x, double by) {
  return x >= range[0] - by && x <= range[1] + by;
}

bool fits(const Range& r, double hue, double saturation, double value, double wider) {
  return (within(r.hue, hue, wider * kHue) || within(r.hue, hue + 360, wider * kHue) ||
          within(r.hue, hue - 360, wider * kHue)) &&
         within(r.saturation, saturation, wider * kSaturation) &&
         within(r.value, value, wider * kValue);
}

// Area that a geom shows, m^2, up to a factor.
double area(const mjModel* m, int g) {
  const double* s = m->geom_size + 3 * g;
  const double* b = m->geom_aabb + 6 * g + 3;
  switch (m->geom_type[g]) {
    case mjGEOM_SPHERE:
      return 12.6 * s[0] * s[0];
    case mjGEOM_CAPSULE:
    case mjGEOM_CYLINDER:
      return 12.6 * s[0] * (s[0] + s[1]);
    default:
      return 8 * (b[0] * b[1] + b[1] * b[2] + b[0] * b[2]);
  }
}

}  // namespace

ColourWords colour_words(const float* rgb) {
  const double r = rgb[0], g = rgb[1], b = rgb[2];
  const double value = std::max({r, g, b}), chroma = value - std::min({r, g, b});
  const double saturation = value > 0 ? chroma / value : 0;
  double hue = 0;
  if (chroma > 0)
    hue = 60 * (value == r   ? std::fmod((g - b) / chroma + 6, 6)
                : value == g ? (b - r) / chroma + 2
                             : (r - g) / chroma + 4);
  ColourWords words;
  for (int i = 0; i < static_cast<int>(kColourWords.size()); ++i) {
    if (fits(kRanges[i], hue, saturation, value, 0)) words.is = i;
    if (fits(kRanges[i], hue, saturation, value, 1)) words.may_be |= 1u << i;
  }
  return words;
}

ColourWords colour_words(const mjModel* m, int body) {
  std::array<double, kColourWords.size()> is{}, may_be{};
  double all = 0;
  for (int g = 0; g < m->ngeom; ++g) {
    if (m->geom_group[g] >= kHidden || !observe::is_descendant_or_self(m, m->geom_bodyid[g], body))
      continue;
    const int material = m->geom_matid[g];
    const float* rgba = material >= 0 ? m->mat_rgba + 4 * material : m->geom_rgba + 4 * g;
    if (rgba[3] == 0) continue;
    bool textured = false;
    for (int role = 0; material >= 0 && role < mjNTEXROLE; ++role)
      textured = textured || m->mat_texid[mjNTEXROLE * material + role] >= 0;
    const ColourWords words =
        textured || rgba[3] < 0.9 ? ColourWords{-1, kAll} : colour_words(rgba);
    const double seen = area(m, g);
    all += seen;
    if (words.is >= 0) is[words.is] += seen;
    for (std::size_t i = 0; i < kColourWords.size(); ++i) {
      if (words.may_be >> i & 1u) may_be[i] += seen;
    }
  }
  ColourWords words;
  for (std::size_t i = 0; i < kColourWords.size(); ++i) {
    if (all > 0 && is[i] >= kMost * all) words.is = static_cast<int>(i);
    if (may_be[i] >= kSome * all) words.may_be |= 1u << i;
  }
  return words;
}

}  // namespace mjsense::tasks::scenes
