// SPDX-License-Identifier: Apache-2.0
#pragma once
// Writer for the MJCF of a generated room. Furniture has contype 0 and conaffinity 3: it collides
// with objects (contype 1) and robots (contype 2), but not with other furniture.

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>

#include "mjsense/core/pose.h"
#include "mjsense/scene/entity.h"
#include "mjsense/scenes/generators/texture.h"

namespace mjsense::scenes {

// Reflection properties of a material.
struct Gloss {
  double specular = 0.1, shininess = 0.2, reflectance = 0;
};

enum class Facing { kUp, kDown, kPlusX, kMinusX, kPlusY, kMinusY };

class RoomWriter {
 public:
  explicit RoomWriter(std::string name) : name_(std::move(name)) {}

  // --- materials
  void plain(std::string_view name, Colour colour, Gloss gloss = {}, double alpha = 1);
  // For slab() and planes: the texture is repeated every `metres`.
  void tiled(std::string_view name, std::string png, double metres, Gloss gloss = {});
  // The texture is shown once on each face of a box, whatever the size of the box.
  void wrapped(std::string_view name, std::string png, Gloss gloss = {});
  // A texture without a material, for `vary`. It must be of the same kind as the texture that it
  // replaces.
  void texture(std::string_view name, std::string png, bool wrapped);
  // A material that emits light: lamps, displays.
  void glowing(std::string_view name, Colour colour, double emission);

  // --- geoms, added to the open body
  void box(std::string_view name, std::string_view material, Vec3 middle, Vec3 half,
           std::string_view more = "");
  // A slab with a tiled texture on one side. `middle`, `wide` and `high` are those of this side;
  // the slab extends `thick` behind it.
  void slab(std::string_view name, std::string_view material, Facing facing, Vec3 middle,
            double wide, double high, double thick, std::string_view more = "");
  void cylinder(std::string_view name, std::string_view material, Vec3 from, Vec3 to, double radius,
                std::string_view more = "");
  void capsule(std::string_view name, std::string_view material, Vec3 from, Vec3 to, double radius,
               std::string_view more = "");
  // A visual ellipsoid with half axes `half`; the third axis is `along`, the second is `flat`.
  void leaf(std::string_view material, Vec3 middle, Vec3 along, Vec3 flat, Vec3 half);
  // Adds an element verbatim: joints, lights, cameras, sites.
  void add(std::string_view element);
  void open_body(std::string_view name, Vec3 pos, double yaw = 0);
  void close_body();
  // Adds an element after the worldbody: equalities, excluded contacts.
  void tail(std::string_view element);
  void asset(std::string_view element) { assets_ += element; }
  void file(std::string name, std::string bytes) { files_[std::move(name)] = std::move(bytes); }

  scene::ModelSource model() const;
  const std::string& name() const { return name_; }

 private:
  std::string name_, assets_, world_, tail_;
  std::map<std::string, std::string> files_;
};

// Shell of a room: floor, ceiling, skirting boards, walls, a lamp below the ceiling; dimensions and
// materials.
struct ShellCfg {
  double x0 = -2, x1 = 2, y0 = -2, y1 = 2, height = 2.6;  // m, inner dimensions
  std::string floor = "floor", wall = "wall", ceiling = "ceiling", skirting = "skirting";
  // A window in the wall at y1: its centre along x, sill height, width and height (m). Width 0: no
  // window.
  double window_x = 0, sill = 1.0, window_wide = 1.2, window_high = 1.1;
};
// Names of the geoms: floor, ceiling, wall_x0, wall_x1, wall_y0, wall_y1; of the lights: lamp,
// daylight, bounce.
void write_shell(RoomWriter& room, const ShellCfg& shell);
// The light `bounce`: ambient light, which stands in for what walls reflect. Moods can colour it.
void write_bounce_light(RoomWriter& room);

}  // namespace mjsense::scenes
