// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/generators/building_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace mjsense::scenes {
namespace {

constexpr double kSkirting = 0.08, kBoard = 0.007;  // m, height and half thickness

std::string manner(bool solid, std::string_view more) {
  return fmt::format("{}{}", solid ? "" : "contype=\"0\" conaffinity=\"0\" group=\"2\" ", more);
}

}  // namespace

void BuildingWriter::box(Vec3 center, Vec3 half, std::string_view material, bool solid,
                         std::string_view more) {
  text_.box("", material, center, half, manner(solid, more));
}

void BuildingWriter::cylinder(Vec3 center, double radius, double half_height,
                              std::string_view material, bool solid, std::string_view more) {
  const Vec3 up{0, 0, half_height};
  text_.cylinder("", material, center - up, center + up, radius, manner(solid, more));
}

void BuildingWriter::ellipsoid(Vec3 p, Vec3 h, std::string_view material, Quat q) {
  text_.add(fmt::format(
      "<geom class=\"shown\" type=\"ellipsoid\" pos=\"{:.5g} {:.5g} {:.5g}\" size=\"{:.5g} {:.5g} "
      "{:.5g}\" quat=\"{:.6g} {:.6g} {:.6g} {:.6g}\" material=\"{}\"/>",
      p.x, p.y, p.z, h.x, h.y, h.z, q.w, q.x, q.y, q.z, material));
}

void BuildingWriter::capsule(Vec3 from, Vec3 to, double radius, std::string_view material,
                             bool solid, std::string_view more) {
  text_.capsule("", material, from, to, radius, manner(solid, more));
}

void BuildingWriter::lamp(std::string_view name, Vec3 at, double brightness, double reach) {
  text_.add(
      fmt::format("<light name=\"{}\" type=\"spot\" bulbradius=\"0.12\" cutoff=\"88\" "
                  "exponent=\"1\" pos=\"{:.4g} {:.4g} {:.4g}\" "
                  "dir=\"0 0 -1\" diffuse=\"{:.4g} {:.4g} {:.4g}\" specular=\"0.15 0.15 0.15\" "
                  "attenuation=\"1 0 {:.4g}\" castshadow=\"true\"/>",
                  name, at.x, at.y, at.z, brightness, 0.97 * brightness, 0.91 * brightness,
                  1 / (reach * reach)));
}

BuildingWriter::Local::Local(BuildingWriter& building, std::string_view name, Vec3 at, double yaw)
    : building_(building), before_(building.frame_) {
  building.text_.open_body(name, at, yaw);
  building.frame_ = before_ * Pose{at, axis_angle({0, 0, 1}, yaw)};
}

BuildingWriter::Local::~Local() {
  building_.text_.close_body();
  building_.frame_ = before_;
}

void write_wall(BuildingWriter& out, Vec3 from, Vec3 to, std::vector<Opening> openings,
                const WallFinish& look) {
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  const double half = 0.5 * look.thickness;
  BuildingWriter::Local local(out, "", from, std::atan2(to.y - from.y, to.x - from.x));
  std::ranges::sort(openings, {}, &Opening::from);
  // Two slabs, back to back, because a slab has its texture on one side only.
  const auto piece = [&](double a, double b, double low, double high) {
    if (b - a < 1e-6 || high - low < 1e-6) return;
    const double x = 0.5 * (a + b), z = 0.5 * (low + high);
    out.text().slab("", look.material, Facing::kMinusY, {x, -half, z}, b - a, high - low, half);
    out.text().slab("", look.material, Facing::kPlusY, {x, half, z}, b - a, high - low, half);
    if (low > 0) return;
    for (const double side : {-1.0, 1.0})
      out.box({x, side * (half + kBoard), 0.5 * kSkirting},
              {0.5 * (b - a), kBoard, 0.5 * kSkirting}, look.skirting, false);
  };
  double at = 0;
  for (const Opening& o : openings) {
    piece(at, o.from, 0, look.height);
    piece(o.from, o.to, 0, o.bottom);
    piece(o.from, o.to, o.top, look.height);
    const double z = 0.5 * (o.bottom + o.top), tall = 0.5 * (o.top - o.bottom);
    for (const double edge : {o.from, o.to})
      out.box({edge, 0, z}, {0.006, half + 0.002, tall}, look.skirting, false);
    out.box({0.5 * (o.from + o.to), 0, o.top}, {0.5 * (o.to - o.from), half + 0.002, 0.006},
            look.skirting, false);
    at = o.to;
  }
  piece(at, length, 0, look.height);
}

void write_window(BuildingWriter& out, Vec3 at, double yaw, double width, double bottom, double top,
                  double thickness) {
  BuildingWriter::Local local(out, "", at, yaw);
  const double half = 0.5 * width, middle = 0.5 * (bottom + top), tall = 0.5 * (top - bottom);
  const double deep = 0.5 * thickness + 0.012;
  out.box({0, 0, middle}, {half, 0.004, tall}, "window_pane");
  for (const double side : {-1.0, 1.0}) {
    out.box({side * (half - 0.025), 0, middle}, {0.025, deep, tall}, "skirting", false);
    out.box({0, 0, side > 0 ? top - 0.025 : bottom + 0.025}, {half, deep, 0.025}, "skirting",
            false);
  }
  out.box({0, 0, middle}, {0.02, 0.02, tall}, "skirting", false);
  out.box({0, 0, bottom + 1.24 * tall}, {half, 0.02, 0.018}, "skirting", false);
  out.box({0, 0, bottom - 0.012}, {half + 0.05, deep + 0.06, 0.014}, "skirting", false);
}

}  // namespace mjsense::scenes
