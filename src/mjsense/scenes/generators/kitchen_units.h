// SPDX-License-Identifier: Apache-2.0
#pragma once
// The pieces of a fitted kitchen. Each writes itself with its front at x = 0, from y0 to y0 + wide.

#include <string>
#include <string_view>

#include "mjsense/core/rng.h"
#include "mjsense/scenes/generators/room_text.h"

namespace mjsense {

// What the pieces of one house have in common.
struct KitchenStyle {
  double deep = 0.58;                                               // m, of base units
  double high = 0.90;                                               // m, top of the worktop
  double worktop = 0.035;                                           // m thick
  double plinth = 0.10;                                             // m
  double wall_low = 1.42, wall_high = 2.10, wall_deep = 0.33;       // m, wall cabinets
  double bar_radius = 0.008, bar_length = 0.18, stand_off = 0.045;  // m, handles
  bool round_bar = true;
  // How many there are so far.
  int drawers = 0, cabinets = 0;

  double carcass_top() const { return high - worktop; }
};

// A bar on two posts, 45 mm before the front at x = front; `along` is its axis. Named <thing>/handle.
void write_handle(RoomText& room, const KitchenStyle& style, std::string_view thing, Vec3 middle,
                  Vec3 along, double length);

void write_drawer_unit(RoomText& room, KitchenStyle& style, Rng& rng, double y0, double wide,
                       int drawers);
// Below the worktop, one or two leaves by its width.
void write_door_unit(RoomText& room, KitchenStyle& style, Rng& rng, double y0, double wide);
void write_wall_cabinet(RoomText& room, KitchenStyle& style, Rng& rng, double y0, double wide);
void write_oven_unit(RoomText& room, KitchenStyle& style, double y0, double wide);
void write_hood(RoomText& room, const KitchenStyle& style, double y0, double wide);
void write_fridge(RoomText& room, const KitchenStyle& style, double y0, double wide, double high,
                  bool hinge_at_y0);
void write_microwave(RoomText& room, const KitchenStyle& style, double middle);
// Worktop `number` from y0 on; with a basin and a tap in its middle.
void write_worktop(RoomText& room, const KitchenStyle& style, int number, double y0, double wide);
void write_sink_worktop(RoomText& room, const KitchenStyle& style, int number, double y0,
                        double wide);
void write_hob(RoomText& room, const KitchenStyle& style, double y0, double wide);

}  // namespace mjsense
