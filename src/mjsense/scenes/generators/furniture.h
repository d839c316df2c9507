// SPDX-License-Identifier: Apache-2.0
#pragma once
// Furniture for generated rooms. Each piece stands on the floor in the frame of the writer: its back
// at y = 0, its front towards -y, its middle at x = 0. Sizes are drawn.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/rng.h"
#include "mjsense/scenes/generators/building.h"
#include "mjsense/scenes/scene_file.h"

namespace mjsense {

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

// What it takes of the floor, at most.
struct FloorSpace {
  double width, depth;  // m
};
FloorSpace floor_space(Furniture piece);

// A top on which things may stand is a geom "<name>_top" and goes to `regions`, in the world's axes.
void write_furniture(Building& out, Furniture piece, const std::string& name, Rng& rng,
                     std::vector<SceneRegionCfg>& regions);
// A table in the middle of a room with chairs on its long sides; around the frame's origin.
void write_dining_table(Building& out, const std::string& name, int chairs, Rng& rng,
                        std::vector<SceneRegionCfg>& regions);
void write_coffee_table(Building& out, const std::string& name, Rng& rng,
                        std::vector<SceneRegionCfg>& regions);
// Materials that the pieces, rugs, windows and ceilings are made of, in colours of the house.
void write_furniture_materials(RoomText& text, Rng& rng);
// A material that shows a picture once: for write_painting().
void write_picture(RoomText& text, const std::string& name, Rng& rng);
// A flat thing on the floor and on a wall; the wall's is at height z, facing -y.
void write_rug(Building& out, std::string_view material, double half_x, double half_y);
void write_painting(Building& out, std::string_view picture, double width, double height, double z);

}  // namespace mjsense
