// SPDX-License-Identifier: Apache-2.0
#pragma once
// Writer for houses with several rooms, on top of RoomWriter: geoms in nested frames, walls with
// openings, windows.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/scenes/generators/room_writer.h"

namespace mjsense::scenes {

class BuildingWriter {
 public:
  explicit BuildingWriter(RoomWriter& text) : text_(text) {}
  RoomWriter& text() { return text_; }

  // Solid geoms collide, others are visual only. Axes are those of the innermost Local.
  void box(Vec3 center, Vec3 half, std::string_view material, bool solid = true,
           std::string_view more = "");
  void cylinder(Vec3 center, double radius, double half_height, std::string_view material,
                bool solid = true, std::string_view more = "");
  void ellipsoid(Vec3 center, Vec3 half, std::string_view material, Quat turned = {});
  void capsule(Vec3 from, Vec3 to, double radius, std::string_view material, bool solid = true,
               std::string_view more = "");
  // A light below a ceiling that shines down; half as bright at `reach` m.
  void lamp(std::string_view name, Vec3 at, double brightness, double reach);

  // RAII: geoms written during its lifetime belong to a static body that is rotated about the
  // vertical axis by `yaw` (rad). `name` may be empty.
  class Local {
   public:
    Local(BuildingWriter& building, std::string_view name, Vec3 at, double yaw);
    ~Local();
    Local(const Local&) = delete;
    Local& operator=(const Local&) = delete;

   private:
    BuildingWriter& building_;
    Pose before_;
  };
  // Pose of the innermost Local in the model frame.
  const Pose& frame() const { return frame_; }

 private:
  RoomWriter& text_;
  Pose frame_;
};

// An opening in a wall: extent along the wall from its start, and heights, m.
struct Opening {
  double from = 0, to = 0;
  double bottom = 0, top = 2.1;
};

struct WallFinish {
  std::string material = "wall", skirting = "skirting";
  double thickness = 0.12, height = 2.6;  // m
};

// A straight wall on the floor; `from` and `to` are on its centre line. It has a skirting board on
// both sides, except where an opening reaches the floor. The sides of its openings are lined.
void write_wall(BuildingWriter& out, Vec3 from, Vec3 to, std::vector<Opening> openings,
                const WallFinish& look);
// A window in an opening of a wall: frame, bars and a bright pane. `at`: centre of the opening, on
// the floor. The wall runs along the x axis rotated by `yaw`. Uses the materials "window_pane" and
// "skirting".
void write_window(BuildingWriter& out, Vec3 at, double yaw, double width, double bottom, double top,
                  double thickness);

}  // namespace mjsense::scenes
