// SPDX-License-Identifier: Apache-2.0
#pragma once
// The cameras of an episode: made for all worlds, placed anew in each at the start of an episode.
//
//   CameraSystem cameras(cfg, "robot_0/", "base");
//   scene_cfg.sensors gets cameras.sensor_cfgs()
//   cameras.initialize(simulation)                 after compilation
//   an episode of a world: state sampled, forward, then
//   cameras.place(world, rng, centre, objects)     in the parallel pass; forward again where
//                                                  varies()

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/cameras/camera_mount.h"
#include "mjsense/core/pose.h"
#include "mjsense/core/rng.h"
#include "mjsense/sim/simulation.h"

namespace mjsense {

struct CameraSystemCfg {
  std::string name;
  std::vector<CameraMountCfg> cameras;
  int width = 640, height = 480;
};
template <class V>
void visit_fields(V& v, CameraSystemCfg& c) {
  v.object("CameraSystemCfg", "The cameras of an episode, in the order of a recording.");
  v("name", c.name, "Name of the camera system.");
  v("cameras", c.cameras, "The cameras.");
  v("width", c.width, "Default width of the images.").unit("pixels").at_least(1);
  v("height", c.height, "Default height of the images.").unit("pixels").at_least(1);
}

// Two cameras of one name, and each camera's own. Throws ValueError.
void validate(const CameraSystemCfg& cfg, std::string_view place);

class CameraSystem {
 public:
  // `prefix`: of the robot's names in the model; `base`: the robot's base body, without it.
  CameraSystem(CameraSystemCfg cfg, const std::string& prefix, const std::string& base);

  const CameraSystemCfg& cfg() const { return cfg_; }
  // Full MuJoCo name of a camera; and for what is no camera of the robot's MJCF, where a new one of
  // that name stands before an episode moves it: body "" is the world.
  struct Mounted {
    std::string camera;
    bool is_new = false;
    std::string body;
    Pose pose;  // in the body
    double fovy = 45;
  };
  const Mounted& mounted(int camera) const { return mounted_[camera]; }
  int width(int camera) const { return cfg_.cameras[camera].width.value_or(cfg_.width); }
  int height(int camera) const { return cfg_.cameras[camera].height.value_or(cfg_.height); }

  // Throws KeyError for a camera that the model does not have.
  void initialize(Simulation& simulation);
  // Some camera must be placed at the start of an episode.
  bool varies() const { return varies_; }

  // Poses and lenses for an episode, written to the world's own model. `world` is fresh; `centre`
  // (m, world frame) and `objects` (bodies) are what orbiting cameras go round and must see. ""; or
  // why there is no place for a camera. Touches this world's alone.
  std::string place(const World& world, std::uint64_t seed, std::uint64_t episode, Vec3 centre,
                    std::span<const int> objects);

  // This world's cameras as JSON text, an object by camera: those on a body have `body`, `pos` (m)
  // and `quat` (wxyz) in it, those in the world `pos`, `forward`, `up`; all `fovy` (degrees). With
  // it an episode can be pictured again.
  std::string frozen(int world) const;

 private:
  struct Lens {
    Pose pose;  // in the camera's body
    double fovy;
  };
  Lens with_noise(int camera, Rng& rng) const;
  std::string orbit(int camera, const World& world, Rng& rng, Vec3 centre,
                    std::span<const int> objects, Lens& out) const;

  CameraSystemCfg cfg_;
  std::vector<Mounted> mounted_;
  std::vector<int> ids_;    // of the model
  std::vector<Lens> rest_;  // without noise
  std::vector<Lens> now_;   // [B, cameras]
  bool varies_ = false;
  Simulation* simulation_ = nullptr;
  double *pos_ = nullptr, *quat_ = nullptr, *fovy_ = nullptr;  // [B, ncam, ...] of MuJoCo's batch
};

// Looks from `eye` at `target`; `up` is up in the image. Where that is nearly the direction itself,
// x is, or y where it looks along x.
Pose look_at(Vec3 eye, Vec3 target, Vec3 up);

}  // namespace mjsense
