// SPDX-License-Identifier: Apache-2.0
#pragma once
// TerrainHeightSensor: how high frames (feet, a base) are above what lies below them. A
// RayCastSensor with one more field:
//   heights  float32 [B, F] m (reduction min, max, mean) or [B, F, n] m (none)
//
// A ray that hits gives frame z - hit z; on a surface's underside (the frame is inside something)
// 0; a ray that misses gives max_distance. Where all rays of a frame miss, the ground straight
// below decides, however far, else the one above (the frame lies under it: 0): the difference of
// heights, within [0, max_distance]. Only where there is no ground at all, the world's z = 0 stands
// for it.

#include <memory>
#include <string>

#include "mjsense/sensors/raycast/raycast_sensor.h"

namespace mjsense {

enum class HeightReduction { kMin, kMax, kMean, kNone };
template <>
inline constexpr std::array<std::string_view, 4> kWords<HeightReduction>{"min", "max", "mean",
                                                                         "none"};

struct TerrainHeightSensorCfg : RayCastSensorCfg {
  Word<HeightReduction> reduction;

  std::unique_ptr<Sensor> build() const override;
};
template <class V>
void visit_fields(V& v, TerrainHeightSensorCfg& c) {
  v.object("TerrainHeightSensorCfg",
           "Height of frames above the surface below them. ``data.heights`` is float32 ``[B, F]``, "
           "or ``[B, F, n]`` without reduction.",
           "terrain_height");
  v.extends(static_cast<RayCastSensorCfg&>(c));
  v("reduction", c.reduction, "Reduction over the rays of a frame.");
}

class TerrainHeightSensor : public RayCastSensor {
 public:
  explicit TerrainHeightSensor(const TerrainHeightSensorCfg& cfg);
  std::string_view kind() const override { return "terrain_height"; }
  void initialize(const SensorInit& init) override;

 protected:
  bool wants_finish() const override { return true; }
  void finish(const RayScene& rays, int world, RayScratch& scratch) override;

 private:
  float height_without_hits(const RayScene& rays, int world, int frame, RayScratch& scratch) const;

  HeightReduction reduction_;
  Field* heights_ = nullptr;
};

}  // namespace mjsense
