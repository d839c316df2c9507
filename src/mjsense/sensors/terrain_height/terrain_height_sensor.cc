// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/terrain_height/terrain_height_sensor.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "mjsense/core/fields/sensor_fields.h"
#include "mjsense/sensors/raycast/raycast_data.h"

namespace mjsense::sensors {

std::unique_ptr<Sensor> TerrainHeightSensorCfg::build() const {
  return std::make_unique<TerrainHeightSensor>(*this);
}

SensorKind terrain_height_kind() { return sensor_kind<TerrainHeightSensorCfg>(&kRayCastData); }

TerrainHeightSensor::TerrainHeightSensor(const TerrainHeightSensorCfg& cfg)
    : RayCastSensor(cfg), reduction_(cfg.reduction) {}

void TerrainHeightSensor::initialize(const SensorInit& init) {
  RayCastSensor::initialize(init);
  const Shape shape = reduction_ == HeightReduction::kNone
                          ? Shape{num_frames(), num_rays_per_frame()}
                          : Shape{num_frames()};
  heights_ = &add_field("heights", kRayCastData.spec("heights", shape, "world"), init.num_worlds);
}

void TerrainHeightSensor::finish(const rays::RayScene& rays, int world, rays::RayScratch& scratch) {
  const int n = num_rays_per_frame();
  const float none = static_cast<float>(cfg_.max_distance);
  const float* distance = distances_->data.row<float>(world).data();
  const float* hit = hit_pos_->data.row<float>(world).data();
  const float* normal = normals_->data.row<float>(world).data();
  float* out = heights_->data.row<float>(world).data();
  for (int f = 0; f < num_frames(); ++f) {
    const double z = frame_pose(world, f).pos[2];
    const int first = f * n;
    const bool any =
        std::any_of(distance + first, distance + first + n, [](float t) { return t >= 0; });
    const float missing = any ? none : height_without_hits(rays, world, f, scratch);
    float minimum = 0, maximum = 0;
    double sum = 0;
    for (int i = 0; i < n; ++i) {
      const int r = first + i;
      float h = missing;
      if (distance[r] >= 0)
        h = normal[3 * r + 2] < 0 ? 0.0f : static_cast<float>(z - hit[3 * r + 2]);
      if (reduction_ == HeightReduction::kNone) out[r] = h;
      minimum = i == 0 ? h : std::min(minimum, h);
      maximum = i == 0 ? h : std::max(maximum, h);
      sum += h;
    }
    if (reduction_ == HeightReduction::kMin) out[f] = minimum;
    if (reduction_ == HeightReduction::kMax) out[f] = maximum;
    if (reduction_ == HeightReduction::kMean) out[f] = static_cast<float>(sum / n);
  }
}

// Casts two rays straight down without a limit: from the frame, and from max_distance above it. The
// first one is used if it hits, otherwise the second one.
float TerrainHeightSensor::height_without_hits(const rays::RayScene& rays, int world, int frame,
                                               rays::RayScratch& scratch) const {
  const FramePose& pose = frame_pose(world, frame);
  double ground = 0;
  rays::RayPacket down{};
  rays::HitPacket hits;
  for (int i = 0; i < rays::kPacket; ++i) {
    down.d[2][i] = -1.0f;
    down.tmax[i] = i < 2 ? rays::kNoHit : -1.0f;
  }
  down.o[2][1] = static_cast<float>(cfg_.max_distance);
  std::copy_n(pose.pos, 3, down.origin);
  rays.trace(world, filter(frame), down, hits, scratch);
  for (int i = 1; i >= 0; --i)
    if (hits.geom[i] >= 0) ground = pose.pos[2] + (down.o[2][i] - hits.t[i]);
  return static_cast<float>(std::clamp(pose.pos[2] - ground, 0.0, cfg_.max_distance));
}

}  // namespace mjsense::sensors
