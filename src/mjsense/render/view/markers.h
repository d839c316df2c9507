// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sites and tendons of one world, as MuJoCo's visualiser creates them. A site has its own shape. A
// tendon is a chain of capsules along its path, or along a catenary where it is slack.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <span>
#include <vector>

#include "mjsense/rays/ray_geom.h"
#include "mjsense/render/view/appearance.h"

namespace mjsense::render {

struct Marker {
  rays::RayGeom shape;
  Material material;  // MuJoCo's defaults if there is none
  float rgba[4];
  int id, object;  // for segmentation: id and mjtObj
};

struct MarkerOptions {
  unsigned site_groups = 0, tendon_groups = 0;  // bit g: those of group g
  bool textures = true;
};

class Markers {
 public:
  // If no group is enabled, there are no markers and no cost in memory or time.
  Markers(const mjModel* model, const MarkerOptions& options);
  // Copies the world's current sites and tendons. Kinematics and tendons must be up to date.
  // Allocates nothing.
  void copy(const mjModel* model, mjData* data);

  std::span<const Marker> all() const { return {markers_.data(), count_}; }
  std::span<const mjvGeom> geoms() const {
    return {geoms_.data(), count_};
  }  // the same markers, for OpenGL
  std::size_t capacity() const { return markers_.size(); }

 private:
  mjvOption options_;
  std::vector<mjvGeom> geoms_;
  std::vector<Marker> markers_;
  std::size_t count_ = 0;
};

}  // namespace mjsense::render
