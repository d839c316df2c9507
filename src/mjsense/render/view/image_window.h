// SPDX-License-Identifier: Apache-2.0
#pragma once
// The part of an image that a geom may cover.

#include <limits>

#include "mjsense/render/view/view.h"

namespace mjsense::render {

// With multisampling, pixels near the window of a geom are sampled more than once if the window is
// not larger than this, relative to the width of a pixel, in one direction: the geom may be between
// the centres of pixels.
inline constexpr float kThin = 2.5f;

inline constexpr float kEndless = std::numeric_limits<float>::infinity();

// Sets center, radius, window and nearest of `g` from its pose and box. Returns false if no point
// of it can be in the image of view.grid between view.near and view.far.
bool find_window(const View& view, ViewGeom& g);

// Corners [8, 3] of g.box, camera frame, m; g.center must be set. Two corners whose indices differ
// in one bit share an edge.
void box_corners(const ViewGeom& g, float (*corners)[3]);

}  // namespace mjsense::render
