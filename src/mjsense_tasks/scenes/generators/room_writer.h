// SPDX-License-Identifier: Apache-2.0
#pragma once
// Writer for the MJCF of a generated room. Furniture has contype 0 and conaffinity 3: it collides
// with objects (contype 1) and robots (contype 2), but not with other furniture.

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/scene/entity.h"
#include "mjsense_tasks/scenes/generators/texture.h"

namespace mjsense::tasks::scenes {

// Reflection properties of a material. Physically based images use the last two; a negative roughness is
// 1 - shininess.
struct Gloss {
  double specular = 0.1, shininess = 0.2, reflectance = 0, metallic = 0, roughness = -1;
};

enum class Facing { kUp, kDown, kPlusX, kMinusX, kPlusY, kMinusY };

// Options of a geom.
struct GeomOptions {
  std::string_view name;
  bool solid = true;            // false: visual only, in group 2
  std::string_view attributes;  // further MJCF attributes
};
inline constexpr GeomOptions kVisual{.solid = false};
// Visual only, in the default group.
inline constexpr GeomOptions kNoContacts{.attributes = "contype=\"0\" conaffinity=\"0\""};

class RoomWriter {
 public:
  explicit RoomWriter(std::string name) : name_(std::move(name)) {}

  // --- materials
  void plain(std::string_view name, Colour colour, Gloss gloss = {});
  // For slab() and planes: the texture is repeated every `metres`.
  void tiled(std::string_view name, Picture picture, double metres, Gloss gloss = {});
  // The texture is shown once on each face of a box, whatever the size of the box.
  void wrapped(std::string_view name, Picture picture, Gloss gloss = {});
  // A texture without a material, for `vary`. It must be of the same kind as the texture that it
  // replaces. Its normal map is the texture <name>_normals, which wrapped textures do not have.
  void texture(std::string_view name, Picture picture, bool wrapped);
  // A material that emits light: lamps, displays.
  // `shown`: the texture that it shows in physically based images, instead of its colour.
  void glowing(std::string_view name, Colour colour, double emission, std::string_view shown = {});

  // --- geoms, added to the open body
  void box(Vec3 middle, Vec3 half, std::string_view material, const GeomOptions& options = {});
  // A slab with a tiled texture on one side. `middle`, `wide` and `high` are those of this side;
  // the slab extends `thick` behind it.
  void slab(Facing facing, Vec3 middle, double wide, double high, double thick,
            std::string_view material, const GeomOptions& options = {});
  void cylinder(Vec3 from, Vec3 to, double radius, std::string_view material,
                const GeomOptions& options = {});
  void upright_cylinder(Vec3 middle, double radius, double half_height, std::string_view material,
                        const GeomOptions& options = {});
  void capsule(Vec3 from, Vec3 to, double radius, std::string_view material,
               const GeomOptions& options = {});
  // Visual ellipsoids with half axes `half`. Of a leaf, the third axis is `along` and the second is
  // `flat`.
  void ellipsoid(Vec3 middle, Vec3 half, std::string_view material, Quat turned = {});
  void leaf(Vec3 middle, Vec3 along, Vec3 flat, Vec3 half, std::string_view material);
  // A light below a ceiling that shines down; half as bright at `reach` m.
  void lamp(std::string_view name, Vec3 at, double brightness, double reach);
  // Adds an element verbatim: joints, lights, cameras, sites.
  void add(std::string_view element);

  // A static body, rotated about the vertical axis by `yaw` (rad). What is written until
  // close_body() belongs to it, with positions in its frame. `name` may be empty.
  void open_body(std::string_view name, Vec3 pos, double yaw = 0);
  void close_body();
  // Opens a body and closes it at the end of the scope.
  class Local {
   public:
    Local(RoomWriter& room, std::string_view name, Vec3 pos, double yaw) : room_(room) {
      room.open_body(name, pos, yaw);
    }
    ~Local() { room_.close_body(); }
    Local(const Local&) = delete;
    Local& operator=(const Local&) = delete;

   private:
    RoomWriter& room_;
  };
  // Pose of the open body in the model frame.
  const Pose& frame() const { return frames_.back(); }

  // Adds an element after the worldbody: equalities, excluded contacts.
  void tail(std::string_view element);
  void asset(std::string_view element) { assets_ += element; }

  scene::ModelSource model() const;

 private:
  void write_geom(std::string_view type, std::string_view place, std::string_view material,
                  const GeomOptions& options);

  std::string name_, assets_, world_, tail_;
  std::map<std::string, std::string> files_;
  std::vector<Pose> frames_{Pose{}};  // of the open bodies
};

}  // namespace mjsense::tasks::scenes
