// SPDX-License-Identifier: Apache-2.0
#pragma once
// Images of worlds that are shown in the arrays of another program, in that program's form and with
// its light model: those of mujoco_warp.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "mjsense/rays/foreign_rays.h"
#include "mjsense/render/kernels/tile_memory.h"
#include "mjsense/render/view/appearance.h"
#include "mjsense/render/view/view_builder.h"
#include "mjsense/worlds/worlds.h"

namespace mjsense::render {

// One camera's images of all worlds. World w has the image [height, width] at `rgb` + w times the row
// length; null: not requested.
struct ForeignCamera {
  int camera = 0, width = 0, height = 0;
  std::optional<PixelGrid> grid;         // otherwise of the camera of each world's model
  std::uint32_t* rgb = nullptr;          // 0xffrrggbb
  float* depth = nullptr;                // planar, m; 0 where nothing is seen
  std::int32_t* segmentation = nullptr;  // (id, mjtObj); -1 where nothing is seen
};

struct ForeignImagesOptions {
  unsigned groups = 0x7;  // bit g: geoms of group g are drawn
  bool textures = true, shadows = false;
  WarpLook look;

  bool operator==(const ForeignImagesOptions&) const = default;
};

class ForeignImages {
 public:
  // Numbers from one world's row to the next.
  struct RowLengths {
    std::size_t rgb = 0, depth = 0, segmentation = 0;
  };

  ForeignImages(const worlds::Worlds& worlds, const ForeignImagesOptions& options);
  // Draws the worlds, whose poses are current. `background`: the rgb where nothing is seen, without a
  // skybox.
  void render(worlds::Worlds& worlds, rays::ForeignRays& rays,
              std::span<const ForeignCamera> cameras, const RowLengths& rows,
              std::uint32_t background);

 private:
  struct Thread {
    ViewBuilder builder;
    TileMemory memory;
    std::vector<std::uint8_t> rgb;  // of an image
    std::vector<float> depth;
  };
  void draw(int world, const ForeignCamera& camera, const RowLengths& rows,
            std::uint32_t background, int first, int last, Thread& thread);

  ForeignImagesOptions options_;
  SurfaceAssets assets_;
  std::vector<Appearance> appearances_;  // by world
  std::vector<PixelGrid> grids_;         // by world and camera of the call
  std::vector<Thread> threads_;
  RenderTiles tiles_ = best_render_tiles();
};

}  // namespace mjsense::render
