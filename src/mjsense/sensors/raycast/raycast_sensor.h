// SPDX-License-Identifier: Apache-2.0
#pragma once
// The sensor that RayCastSensorCfg builds, and the base of sensors that cast rays.

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/debug_shapes.h"
#include "mjsense/rays/packet.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/sensors/raycast/pose_history.h"
#include "mjsense/sensors/raycast/ray_bundle.h"
#include "mjsense/sensors/raycast/raycast_sensor_cfg.h"

namespace mjsense::sensors {

class RayCastSensor : public Sensor {
 public:
  explicit RayCastSensor(const RayCastSensorCfg& cfg);
  ~RayCastSensor() override;

  std::string_view kind() const override { return "raycast"; }
  Stage stage() const override { return Stage::kCast; }
  mjtStage needs() const override { return mjSTAGE_POS; }
  void initialize(const SensorInit& init) override;
  bool wants_substep() const override { return !history_.empty(); }
  void substep(const World& world) override;
  void compute(const World& world) override;
  void cast(const CastContext& context) override;
  void reset(const World& world) override;
  bool debug_vis() const override { return cfg_.debug_vis; }
  void draw(const World& world, DebugShapes& shapes) override;

  const RayCastSensorCfg& cfg() const { return cfg_; }
  int num_frames() const { return static_cast<int>(frames_.size()); }
  int num_rays_per_frame() const { return bundles_.front().num_rays(); }
  int num_rays() const { return num_frames() * num_rays_per_frame(); }
  // Local rays of one frame, [n]; all of them if the sensor casts its pattern in parts.
  const RayPattern& pattern() const { return pattern_; }
  // Ray r of a world in its current state, for drawing. Rays with different times are treated as if
  // they were cast now.
  struct WorldRay {
    std::array<double, 3> origin, direction;  // m, world; unit
  };
  WorldRay world_ray(int world, int r) const;
  // The frame's pose and the alignment of its rays, as of the last compute().
  const FramePose& frame_pose(int world, int frame) const {
    return poses_[world * num_frames() + frame];
  }

 protected:
  // A pattern may be cast in parts of equal size, one after the other; part() is the index of the
  // one to cast.
  virtual int num_parts() const { return 1; }
  virtual int part(const World& /*world*/) const { return 0; }
  // The rays of one frame, for the configured pattern.
  virtual RayPattern build_pattern(const mjModel* model) const;
  // Called when one packet of this world and frame has been traced. Lane i is ray bundle.rays(p)[i]
  // of the frame, or no ray if that is < 0. Lanes whose hit does not count have geom -1. Runs on
  // any thread.
  virtual void traced(const rays::RayScene& rays, int world, int frame, const RayBundle& bundle,
                      int p, const rays::RayPacket& packet, const rays::HitPacket& hits);
  // Called when all rays of a world have been traced. Worlds run in parallel, each on one thread.
  virtual void finish(const rays::RayScene& rays, int world, rays::RayScratch& scratch);
  virtual bool wants_finish() const { return false; }
  std::string context() const;
  Field& add(std::string_view name, Shape shape, std::string frame, double low, double high,
             int num_worlds);
  // Makes ray r of this world a miss. The caller sets hit_pos_w.
  void forget(int world, int r);
  // The geoms that rays of this frame can hit.
  rays::RayFilter filter(int frame) const;

  RayCastSensorCfg cfg_;
  // True if exclude_parent_body also applies to a frame on the world body.
  bool exclude_world_ = true;
  Field *distances_ = nullptr, *hit_pos_ = nullptr, *normals_ = nullptr, *frame_pos_ = nullptr,
        *frame_quat_ = nullptr, *pos_ = nullptr, *quat_ = nullptr, *geom_id_ = nullptr,
        *body_id_ = nullptr, *material_id_ = nullptr;

 private:
  // Outputs of a frame's rays; ids may be null.
  struct Outputs {
    float *distances, *hit_pos, *normals;
    int *geoms, *bodies, *materials;
  };
  Outputs outputs(int world, int frame);
  static void write(const RayBundle& bundle, int p, const rays::HitPacket& hits,
                    const rays::RayOutputs& rows, const Outputs& out);
  void remember(const World& world);
  // Like RayScene::place(), but each ray has the frame's pose at its own time.
  void packet_to_world(const rays::RayScene& rays, int world, int frame, int p,
                       rays::RayPacket& out) const;
  void place_timed(int world, int frame, int p, float reach, rays::RayPacket& out) const;
  void trace_packets(const rays::RayScene& rays, int world, int frame, int begin, int end,
                     rays::RayScratch& scratch);
  RayAlignment alignment_ = RayAlignment::kBase;
  rays::RayFilter filter_;
  RayPattern pattern_;
  std::vector<RayBundle> bundles_;  // one per part
  std::vector<int> parts_;          // [B] part to cast now
  std::vector<double> moments_;     // [B] s, time of the last compute()
  // Of frames [B, F]; empty unless rays have different times.
  PoseHistory history_;
  std::vector<RayFrame> frames_;
  std::vector<FramePose> poses_;           // [B, F]
  std::vector<rays::RayScratch> scratch_;  // one per thread
};

}  // namespace mjsense::sensors
