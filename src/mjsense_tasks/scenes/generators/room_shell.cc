// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/room_shell.h"

#include <fmt/format.h>

namespace mjsense::tasks::scenes {
namespace {

constexpr double kWall = 0.1;  // m thick
constexpr double kSkirtingHigh = 0.09, kSkirtingThick = 0.012;

// The wall at y1 with a window: four pieces around the opening, frame, sill and a bright pane.
void window_wall(RoomWriter& room, const ShellCfg& s) {
  const double left = s.window_x - s.window_wide / 2, right = s.window_x + s.window_wide / 2;
  const double top = s.sill + s.window_high, y = s.y1;
  const auto piece = [&](const char* name, double x0, double x1, double z0, double z1) {
    room.slab(Facing::kMinusY, {(x0 + x1) / 2, y, (z0 + z1) / 2}, x1 - x0, z1 - z0, kWall, "wall",
              {.name = name});
  };
  piece("wall_y1", s.x0, left, 0, s.height);
  piece("wall_y1_right", right, s.x1, 0, s.height);
  piece("wall_y1_below", left, right, 0, s.sill);
  piece("wall_y1_above", left, right, top, s.height);
  const double bar = 0.025, depth = 0.03, at = y + 0.05;
  const Vec3 middle{s.window_x, at, s.sill + s.window_high / 2};
  for (int side = -1; side <= 1; ++side) {
    room.box(middle + Vec3{side * (s.window_wide / 2 - bar), 0, 0}, {bar, depth, s.window_high / 2},
             "skirting");
    if (side == 0) continue;
    room.box(middle + Vec3{0, 0, side * (s.window_high / 2 - bar)}, {s.window_wide / 2, depth, bar},
             "skirting");
  }
  room.box(middle + Vec3{0, 0.02, 0}, {s.window_wide / 2, 0.004, s.window_high / 2}, "window_pane",
           kNoContacts);
  room.box({s.window_x, y - 0.06, s.sill - 0.015}, {s.window_wide / 2 + 0.05, 0.08, 0.015},
           "skirting", {.name = "window_sill"});
}

}  // namespace

void write_shell(RoomWriter& room, const ShellCfg& s) {
  const double x = (s.x0 + s.x1) / 2, y = (s.y0 + s.y1) / 2, wide = s.x1 - s.x0, deep = s.y1 - s.y0;
  room.add(
      fmt::format("<geom name=\"floor\" type=\"plane\" pos=\"{} {} 0\" size=\"{} {} 0.1\" "
                  "material=\"floor\" contype=\"0\" conaffinity=\"3\"/>",
                  x, y, wide / 2 + kWall, deep / 2 + kWall));
  room.slab(Facing::kDown, {x, y, s.height}, wide, deep, kWall, "ceiling", {.name = "ceiling"});
  const double mid = s.height / 2;
  room.slab(Facing::kPlusX, {s.x0, y, mid}, deep, s.height, kWall, "wall", {.name = "wall_x0"});
  room.slab(Facing::kMinusX, {s.x1, y, mid}, deep, s.height, kWall, "wall", {.name = "wall_x1"});
  room.slab(Facing::kPlusY, {x, s.y0, mid}, wide, s.height, kWall, "wall", {.name = "wall_y0"});
  window_wall(room, s);
  const double t = kSkirtingThick / 2, h = kSkirtingHigh / 2;
  room.box({s.x0 + t, y, h}, {t, deep / 2, h}, "skirting", kNoContacts);
  room.box({s.x1 - t, y, h}, {t, deep / 2, h}, "skirting", kNoContacts);
  room.box({x, s.y0 + t, h}, {wide / 2, t, h}, "skirting", kNoContacts);
  room.box({x, s.y1 - t, h}, {wide / 2, t, h}, "skirting", kNoContacts);

  room.box({x, y, s.height - 0.02}, {0.22, 0.22, 0.02}, "lamp_glass", kNoContacts);
  room.add(
      fmt::format("<light name=\"lamp\" type=\"point\" bulbradius=\"0.12\" pos=\"{} {} {}\" "
                  "intensity=\"2800\" diffuse=\"0.52 0.50 "
                  "0.47\" specular=\"0.25 0.25 0.25\" attenuation=\"1 0 0\" castshadow=\"true\"/>",
                  x, y, s.height - 0.16));
  room.add(
      fmt::format("<light name=\"daylight\" type=\"point\" bulbradius=\"0.35\" pos=\"{} {} {}\" "
                  "diffuse=\"0.30 0.32 "
                  "0.35\" specular=\"0.1 0.1 0.1\" attenuation=\"1 0 0\" castshadow=\"true\"/>",
                  s.window_x, s.y1 - 0.5, s.sill + 0.8 * s.window_high));
  write_bounce_light(room);
}

void write_bounce_light(RoomWriter& room) {
  room.add(
      "<light name=\"bounce\" type=\"directional\" dir=\"0 0 -1\" ambient=\"0.20 0.20 0.20\" "
      "diffuse=\"0 0 0\" specular=\"0 0 0\" castshadow=\"false\"/>");
  // A white ceiling above a darker floor.
  room.asset(
      "<texture name=\"surroundings\" type=\"cube\" builtin=\"gradient\" rgb1=\"0.95 0.94 0.92\" "
      "rgb2=\"0.60 0.55 0.50\" width=\"32\" height=\"32\"/>\n");
  room.add(
      "<light name=\"surroundings\" type=\"image\" texture=\"surroundings\" intensity=\"480\" "
      "diffuse=\"1 1 1\" ambient=\"0 0 0\" specular=\"0 0 0\"/>");
}

}  // namespace mjsense::tasks::scenes
