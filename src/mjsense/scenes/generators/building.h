// SPDX-License-Identifier: Apache-2.0
#pragma once
// What houses of several rooms are written with, on top of RoomText: pieces that stand in frames of
// their own, walls with openings, windows.

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/scenes/generators/room_text.h"

namespace mjsense {

class Building {
 public:
  explicit Building(RoomText& text) : text_(text) {}
  RoomText& text() { return text_; }

  // Solid pieces touch, others are seen alone. Upright, in the frame of the innermost Local.
  void box(Vec3 center, Vec3 half, std::string_view material, bool solid = true,
           std::string_view more = "");
  void cylinder(Vec3 center, double radius, double half_height, std::string_view material,
                bool solid = true, std::string_view more = "");
  void ellipsoid(Vec3 center, Vec3 half, std::string_view material, Quat turned = {});
  void capsule(Vec3 from, Vec3 to, double radius, std::string_view material, bool solid = true,
               std::string_view more = "");
  // Below a ceiling, shining down; half as bright at `reach` m.
  void lamp(std::string_view name, Vec3 at, double brightness, double reach);

  // What is written while it lives stands in a static body that is turned about the vertical (rad);
  // `name` may be empty.
  class Local {
   public:
    Local(Building& building, std::string_view name, Vec3 at, double yaw);
    ~Local();
    Local(const Local&) = delete;
    Local& operator=(const Local&) = delete;

   private:
    Building& building_;
    Pose before_;
  };
  // Pose of the innermost Local in the model.
  const Pose& frame() const { return frame_; }

 private:
  RoomText& text_;
  Pose frame_;
};

// An opening in a wall, m along it from its start, and its height.
struct Opening {
  double from = 0, to = 0;
  double bottom = 0, top = 2.1;
};

struct WallLook {
  std::string material = "wall", skirting = "skirting";
  double thickness = 0.12, height = 2.6;  // m
};

// A straight wall on the floor between two points of its middle line, with a skirting board on both
// sides except where an opening reaches the floor. Its openings have lined sides.
void write_wall(Building& out, Vec3 from, Vec3 to, std::vector<Opening> openings,
                const WallLook& look);
// A window in a wall that has the opening: frame, bars and a bright pane. `at`: the middle of the
// opening, on the floor; the wall runs along the turned x axis. Materials "window_pane" and
// "skirting".
void write_window(Building& out, Vec3 at, double yaw, double width, double bottom, double top,
                  double thickness);

}  // namespace mjsense
