// SPDX-License-Identifier: Apache-2.0
#pragma once
// Textures with their mipmaps, as the kernels read them. Level 0 of a mipmap is the texture's own
// image; each further level has half of its width and height, down to 1 x 1.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>

namespace mjsense::render {

// Owner of a texture whose levels are stored when a kernel first needs them. Such a texture belongs to
// one thread.
class TextureOnDemand {
 public:
  // Changes the texture so that `level` and all coarser ones are stored.
  virtual void add_level(int level) = 0;

 protected:
  ~TextureOnDemand() = default;
};

// A mipmap of RGBA8 images in one array: the finest level first, row 0 first. A cube map has its six
// faces (+x -x +y -y +z -z) one after another in each level. Each row has one extra texel at its end,
// because kernels read neighbours in pairs: the row's first texel in a 2D texture, which repeats, and
// its last texel in a cube's face. Sizes and offsets are arrays by level, for gather instructions.
struct Texture {
  static constexpr int kMaxLevels = 15;
  bool cube = false;
  bool alpha = false;       // it has an alpha channel
  bool grey = false;        // it has one channel and is not used for colours
  bool linear = false;      // its colours were decoded from sRGB when they were stored
  bool same_faces = false;  // a cube map with one image for all faces, which is stored once
  int levels = 0;           // of the mipmap; 0: the texture cannot be drawn
  int finest = 0;           // the finest level that is stored
  // The linear colour of its first image, as the mean of at most 32 x 32 texels.
  float mean[3] = {1, 1, 1};
  TextureOnDemand* on_demand = nullptr;   // stores finer levels; null if all are stored
  const std::uint32_t* texels = nullptr;  // R in the lowest byte
  float width[kMaxLevels] = {}, height[kMaxLevels] = {};  // by level, texels
  int offset[kMaxLevels] = {};  // by level: index of its first texel, if the level is stored
};

// A texture with its memory.
struct StoredTexture {
  Texture texture;
  std::unique_ptr<std::uint32_t[]> texels;
};

// The model's texture `id` with the sizes of its levels, but without texels.
Texture texture_levels(const mjModel* model, int id);

// The model's texture `id` with the levels from `finest` to the coarsest, shared by all models of the
// process that have an equal texture. The finer levels use no memory.
std::shared_ptr<const StoredTexture> stored_texture(const mjModel* model, int id, int finest = 0);

}  // namespace mjsense::render
