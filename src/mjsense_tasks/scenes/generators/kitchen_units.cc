// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/kitchen_units.h"

#include <fmt/format.h>

#include <algorithm>

namespace mjsense::tasks::scenes {
namespace {

constexpr double kPanel = 0.018;  // m, thickness of boards
constexpr double kGap = 0.003;    // m, between fronts
constexpr char kSlide[] = "damping=\"6\" frictionloss=\"1.5\" armature=\"0.05\"";
constexpr char kHinge[] = "damping=\"0.35\" frictionloss=\"0.25\" armature=\"0.01\"";
constexpr char kLight[] = "density=\"450\"";

// The boards of a box with an open front, from x = kPanel to `deep`.
void carcass(RoomWriter& room, std::string_view material, double y0, double wide, double z0,
             double z1, double deep) {
  const double x = (kPanel + deep) / 2, hx = (deep - kPanel) / 2, t = kPanel / 2;
  const double y = y0 + wide / 2, z = (z0 + z1) / 2, hz = (z1 - z0) / 2;
  room.box({x, y0 + t, z}, {hx, t, hz}, material);
  room.box({x, y0 + wide - t, z}, {hx, t, hz}, material);
  room.box({x, y, z0 + t}, {hx, wide / 2 - kPanel, t}, material);
  room.box({x, y, z1 - t}, {hx, wide / 2 - kPanel, t}, material);
  room.box({deep - t, y, z}, {t, wide / 2 - kPanel, hz - kPanel}, material);
}

// A leaf on a vertical hinge. It fills y0 .. y0 + wide, z0 .. z1 at x = 0 .. kPanel.
struct Leaf {
  std::string thing;
  double x = 0, y0 = 0, wide = 0, z0 = 0, z1 = 0;
  bool hinge_at_y0 = true;
  double maximum = 1.75;  // rad
  std::string_view material = "front";
  double handle_z = 0, handle_length = 0;
  double thick = kPanel;
};

void leaf(RoomWriter& room, const KitchenStyle& style, const Leaf& l) {
  const double side = l.hinge_at_y0 ? 1 : -1;
  const double hinge = l.hinge_at_y0 ? l.y0 + kGap / 2 : l.y0 + l.wide - kGap / 2;
  const double w = l.wide - kGap, middle = (l.z0 + l.z1) / 2;
  room.open_body(l.thing + "/door", {l.x, hinge, middle});
  room.add(
      fmt::format("<joint name=\"{}/hinge\" type=\"hinge\" axis=\"0 0 {}\" range=\"0 {}\" {}/>",
                  l.thing, side, l.maximum, kHinge));
  room.box({l.thick / 2, side * w / 2, 0}, {l.thick / 2, w / 2, (l.z1 - l.z0 - kGap) / 2},
           l.material, {.name = l.thing + "/leaf", .attributes = kLight});
  write_handle(room, style, l.thing, {0, side * (w - 0.045), l.handle_z - middle}, {0, 0, 1},
               l.handle_length);
}

}  // namespace

void write_handle(RoomWriter& room, const KitchenStyle& style, std::string_view thing, Vec3 middle,
                  Vec3 along, double length) {
  const Vec3 bar = middle + Vec3{-style.stand_off, 0, 0};
  const Vec3 end = (length / 2) * along;
  const std::string name = fmt::format("{}/handle", thing);
  if (style.round_bar) {
    room.capsule(bar - end, bar + end, style.bar_radius, "handle",
                 {.name = name, .attributes = "friction=\"1.2 0.01 0.0001\""});
  } else {
    const double r = style.bar_radius;
    const Vec3 half = along.z > 0.5 ? Vec3{r, 0.8 * r, length / 2} : Vec3{r, length / 2, 0.8 * r};
    room.box(bar, half, "handle", {.name = name, .attributes = "friction=\"1.2 0.01 0.0001\""});
  }
  for (int side = -1; side <= 1; side += 2) {
    const Vec3 foot = (side * (length / 2 - 0.012)) * along;
    room.cylinder(middle + foot, bar + foot, 0.7 * style.bar_radius, "handle");
  }
}

void write_drawer_unit(RoomWriter& room, KitchenStyle& style, Rng& rng, double y0, double wide,
                       int drawers) {
  const double bottom = style.plinth, top = style.carcass_top();
  carcass(room, "carcass", y0, wide, bottom, top, style.deep);
  room.box({0.07, y0 + wide / 2, bottom / 2}, {0.01, wide / 2, bottom / 2}, "plinth");
  // If there are more than two drawers, the top one is shallower.
  const double first = drawers > 2 ? rng.uniform(0.16, 0.2) : (top - bottom) / drawers;
  const double rest = drawers > 1 ? (top - bottom - first) / (drawers - 1) : 0;
  double z1 = top;
  for (int i = 0; i < drawers; ++i) {
    const double high = i == 0 ? first : rest, z0 = z1 - high;
    const std::string thing = fmt::format("drawer_{}", style.drawers++);
    const double y = y0 + wide / 2, w = wide / 2 - kGap / 2, h = high / 2 - kGap / 2;
    room.open_body(thing, {0, y, (z0 + z1) / 2});
    const double travel = 0.36;
    room.add(
        fmt::format("<joint name=\"{}/slide\" type=\"slide\" axis=\"-1 0 0\" range=\"0 {}\" {}/>",
                    thing, travel, kSlide));
    room.box({kPanel / 2, 0, 0}, {kPanel / 2, w, h}, "front",
             {.name = thing + "/front", .attributes = kLight});
    const double in = wide / 2 - kPanel - 0.012, deep = 0.46, side = std::min(0.12, high - 0.06);
    const double low = -h + 0.02;
    room.box({kPanel + deep / 2, 0, low}, {deep / 2, in, 0.006}, "inside", {.attributes = kLight});
    for (int s = -1; s <= 1; s += 2)
      room.box({kPanel + deep / 2, s * in, low + side / 2}, {deep / 2, 0.007, side / 2}, "inside",
               {.attributes = kLight});
    room.box({kPanel + deep, 0, low + side / 2}, {0.007, in, side / 2}, "inside",
             {.attributes = kLight});
    write_handle(room, style, thing, {0, 0, std::min(0.0, h - 0.07)}, {0, 1, 0},
                 std::min(style.bar_length, 0.6 * wide));
    room.close_body();
    z1 = z0;
  }
}

void write_door_unit(RoomWriter& room, KitchenStyle& style, Rng& rng, double y0, double wide) {
  const double bottom = style.plinth, top = style.carcass_top();
  room.box({0.07, y0 + wide / 2, bottom / 2}, {0.01, wide / 2, bottom / 2}, "plinth");
  carcass(room, "carcass", y0, wide, bottom, top, style.deep);
  room.box({style.deep / 2, y0 + wide / 2, (bottom + top) / 2},
           {style.deep / 2 - kPanel, wide / 2 - kPanel, kPanel / 2}, "carcass");
  const int leaves = wide > 0.6 ? 2 : 1;
  const bool at_y0 = rng.below(2) == 0;
  for (int i = 0; i < leaves; ++i) {
    const std::string thing = fmt::format("cabinet_{}", style.cabinets++);
    const double w = wide / leaves;
    room.open_body(thing, {0, 0, 0});
    leaf(room, style,
         {.thing = thing,
          .y0 = y0 + i * w,
          .wide = w,
          .z0 = bottom,
          .z1 = top,
          .hinge_at_y0 = leaves == 2 ? i == 0 : at_y0,
          .handle_z = top - 0.07 - style.bar_length / 2,
          .handle_length = style.bar_length});
    room.close_body();
    room.close_body();
  }
}

void write_wall_cabinet(RoomWriter& room, KitchenStyle& style, Rng& rng, double y0, double wide) {
  const double x = style.deep + 0.02 - style.wall_deep;
  const int leaves = wide > 0.6 ? 2 : 1;
  const bool at_y0 = rng.below(2) == 0;
  // Its boards are in a frame that is moved to the wall.
  room.open_body("", {x, 0, 0});
  carcass(room, "carcass", y0, wide, style.wall_low, style.wall_high, style.wall_deep);
  room.box({style.wall_deep / 2, y0 + wide / 2, (style.wall_low + style.wall_high) / 2},
           {style.wall_deep / 2 - kPanel, wide / 2 - kPanel, kPanel / 2}, "carcass");
  room.close_body();
  for (int i = 0; i < leaves; ++i) {
    const std::string thing = fmt::format("cabinet_{}", style.cabinets++);
    const double w = wide / leaves;
    room.open_body(thing, {x, 0, 0});
    leaf(room, style,
         {.thing = thing,
          .y0 = y0 + i * w,
          .wide = w,
          .z0 = style.wall_low,
          .z1 = style.wall_high,
          .hinge_at_y0 = leaves == 2 ? i == 0 : at_y0,
          .handle_z = style.wall_low + 0.05 + style.bar_length / 2,
          .handle_length = style.bar_length});
    room.close_body();
    room.close_body();
  }
}

void write_oven_unit(RoomWriter& room, KitchenStyle& style, double y0, double wide) {
  const double bottom = style.plinth, top = style.carcass_top(), y = y0 + wide / 2;
  room.box({0.07, y, bottom / 2}, {0.01, wide / 2, bottom / 2}, "plinth");
  carcass(room, "oven_inside", y0, wide, bottom, top, style.deep);
  const double panel = top - 0.10, low = bottom + 0.11;
  room.box({kPanel / 2, y, (panel + top) / 2},
           {kPanel / 2, wide / 2 - kGap / 2, (top - panel - kGap) / 2}, "steel",
           {.name = "oven_0/panel"});
  room.box({kPanel / 2, y, (bottom + low) / 2},
           {kPanel / 2, wide / 2 - kGap / 2, (low - bottom - kGap) / 2}, "steel");
  room.box({-0.001, y, (panel + top) / 2}, {0.002, 0.06, 0.018}, "display", kNoContacts);
  for (int side = -1; side <= 1; side += 2)
    for (int i = 0; i < 2; ++i) {
      const double at = y + side * (0.12 + 0.08 * i), z = (panel + top) / 2;
      room.cylinder({0, at, z}, {-0.022, at, z}, 0.018, "handle");
    }
  for (int i = 0; i < 2; ++i)  // racks
    room.box({style.deep / 2, y, low + 0.12 + 0.16 * i},
             {style.deep / 2 - 0.05, wide / 2 - 0.03, 0.003}, "steel");
  room.open_body("oven_0", {0, y, 0});
  room.open_body("oven_0/door", {0, 0, low});
  room.add(fmt::format(
      "<joint name=\"oven_0/hinge\" type=\"hinge\" axis=\"0 -1 0\" range=\"0 1.4\" "
      "damping=\"0.6\" frictionloss=\"1.2\" stiffness=\"2\" springref=\"0\" armature=\"0.02\"/>"));
  const double high = panel - low - kGap;
  room.box({kPanel / 2, 0, high / 2}, {kPanel / 2, wide / 2 - kGap / 2, high / 2}, "steel",
           {.name = "oven_0/leaf", .attributes = "density=\"150\""});
  room.box({-0.001, 0, 0.45 * high}, {0.002, wide / 2 - 0.07, 0.32 * high}, "glass",
           {.attributes = "contype=\"0\" conaffinity=\"0\" mass=\"0\""});
  write_handle(room, style, "oven_0", {0, 0, high - 0.045}, {0, 1, 0}, 0.7 * wide);
  room.close_body();
  room.close_body();
}

void write_hood(RoomWriter& room, const KitchenStyle& style, double y0, double wide) {
  const double y = y0 + wide / 2, back = style.deep + 0.02, deep = 0.42;
  room.box({back - deep / 2, y, 1.62}, {deep / 2, wide / 2 - 0.02, 0.03}, "steel",
           {.name = "hood"});
  room.box({back - 0.14, y, 2.1}, {0.13, 0.14, 0.45}, "steel");
  room.box({back - deep / 2, y, 1.588}, {0.02, 0.12, 0.003}, "lamp_glass", kNoContacts);
}

void write_fridge(RoomWriter& room, const KitchenStyle& style, double y0, double wide, double high,
                  bool hinge_at_y0) {
  const double foot = 0.06, split = 0.68, deep = style.deep + 0.02, y = y0 + wide / 2;
  const double w = wide - 0.01, thick = 0.045;
  const auto compartment = [&](double z0, double z1) {
    room.open_body("", {thick, 0, 0});
    carcass(room, "fridge_inside", y0 + 0.005, w, z0, z1, deep - thick);
    room.close_body();
  };
  compartment(foot, split);
  compartment(split, high);
  room.box({deep / 2 + 0.03, y, 1.05}, {deep / 2 - 0.1, w / 2 - 0.02, 0.006}, "fridge_inside");
  room.box({deep / 2 + 0.03, y, 1.4}, {deep / 2 - 0.1, w / 2 - 0.02, 0.006}, "fridge_inside");
  room.box({deep / 2 + 0.04, y0 + 0.004, (foot + high) / 2},
           {deep / 2 - 0.03, 0.004, (high - foot) / 2}, "fridge");
  room.box({deep / 2 + 0.04, y0 + wide - 0.004, (foot + high) / 2},
           {deep / 2 - 0.03, 0.004, (high - foot) / 2}, "fridge");
  room.box({0.08, y, foot / 2}, {0.01, w / 2, foot / 2}, "plinth");
  const double length = 1.7 * style.bar_length;
  const auto door = [&](const char* thing, double z0, double z1, double handle_z, double bar) {
    room.open_body(thing, {0, 0, 0});
    leaf(room, style,
         {.thing = thing,
          .y0 = y0,
          .wide = wide,
          .z0 = z0,
          .z1 = z1,
          .hinge_at_y0 = hinge_at_y0,
          .material = "fridge",
          .handle_z = handle_z,
          .handle_length = bar,
          .thick = thick});
    room.close_body();
    room.close_body();
  };
  door("fridge_0", split, high, split + 0.08 + length / 2, length);
  door("freezer_0", foot, split, split - 0.06 - style.bar_length / 2, style.bar_length);
}

void write_microwave(RoomWriter& room, const KitchenStyle& style, double middle) {
  const double wide = 0.48, deep = 0.36, high = 0.28, x = 0.16, z = style.high + 0.012;
  const double door = 0.35, y0 = middle - wide / 2;
  room.open_body("microwave_0", {x, 0, 0});
  const double t = 0.012;
  const Vec3 centre{deep / 2, middle, z + high / 2};
  const double my = middle + door / 2;  // of the part next to the door
  room.box({deep / 2, middle, z + t / 2}, {deep / 2, wide / 2, t / 2}, "appliance");
  room.box({deep / 2, middle, z + high - t / 2}, {deep / 2, wide / 2, t / 2}, "appliance");
  room.box({deep / 2, y0 + t / 2, centre.z}, {deep / 2, t / 2, high / 2 - t}, "appliance");
  room.box({deep - t / 2, middle, centre.z}, {t / 2, wide / 2 - t, high / 2 - t}, "appliance");
  room.box({deep / 2 - 0.01, my, centre.z}, {deep / 2 + 0.01, (wide - door) / 2, high / 2 - t},
           "appliance", {.name = "microwave_0/panel"});
  room.box({-0.021, my, z + high - 0.055}, {0.002, 0.04, 0.014}, "display", kNoContacts);
  for (int i = 0; i < 9; ++i)
    room.box({-0.021, my + 0.028 * (i % 3 - 1), z + 0.07 + 0.03 * (i / 3)}, {0.002, 0.010, 0.010},
             "handle", kNoContacts);
  room.cylinder({deep / 2, middle - 0.06, z + t}, {deep / 2, middle - 0.06, z + t + 0.008}, 0.12,
                "glass");
  room.open_body("microwave_0/door", {-0.02, y0, centre.z});
  room.add(fmt::format(
      "<joint name=\"microwave_0/hinge\" type=\"hinge\" axis=\"0 0 1\" range=\"0 1.75\" {}/>",
      kHinge));
  room.box({0.009, door / 2, 0}, {0.009, door / 2 - 0.001, high / 2}, "appliance",
           {.name = "microwave_0/leaf", .attributes = kLight});
  room.box({-0.001, door / 2 - 0.02, 0}, {0.002, door / 2 - 0.055, high / 2 - 0.04}, "glass",
           {.attributes = "contype=\"0\" conaffinity=\"0\" mass=\"0\""});
  write_handle(room, style, "microwave_0", {0, door - 0.032, 0}, {0, 0, 1}, 0.2);
  room.close_body();
  room.close_body();
}

void write_worktop(RoomWriter& room, const KitchenStyle& style, int number, double y0,
                   double wide) {
  room.slab(
      Facing::kUp, {style.deep / 2, y0 + wide / 2, style.high}, style.deep + 0.04, wide,
      style.worktop, "worktop",
      {.name = fmt::format("worktop_{}", number), .attributes = "friction=\"0.9 0.005 0.0002\""});
}

void write_sink_worktop(RoomWriter& room, const KitchenStyle& style, int number, double y0,
                        double wide) {
  const double x0 = 0.10, x1 = 0.46, half = 0.23, y = y0 + wide / 2, z = style.high;
  const double front = -0.02, back = style.deep + 0.02;
  const auto piece = [&](const std::string& name, double a, double b, double c, double d) {
    room.slab(Facing::kUp, {(a + b) / 2, (c + d) / 2, z}, b - a, d - c, style.worktop, "worktop",
              {.name = name, .attributes = "friction=\"0.9 0.005 0.0002\""});
  };
  piece(fmt::format("worktop_{}", number), front, x0, y0, y0 + wide);
  piece("", x1, back, y0, y0 + wide);
  piece("", x0, x1, y0, y - half);
  piece("", x0, x1, y + half, y0 + wide);
  const double deep = 0.17, t = 0.004, mx = (x0 + x1) / 2, hx = (x1 - x0) / 2;
  room.box({mx, y, z - deep}, {hx, half, t}, "steel", {.name = "sink"});
  room.box({x0, y, z - deep / 2 + t}, {t, half, deep / 2}, "steel");
  room.box({x1, y, z - deep / 2 + t}, {t, half, deep / 2}, "steel");
  room.box({mx, y - half, z - deep / 2 + t}, {hx, t, deep / 2}, "steel");
  room.box({mx, y + half, z - deep / 2 + t}, {hx, t, deep / 2}, "steel");
  room.cylinder({mx, y, z - deep + t}, {mx, y, z - deep + t + 0.004}, 0.035, "handle");
  const double tx = x1 + 0.06;
  room.cylinder({tx, y, z}, {tx, y, z + 0.03}, 0.026, "steel", {.name = "tap"});
  room.capsule({tx, y, z + 0.02}, {tx, y, z + 0.27}, 0.013, "steel");
  room.capsule({tx, y, z + 0.27}, {tx - 0.17, y, z + 0.30}, 0.013, "steel");
  room.capsule({tx - 0.17, y, z + 0.30}, {tx - 0.17, y, z + 0.25}, 0.012, "steel");
  room.capsule({tx, y + 0.02, z + 0.09}, {tx - 0.02, y + 0.08, z + 0.13}, 0.007, "steel");
}

void write_hob(RoomWriter& room, const KitchenStyle& style, double y0, double wide) {
  const double y = y0 + wide / 2, x = style.deep / 2 + 0.02, z = style.high;
  room.box({x, y, z + 0.003}, {0.25, wide / 2 - 0.02, 0.003}, "glass", {.name = "hob"});
  for (int i = 0; i < 4; ++i) {
    const double px = x + (i & 1 ? 0.12 : -0.12), py = y + (i & 2 ? 0.14 : -0.14);
    const double r = i == 0 || i == 3 ? 0.095 : 0.075;
    room.cylinder({px, py, z + 0.005}, {px, py, z + 0.0066}, r, "ring", kNoContacts);
    room.cylinder({px, py, z + 0.005}, {px, py, z + 0.0072}, r - 0.006, "glass", kNoContacts);
  }
}

}  // namespace mjsense::tasks::scenes
