// SPDX-License-Identifier: Apache-2.0
#pragma once
// Writes the MJCF of a generated room. Furniture has contype 0 and conaffinity 3: objects (contype 1)
// and robots (contype 2) touch it, pieces of it never touch each other.

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "mjsense/core/pose.h"
#include "mjsense/scene/entity.h"
#include "mjsense/scenes/generators/texture.h"

namespace mjsense {

// Shine of a material.
struct Gloss {
  double specular = 0.1, shininess = 0.2, reflectance = 0;
};

enum class Facing { kUp, kDown, kPlusX, kMinusX, kPlusY, kMinusY };

class RoomText {
 public:
  explicit RoomText(std::string name) : name_(std::move(name)) {}

  // --- materials
  void plain(std::string_view name, Colour colour, Gloss gloss = {}, double alpha = 1);
  // Lies flat, `metres` a side, repeated; for slab() and planes.
  void tiled(std::string_view name, std::string png, double metres, Gloss gloss = {});
  // Once on each face of a box, whatever its size.
  void wrapped(std::string_view name, std::string png, Gloss gloss = {});
  // A texture alone, for `vary`; of the same kind as what it may replace.
  void texture(std::string_view name, std::string png, bool wrapped);
  // Light that a material gives: lamps, displays.
  void glowing(std::string_view name, Colour colour, double emission);

  // --- geoms, into the open body
  void box(std::string_view name, std::string_view material, Vec3 middle, Vec3 half,
           std::string_view more = "");
  // Of which one side shows a tiled texture: `wide` and `high` of that side, `thick` behind it.
  // `middle` is that of the side.
  void slab(std::string_view name, std::string_view material, Facing facing, Vec3 middle,
            double wide, double high, double thick, std::string_view more = "");
  void cylinder(std::string_view name, std::string_view material, Vec3 from, Vec3 to, double radius,
                std::string_view more = "");
  void capsule(std::string_view name, std::string_view material, Vec3 from, Vec3 to, double radius,
               std::string_view more = "");
  // An ellipsoid of half axes `half` whose third axis is `along`, its second `flat`; only to look at.
  void leaf(std::string_view material, Vec3 middle, Vec3 along, Vec3 flat, Vec3 half);
  // As it stands: joints, lights, cameras, sites.
  void add(std::string_view element);
  void open_body(std::string_view name, Vec3 pos, double yaw = 0);
  void close_body();
  // After the worldbody: equalities, excluded contacts.
  void tail(std::string_view element);
  void asset(std::string_view element) { assets_ += element; }
  void file(std::string name, std::string bytes) { files_[std::move(name)] = std::move(bytes); }

  ModelSource model() const;
  const std::string& name() const { return name_; }

 private:
  std::string name_, assets_, world_, tail_;
  std::map<std::string, std::string> files_;
};

// The shell of a room: floor, ceiling, skirting boards, a lamp below the ceiling, walls; what it is
// made of.
struct ShellCfg {
  double x0 = -2, x1 = 2, y0 = -2, y1 = 2, height = 2.6;  // m, inside
  std::string floor = "floor", wall = "wall", ceiling = "ceiling", skirting = "skirting";
  // A window in the wall at y1 (its middle along x, sill height, width, height); width 0: none.
  double window_x = 0, sill = 1.0, window_wide = 1.2, window_high = 1.1;
};
// Names: floor, ceiling, wall_x0, wall_x1, wall_y0, wall_y1, lamp (a light), daylight (a light).
void write_shell(RoomText& room, const ShellCfg& shell);

}  // namespace mjsense
