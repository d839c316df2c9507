// SPDX-License-Identifier: Apache-2.0
#pragma once
// Working memory of CameraSensor::cast().

#include <vector>

#include "mjsense/render/kernels/tile_memory.h"
#include "mjsense/render/path/path_tracer.h"
#include "mjsense/render/view/view_builder.h"
#include "mjsense/sensors/camera/camera_sensor.h"

namespace mjsense::sensors {

// If there are fewer images per thread than this, images are divided into bands.
inline constexpr int kImagesPerThread = 4;

// With few large images, each has a view, whose tiles are divided among the threads. With many small
// ones, each thread has a view.
struct CameraSensor::Workspace {
  std::vector<render::ViewBuilder> builders;
  // By builder: tiles of the fixed layer that must be rendered before the image; null: none.
  std::vector<render::FixedTile*> making;
  std::vector<render::TileMemory> memory;  // by thread
  std::vector<render::PathTracer> paths;   // by builder; empty: images are not path-traced
  render::RenderTiles render = render::best_render_tiles();
};

}  // namespace mjsense::sensors
