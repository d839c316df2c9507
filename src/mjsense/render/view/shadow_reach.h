// SPDX-License-Identifier: Apache-2.0
#pragma once
// What may cast a shadow into an image stands between a light and what the image shows: the rest of
// a large scene is passed by there, too.

namespace mjsense {

class Appearance;
class Frustum;
class RayWorld;

// Widens the frustum until all that may cast a shadow into it is inside. The world must have no
// skins, whose boxes nobody keeps.
void reach_lights(const RayWorld& world, const Appearance& appearance, Frustum& frustum);

}  // namespace mjsense
