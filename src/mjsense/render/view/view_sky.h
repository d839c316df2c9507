// SPDX-License-Identifier: Apache-2.0
#pragma once
// The skybox, haze and fog of a view.

#include "mjsense/render/view/appearance.h"
#include "mjsense/render/view/view.h"

namespace mjsense::rays {
struct RayGeom;
}  // namespace mjsense::rays

namespace mjsense::render {

// Whether the plane is infinite. The first infinite plane of a scene has the haze.
bool is_endless(const rays::RayGeom& geom);

// `plane`: null if there is no haze. position, rotation: X_WC, row-major.
void set_sky(const rays::RayGeom* plane, const Sky& sky, const double position[3],
             const double rotation[9], View& view);

void set_fog(const Fog& fog, View& view);

}  // namespace mjsense::render
