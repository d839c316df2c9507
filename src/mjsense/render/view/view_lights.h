// SPDX-License-Identifier: Apache-2.0
#pragma once
// The lights of a view, in the camera's frame.

#include "mjsense/render/view/appearance.h"
#include "mjsense/render/view/drawn_scene.h"
#include "mjsense/render/view/view.h"
#include "mjsense/render/view/view_options.h"

namespace mjsense::rays {
class RayWorld;
}  // namespace mjsense::rays

namespace mjsense::render {

// Sets the lights of `view`. position, rotation: X_WC, row-major. `headlight`: direction of the headlight,
// world frame; null: the camera's viewing direction.
void set_lights(const rays::RayWorld& world, const Appearance& appearance,
                const ViewOptions& options, const double position[3], const double rotation[9],
                const double* headlight, View& view);
void set_lights(const DrawnScene& scene, const double position[3], const double rotation[9],
                View& view);

}  // namespace mjsense::render
