// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace mjsense::tasks {

// kInOrOn: any receptacle. kNextTo: next to any object. kColor: the receptacle of the given color
// among several of one kind. kPacking: into a box.
enum class PlaceKind { kInOrOn, kNextTo, kColor, kPacking };

}  // namespace mjsense::tasks
