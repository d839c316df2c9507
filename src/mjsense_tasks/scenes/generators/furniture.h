// SPDX-License-Identifier: Apache-2.0
#pragma once
// Furniture of generated rooms. Each piece is on the floor of the writer's frame, with its back at
// y = 0, its front towards -y and its centre at x = 0. Sizes are random.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense_tasks/scenes/generators/room_writer.h"
#include "mjsense_tasks/scenes/scene_file.h"

namespace mjsense::tasks::scenes {

enum class Furniture {
  kSofa,
  kTelevision,
  kBookcase,
  kDesk,
  kBed,
  kWardrobe,
  kSideboard,
  kArmchair,
  kPlant,
  kFloorLamp,
  kNightstand,
};

// Maximum floor area of a piece.
struct FloorSpace {
  double width, depth;  // m
};
FloorSpace floor_space(Furniture piece);

// A surface for objects is a geom "<name>_top" and is appended to `regions`, in world axes.
void write_furniture(RoomWriter& out, Furniture piece, const std::string& name, Rng& rng,
                     std::vector<SceneRegionCfg>& regions);
// A table for the centre of a room with chairs along its long sides, centred at the frame's origin.
void write_dining_table(RoomWriter& out, const std::string& name, int chairs, Rng& rng,
                        std::vector<SceneRegionCfg>& regions);
void write_coffee_table(RoomWriter& out, const std::string& name, Rng& rng,
                        std::vector<SceneRegionCfg>& regions);
// Materials of furniture, rugs, windows and ceilings, in the colours of the house.
void write_furniture_materials(RoomWriter& out, Rng& rng);
// A material that shows an image once, for write_painting().
void write_picture(RoomWriter& out, const std::string& name, Rng& rng);
// A rug on the floor, and a painting on a wall at height z, facing -y.
void write_rug(RoomWriter& out, std::string_view material, double half_x, double half_y);
void write_painting(RoomWriter& out, std::string_view picture, double width, double height,
                    double z);

}  // namespace mjsense::tasks::scenes
