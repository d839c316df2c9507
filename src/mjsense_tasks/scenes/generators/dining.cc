// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/dining.h"

#include "mjsense_tasks/scenes/generators/furniture.h"
#include "mjsense_tasks/scenes/generators/room_shell.h"
#include "mjsense_tasks/scenes/generators/surface_finishes.h"

namespace mjsense::tasks::scenes {
namespace {

constexpr Colour kRugs[] = {{0.48, 0.30, 0.28}, {0.34, 0.40, 0.46}, {0.62, 0.56, 0.44}};
constexpr Colour kFrames[] = {{0.16, 0.14, 0.13}, {0.46, 0.34, 0.20}, {0.72, 0.70, 0.66}};

// A body named `name`: a chair that faces -x or +x, with its seat at x, y.
void chair(RoomWriter& room, const char* name, double x, double y, double back) {
  room.open_body(name, {x, y, 0});
  for (int i = 0; i < 4; ++i) {
    const double dx = i & 1 ? 0.18 : -0.18, dy = i & 2 ? 0.18 : -0.18;
    room.box({dx, dy, 0.22}, {0.018, 0.018, 0.22}, "chair");
  }
  room.box({0, 0, 0.45}, {0.21, 0.21, 0.015}, "chair");
  for (int i = -1; i <= 1; i += 2)
    room.box({0.19 * back, 0.19 * i, 0.68}, {0.016, 0.016, 0.22}, "chair");
  for (int i = 0; i < 3; ++i)
    room.box({0.19 * back, 0, 0.62 + 0.11 * i}, {0.010, 0.18, 0.028}, "chair");
  room.close_body();
}

scene::ModelSource make_dining(GeneratorInput& input, SceneFileCfg& cfg) {
  Rng& rng = input.rng;
  RoomWriter room("dining");
  write_shell_finishes(room, rng);
  const Colour wood = wood_colour(rng);
  const Gloss satin{.specular = 0.2, .shininess = 0.4, .roughness = 0.45};
  room.tiled("table", boards_picture(wood, 8, rng.next()), 1.0, satin);
  room.wrapped("table_edge", wood_picture(brighter(wood, 0.85), rng.next()), satin);
  const auto seat = rng.next();
  room.wrapped("chair", wood_picture(wood_colour(rng), seat), satin);
  const auto rug = rng.next();
  room.tiled("rug", cloth_picture(pick(rng, kRugs), rug), 0.5);
  room.plain("frame", pick(rng, kFrames), satin);
  write_picture(room, "picture", rng);

  const double wide = rng.uniform(1.2, 1.5), deep = rng.uniform(0.80, 0.90),
               high = rng.uniform(0.60, 0.70), front = 0.30, x = front + deep / 2;
  const double wall = front + deep + rng.uniform(0.6, 0.9);
  ShellCfg shell{.x0 = -rng.uniform(1.9, 2.4),
                 .x1 = wall,
                 .y0 = -rng.uniform(1.9, 2.3),
                 .y1 = rng.uniform(1.9, 2.3)};
  shell.window_x = rng.uniform(-0.6, 0.3);
  write_shell(room, shell);
  room.slab(Facing::kUp, {x, 0, 0.006}, deep + 1.0, wide + 0.8, 0.006, "rug",
            {.name = "rug", .attributes = "contype=\"0\" conaffinity=\"0\""});
  room.slab(Facing::kUp, {x, 0, high}, deep, wide, 0.03, "table",
            {.name = "table_top", .attributes = "friction=\"0.9 0.005 0.0002\""});
  room.box({x, 0, high - 0.055}, {deep / 2 - 0.05, wide / 2 - 0.05, 0.025}, "table_edge");
  for (int i = 0; i < 4; ++i) {
    const double dx = (i & 1 ? 0.5 : -0.5) * deep, dy = (i & 2 ? 0.5 : -0.5) * wide;
    room.box({x + dx - (i & 1 ? 0.05 : -0.05), dy - (i & 2 ? 0.05 : -0.05), (high - 0.03) / 2},
             {0.03, 0.03, (high - 0.03) / 2}, "table_edge");
  }
  chair(room, "chair_0", front + deep + 0.22, rng.uniform(-0.5, -0.25), 1);
  chair(room, "chair_1", front + deep + 0.26, rng.uniform(0.25, 0.5), 1);
  const double py = rng.uniform(-0.6, 0.6);
  room.box({wall - 0.012, py, 1.55}, {0.012, 0.42, 0.30}, "frame");
  room.slab(Facing::kMinusX, {wall - 0.0255, py, 1.55}, 0.76, 0.52, 0.002, "picture", kNoContacts);

  SceneRegionCfg region;
  region.name = "table";
  region.on = "room/table_top";
  region.area = {front + 0.08, front + deep - 0.12, -0.48, 0.48};
  region.target_area = {front + 0.12, front + 0.36, -0.25, 0.25};
  cfg.regions.push_back(region);
  return room.model();
}

}  // namespace

Generator dining_generator() {
  return {"dining", "A table in a dining room with chairs, a rug and a window.", {}, make_dining};
}

}  // namespace mjsense::tasks::scenes
