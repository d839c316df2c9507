// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/generators/table_room.h"

#include <numbers>

#include "mjsense_tasks/scenes/generators/furniture.h"
#include "mjsense_tasks/scenes/generators/room_shell.h"
#include "mjsense_tasks/scenes/generators/surface_finishes.h"

namespace mjsense::tasks::scenes {
namespace {

using std::numbers::pi;

// Materials of the room, and textures from which `vary` can choose another one in every episode.
void write_table_materials(RoomWriter& room, Rng& rng) {
  write_shell_finishes(room, rng);
  write_furniture_materials(room, rng);
  write_picture(room, "painting", rng);
  const Gloss satin{.specular = 0.2, .shininess = 0.4, .roughness = 0.45};
  const Colour wood = wood_colour(rng);
  room.tiled("table", boards_picture(wood, 7, rng.next()), 0.8, satin);
  room.wrapped("table_edge", wood_picture(brighter(wood, 0.8), rng.next()), satin);
  const auto texture = [&](const char* name, Picture picture) {
    room.texture(name, std::move(picture), false);
  };
  texture("table_oak", boards_picture({0.70, 0.55, 0.38}, 8, rng.next()));
  texture("table_walnut", boards_picture({0.40, 0.28, 0.19}, 6, rng.next()));
  texture("table_birch", wood_picture({0.80, 0.70, 0.55}, rng.next(), 512));
  texture("table_stone", stone_picture({0.58, 0.57, 0.55}, rng.next()));
  texture("table_slate", stone_picture({0.27, 0.28, 0.30}, rng.next()));
  texture("table_laminate", plaster_picture({0.80, 0.79, 0.76}, rng.next()));
  texture("table_linen", cloth_picture({0.66, 0.60, 0.50}, rng.next()));
  texture("floor_planks", planks_picture({0.55, 0.42, 0.30}, 8, rng.next()));
  texture("floor_tiles",
          tiles_picture({0.62, 0.60, 0.57}, {0.45, 0.44, 0.43}, 3, false, rng.next()));
  texture("floor_carpet", cloth_picture({0.44, 0.44, 0.46}, rng.next()));
  texture("wall_bricks",
          tiles_picture({0.74, 0.71, 0.67}, {0.66, 0.64, 0.61}, 8, true, rng.next()));
  texture("wall_paper", cloth_picture({0.78, 0.77, 0.73}, rng.next()));
}

void write_table(RoomWriter& room) {
  room.open_body("table", {0.70, 0, 0});
  room.slab(Facing::kUp, {0, 0, 0.60}, 0.84, 1.30, 0.03, "table",
            {.name = "table_top", .attributes = "friction=\"0.9 0.005 0.0002\""});
  room.box({0, 0, 0.552}, {0.40, 0.63, 0.018}, "table_edge");
  for (const double x : {0.36, -0.36}) {
    for (const double y : {0.59, -0.59})
      room.box({x, y, 0.267}, {0.025, 0.025, 0.267}, "table_edge");
  }
  room.close_body();
}

scene::ModelSource make_table_room(GeneratorInput& input, SceneFileCfg&) {
  Rng& rng = input.rng;
  RoomWriter room("table_room");
  write_table_materials(room, rng);
  ShellCfg shell{.x0 = -1.9, .x1 = rng.uniform(2.2, 2.5), .y0 = -2.2, .y1 = 2.2};
  shell.window_x = rng.uniform(0.4, 0.9);
  shell.window_wide = 1.4;
  write_shell(room, shell);
  write_table(room);

  std::vector<SceneRegionCfg> unused;  // objects are placed on the table only
  const auto stand = [&](Furniture piece, const char* name, double x, double y, double yaw) {
    RoomWriter::Local local(room, name, {x, y, 0}, yaw);
    write_furniture(room, piece, name, rng, unused);
  };
  const double sideboard = rng.uniform(-0.7, 0.3);
  stand(Furniture::kSideboard, "sideboard", shell.x1, sideboard, -0.5 * pi);
  stand(Furniture::kPlant, "plant", shell.x1 - 0.35, shell.y0 + 0.25, pi);
  const double along = rng.uniform(0.7, 1.2);
  stand(rng.below(2) == 0 ? Furniture::kBookcase : Furniture::kArmchair, "by_the_wall", along,
        shell.y0, pi);
  {
    RoomWriter::Local wall(room, "", {shell.x1, sideboard, 0}, -0.5 * pi);
    write_painting(room, "painting", 0.85, 0.57, 1.6);
  }
  {
    RoomWriter::Local rug(room, "", {0.9, 0, 0}, 0);
    write_rug(room, "cloth_2", 1.1, 1.2);
  }
  return room.model();
}

}  // namespace

Generator table_room_generator() {
  return {"table_room", "A table in a furnished room with a window.", {}, make_table_room};
}

}  // namespace mjsense::tasks::scenes
