// SPDX-License-Identifier: Apache-2.0
#pragma once
// The textures of a material besides its colours, for physically based views: what MuJoCo calls the
// roles of its textures (mjtTextureRole). They are 2D and are placed as the texture of the colours.

#include <mujoco/mujoco.h>

#include <array>

namespace mjsense::render {

// Values are linear and are factors of the material's own; in a map of three equal channels, the
// first counts.
enum TextureMap {
  kOcclusionMap,  // of the light from the surroundings
  kRoughnessMap,
  kMetallicMap,
  kNormalMap,  // 2 rgb - 1: in the directions of u, of the rows upwards, and outwards
  kOpacityMap,
  kEmissiveMap,  // colours, encoded like those of other textures
  kOrmMap,       // occlusion, roughness and metallic as red, green and blue
  kNumTextureMaps
};

// Ids of a material's textures by mjtTextureRole; -1: none.
using TextureIds = std::array<int, mjNTEXROLE>;
inline constexpr TextureIds kNoTextures = [] {
  TextureIds ids{};
  for (int& id : ids) id = -1;
  return ids;
}();
inline TextureIds textures_of(const mjModel* model, int material) {
  TextureIds ids;
  for (int role = 0; role < mjNTEXROLE; ++role)
    ids[role] = model->mat_texid[mjNTEXROLE * material + role];
  return ids;
}
inline int texture_of(const TextureIds& ids, TextureMap map) {
  constexpr int kRoles[kNumTextureMaps] = {
      mjTEXROLE_OCCLUSION, mjTEXROLE_ROUGHNESS, mjTEXROLE_METALLIC, mjTEXROLE_NORMAL,
      mjTEXROLE_OPACITY,   mjTEXROLE_EMISSIVE,  mjTEXROLE_ORM};
  return ids[kRoles[map]];
}

// Throws ValueError for a material whose map is a cube or has too few channels.
void check_texture_maps(const mjModel* model);

}  // namespace mjsense::render
