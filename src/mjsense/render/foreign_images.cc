// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/foreign_images.h"

#include <algorithm>

#include "mjsense/render/view/camera_model.h"
#include "mjsense/worlds/ordered_apply.h"

namespace mjsense::render {
namespace {

// If there are fewer images per thread than this, images are divided into bands.
constexpr int kImagesPerThread = 4, kBandsPerThread = 8;

ViewOptions view_options(const ForeignImagesOptions& options, const mjModel* m) {
  ViewOptions view;
  view.groups = options.groups;
  view.textures = options.textures;
  view.shadows = options.shadows;
  view.warp = options.look;
  if (options.look.series_4) view.far = static_cast<float>(m->vis.map.zfar * m->stat.extent);
  return view;
}

}  // namespace

ForeignImages::ForeignImages(const worlds::Worlds& worlds, const ForeignImagesOptions& options)
    : options_(options),
      assets_(worlds.model(), true, options.textures || options.look.skybox, options.look),
      appearances_(worlds.size(), Appearance(worlds.model(), kMaxLights, options.look)) {
  const auto geoms = static_cast<int>(ViewBuilder::max_geoms(worlds.model()));
  threads_.reserve(worlds.threads());
  for (int i = 0; i < worlds.threads(); ++i)
    threads_.push_back({ViewBuilder(worlds.model(), assets_, view_options(options, worlds.model())),
                        TileMemory(geoms),
                        {},
                        {}});
}

void ForeignImages::render(worlds::Worlds& worlds, rays::ForeignRays& rays,
                           std::span<const ForeignCamera> cameras, const RowLengths& rows,
                           std::uint32_t background) {
  const int count = static_cast<int>(cameras.size()), images = worlds.size() * count;
  grids_.resize(images);
  rays.update(worlds, [&](const mjModel* m, int w) {
    appearances_[w].copy(m);
    for (int c = 0; c < count; ++c) {
      const ForeignCamera& camera = cameras[c];
      grids_[w * count + c] = camera.grid
                                  ? *camera.grid
                                  : grid_of_camera(m, camera.camera, camera.width, camera.height);
    }
  });
  int tile_rows = 1;
  std::size_t pixels = 0;
  for (const ForeignCamera& camera : cameras) {
    tile_rows = std::max(tile_rows, (camera.height + kTileSize - 1) / kTileSize);
    pixels = std::max(pixels, static_cast<std::size_t>(camera.width) * camera.height);
  }
  for (Thread& thread : threads_) {
    thread.rgb.resize(3 * pixels);
    thread.depth.resize(pixels);
  }
  const int threads = static_cast<int>(threads_.size());
  const bool whole = threads == 1 || images >= kImagesPerThread * threads;
  const int bands =
      whole ? 1 : std::clamp(kBandsPerThread * threads / std::max(images, 1), 1, tile_rows);
  rays.pool().run(images * bands, [&](int item, int thread) {
    const int image = item / bands, band = item % bands;
    const ForeignCamera& camera = cameras[image % count];
    const int all = (camera.height + kTileSize - 1) / kTileSize;
    const int first = band * all / bands, last = (band + 1) * all / bands;
    if (first == last) return;
    Thread& own = threads_[thread];
    const rays::RayCamera& pose = rays.scene().world(image / count).cameras()[camera.camera];
    own.builder.build(rays.scene().world(image / count), rays.scene().shared(),
                      appearances_[image / count], {}, pose.pos, pose.mat, grids_[image]);
    draw(image / count, camera, rows, background, first, last, own);
  });
}

// Draws the rows of tiles [first, last) of the thread's view.
void ForeignImages::draw(int world, const ForeignCamera& camera, const RowLengths& rows,
                         std::uint32_t background, int first, int last, Thread& thread) {
  ImageTargets targets;
  if (camera.rgb) targets.rgb = thread.rgb.data();
  targets.depth = camera.depth ? camera.depth + world * rows.depth : thread.depth.data();
  if (camera.segmentation) targets.segmentation = camera.segmentation + world * rows.segmentation;
  tiles_(thread.builder.view(), targets, first, last, thread.memory.scratch());
  if (!camera.rgb) return;
  std::uint32_t* out = camera.rgb + world * rows.rgb;
  const std::size_t end =
      static_cast<std::size_t>(std::min(last * kTileSize, camera.height)) * camera.width;
  for (std::size_t i = static_cast<std::size_t>(first) * kTileSize * camera.width; i < end; ++i) {
    const std::uint8_t* p = thread.rgb.data() + 3 * i;
    const bool seen = targets.depth[i] > 0 || thread.builder.view().skybox;
    out[i] = seen ? 0xff000000u | p[0] << 16 | p[1] << 8 | p[2] : background;
  }
}

}  // namespace mjsense::render
