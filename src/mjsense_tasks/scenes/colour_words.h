// SPDX-License-Identifier: Apache-2.0
#pragma once
// Words for the colours of objects in instructions.

#include <mujoco/mujoco.h>

#include <array>
#include <string_view>

namespace mjsense::tasks::scenes {

inline constexpr std::array<std::string_view, 12> kColourWords{"red",   "orange", "yellow", "green",
                                                               "teal",  "blue",   "purple", "pink",
                                                               "brown", "white",  "black",  "grey"};

// What can be said about the colour of an object. Colours between two words have none.
struct ColourWords {
  int is = -1;          // index in kColourWords of the word that describes it; -1: none does
  unsigned may_be = 0;  // bit i: kColourWords[i] is possible, too
};

// Of one colour, rgb in [0, 1].
ColourWords colour_words(const float* rgb);
// Of a body with its descendants, by the area of its visible geoms: `is` is the word for at least
// 70 % of it, `may_be` has those for at least 10 %. Textures and transparent geoms may have any
// colour.
ColourWords colour_words(const mjModel* model, int body);

}  // namespace mjsense::tasks::scenes
