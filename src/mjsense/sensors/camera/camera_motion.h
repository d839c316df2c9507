// SPDX-License-Identifier: Apache-2.0
#pragma once
// The scene during an exposure of an image sensor: motion blur and rolling shutter, from the positions that
// a world had after its last physics steps. Row y of H is exposed from end(y) - exposure_time to
//
//   end(y) = time - readout_time (H - 1 - y) / H
//
// and is the mean of n instants, the middles of n equal parts. The instants of all rows are on one grid: instant i
// shows the scene at time - i step - exposure_time / 2 n, and row y is the mean of instants [k, k + n) with
// k = round((time - end(y)) / step).
//
//   n = samples, or fewer for short exposures, so that the rows of an image end at no more than kMaxEnds times
//   step = exposure_time / n, or readout_time / kMaxEnds if the exposure is shorter, which then is an instant
//
// Between two known times positions are interpolated along the joints; before the first one they are as
// then. If nothing has moved, the image has one instant: the present.

#include <mujoco/mujoco.h>

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "mjsense/core/sensor.h"
#include "mjsense/rays/ray_world.h"
#include "mjsense/render/view/markers.h"
#include "mjsense/sensors/camera/camera_sensor_cfg.h"

namespace mjsense::sensors {

class CameraMotion {
 public:
  static constexpr int kMaxEnds = 64;
  struct Rows {
    int first = 0, last = 0;  // [first, last)
  };
  struct Scene {
    const rays::RayWorld& state;
    std::span<const render::Marker> markers;
  };

  // Throws ValueError with `context` if too many positions would have to be kept.
  CameraMotion(const mjModel* model, const CameraSensorCfg& cfg, const ImagerCfg& imager,
               const render::MarkerOptions& markers, int num_worlds, int threads,
               const std::string& context);

  void clear(int world) { worlds_[world].used = 0; }
  // Adds the present positions. They replace those of the same time or later.
  void remember(const World& world);

  // Chooses the instants of an image of the newest positions, and returns their number.
  int plan(const CastContext& context, int world, double exposure_time);
  int instants(int world) const { return worlds_[world].instants; }
  // Rows of pixels that instant `i` is part of. They move down as `i` decreases.
  Rows rows(int world, int i) const;
  // The scene at instant `i`. Only one thread per world may call it at a time.
  Scene at(int world, int i, int thread);

  // [H, W, 3]: the radiance of the last instant that was rendered.
  float* image(int world) { return worlds_[world].image.data(); }
  // Rows of pixels that the last instant was part of.
  Rows rendered(int world) const { return worlds_[world].rendered; }
  void keep(int world, int i) { worlds_[world].rendered = rows(world, i); }
  // Adds the radiance of instant `i` in rows of pixels [first, last) to `mean` [H, W, 3].
  void add(int world, int i, int first, int last, float* mean) const;

 private:
  struct PerWorld {
    std::vector<double> times;      // [capacity] s, a ring
    std::vector<mjtNum> positions;  // [capacity, size_]
    int newest = 0, used = 0;
    int instants = 1, count = 1;  // of the image; of a row
    double step = 0, latest = 0;  // s, between instants; from instant 0 to the newest positions
    mjModel model;                // of this world, during a cast; owns nothing
    std::vector<float> image;
    Rows rendered;
  };
  struct Delete {
    void operator()(mjData* data) const { mj_deleteData(data); }
  };
  int slot(const PerWorld& w, int age) const {  // age 0: the newest
    return (w.newest - age + capacity_) % capacity_;
  }
  const mjtNum* positions(const PerWorld& w, int age) const {
    return w.positions.data() + static_cast<std::size_t>(slot(w, age)) * size_;
  }
  bool moves(const PerWorld& w, double span) const;  // in the last `span` seconds
  int first_instant(const PerWorld& w, int row) const;
  void place(const PerWorld& w, double time, mjData* data) const;

  const mjModel* model_;
  int width_, height_, samples_, capacity_;
  std::size_t size_;  // of qpos and the poses of mocap bodies
  double readout_;    // s
  std::vector<PerWorld> worlds_;
  std::vector<std::unique_ptr<mjData, Delete>> data_;  // by thread
  // By world; made for the first image in which something moves.
  std::vector<rays::RayWorld> moved_;
  std::vector<render::Markers> markers_;
};

}  // namespace mjsense::sensors
