// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/furniture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "mjsense_tasks/scenes/generators/surface_finishes.h"

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

constexpr double kRim = 0.07;  // m, edge of a top on which no object's origin is placed

// Part of a top where objects may be placed, m from its centre.
struct Part {
  double x0, x1, y0, y1;
};

// A level top for objects, which may be placed on all of it except the edge, or on a part of it.
void top(RoomWriter& out, const std::string& name, Vec3 center, Vec3 half,
         std::string_view material, std::vector<SceneRegionCfg>& regions,
         std::optional<Part> part = {}) {
  out.box(center, half, material, {.name = name + "_top"});
  const double y = std::max(half.y - kRim, 0.02);
  const Part p = part.value_or(Part{-half.x + kRim, half.x - kRim, -y, y});
  std::array<double, 4> area{1e9, -1e9, 1e9, -1e9};
  for (const Vec3 corner :
       {Vec3{p.x0, p.y0, 0}, Vec3{p.x1, p.y0, 0}, Vec3{p.x0, p.y1, 0}, Vec3{p.x1, p.y1, 0}}) {
    const Vec3 at = out.frame() * (center + corner);
    area = {std::min(area[0], at.x), std::max(area[1], at.x), std::min(area[2], at.y),
            std::max(area[3], at.y)};
  }
  SceneRegionCfg region;
  region.name = name;
  region.on = fmt::format("room/{}_top", name);
  region.area = area;
  regions.push_back(std::move(region));
}

void four_legs(RoomWriter& out, double half_x, double half_y, double y, double height,
               double radius, std::string_view material) {
  for (const double a : {-1.0, 1.0}) {
    for (const double b : {-1.0, 1.0})
      out.upright_cylinder({a * half_x, y + b * half_y, 0.5 * height}, radius, 0.5 * height,
                           material);
  }
}

void chair(RoomWriter& out, Rng& rng) {
  const double seat = rng.uniform(0.44, 0.47);
  four_legs(out, 0.18, 0.17, -0.21, seat - 0.02, 0.014, "dark_wood");
  out.box({0, -0.21, seat - 0.01}, {0.21, 0.20, 0.016}, "wood");
  out.box({0, -0.22, seat + 0.015}, {0.19, 0.18, 0.012}, "cloth_2");
  for (const double a : {-1.0, 1.0})
    out.capsule({a * 0.18, -0.025, seat}, {a * 0.18, 0.0, seat + 0.42}, 0.014, "dark_wood");
  out.box({0, -0.01, seat + 0.33}, {0.17, 0.010, 0.085}, "wood");
}

void sofa(RoomWriter& out, Rng& rng) {
  const double half = rng.uniform(0.85, 0.95), arm = rng.uniform(0.08, 0.11);
  out.box({0, -0.44, 0.17}, {half, 0.41, 0.10}, "cloth_1");
  out.box({0, -0.12, 0.50}, {half, 0.10, 0.28}, "cloth_1");
  for (const double a : {-1.0, 1.0}) {
    out.box({a * (half - arm), -0.46, 0.40}, {arm, 0.40, 0.19}, "cloth_1");
    out.capsule({a * (half - arm), -0.12, 0.59}, {a * (half - arm), -0.80, 0.59}, arm, "cloth_1");
    const double cushion = 0.5 * (half - 2 * arm);
    out.box({a * cushion, -0.51, 0.335}, {cushion - 0.008, 0.335, 0.065}, "cloth_1");
    out.box({a * cushion, -0.27, 0.56}, {cushion - 0.012, 0.06, 0.165}, "cloth_1");
    out.upright_cylinder({a * (half - 0.08), -0.80, 0.035}, 0.02, 0.035, "dark_wood", kVisual);
  }
  const double pillow = rng.uniform(-1, 1) > 0 ? 1 : -1;
  out.ellipsoid({pillow * (half - 2 * arm - 0.2), -0.40, 0.55}, {0.20, 0.08, 0.17}, "cloth_3",
                axis_angle({1, 0, 0}, -0.3));
}

void armchair(RoomWriter& out, Rng& rng) {
  const double half = rng.uniform(0.38, 0.42);
  out.box({0, -0.40, 0.22}, {half, 0.36, 0.10}, "cloth_2");
  out.box({0, -0.12, 0.52}, {half, 0.10, 0.30}, "cloth_2");
  for (const double a : {-1.0, 1.0})
    out.box({a * (half - 0.07), -0.42, 0.40}, {0.07, 0.34, 0.18}, "cloth_2");
  out.box({0, -0.47, 0.36}, {half - 0.145, 0.29, 0.06}, "cloth_2");
  four_legs(out, half - 0.06, 0.28, -0.40, 0.12, 0.018, "dark_wood");
}

void television(RoomWriter& out, const std::string& name, Rng& rng,
                std::vector<SceneRegionCfg>& regions) {
  const double half = rng.uniform(0.72, 0.85), height = rng.uniform(0.46, 0.56);
  out.box({0, -0.21, 0.5 * height}, {half - 0.02, 0.19, 0.5 * height - 0.05}, "white_wood");
  // Objects are placed next to the television.
  top(out, name, {0, -0.21, height - 0.015}, {half, 0.21, 0.015}, "wood", regions,
      Part{0.62 * half, half - kRim, -0.14, 0.14});
  for (const double a : {-0.5, 0.5})
    out.box({a * half, -0.405, 0.5 * height}, {0.47 * half, 0.006, 0.5 * height - 0.08}, "wood",
            kVisual);
  out.box({-0.15, -0.18, height + 0.40}, {0.50, 0.02, 0.29}, "black");
  out.box({-0.15, -0.2015, height + 0.40}, {0.485, 0.002, 0.275}, "screen", kVisual);
  out.box({-0.15, -0.18, height + 0.055}, {0.03, 0.02, 0.06}, "black");
  out.box({-0.15, -0.18, height + 0.008}, {0.20, 0.09, 0.006}, "black");
}

void bookcase(RoomWriter& out, Rng& rng) {
  const double half = rng.uniform(0.38, 0.46), height = rng.uniform(1.75, 1.95);
  constexpr int kShelves = 5;
  for (const double a : {-1.0, 1.0})
    out.box({a * half, -0.15, 0.5 * height}, {0.012, 0.15, 0.5 * height}, "wood");
  out.box({0, -0.008, 0.5 * height}, {half, 0.006, 0.5 * height}, "wood");
  for (int i = 0; i <= kShelves; ++i) {
    const double z = 0.05 + i * (height - 0.07) / kShelves;
    out.box({0, -0.15, z}, {half - 0.012, 0.145, 0.011}, "wood");
    if (i == kShelves) break;
    double x = -half + 0.03;
    const double end = half - rng.uniform(0.05, 0.5);
    while (x < end) {
      const double thick = rng.uniform(0.011, 0.024), tall = rng.uniform(0.10, 0.14);
      const int colour = static_cast<int>(rng.below(5));
      out.box({x + thick, -0.15 + rng.uniform(-0.02, 0.01), z + 0.011 + tall}, {thick, 0.10, tall},
              fmt::format("book_{}", colour), kVisual);
      x += 2 * thick + 0.002;
    }
  }
}

void desk(RoomWriter& out, const std::string& name, Rng& rng,
          std::vector<SceneRegionCfg>& regions) {
  const double half = rng.uniform(0.60, 0.72), height = rng.uniform(0.72, 0.76);
  top(out, name, {0, -0.34, height - 0.014}, {half, 0.33, 0.014}, "wood", regions,
      Part{-half + kRim, 0.05 * half, -0.26, 0.20});
  four_legs(out, half - 0.05, 0.28, -0.34, height - 0.028, 0.022, "steel");
  out.box({half - 0.22, -0.34, 0.5 * height + 0.08}, {0.18, 0.28, 0.5 * height - 0.11},
          "white_wood");
  for (const double z : {0.28, 0.46, 0.64})
    out.box({half - 0.22, -0.63, z}, {0.06, 0.008, 0.008}, "steel", kVisual);
  // A screen, its keyboard, and a chair in front.
  out.box({0.30, -0.14, height + 0.27}, {0.27, 0.012, 0.165}, "black");
  out.box({0.30, -0.153, height + 0.27}, {0.26, 0.002, 0.155}, "screen", kVisual);
  out.box({0.30, -0.13, height + 0.06}, {0.02, 0.01, 0.06}, "black", kVisual);
  out.box({0.30, -0.14, height + 0.004}, {0.11, 0.08, 0.004}, "black");
  out.box({0.30, -0.42, height + 0.008}, {0.20, 0.06, 0.008}, "black");
  RoomWriter::Local seat(out, "", {-0.15, -0.86, 0}, pi + rng.uniform(-0.3, 0.3));
  RoomWriter::Local back(out, "", {0, 0.21, 0}, 0);
  chair(out, rng);
}

void bed(RoomWriter& out, const std::string& name, Rng& rng, std::vector<SceneRegionCfg>& regions) {
  const double half = rng.uniform(0.70, 0.85);
  out.box({0, -0.03, 0.45}, {half + 0.03, 0.03, 0.45}, "wood");
  out.box({0, -1.05, 0.17}, {half, 1.0, 0.09}, "wood");
  // Near the foot of the bed, where objects are within reach.
  top(out, name, {0, -1.05, 0.36}, {half - 0.02, 0.98, 0.10}, "sheet", regions,
      Part{-half + 0.12, half - 0.12, -0.86, -0.40});
  out.box({0, -1.35, 0.455}, {half + 0.005, 0.70, 0.006}, "cloth_3", kVisual);
  out.box({0, -1.35, 0.35}, {half + 0.006, 0.70, 0.109}, "cloth_3", kVisual);
  for (const double a : {-0.5, 0.5})
    out.ellipsoid({a * half, -0.32, 0.51}, {0.34, 0.20, 0.075}, "sheet");
}

void wardrobe(RoomWriter& out, Rng& rng) {
  const double half = rng.uniform(0.55, 0.75);
  out.box({0, -0.29, 1.0}, {half, 0.28, 1.0}, "white_wood");
  for (const double a : {-1.0, 1.0}) {
    out.box({a * 0.5 * half, -0.578, 1.02}, {0.5 * half - 0.004, 0.009, 0.95}, "wood", kVisual);
    out.capsule({a * 0.06, -0.605, 0.95}, {a * 0.06, -0.605, 1.12}, 0.007, "steel", kVisual);
  }
}

void sideboard(RoomWriter& out, const std::string& name, Rng& rng,
               std::vector<SceneRegionCfg>& regions) {
  const double half = rng.uniform(0.55, 0.70), height = rng.uniform(0.74, 0.84);
  four_legs(out, half - 0.06, 0.15, -0.20, 0.14, 0.018, "dark_wood");
  out.box({0, -0.20, 0.5 * height + 0.06}, {half - 0.01, 0.19, 0.5 * height - 0.075}, "white_wood");
  top(out, name, {0, -0.20, height - 0.012}, {half, 0.20, 0.012}, "wood", regions);
  for (int i = -1; i <= 1; ++i) {
    const double x = i * 2.0 * (half - 0.02) / 3;
    out.box({x, -0.393, 0.5 * height + 0.06},
            {(half - 0.02) / 3 - 0.004, 0.007, 0.5 * height - 0.085}, "wood", kVisual);
    out.ellipsoid({x + 0.1, -0.41, 0.5 * height + 0.12}, {0.012, 0.012, 0.012}, "steel");
  }
}

void nightstand(RoomWriter& out, const std::string& name, Rng& rng,
                std::vector<SceneRegionCfg>& regions) {
  const double height = rng.uniform(0.48, 0.56);
  out.box({0, -0.20, 0.5 * height}, {0.21, 0.18, 0.5 * height - 0.02}, "white_wood");
  top(out, name, {0, -0.20, height - 0.012}, {0.23, 0.20, 0.012}, "wood", regions);
  out.box({0, -0.385, 0.65 * height}, {0.19, 0.006, 0.12}, "wood", kVisual);
  out.ellipsoid({0, -0.40, 0.65 * height}, {0.012, 0.012, 0.012}, "steel");
}

void plant(RoomWriter& out, Rng& rng) {
  const double height = rng.uniform(0.25, 0.34), radius = rng.uniform(0.13, 0.17);
  out.upright_cylinder({0, -0.25, 0.5 * height}, radius, 0.5 * height, "pot");
  out.upright_cylinder({0, -0.25, height}, radius - 0.012, 0.004, "soil", kVisual);
  out.capsule({0, -0.25, height}, {0, -0.25, height + 0.35}, 0.016, "dark_wood", kVisual);
  const int leaves = 12 + static_cast<int>(rng.below(6));
  for (int i = 0; i < leaves; ++i) {
    const double turn = 2.4 * i, lean = rng.uniform(0.35, 1.15);
    const double from = height + 0.08 + 0.28 * i / leaves, length = rng.uniform(0.13, 0.19);
    const Quat q = axis_angle({0, 0, 1}, turn) * axis_angle({0, 1, 0}, lean);
    const Vec3 p = Vec3{0, -0.25, from} + rotate(q, {0, 0, length});
    out.ellipsoid(p, {0.045, 0.006, length}, i % 3 == 0 ? "leaf_2" : "leaf_1", q);
  }
}

void floor_lamp(RoomWriter& out, Rng& rng) {
  const double height = rng.uniform(1.45, 1.65);
  out.upright_cylinder({0, -0.2, 0.012}, 0.14, 0.012, "steel");
  out.upright_cylinder({0, -0.2, 0.5 * height}, 0.012, 0.5 * height, "steel");
  out.upright_cylinder({0, -0.2, height + 0.02}, 0.17, 0.13, "shade");
}

}  // namespace

FloorSpace floor_space(Furniture piece) {
  switch (piece) {
    case Furniture::kSofa:
      return {1.95, 0.88};
    case Furniture::kTelevision:
      return {1.75, 0.45};
    case Furniture::kBookcase:
      return {0.98, 0.32};
    case Furniture::kDesk:
      return {1.50, 1.15};
    case Furniture::kBed:
      return {1.80, 2.12};
    case Furniture::kWardrobe:
      return {1.55, 0.62};
    case Furniture::kSideboard:
      return {1.45, 0.44};
    case Furniture::kArmchair:
      return {0.90, 0.80};
    case Furniture::kPlant:
      return {0.55, 0.50};
    case Furniture::kFloorLamp:
      return {0.40, 0.42};
    case Furniture::kNightstand:
      return {0.50, 0.42};
  }
  return {1, 1};
}

void write_furniture(RoomWriter& out, Furniture piece, const std::string& name, Rng& rng,
                     std::vector<SceneRegionCfg>& regions) {
  switch (piece) {
    case Furniture::kSofa:
      return sofa(out, rng);
    case Furniture::kTelevision:
      return television(out, name, rng, regions);
    case Furniture::kBookcase:
      return bookcase(out, rng);
    case Furniture::kDesk:
      return desk(out, name, rng, regions);
    case Furniture::kBed:
      return bed(out, name, rng, regions);
    case Furniture::kWardrobe:
      return wardrobe(out, rng);
    case Furniture::kSideboard:
      return sideboard(out, name, rng, regions);
    case Furniture::kArmchair:
      return armchair(out, rng);
    case Furniture::kPlant:
      return plant(out, rng);
    case Furniture::kFloorLamp:
      return floor_lamp(out, rng);
    case Furniture::kNightstand:
      return nightstand(out, name, rng, regions);
  }
}

void write_dining_table(RoomWriter& out, const std::string& name, int chairs, Rng& rng,
                        std::vector<SceneRegionCfg>& regions) {
  const double half_x = 0.32 * chairs / 2 + 0.10, half_y = 0.42, height = rng.uniform(0.73, 0.76);
  top(out, name, {0, 0, height - 0.015}, {half_x, half_y, 0.015}, "wood", regions);
  four_legs(out, half_x - 0.06, half_y - 0.06, 0, height - 0.03, 0.028, "dark_wood");
  for (int i = 0; i < chairs; ++i) {
    const double side = i % 2 == 0 ? 1 : -1;
    const int row = i / 2;
    const double x = (row - 0.25 * (chairs - 2)) * 0.60;
    const double yaw = (side > 0 ? 0 : pi) + rng.uniform(-0.12, 0.12);
    const double y = side * (half_y + 0.22 + rng.uniform(-0.06, 0.06));
    RoomWriter::Local seat(out, "", {x, y, 0}, yaw);
    chair(out, rng);
  }
}

void write_coffee_table(RoomWriter& out, const std::string& name, Rng& rng,
                        std::vector<SceneRegionCfg>& regions) {
  const double half_x = rng.uniform(0.42, 0.52), height = rng.uniform(0.38, 0.44);
  top(out, name, {0, 0, height - 0.014}, {half_x, 0.28, 0.014}, "wood", regions);
  four_legs(out, half_x - 0.05, 0.23, 0, height - 0.028, 0.018, "dark_wood");
  out.box({0, 0, 0.14}, {half_x - 0.05, 0.23, 0.008}, "wood");
}

void write_furniture_materials(RoomWriter& out, Rng& rng) {
  constexpr Colour kCloths[] = {{0.42, 0.48, 0.55}, {0.62, 0.58, 0.50}, {0.33, 0.42, 0.38},
                                {0.60, 0.38, 0.30}, {0.72, 0.66, 0.55}, {0.30, 0.34, 0.45},
                                {0.70, 0.52, 0.28}, {0.46, 0.30, 0.34}};
  constexpr Colour kBooks[] = {{0.55, 0.20, 0.18},
                               {0.20, 0.30, 0.46},
                               {0.80, 0.74, 0.60},
                               {0.25, 0.40, 0.30},
                               {0.72, 0.52, 0.22}};
  constexpr Colour kPots[] = {{0.70, 0.45, 0.34}, {0.82, 0.80, 0.76}, {0.35, 0.38, 0.40}};
  const Gloss polished{.specular = 0.25, .shininess = 0.4, .roughness = 0.45}, matt{0.02, 0.05};
  const auto around = [&](Colour c) { return brighter(c, rng.uniform(0.9, 1.1)); };
  const Colour wood = wood_colour(rng);
  out.wrapped("wood", wood_picture(wood, rng.next()), polished);
  out.plain("dark_wood", brighter(wood, 0.55), polished);
  out.plain("white_wood", around({0.86, 0.85, 0.82}), polished);
  const auto first = rng.below(8);
  for (std::uint32_t i = 0; i < 3; ++i) {
    const auto threads = rng.next();
    out.wrapped(fmt::format("cloth_{}", i + 1),
                cloth_picture(around(kCloths[(first + 3 * i) % 8]), threads), matt);
  }
  out.plain("sheet", around({0.90, 0.89, 0.86}), matt);
  for (int i = 0; i < 5; ++i) out.plain(fmt::format("book_{}", i), around(kBooks[i]));
  out.plain("steel", {0.60, 0.61, 0.63},
            {.specular = 0.7, .shininess = 0.7, .metallic = 1, .roughness = 0.35});
  out.plain("black", {0.07, 0.07, 0.08}, {0.3, 0.5});
  out.plain("screen", {0.05, 0.06, 0.08},
            {.specular = 0.8, .shininess = 0.9, .reflectance = 0.06, .roughness = 0.05});
  out.plain("pot", around(pick(rng, kPots)));
  out.plain("soil", {0.20, 0.14, 0.10});
  out.plain("leaf_1", around({0.20, 0.42, 0.20}), {0.15, 0.3});
  out.plain("leaf_2", around({0.32, 0.52, 0.26}), {0.15, 0.3});
  out.glowing("shade", {0.95, 0.90, 0.78}, 0.45);
  // Light sources below the ceiling shine down only; emission stands in for the light that the room
  // reflects onto the ceiling.
  out.glowing("ceiling_paint", {0.90, 0.90, 0.89}, 0.35);
}

void write_picture(RoomWriter& out, const std::string& name, Rng& rng) {
  out.texture(name, landscape_picture(rng.next()), false);
  out.asset(fmt::format("<material name=\"{0}\" texture=\"{0}\" specular=\"0.05\"/>\n", name));
}

void write_rug(RoomWriter& out, std::string_view material, double half_x, double half_y) {
  out.box({0, 0, 0.004}, {half_x, half_y, 0.004}, material, kVisual);
}

void write_painting(RoomWriter& out, std::string_view picture, double width, double height,
                    double z) {
  out.box({0, -0.012, z}, {0.5 * width + 0.025, 0.012, 0.5 * height + 0.025}, "dark_wood", kVisual);
  out.slab(Facing::kMinusY, {0, -0.0255, z}, width, height, 0.002, picture, kVisual);
}

}  // namespace mjsense::tasks::scenes
