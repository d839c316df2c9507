// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/hinged_door.h"

#include <fmt/format.h>

#include <numbers>

#include "mjsense_tasks/scenes/generators/walls.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr double kGap = 0.004, kThick = 0.04;  // m, gap around the leaf and thickness of the leaf
constexpr double kJamb = 0.03;                 // m, width of the frame next to the leaf
constexpr double kReach = 0.014;               // m, by which the bolt protrudes from the leaf
constexpr double kBolt = 0.006;                // m, half of its thickness

// Jambs, head and casings on both faces of the wall.
void frame(RoomWriter& out, const HingedDoor& door) {
  const double half = 0.5 * door.width + kGap, deep = 0.5 * kWallThickness;
  const double top = door.height + 2 * kGap;
  for (const double side : {-1.0, 1.0}) {
    out.box({0, side * (half + 0.5 * kJamb), 0.5 * top}, {deep + 0.004, 0.5 * kJamb, 0.5 * top},
            "skirting");
    for (const double face : {-1.0, 1.0})
      out.box({face * (deep + 0.008), side * (half + 0.045), 0.5 * (top + 0.075)},
              {0.009, 0.036, 0.5 * (top + 0.075)}, "skirting", kVisual);
  }
  out.box({0, 0, top + 0.5 * kJamb}, {deep + 0.004, half + kJamb, 0.5 * kJamb}, "skirting");
  for (const double face : {-1.0, 1.0})
    out.box({face * (deep + 0.008), 0, top + 0.045}, {0.009, half + 0.081, 0.036}, "skirting",
            kVisual);
  // The rebate that stops the leaf, on the side from which it is pushed.
  for (const double side : {-1.0, 1.0})
    out.box({-0.5 * kThick - 0.015, side * (half - 0.006), 0.5 * top}, {0.012, 0.006, 0.5 * top},
            "skirting", kVisual);
}

// The leaf with panels on both faces. The body frame is at the hinge, x points to the latch; s =
// +-1 is the direction of opening along y.
void leaf(RoomWriter& out, const HingedDoor& door, double s) {
  const double middle = 0.5 * door.width, y = -s * 0.5 * kThick;
  const double half = middle - kGap, tall = 0.5 * (door.height - 0.008);
  out.add(fmt::format(
      "<geom name=\"door_leaf\" type=\"box\" pos=\"{:.4f} {:.4f} {:.4f}\" size=\"{:.4f} {:.4f} "
      "{:.4f}\" "
      "class=\"furniture\" material=\"door_paint\" mass=\"{:.2f}\" friction=\"0.4 0.005 0.0001\"/>",
      middle, y, tall + 0.008, half, 0.5 * kThick, tall, 24 * door.width * door.height / 1.8));
  // Mouldings around two panels.
  for (const auto& [low, high] : {std::pair{0.20, 0.84}, std::pair{1.14, door.height - 0.16}}) {
    const double z = 0.5 * (low + high), h = 0.5 * (high - low), w = half - 0.12;
    for (const double face : {-1.0, 1.0}) {
      const double at = y + face * (0.5 * kThick + 0.002);
      for (const double edge : {-1.0, 1.0}) {
        out.box({middle + edge * w, at, z}, {0.009, 0.005, h}, "door_paint",
                {.solid = false, .attributes = "mass=\"0\""});
        out.box({middle, at, z + edge * h}, {w + 0.009, 0.005, 0.009}, "door_paint",
                {.solid = false, .attributes = "mass=\"0\""});
      }
    }
  }
  for (const double z : {0.22, 0.5 * door.height, door.height - 0.22})
    out.upright_cylinder({0, s * 0.004, z}, 0.008, 0.05, "door_metal",
                         {.solid = false, .attributes = "mass=\"0\""});
}

void lever(RoomWriter& out, const HingedDoor& door, double s) {
  const double u = door.width - 0.065, y = -s * 0.5 * kThick, z = door.handle_height;
  for (const double face : {-1.0, 1.0}) {
    const double at = y + face * (0.5 * kThick + 0.004);
    out.box({u, at, z - 0.045}, {0.021, 0.004, 0.085}, "door_metal",
            {.solid = false, .attributes = "mass=\"0\""});
    out.cylinder({u, at, z - 0.10}, {u, at + face * 0.006, z - 0.10}, 0.007, "black",
                 {.solid = false, .attributes = "mass=\"0\""});
  }
  // A positive angle presses the lever down; a spring returns it.
  out.add(fmt::format("<body name=\"door_handle\" pos=\"{:.4f} {:.4f} {:.4f}\">", u, y, z));
  out.add(
      "<joint name=\"door_handle_hinge\" type=\"hinge\" axis=\"0 -1 0\" range=\"0 0.85\" "
      "stiffness=\"1.6\" "
      "springref=\"-0.25\" damping=\"0.08\" armature=\"0.003\" frictionloss=\"0.05\"/>");
  const std::string metal = "mass=\"0.12\" friction=\"1.0 0.01 0.001\" condim=\"4\"";
  for (const double face : {-1.0, 1.0}) {
    const double far = face * (0.5 * kThick + 0.052);
    out.capsule({0, face * 0.5 * kThick, 0}, {0, far, 0}, 0.010, "door_metal",
                {.attributes = metal});
    out.capsule({0, far, 0}, {-door.handle_length, far, 0}, 0.010, "door_metal",
                {.attributes = metal});
  }
  out.add("</body>");
}

void bolt(RoomWriter& out, const HingedDoor& door, double s) {
  const double u = door.width - kGap, y = -s * 0.5 * kThick, z = door.handle_height;
  out.add(fmt::format("<body name=\"door_bolt\" pos=\"{:.4f} {:.4f} {:.4f}\">", u, y, z));
  out.add(
      fmt::format("<joint name=\"door_bolt_slide\" type=\"slide\" axis=\"-1 0 0\" range=\"-0.001 "
                  "0.03\" damping=\"2\" "
                  "armature=\"0.05\"/>"));
  out.add(fmt::format(
      "<geom name=\"door_bolt\" type=\"box\" pos=\"{0:.4f} 0 0\" size=\"{0:.4f} {1:.4f} 0.011\" "
      "material=\"door_metal\" mass=\"0.05\" contype=\"8\" conaffinity=\"8\" friction=\"0.05 0.005 "
      "0.0001\" "
      "condim=\"3\" solref=\"0.004 1\" solimp=\"0.98 0.999 0.0005\"/>",
      0.5 * kReach, kBolt));
  out.add("</body>");
}

}  // namespace

HingedDoor draw_door(Rng& rng) {
  HingedDoor door;
  door.hinge_left = rng.below(2) == 0;
  door.width = rng.uniform(0.86, 0.98);
  door.height = rng.uniform(1.98, 2.08);
  door.handle_height = rng.uniform(0.95, 1.08);
  door.handle_length = rng.uniform(0.115, 0.135);
  door.opens = rng.uniform(1.45, 1.66);
  door.friction = rng.uniform(0.3, 1.2);
  door.damping = rng.uniform(1.0, 3.0);
  return door;
}

double opening_width(const HingedDoor& door) { return door.width + 2 * (kGap + kJamb); }
double opening_height(const HingedDoor& door) { return door.height + 2 * kGap + kJamb; }

void write_door(RoomWriter& out, const HingedDoor& door) {
  const double side = door.hinge_left ? 1 : -1;  // side of the hinge along y
  const double s = side;                         // the leaf's y axis points to +x or to -x
  {
    RoomWriter::Local body(out, "door_frame", {0, 0, 0}, 0);
    frame(out, door);
    // The strike blocks the bolt's motion; the latch edge is opposite to the hinge.
    const double from = 0.5 * door.width + 0.001;
    out.add(fmt::format(
        "<geom name=\"door_strike\" type=\"box\" pos=\"{:.4f} {:.4f} {:.4f}\" size=\"0.008 {:.4f} "
        "0.03\" "
        "material=\"door_metal\" contype=\"8\" conaffinity=\"8\" friction=\"0.05 0.005 0.0001\" "
        "solref=\"0.004 1\" solimp=\"0.98 0.999 0.0005\"/>",
        kBolt + 0.0085, -side * (from + 0.5 * kReach), door.handle_height, 0.5 * kReach));
  }
  // The hinge axis is on the face towards which the leaf opens.
  out.add(fmt::format("<body name=\"door\" pos=\"{:.4f} {:.4f} 0\" quat=\"0.70710678 0 0 {:.8f}\">",
                      0.5 * kThick, side * 0.5 * door.width, -side * 0.70710678));
  const double low = s > 0 ? 0 : -door.opens, high = s > 0 ? door.opens : 0;
  out.add(
      fmt::format("<joint name=\"door_hinge\" type=\"hinge\" axis=\"0 0 1\" range=\"{:.4f} "
                  "{:.4f}\" damping=\"{:.2f}\" "
                  "frictionloss=\"{:.2f}\" armature=\"0.1\"/>",
                  low, high, door.damping, door.friction));
  leaf(out, door, s);
  lever(out, door, s);
  bolt(out, door, s);
  out.add("</body>");

  out.tail(
      fmt::format("<equality><joint joint1=\"door_bolt_slide\" joint2=\"door_handle_hinge\" "
                  "polycoef=\"0 {:.5f} 0 0 0\" solref=\"0.01 1\"/></equality>",
                  kReach / door.press));
}

}  // namespace mjsense::tasks::scenes
