// SPDX-License-Identifier: Apache-2.0
#include "mjsense/scenes/generators/room_with_door.h"

#include <fmt/format.h>

#include <numbers>

#include "mjsense/scenes/generators/furniture.h"
#include "mjsense/scenes/generators/hinged_door.h"
#include "mjsense/scenes/generators/surface_finishes.h"

namespace mjsense::scenes {
namespace {

using std::numbers::pi;

constexpr double kHeight = 2.6, kWall = 0.12;  // m
constexpr double kSill = 0.9, kLintel = 2.25;  // m, of windows
constexpr double kWindow = 1.2;                // m wide

struct Sizes {
  double front, back;  // m, depth of the rooms at x < 0 and x > 0
  double left, right;  // m, from the centre of the door to the walls at y > 0 and y < 0
};

void write_shell_of(BuildingWriter& out, const Sizes& s, const HingedDoor& door) {
  const double mid = 0.5 * (s.left - s.right), wide = s.left + s.right;
  out.text().slab("floor_front", "floor_front", Facing::kUp, {-0.5 * s.front, mid, 0}, s.front,
                  wide, 0.1);
  out.text().slab("floor_back", "floor_back", Facing::kUp, {0.5 * s.back, mid, 0}, s.back, wide,
                  0.1);
  out.text().slab("ceiling", "ceiling_paint", Facing::kDown,
                  {0.5 * (s.back - s.front), mid, kHeight}, s.back + s.front, wide, 0.1);
  BuildingWriter::Local walls(out, "walls", {0, 0, 0}, 0);
  const WallFinish look{.thickness = kWall, .height = kHeight};
  const double half = 0.5 * opening_width(door);
  write_wall(out, {0, -s.right, 0}, {0, s.left, 0},
             {{s.right - half, s.right + half, 0, opening_height(door)}}, look);
  const double first = 0.5 * s.front, second = s.front + 0.5 * s.back, w = 0.5 * kWindow;
  write_wall(out, {-s.front, s.left, 0}, {s.back, s.left, 0},
             {{first - w, first + w, kSill, kLintel}, {second - w, second + w, kSill, kLintel}},
             look);
  write_wall(out, {-s.front, -s.right, 0}, {s.back, -s.right, 0}, {}, look);
  write_wall(out, {-s.front, -s.right, 0}, {-s.front, s.left, 0}, {}, look);
  write_wall(out, {s.back, -s.right, 0}, {s.back, s.left, 0}, {}, look);
  for (const double x : {-0.5 * s.front, 0.5 * s.back})
    write_window(out, {x, s.left, 0}, 0, kWindow, kSill, kLintel, kWall);
}

void write_materials(RoomWriter& text, Rng& rng) {
  constexpr Colour kPaints[] = {{0.90, 0.89, 0.86},
                                {0.62, 0.67, 0.66},
                                {0.80, 0.76, 0.68},
                                {0.36, 0.42, 0.48},
                                {0.66, 0.48, 0.32}};
  write_shell_finishes(text, rng);
  write_furniture_materials(text, rng);
  text.plain("door_paint", brighter(pick(rng, kPaints), rng.uniform(0.95, 1.05)), {0.2, 0.35});
  text.plain("door_metal", rng.below(3) == 0 ? Colour{0.72, 0.60, 0.38} : Colour{0.62, 0.63, 0.65},
             {0.8, 0.7});
  const Gloss polished{0.15, 0.3, 0.03};
  text.tiled("floor_front", planks_png(brighter(wood_colour(rng), 0.85), 8, rng.next()), 1.2,
             polished);
  if (rng.below(2) == 0) {
    text.tiled("floor_back",
               tiles_png({0.72, 0.70, 0.66}, {0.52, 0.51, 0.49}, 3, false, rng.next()), 1.2,
               polished);
  } else {
    text.tiled("floor_back", planks_png(brighter(wood_colour(rng), 0.8), 8, rng.next()), 1.2,
               polished);
  }
  for (const char* name : {"painting_1", "painting_2"}) write_picture(text, name, rng);
}

scene::ModelSource make(GeneratorInput& input, SceneFileCfg& cfg) {
  Rng& rng = input.rng;
  HingedDoor door = draw_door(rng);
  if (input.parameters[0] > 0) door.width = input.parameters[0];
  if (input.parameters[1] != 0) door.hinge_left = input.parameters[1] > 0;
  const Sizes s{rng.uniform(3.4, 4.0), rng.uniform(3.4, 4.0), rng.uniform(2.1, 2.6),
                rng.uniform(2.1, 2.6)};
  RoomWriter text("room_with_door");
  write_materials(text, rng);
  BuildingWriter out(text);
  write_shell_of(out, s, door);
  const double mid = 0.5 * (s.left - s.right);
  for (const auto& [name, x] :
       {std::pair{"lamp_front", -0.5 * s.front}, std::pair{"lamp_back", 0.5 * s.back}}) {
    out.lamp(name, {x, mid, kHeight - 0.12}, 0.85, 3.6);
    out.cylinder({x, mid, kHeight - 0.03}, 0.16, 0.03, "shade", false);
  }
  write_bounce_light(text);

  // At the far walls, outside of the space needed to open the door: x, y on the wall's face, yaw.
  const double f = -s.front + 0.06, b = s.back - 0.06, l = s.left - 0.06, r = -s.right + 0.06;
  const auto stand = [&](Furniture piece, const char* name, double x, double y, double yaw) {
    BuildingWriter::Local local(out, name, {x, y, 0}, yaw);
    write_furniture(out, piece, name, rng, cfg.regions);
  };
  stand(Furniture::kSideboard, "sideboard", f, mid + rng.uniform(-0.4, 0.4), 0.5 * pi);
  stand(Furniture::kPlant, "plant", -s.front + 0.5, l, 0);
  stand(Furniture::kFloorLamp, "floor_lamp", -s.front + 0.45, r, pi);
  stand(Furniture::kSofa, "sofa", b, mid + rng.uniform(-0.3, 0.3), -0.5 * pi);
  stand(Furniture::kBookcase, "bookcase", s.back - 0.7, r, pi);
  const auto hang = [&](const char* picture, double x, double yaw, double z) {
    BuildingWriter::Local local(out, "", {x, mid, 0}, yaw);
    write_painting(out, picture, 0.85, 0.57, z);
  };
  hang("painting_1", f, 0.5 * pi, 1.55);
  hang("painting_2", b, -0.5 * pi, 1.65);
  {
    BuildingWriter::Local rug(out, "", {-0.55 * s.front, mid, 0}, 0);
    write_rug(out, "cloth_2", 0.75, 1.05);
  }
  write_door(out, door, kWall);
  text.add(
      fmt::format("<camera name=\"view_front\" pos=\"{:.3f} {:.3f} 1.75\" "
                  "xyaxes=\"0.32 -0.95 0 0.14 0.05 0.99\" fovy=\"66\"/>",
                  -s.front + 0.3, 0.5 * s.left));
  text.add(
      fmt::format("<camera name=\"view_back\" pos=\"{:.3f} {:.3f} 1.75\" "
                  "xyaxes=\"-0.32 0.95 0 -0.14 -0.05 0.99\" fovy=\"66\"/>",
                  s.back - 0.3, -0.5 * s.right));
  cfg.robot.pos = {-0.5 * s.front, 0, 0};
  return text.model();
}

}  // namespace

Generator room_with_door_generator() {
  return {"room_with_door",
          "Two furnished rooms and the door between them, with a lever and a latch.",
          {{"door_width", 0, "Width (m) of the leaf; 0: drawn."},
           {"hinge_left", 0,
            "1: the hinge is on the left when pushing the door, -1: on the right; 0: drawn."}},
          make};
}

}  // namespace mjsense::scenes
