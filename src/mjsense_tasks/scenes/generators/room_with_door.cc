// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/room_with_door.h"

#include <fmt/format.h>

#include <numbers>
#include <tuple>

#include "mjsense_tasks/scenes/generators/furniture.h"
#include "mjsense_tasks/scenes/generators/hinged_door.h"
#include "mjsense_tasks/scenes/generators/room_shell.h"
#include "mjsense_tasks/scenes/generators/surface_finishes.h"
#include "mjsense_tasks/scenes/generators/wall_fittings.h"
#include "mjsense_tasks/scenes/generators/walls.h"

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

constexpr double kSill = 0.9, kLintel = 2.25;  // m, of windows
constexpr double kWindow = 1.2;                // m wide

struct Sizes {
  double front, back;  // m, depth of the rooms at x < 0 and x > 0
  double left, right;  // m, from the centre of the door to the walls at y > 0 and y < 0
};

void write_shell_of(RoomWriter& out, const Sizes& s, const HingedDoor& door) {
  const double mid = 0.5 * (s.left - s.right), wide = s.left + s.right;
  out.slab(Facing::kUp, {-0.5 * s.front, mid, 0}, s.front, wide, 0.1, "floor_front",
           {.name = "floor_front"});
  out.slab(Facing::kUp, {0.5 * s.back, mid, 0}, s.back, wide, 0.1, "floor_back",
           {.name = "floor_back"});
  out.slab(Facing::kDown, {0.5 * (s.back - s.front), mid, kWallHeight}, s.back + s.front, wide, 0.1,
           "ceiling_paint", {.name = "ceiling"});
  RoomWriter::Local walls(out, "walls", {0, 0, 0}, 0);
  const double half = 0.5 * opening_width(door);
  write_wall(out, {0, -s.right, 0}, {0, s.left, 0},
             {{s.right - half, s.right + half, 0, opening_height(door)}});
  const double first = 0.5 * s.front, second = s.front + 0.5 * s.back, w = 0.5 * kWindow;
  write_wall(out, {-s.front, s.left, 0}, {s.back, s.left, 0},
             {{first - w, first + w, kSill, kLintel}, {second - w, second + w, kSill, kLintel}});
  write_wall(out, {-s.front, -s.right, 0}, {s.back, -s.right, 0}, {});
  write_wall(out, {-s.front, -s.right, 0}, {-s.front, s.left, 0}, {});
  write_wall(out, {s.back, -s.right, 0}, {s.back, s.left, 0}, {});
  for (const double x : {-0.5 * s.front, 0.5 * s.back})
    write_window(out, {x, s.left, 0}, 0, kWindow, kSill, kLintel);
}

void write_door_materials(RoomWriter& out, Rng& rng) {
  constexpr Colour kPaints[] = {{0.90, 0.89, 0.86},
                                {0.62, 0.67, 0.66},
                                {0.80, 0.76, 0.68},
                                {0.36, 0.42, 0.48},
                                {0.66, 0.48, 0.32}};
  write_shell_finishes(out, rng);
  write_furniture_materials(out, rng);
  const double brightness = rng.uniform(0.95, 1.05);
  out.plain("door_paint", brighter(pick(rng, kPaints), brightness),
            {.specular = 0.2, .shininess = 0.35, .roughness = 0.45});
  out.plain("door_metal", rng.below(3) == 0 ? Colour{0.72, 0.60, 0.38} : Colour{0.62, 0.63, 0.65},
            {.specular = 0.8, .shininess = 0.7, .metallic = 1, .roughness = 0.35});
  const Gloss polished{.specular = 0.15, .shininess = 0.3, .reflectance = 0.03, .roughness = 0.5};
  const auto front = rng.next();
  out.tiled("floor_front", planks_picture(brighter(wood_colour(rng), 0.85), 8, front), 1.2,
            polished);
  const bool tiles = rng.below(2) == 0;
  const auto back = rng.next();
  out.tiled("floor_back",
            tiles ? tiles_picture({0.72, 0.70, 0.66}, {0.52, 0.51, 0.49}, 3, false, back)
                  : planks_picture(brighter(wood_colour(rng), 0.8), 8, back),
            1.2, polished);
  for (const char* name : {"painting_1", "painting_2"}) write_picture(out, name, rng);
}

// Furnishes the wall with the door on both sides: panels, a light switch and a painting; a coat rack
// in the front room and a clock in the back one.
void write_door_wall(RoomWriter& out, const Sizes& s, const HingedDoor& door, Rng& rng) {
  out.plain("panel", paint_colour(rng), {0.1, 0.2});
  for (const char* name : {"painting_3", "painting_4"}) write_picture(out, name, rng);
  const double casing = 0.5 * opening_width(door) + 0.09;
  for (const bool front : {true, false}) {
    // In this frame, x points to the right as seen from the room.
    RoomWriter::Local wall(out, "", {front ? -0.5 * kWallThickness : 0.5 * kWallThickness, 0, 0},
                           front ? -0.5 * pi : 0.5 * pi);
    const double from = front ? -s.left : -s.right, to = front ? s.right : s.left;
    const double latch = front == door.hinge_left ? 1 : -1;
    const auto middle = [&](double side) { return 0.5 * (side > 0 ? casing + to : from - casing); };
    write_panelling(out, from, -casing);
    write_panelling(out, casing, to);
    write_light_switch(out, latch * (casing + 0.14));
    if (front) {
      write_coat_rack(out, middle(-latch), rng);
    } else {
      write_wall_clock(out, middle(latch), rng);
    }
    RoomWriter::Local picture(out, "", {middle(front ? latch : -latch), 0, 0}, 0);
    write_painting(out, front ? "painting_3" : "painting_4", 0.75, 0.50, 1.6);
  }
}

scene::ModelSource make_room_with_door(GeneratorInput& input, SceneFileCfg& cfg) {
  Rng& rng = input.rng;
  HingedDoor door = draw_door(rng);
  if (input.parameters[0] > 0) door.width = input.parameters[0];
  if (input.parameters[1] != 0) door.hinge_left = input.parameters[1] > 0;
  const Sizes s{rng.uniform(3.4, 4.0), rng.uniform(3.4, 4.0), rng.uniform(2.1, 2.6),
                rng.uniform(2.1, 2.6)};
  RoomWriter out("room_with_door");
  write_door_materials(out, rng);
  write_shell_of(out, s, door);
  const double mid = 0.5 * (s.left - s.right);
  for (const auto& [name, x] :
       {std::pair{"lamp_front", -0.5 * s.front}, std::pair{"lamp_back", 0.5 * s.back}}) {
    out.lamp(name, {x, mid, kWallHeight - 0.12}, 0.85, 3.6);
    out.upright_cylinder({x, mid, kWallHeight - 0.03}, 0.16, 0.03, "shade", kVisual);
  }
  write_bounce_light(out);

  // At the far walls, outside of the space needed to open the door: x, y on the wall's face, yaw.
  const double f = -s.front + 0.06, b = s.back - 0.06, l = s.left - 0.06, r = -s.right + 0.06;
  const auto stand = [&](Furniture piece, const char* name, double x, double y, double yaw) {
    RoomWriter::Local local(out, name, {x, y, 0}, yaw);
    write_furniture(out, piece, name, rng, cfg.regions);
  };
  stand(Furniture::kSideboard, "sideboard", f, mid + rng.uniform(-0.4, 0.4), 0.5 * pi);
  stand(Furniture::kPlant, "plant", -s.front + 0.5, l, 0);
  stand(Furniture::kFloorLamp, "floor_lamp", -s.front + 0.45, r, pi);
  stand(Furniture::kSofa, "sofa", b, mid + rng.uniform(-0.3, 0.3), -0.5 * pi);
  stand(Furniture::kBookcase, "bookcase", s.back - 0.7, r, pi);
  const auto hang = [&](const char* picture, double x, double yaw, double z) {
    RoomWriter::Local local(out, "", {x, mid, 0}, yaw);
    write_painting(out, picture, 0.85, 0.57, z);
  };
  hang("painting_1", f, 0.5 * pi, 1.55);
  hang("painting_2", b, -0.5 * pi, 1.65);
  {
    RoomWriter::Local rug(out, "", {-0.55 * s.front, mid, 0}, 0);
    write_rug(out, "cloth_2", 0.75, 1.05);
  }
  write_door(out, door);
  write_door_wall(out, s, door, rng);
  // Near the door, furniture is at the side walls only, outside of the space needed to open it.
  stand(Furniture::kBookcase, "bookcase_front", -0.95, r, pi);
  stand(Furniture::kPlant, "plant_back", 0.45, l, 0);
  for (const auto& [x, cloth, half_x, half_y] :
       {std::tuple{-0.5, "cloth_1", 0.25, 0.42}, std::tuple{0.5 * s.back, "cloth_3", 0.6, 0.9}}) {
    RoomWriter::Local rug(out, "", {x, x < 0 ? 0 : mid, 0}, 0);
    write_rug(out, cloth, half_x, half_y);
  }
  out.add(
      fmt::format("<camera name=\"view_front\" pos=\"{:.3f} {:.3f} 1.75\" "
                  "xyaxes=\"0.32 -0.95 0 0.14 0.05 0.99\" fovy=\"66\"/>",
                  -s.front + 0.3, 0.5 * s.left));
  out.add(
      fmt::format("<camera name=\"view_back\" pos=\"{:.3f} {:.3f} 1.75\" "
                  "xyaxes=\"-0.32 0.95 0 -0.14 -0.05 0.99\" fovy=\"66\"/>",
                  s.back - 0.3, -0.5 * s.right));
  cfg.robot.pos = {-0.5 * s.front, 0, 0};
  return out.model();
}

}  // namespace

Generator room_with_door_generator() {
  return {"room_with_door",
          "Two furnished rooms and the door between them, with a lever and a latch.",
          {{"door_width", 0, "Width (m) of the leaf; 0: drawn."},
           {"hinge_left", 0,
            "1: the hinge is on the left when pushing the door, -1: on the right; 0: drawn."}},
          make_room_with_door};
}

}  // namespace mjsense::tasks::scenes
