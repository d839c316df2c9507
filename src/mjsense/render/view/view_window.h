// SPDX-License-Identifier: Apache-2.0
#pragma once
// Where in an image a geom can be.

#include "mjsense/render/view/view.h"

namespace mjsense {

// Fills center, radius, window and nearest of `g`, whose pose and box are known. False: none of it
// can be in the image of view.grid between view.near and view.far.
bool find_window(const View& view, ViewGeom& g);

// The corners [8, 3] of g.box, C, m; g.center is known. Two whose numbers differ in one bit share an
// edge.
void box_corners(const ViewGeom& g, float (*corners)[3]);

}  // namespace mjsense
