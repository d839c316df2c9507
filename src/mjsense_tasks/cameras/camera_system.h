// SPDX-License-Identifier: Apache-2.0
#pragma once
// The cameras of an episode. They are created with the scene for all worlds, and placed anew in
// each world at the start of an episode.
//
//   CameraSystem cameras(cfg, "robot_0/", "base");
//   add a CameraSensorCfg to the scene for every camera, at mounted(i) if it is new
//   cameras.initialize(simulation)                      after compilation
//   start of an episode of a world, after its state is sampled and forward() has run:
//   cameras.place(world, seed, episode, centre, objects)   in the parallel pass
//   forward() again if varies()

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "mjsense/core/pose.h"
#include "mjsense/core/rng.h"
#include "mjsense/sim/simulation.h"
#include "mjsense_tasks/cameras/camera_mount.h"

namespace mjsense::tasks::cameras {

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

// Throws ValueError if two cameras have the same name or if a camera is invalid.
void validate(const CameraSystemCfg& cfg, std::string_view context);

class CameraSystem {
 public:
  // `prefix`: prefix of the robot's names in the model. `base`: the robot's base body, without the
  // prefix.
  CameraSystem(CameraSystemCfg cfg, const std::string& prefix, const std::string& base);

  const CameraSystemCfg& cfg() const { return cfg_; }
  // A camera in the model. `camera` is its full MuJoCo name. If the camera is not in the robot's
  // MJCF, `is_new` is true and the other members say where to add it; episodes move it later. An
  // empty body is the world.
  struct Mounted {
    std::string camera;
    bool is_new = false;
    std::string body;
    Pose pose;  // in the frame of the body
    double fovy = 45;
  };
  const Mounted& mounted(int camera) const { return mounted_[camera]; }
  int width(int camera) const { return cfg_.cameras[camera].width.value_or(cfg_.width); }
  int height(int camera) const { return cfg_.cameras[camera].height.value_or(cfg_.height); }
  // The share of an image that an object covers depends on its aspect ratio.
  void set_size(int camera, int width, int height) {
    cfg_.cameras[camera].width = width;
    cfg_.cameras[camera].height = height;
  }

  // Throws KeyError if the model lacks a camera.
  void initialize(sim::Simulation& simulation);
  // Allows set_poses(), also without cameras that vary. Call it before initialize().
  void allow_poses() { varies_ = true; }
  // Writes the poses and fields of view of these cameras, which are mounted on the same bodies as
  // those of cfg(), to the world's own model. Throws KeyError, ValueError.
  void set_poses(int world, const CameraSystemCfg& given);
  // True if some camera must be placed at the start of an episode.
  bool varies() const { return varies_; }

  // Draws poses and fields of view for an episode and writes them to the world's own model. The
  // world's data must be current. Orbiting cameras are placed around `centre` (m, world frame) and
  // must see `objects` (bodies). Returns "", or why there is no pose for a camera, which then has
  // the best one that was tried. Accesses this world only, so that worlds can be placed in parallel.
  std::string place_cameras(const World& world, std::uint64_t seed, std::uint64_t episode,
                            Vec3 centre, std::span<const int> objects);

  // This world's cameras as JSON text, one object per camera. Cameras on a body have `body` and, in
  // its frame, `pos` (m) and `quat` (wxyz); cameras in the world have `pos`, `forward` and `up`;
  // all have `fovy` (degrees). It allows the images of an episode to be rendered again.
  std::string frozen(int world) const;

 private:
  struct Lens {
    Pose pose;  // in the frame of the camera's body
    double fovy;
  };
  Lens with_noise(int camera, Rng& rng) const;
  void write(int world, int camera, const Lens& lens);
  // Searches for a lens in the world that shows more than `best`, the share that `out` shows.
  std::string orbit(int camera, const World& world, Rng& rng, Vec3 centre,
                    std::span<const int> objects, double best, Lens& out) const;
  // Moves a lens that does not show enough of the objects.
  std::string make_visible(int camera, const World& world, Rng& rng, Vec3 centre,
                           std::span<const int> objects, Lens& lens) const;
  double lowest_visible_share(int camera, const World& world, const Lens& lens,
                              std::span<const int> objects) const;

  CameraSystemCfg cfg_;
  std::vector<Mounted> mounted_;
  std::vector<int> ids_;    // camera ids in the model
  std::vector<Lens> rest_;  // [cameras], without noise
  std::vector<Lens> now_;   // [B, cameras], of the current episode
  bool varies_ = false;
  sim::Simulation* simulation_ = nullptr;
  double *pos_ = nullptr, *quat_ = nullptr, *fovy_ = nullptr;  // [B, ncam, ...] of MuJoCo's batch
};

// Pose of a camera at `eye` that looks at `target`; `up` is up in the image. If `up` is nearly
// parallel to the viewing direction, x is used instead, or y if the camera looks along x.
Pose look_at(Vec3 eye, Vec3 target, Vec3 up);

}  // namespace mjsense::tasks::cameras
