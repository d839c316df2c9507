// SPDX-License-Identifier: Apache-2.0
#pragma once
// Sites and tendons of one world as MuJoCo's visualiser makes them: a site is the shape that it
// has, a tendon a chain of capsules along its path, hanging through where it is a slack string.

#include <mujoco/mujoco.h>

#include <cstddef>
#include <span>
#include <vector>

#include "mjsense/rays/ray_geom.h"
#include "mjsense/render/view/appearance.h"

namespace mjsense {

struct Marker {
  RayGeom shape;
  Material material;  // MuJoCo's defaults if it has none
  float rgba[4];
  int id, object;  // for segmentation: id and mjtObj
};

struct MarkerOptions {
  unsigned site_groups = 0, tendon_groups = 0;  // bit g: those of group g
  bool textures = true;
};

class Markers {
 public:
  // Without groups there are none, and nothing costs memory or time.
  Markers(const mjModel* model, const MarkerOptions& options);
  // Takes those of the world as they are now; its kinematics and tendons are up to date. No
  // allocation.
  void copy(const mjModel* model, mjData* data);

  std::span<const Marker> all() const { return {markers_.data(), count_}; }
  std::span<const mjvGeom> geoms() const {
    return {geoms_.data(), count_};
  }  // the same, for OpenGL
  std::size_t capacity() const { return markers_.size(); }

 private:
  mjvOption options_;
  std::vector<mjvGeom> geoms_;
  std::vector<Marker> markers_;
  std::size_t count_ = 0;
};

}  // namespace mjsense
