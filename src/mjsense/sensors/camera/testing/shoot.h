#pragma once
// For tests of cameras: one image of one world.

#include <memory>

#include "mjsense/core/parallel.h"
#include "mjsense/rays/ray_scene.h"
#include "mjsense/rays/testing/scene.h"
#include "mjsense/sensors/camera/camera_sensor.h"

namespace mjsense::testing {

// A camera with the image of `m` as it is now; `rays` is up to date.
inline std::unique_ptr<Sensor> shoot(const CameraSensorCfg& cfg, const TestModel& m,
                                     RayScene& rays) {
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

}  // namespace mjsense::testing
