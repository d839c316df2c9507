// SPDX-License-Identifier: Apache-2.0
#pragma once
// Extends a camera's frustum by shadow casters. Only objects between a light and the visible region
// can cast a shadow into the image; the rest of a large scene is skipped.

namespace mjsense::rays {
class RayWorld;
}  // namespace mjsense::rays

namespace mjsense::render {

class Appearance;
class Frustum;

// Extends the frustum until everything that may cast a shadow into it is inside. The world must
// have no skins, because their bounding boxes are not stored.
// `samples`: ViewOptions::shadow_samples.
void reach_lights(const rays::RayWorld& world, const Appearance& appearance, int samples,
                  Frustum& frustum);

}  // namespace mjsense::render
