// SPDX-License-Identifier: Apache-2.0
// The images of CameraSensor: views, rendering on several threads, and the fields that follow from them.
#include <algorithm>
#include <span>

#include "mjsense/core/system/thread_pool.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/sensors/camera/camera_sensor.h"
#include "mjsense/sensors/camera/camera_workspace.h"
#include "mjsense/sensors/camera/depth_noise.h"

namespace mjsense::sensors {
namespace {

// There are enough bands for all threads to finish at about the same time.
constexpr int kBandsPerThread = 16;

}  // namespace

// Targets in the fields of this world; buffers of this thread for those that only derive() needs.
render::ImageTargets CameraSensor::targets(int world, int thread) {
  render::ImageTargets t;
  t.samples = cfg_.samples;
  if (instant_ >= 0) {
    t.hdr = motion_->image(world);
    return t;
  }
  if (response_) {
    if (!motion_) t.hdr = response_->radiance(world);
  } else if (rgb_) {
    t.rgb = rgb_->data.row<std::uint8_t>(world).data();
  }
  if (hdr_) t.hdr = hdr_->data.row<float>(world).data();
  if (depth_) t.depth = depth_->data.row<float>(world).data();
  if (segmentation_) t.segmentation = segmentation_->data.row<std::int32_t>(world).data();
  if (normals_) t.normals = normals_->data.row<float>(world).data();
  if (points_) t.points = points_->data.row<float>(world).data();
  t.depth_along_ray = cfg_.depth_kind == DepthKind::kRay;
  if (optical_flow_) optical_flow_->complete(t, thread);
  if (owners_) owners_->complete(t, thread);
  return t;
}

const render::View& CameraSensor::build_view(const CastContext& context, int world,
                                             render::ViewBuilder& builder, int thread) const {
  const PerWorld& w = worlds_[world];
  const bool present = instant_ < 0 || motion_->instants(world) == 1;
  const CameraMotion::Scene scene =
      present ? CameraMotion::Scene{context.rays->world(world), w.markers.all()}
              : motion_->at(world, instant_, thread);
  const rays::RayCamera& camera = scene.state.cameras()[camera_];
  const render::View& view = builder.build(scene.state, context.rays->shared(), w.appearance,
                                           scene.markers, camera.pos, camera.mat, w.grid);
  if (fixed_layers_) builder.use_fixed(fixed_layers_->find(world, view));
  if (!workspace_->paths.empty())
    workspace_->paths[&builder - workspace_->builders.data()].build(view);
  return view;
}

void CameraSensor::make_fixed(const render::View& view, render::FixedTile* tiles, int first,
                              int last, int thread) {
  render::ImageTargets targets;
  targets.fixed_tiles = tiles;
  workspace_->render(view, targets, first, last, workspace_->memory[thread].scratch());
}

void CameraSensor::settle_common_layer(const CastContext& context, int world, int tile_rows) {
  const render::View& view = build_view(context, world, workspace_->builders[0], 0);
  render::FixedTile* tiles = fixed_layers_->settle_common(world, view);
  if (!tiles) return;
  context.pool.run(tile_rows,
                   [&](int row, int thread) { make_fixed(view, tiles, row, row + 1, thread); });
}

render::FixedTile* CameraSensor::settle_layer(int world, const render::View& view) {
  return fixed_layers_ && !view.fixed_tiles ? fixed_layers_->settle(world, view) : nullptr;
}

void CameraSensor::cast(const CastContext& context) {
  due_.clear();
  for (int id : context.ids)
    if (worlds_[id].due) due_.push_back(id);
  if (motion_) expose(context);
  // rgb, intrinsics and pose: an exposed image has no others
  if (!motion_ || fields().size() > 3) render_images(context, due_);
  if (response_) develop(context);
  if (!clean_.empty()) add_noise(context);
  for (int id : due_) worlds_[id].due = false;
}

void CameraSensor::develop(const CastContext& context) {
  context.pool.run(static_cast<int>(due_.size()), [&](int item, int) {
    const int id = due_[item];
    const PerWorld& w = worlds_[id];
    response_->develop(
        id, w.time, w.grid, w.colour_rng,
        hdr_ && !motion_ ? hdr_->data.row<float>(id).data() : response_->radiance(id),
        rgb_->data.row<std::uint8_t>(id).data());
  });
}

void CameraSensor::add_noise(const CastContext& context) {
  const StereoCamera camera = stereo_preset(cfg_.depth_noise);
  context.pool.run(static_cast<int>(due_.size()), [&](int item, int thread) {
    const int id = due_[item];
    add_stereo_noise(camera, depth_->data.row<float>(id), cfg_.width, 1.0 / worlds_[id].grid.dx,
                     worlds_[id].rng, clean_[thread]);
  });
}

void CameraSensor::render_rows(int slot, int world, int first, int last, int thread) {
  const render::View& view = workspace_->builders[slot].view();
  render::ImageTargets image = targets(world, thread);
  const int height = cfg_.height, size = render::kTileSize;
  if (instant_ >= 0) {
    const CameraMotion::Rows rows = motion_->rows(world, instant_);
    first = std::max(first, rows.first / size);
    last = std::min(last, (rows.last + size - 1) / size);
    if (first >= last) return;
  }
  if (!workspace_->paths.empty() && (image.rgb || image.hdr)) {
    workspace_->paths[slot].render(first, last, image);
    image.rgb = nullptr;
    image.hdr = nullptr;
  }
  if (render::ChangedTiles* tiles = changed_tiles(world)) {
    image.changed_tiles = tiles->changed();
    image.receivers = tiles->receivers();
  }
  if (instant_ < 0) {
    workspace_->render(view, image, first, last, workspace_->memory[thread].scratch());
    derive(world, image, first * size, std::min(last * size, height));
    return;
  }
  // Only rows of tiles that show the instant before have other tiles that are kept.
  const CameraMotion::Rows before = motion_->rendered(world);
  for (int row = first; row < last && image.hdr; ++row) {
    render::ImageTargets part = image;
    if (before.first >= (row + 1) * size || before.last <= row * size) part.changed_tiles = nullptr;
    workspace_->render(view, part, row, row + 1, workspace_->memory[thread].scratch());
  }
  motion_->add(world, instant_, first * size, last * size, response_->radiance(world));
}

// Computes the fields that follow from depth and ids, for pixel rows [first, last).
void CameraSensor::derive(int world, const render::ImageTargets& image, int first, int last) {
  if (optical_flow_)
    optical_flow_->write(world, image, first, last, flow_->data.row<float>(world).data());
  if (owners_) {
    const auto row = [&](Field* field) {
      return field ? field->data.row<std::int32_t>(world).data() : nullptr;
    };
    owners_->write(image, first * cfg_.width, last * cfg_.width, row(bodies_), row(entities_));
  }
}

void CameraSensor::expose(const CastContext& context) {
  int instants = 0;
  for (int id : due_)
    instants = std::max(instants,
                        motion_->plan(context, id, response_->exposure_time(id, worlds_[id].time)));
  for (instant_ = instants - 1; instant_ >= 0; --instant_) {
    exposed_.clear();
    for (int id : due_)
      if (motion_->instants(id) > instant_) exposed_.push_back(id);
    render_images(context, exposed_);
    for (int id : exposed_) motion_->keep(id, instant_);
  }
}

void CameraSensor::render_images(const CastContext& context, std::span<const int> images) {
  if (gl_) {
    for (int id : images) {
      const render::ImageTargets image = targets(id, 0);
      gl_->render(id, context.rays->world(id), worlds_[id].markers.geoms(), image);
      derive(id, image, 0, cfg_.height);
    }
    return;
  }
  const int count = static_cast<int>(images.size()), threads = context.pool.size();
  if (count == 0) return;
  const int tile_rows = (cfg_.height + render::kTileSize - 1) / render::kTileSize;
  if (fixed_layers_) settle_common_layer(context, images[0], tile_rows);
  if (threads == 1 || count >= kImagesPerThread * threads) {
    render_whole(context, images, tile_rows);
  } else {
    render_in_bands(context, images, tile_rows);
  }
}

// Each thread renders whole images.
void CameraSensor::render_whole(const CastContext& context, std::span<const int> images,
                                int tile_rows) {
  context.pool.run(static_cast<int>(images.size()), [&](int item, int thread) {
    render::ViewBuilder& builder = workspace_->builders[thread];
    const render::View& view = build_view(context, images[item], builder, thread);
    render::ChangedTiles* changed = changed_tiles(images[item]);
    if (changed) changed->compare(view);
    if (render::FixedTile* tiles = settle_layer(images[item], view)) {
      make_fixed(view, tiles, 0, tile_rows, thread);
      builder.use_fixed(tiles);
    }
    render_rows(thread, images[item], 0, tile_rows, thread);
    if (changed) changed->keep(view);
  });
}

void CameraSensor::render_in_bands(const CastContext& context, std::span<const int> images,
                                   int tile_rows) {
  Workspace& work = *workspace_;
  const int count = static_cast<int>(images.size());
  const int bands = std::clamp(kBandsPerThread * context.pool.size() / count, 1, tile_rows);
  // body(image, first row of tiles, row after the last, thread)
  const auto run_bands = [&](auto body) {
    context.pool.run(count * bands, [&](int item, int thread) {
      const int image = item / bands, band = item % bands;
      body(image, band * tile_rows / bands, (band + 1) * tile_rows / bands, thread);
    });
  };
  context.pool.run(count, [&](int item, int thread) {
    const render::View& view = build_view(context, images[item], work.builders[item], thread);
    if (render::ChangedTiles* changed = changed_tiles(images[item])) changed->compare(view);
    work.making[item] = settle_layer(images[item], view);
  });
  const auto making = std::span(work.making).first(count);
  if (std::ranges::any_of(making, [](render::FixedTile* tiles) { return tiles != nullptr; })) {
    run_bands([&](int image, int first, int last, int thread) {
      if (making[image])
        make_fixed(work.builders[image].view(), making[image], first, last, thread);
    });
    for (int i = 0; i < count; ++i)
      if (making[i]) work.builders[i].use_fixed(making[i]);
  }
  run_bands([&](int image, int first, int last, int thread) {
    render_rows(image, images[image], first, last, thread);
  });
  if (!changed_tiles(images[0])) return;
  context.pool.run(
      count, [&](int item, int) { changed_tiles(images[item])->keep(work.builders[item].view()); });
}

}  // namespace mjsense::sensors
