// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/kitchen.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "mjsense_tasks/scenes/generators/kitchen_units.h"
#include "mjsense_tasks/scenes/generators/room_shell.h"
#include "mjsense_tasks/scenes/generators/surface_finishes.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr Colour kStones[] = {{0.26, 0.26, 0.27}, {0.62, 0.60, 0.57}, {0.78, 0.76, 0.72}};
constexpr Colour kSplash[] = {
    {0.90, 0.90, 0.88}, {0.70, 0.78, 0.78}, {0.80, 0.72, 0.62}, {0.52, 0.60, 0.56}};

enum class Unit { kDrawers, kWideDrawers, kDoor, kSink, kOven };

struct Placed {
  Unit unit;
  double y0, wide;
};

void materials(RoomWriter& room, Rng& rng) {
  write_shell_finishes(room, rng);
  const Gloss satin{.specular = 0.2, .shininess = 0.4, .roughness = 0.45};
  const bool of_wood = rng.below(2) == 0;
  const auto front = rng.next();
  room.wrapped(
      "front",
      of_wood ? wood_picture(wood_colour(rng), front) : plaster_picture(paint_colour(rng), front),
      satin);
  room.plain("carcass", {0.86, 0.86, 0.84}, {.specular = 0.1, .shininess = 0.3});
  room.wrapped("inside", wood_picture({0.80, 0.70, 0.56}, rng.next()));
  room.plain("plinth", {0.18, 0.18, 0.19});
  const bool of_stone = rng.below(3) > 0;
  const auto worktop = rng.next();
  if (of_stone) {
    room.tiled("worktop", stone_picture(pick(rng, kStones), worktop), 0.6,
               {.specular = 0.4, .shininess = 0.6, .reflectance = 0.04, .roughness = 0.25});
  } else {
    room.tiled("worktop", planks_picture(wood_colour(rng), 10, worktop), 0.8, satin);
  }
  const Colour splash = pick(rng, kSplash), joint = mix(splash, {0.75, 0.74, 0.72}, 0.7);
  const auto tiles = rng.next();
  room.tiled("splash", tiles_picture(splash, joint, 4, rng.below(2) == 0, tiles), 0.6,
             {.specular = 0.4, .shininess = 0.6, .roughness = 0.2});
  room.wrapped("steel", brushed_picture({0.66, 0.67, 0.68}, rng.next()),
               {.specular = 0.6, .shininess = 0.6, .metallic = 1, .roughness = 0.35});
  const Colour metals[] = {{0.70, 0.71, 0.72}, {0.16, 0.16, 0.17}, {0.66, 0.54, 0.34}};
  room.plain("handle", pick(rng, metals),
             {.specular = 0.7, .shininess = 0.7, .metallic = 1, .roughness = 0.35});
  room.plain("glass", {0.06, 0.06, 0.07},
             {.specular = 0.7, .shininess = 0.8, .reflectance = 0.06, .roughness = 0.05});
  room.plain("ring", {0.35, 0.35, 0.36});
  room.glowing("display", {0.25, 0.75, 0.70}, 0.7);
  room.plain("oven_inside", {0.20, 0.20, 0.21});
  const bool white = rng.below(2) == 0;
  room.wrapped(
      "fridge",
      brushed_picture(white ? Colour{0.88, 0.88, 0.87} : Colour{0.68, 0.69, 0.70}, rng.next()),
      {.specular = 0.4, .shininess = 0.5, .metallic = white ? 0.0 : 1.0, .roughness = 0.4});
  room.plain("fridge_inside", {0.93, 0.94, 0.95});
  room.plain("appliance", rng.below(2) == 0 ? Colour{0.80, 0.80, 0.79} : Colour{0.22, 0.22, 0.23},
             {.specular = 0.4, .shininess = 0.5});
  room.plain("jar", mix({0.80, 0.62, 0.45}, {0.55, 0.65, 0.70}, rng.uniform()), satin);
  room.wrapped("board", wood_picture({0.62, 0.46, 0.30}, rng.next()));
  room.plain("leaf", {0.24, 0.44, 0.22});
}

// Static items at the back of a worktop.
void clutter(RoomWriter& room, Rng& rng, double z, double y0, double wide) {
  const double x = 0.52;
  const double jar = y0 + 0.08 + rng.uniform(0, 0.05);
  room.open_body("jar", {x, jar, z});
  room.cylinder({0, 0, 0}, {0, 0, 0.15}, 0.05, "jar");
  for (int i = 0; i < 4; ++i) {
    const double a = 1.6 * i + rng.uniform(0, 1);
    room.capsule({0, 0, 0.1}, {0.035 * std::cos(a), 0.05 * std::sin(a), rng.uniform(0.26, 0.32)},
                 0.006, "board");
  }
  room.close_body();
  room.open_body("chopping_board", {0.562, y0 + wide - 0.17, z});  // leans against the wall
  room.add(
      "<geom class=\"furniture\" type=\"box\" pos=\"0 0 0.15\" euler=\"0 0.14 0\" "
      "size=\"0.009 0.10 0.15\" material=\"board\"/>");
  room.close_body();
}

scene::ModelSource make_kitchen(GeneratorInput& input, SceneFileCfg& cfg) {
  Rng& rng = input.rng;
  RoomWriter room("kitchen");
  materials(room, rng);
  KitchenStyle style;
  style.high = rng.uniform(0.86, 0.92);
  style.bar_radius = rng.uniform(0.0065, 0.009);
  style.bar_length = rng.uniform(0.15, 0.2);
  style.round_bar = rng.below(2) == 0;
  style.wall_low = style.high + rng.uniform(0.50, 0.55);
  style.wall_high = style.wall_low + rng.uniform(0.60, 0.68);

  // The fridge is at one end, the other units follow in any order; the sink and the oven are not
  // adjacent.
  std::vector<Unit> order{Unit::kDrawers, Unit::kDoor, Unit::kWideDrawers, Unit::kSink};
  for (std::size_t i = order.size() - 1; i > 0; --i)
    std::swap(order[i], order[rng.below(static_cast<std::uint32_t>(i + 1))]);
  const auto sink = std::ranges::find(order, Unit::kSink) - order.begin();
  order.insert(order.begin() + (sink < 2 ? 3 : 1), Unit::kOven);
  const double fridge = rng.uniform(0.60, 0.68), fridge_high = rng.uniform(1.75, 1.9);
  const bool fridge_first = rng.below(2) == 0;
  std::vector<Placed> units;
  double length = 0;
  for (Unit unit : order) {
    const double wide = unit == Unit::kDrawers       ? rng.uniform(0.40, 0.50)
                        : unit == Unit::kWideDrawers ? rng.uniform(0.60, 0.75)
                        : unit == Unit::kDoor        ? rng.uniform(0.50, 0.58)
                        : unit == Unit::kSink        ? rng.uniform(0.76, 0.84)
                                                     : 0.60;
    units.push_back({unit, length, wide});
    length += wide;
  }
  const double gap = 0.03, whole = length + fridge + gap, start = -whole / 2;
  const double first = start + (fridge_first ? fridge + gap : 0.0);
  for (Placed& unit : units) unit.y0 += first;
  const double last = first + length;

  const double wall = style.deep + 0.02;
  ShellCfg shell{.x0 = -rng.uniform(2.2, 2.8),
                 .x1 = wall,
                 .y0 = start - rng.uniform(0.02, 0.5),
                 .y1 = start + whole + rng.uniform(0.4, 0.9),
                 .height = rng.uniform(2.45, 2.7)};
  shell.window_x = 0.5 * (shell.x0 - 0.3);
  write_shell(room, shell);
  room.slab(Facing::kMinusX, {wall - 0.008, (first + last) / 2, (style.high + style.wall_low) / 2},
            length, style.wall_low - style.high + 0.02, 0.008, "splash", {.name = "backsplash"});

  int number = 0;
  const double fridge_y0 = fridge_first ? start : last + gap;
  write_fridge(room, style, fridge_y0, fridge, fridge_high, fridge_first == (rng.below(4) > 0));
  for (const Placed& u : units) {
    if (u.unit == Unit::kDrawers)
      write_drawer_unit(room, style, rng, u.y0, u.wide, 3 + static_cast<int>(rng.below(2)));
    if (u.unit == Unit::kWideDrawers)
      write_drawer_unit(room, style, rng, u.y0, u.wide, 2 + static_cast<int>(rng.below(2)));
    if (u.unit == Unit::kDoor || u.unit == Unit::kSink)
      write_door_unit(room, style, rng, u.y0, u.wide);
    if (u.unit == Unit::kOven) {
      write_oven_unit(room, style, u.y0, u.wide);
      write_hob(room, style, u.y0, u.wide);
      write_hood(room, style, u.y0, u.wide);
    }
    if (u.unit == Unit::kSink) {
      write_sink_worktop(room, style, number, u.y0, u.wide);
    } else {
      write_worktop(room, style, number, u.y0, u.wide);
    }
    if (u.unit == Unit::kWideDrawers) {
      clutter(room, rng, style.high, u.y0, u.wide);
      SceneRegionCfg region;
      region.name = "worktop";
      region.on = fmt::format("room/worktop_{}", number);
      const double y1 = u.y0 + u.wide;
      region.area = {0.08, 0.36, u.y0 + 0.06, y1 - 0.06};
      region.target_area = {0.08, 0.24, u.y0 + 0.12, y1 - 0.12};
      cfg.regions.push_back(region);
      cfg.robot.pos = {-0.34, u.y0 + u.wide / 2, 0};
    }
    ++number;
  }
  // Wall cabinets above all units except the oven, which has a hood; the microwave's space stays
  // free.
  for (const Placed& u : units) {
    if (u.unit != Unit::kOven) write_wall_cabinet(room, style, rng, u.y0, u.wide);
    if (u.unit == Unit::kDoor) write_microwave(room, style, u.y0 + u.wide / 2);
  }
  return room.model();
}

}  // namespace

Generator kitchen_generator() {
  return {
      "kitchen", "A fitted kitchen: drawers, cabinets, oven, fridge, microwave.", {}, make_kitchen};
}

}  // namespace mjsense::tasks::scenes
