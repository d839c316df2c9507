// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/shelf.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense_tasks/scenes/generators/room_shell.h"
#include "mjsense_tasks/scenes/generators/surface_finishes.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr Colour kSpines[] = {{0.55, 0.18, 0.16}, {0.16, 0.27, 0.42}, {0.22, 0.38, 0.27},
                              {0.78, 0.66, 0.36}, {0.85, 0.82, 0.74}, {0.30, 0.22, 0.32},
                              {0.80, 0.45, 0.22}, {0.20, 0.20, 0.22}};

// A row of books from y0, about `length` long, with their backs at `x`. Returns their number.
void books(RoomWriter& room, Rng& rng, double x, double y0, double length, double z,
           double maximum) {
  double y = y0;
  while (true) {
    const double thick = rng.uniform(0.018, 0.045), high = rng.uniform(0.62, 0.9) * maximum,
                 deep = rng.uniform(0.13, 0.18);
    const auto colour = rng.below(static_cast<std::uint32_t>(std::size(kSpines)));
    if (y + thick > y0 + length) return;
    room.box({x + deep / 2, y + thick / 2, z + high / 2}, {deep / 2, thick / 2 - 0.0008, high / 2},
             fmt::format("spine_{}", colour));
    y += thick;
  }
}

scene::ModelSource make_shelf(GeneratorInput& input, SceneFileCfg& cfg) {
  Rng& rng = input.rng;
  RoomWriter room("shelf");
  write_shell_finishes(room, rng);
  const bool painted = rng.below(3) == 0;
  const Colour colour = painted ? paint_colour(rng) : wood_colour(rng);
  const Gloss sheen{.specular = 0.15, .shininess = 0.35};
  room.wrapped("case",
               painted ? plaster_picture(colour, rng.next()) : wood_picture(colour, rng.next()),
               sheen);
  for (std::size_t i = 0; i < std::size(kSpines); ++i)
    room.plain(fmt::format("spine_{}", i), kSpines[i], {.specular = 0.1, .shininess = 0.2});
  room.plain("pot", mix({0.75, 0.42, 0.30}, {0.85, 0.85, 0.82}, rng.uniform()), sheen);
  room.plain("leaf", {0.22, 0.42, 0.20}, {.specular = 0.1, .shininess = 0.3});

  const double front = rng.uniform(0.46, 0.52), deep = rng.uniform(0.27, 0.32),
               wide = rng.uniform(0.85, 1.1);
  const double lowest = input.parameters[0] > 0 ? input.parameters[0] : rng.uniform(0.5, 0.6),
               step = rng.uniform(0.34, 0.40);
  constexpr int kBoards = 3;
  constexpr double kThick = 0.022;
  constexpr double kClear = 0.075;  // m, half of the longest object
  const double back = front + deep;
  ShellCfg shell{.x0 = -2.4, .x1 = back + 0.03, .y0 = -2.2, .y1 = 2.2, .window_x = -1.2};
  write_shell(room, shell);

  const double top = lowest + kBoards * step;
  for (int side = -1; side <= 1; side += 2) {
    room.box({front + deep / 2, side * (wide + kThick) / 2, (top + kThick) / 2},
             {deep / 2, kThick / 2, (top + kThick) / 2}, "case");
  }
  room.box({back + 0.008, 0, (top + kThick) / 2}, {0.006, wide / 2, (top + kThick) / 2}, "case",
           {.name = "case_back"});
  room.box({front + 0.02, 0, 0.05}, {0.01, wide / 2, 0.05}, "case", {.name = "plinth"});
  // the lowest board is near the floor, the highest is the top
  for (int i = -1; i <= kBoards; ++i) {
    const double z = i < 0 ? 0.1 : lowest + i * step;
    const std::string name = i < 0          ? "foot_board"
                             : i == kBoards ? "case_top"
                                            : fmt::format("board_{}", i);
    room.box({front + deep / 2, 0, z - kThick / 2}, {deep / 2, wide / 2, kThick / 2}, "case",
             {.name = name, .attributes = "friction=\"0.9 0.005 0.0002\""});
  }
  // Books below and above the arm's reach, and at one end of a board.
  const double inside = front + 0.06;
  const double low_row = rng.uniform(0.5, 0.93) * wide;
  room.open_body("books_low", {});
  books(room, rng, inside, -wide / 2 + 0.02, low_row, 0.1, std::min(0.3, lowest - 0.14));
  room.close_body();
  const double top_row = rng.uniform(0.3, 0.6) * wide;
  room.open_body("books_top", {});
  books(room, rng, inside, -wide / 2 + 0.10, top_row, top, 0.26);
  room.close_body();
  const int with_books = static_cast<int>(rng.below(kBoards));
  const double taken = 0.2 * wide;
  books(room, rng, inside, wide / 2 - taken, taken - 0.01, lowest + with_books * step, step - 0.06);
  // A plant next to the bookcase.
  const double side = rng.below(2) == 0 ? 1 : -1, px = back - 0.22, py = side * (wide / 2 + 0.4);
  room.open_body("plant", {px, py, 0});
  room.cylinder({0, 0, 0}, {0, 0, 0.28}, 0.14, "pot", {.name = "plant"});
  constexpr int kLeaves = 16;
  for (int i = 0; i < kLeaves; ++i) {  // leaves lean away from the centre, not into the wall
    double turn = 2.4 * i;
    const double lean = rng.uniform(0.1, 0.55), half = rng.uniform(0.2, 0.36);
    const Vec3 out{std::cos(turn), std::sin(turn), 0};
    const double away = std::sin(lean) * (out.x > 0 ? 0.4 : 1.0);
    const Vec3 along = normalized(Vec3{away * out.x, std::sin(lean) * out.y, std::cos(lean)});
    const Vec3 flat = normalized(cross(along, Vec3{-out.y, out.x, 0}));
    room.leaf(Vec3{0, 0, 0.24} + 0.04 * out + half * along, along, flat, {0.035, 0.006, half},
              "leaf");
  }
  room.close_body();

  for (int i = 0; i < kBoards; ++i) {
    // The longest object, lying across, touches neither the sides nor the back nor the books.
    const double y1 = wide / 2 - kClear - (i == with_books ? taken : 0.0);
    SceneRegionCfg region;
    region.name = fmt::format("board_{}", i);
    region.on = "room/" + region.name;
    region.area = {front + 0.04, back - kClear, -wide / 2 + kClear, y1};
    region.target_area = {front + 0.05, front + 0.11, -wide / 2 + 0.16, y1 - 0.085};
    cfg.regions.push_back(region);
  }
  return room.model();
}

}  // namespace

Generator shelf_generator() {
  return {"shelf",
          "A bookcase with boards on which objects stand.",
          {{"lowest", 0, "Height (m) of the lowest board that is used; 0: drawn."}},
          make_shelf};
}

}  // namespace mjsense::tasks::scenes
