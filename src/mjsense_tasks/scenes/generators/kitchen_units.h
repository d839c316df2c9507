// SPDX-License-Identifier: Apache-2.0
#pragma once
// Units of a fitted kitchen. The front of each is at x = 0; it extends from y0 to y0 + wide.

#include <string>
#include <string_view>

#include "mjsense/core/rng.h"
#include "mjsense_tasks/scenes/generators/room_writer.h"

namespace mjsense::tasks::scenes {

// Properties shared by the units of one house.
struct KitchenStyle {
  double deep = 0.58;                                               // m, of base units
  double high = 0.90;                                               // m, top of the worktop
  double worktop = 0.035;                                           // m thick
  double plinth = 0.10;                                             // m
  double wall_low = 1.42, wall_high = 2.10, wall_deep = 0.33;       // m, wall cabinets
  double bar_radius = 0.008, bar_length = 0.18, stand_off = 0.045;  // m, handles
  bool round_bar = true;
  // Number of drawers and cabinets written so far.
  int drawers = 0, cabinets = 0;

  double carcass_top() const { return high - worktop; }
};

// A bar handle on two posts, 45 mm in front of x = front, with the axis `along`. Named
// <thing>/handle.
void write_handle(RoomWriter& room, const KitchenStyle& style, std::string_view thing, Vec3 middle,
                  Vec3 along, double length);

void write_drawer_unit(RoomWriter& room, KitchenStyle& style, Rng& rng, double y0, double wide,
                       int drawers);
// A unit below the worktop, with one or two leaves depending on its width.
void write_door_unit(RoomWriter& room, KitchenStyle& style, Rng& rng, double y0, double wide);
void write_wall_cabinet(RoomWriter& room, KitchenStyle& style, Rng& rng, double y0, double wide);
void write_oven_unit(RoomWriter& room, KitchenStyle& style, double y0, double wide);
void write_hood(RoomWriter& room, const KitchenStyle& style, double y0, double wide);
void write_fridge(RoomWriter& room, const KitchenStyle& style, double y0, double wide, double high,
                  bool hinge_at_y0);
void write_microwave(RoomWriter& room, const KitchenStyle& style, double middle);
// Worktop `number` from y0. The second function adds a basin and a tap at its centre.
void write_worktop(RoomWriter& room, const KitchenStyle& style, int number, double y0, double wide);
void write_sink_worktop(RoomWriter& room, const KitchenStyle& style, int number, double y0,
                        double wide);
void write_hob(RoomWriter& room, const KitchenStyle& style, double y0, double wide);

}  // namespace mjsense::tasks::scenes
