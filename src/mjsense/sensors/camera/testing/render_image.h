// SPDX-License-Identifier: Apache-2.0
#pragma once
// For tests of cameras: one image of one world.

#include <cmath>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/rays/testing/scene.h"
#include "mjsense/sensors/camera/camera_sensor.h"

namespace mjsense::testing {

// Returns a camera with the image of the current state of `m`; `rays` must be up to date.
inline std::unique_ptr<Sensor> shoot(const sensors::CameraSensorCfg& cfg, const TestModel& m,
                                     rays::RayScene& rays) {
  std::unique_ptr<Sensor> camera = cfg.build();
  SensorInit init;
  init.model = m.model;
  camera->initialize(init);
  camera->compute(m.world());
  ThreadPool pool(1);
  const int world = 0;
  camera->cast({&rays, {&world, 1}, pool});
  return camera;
}

// The same image by rays and by MuJoCo's own renderer.
struct Pair {
  // `opengl` is null if that renderer is not available; `missing` says why.
  std::unique_ptr<Sensor> rays, opengl;
  std::string missing;

  Pair(sensors::CameraSensorCfg cfg, const TestModel& m) {
    rays::RayScene scene(m.model, 1);
    scene.update(m.world());
    rays = shoot(cfg, m, scene);
    cfg.renderer = "opengl";
    try {
      opengl = shoot(cfg, m, scene);
    } catch (const RuntimeError& e) {
      missing = e.what();
    }
  }
  template <class T>
  std::span<const T> by_rays(const char* field) const {
    return rays->field(field).data.row<T>(0);
  }
  template <class T>
  std::span<const T> by_opengl(const char* field) const {
    return opengl->field(field).data.row<T>(0);
  }
  double psnr() const {  // dB, of rgb
    const auto a = by_rays<std::uint8_t>("rgb"), b = by_opengl<std::uint8_t>("rgb");
    double sum = 1e-9;
    for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return 10 * std::log10(255.0 * 255.0 * static_cast<double>(a.size()) / sum);
  }
  // Share of the pixels that show another object than OpenGL's.
  double other_ids() const {
    const auto a = by_rays<std::int32_t>("segmentation"),
               b = by_opengl<std::int32_t>("segmentation");
    int other = 0;
    for (std::size_t i = 0; i < a.size(); i += 2) other += a[i] != b[i] || a[i + 1] != b[i + 1];
    return 2.0 * other / static_cast<double>(a.size());
  }
  // Share of the pixels whose depth differs by more than `tolerance` m.
  double other_depths(double tolerance) const {
    const auto a = by_rays<float>("depth"), b = by_opengl<float>("depth");
    int other = 0;
    for (std::size_t i = 0; i < a.size(); ++i) other += !(std::abs(a[i] - b[i]) <= tolerance);
    return static_cast<double>(other) / static_cast<double>(a.size());
  }
};

}  // namespace mjsense::testing
