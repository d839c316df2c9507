// SPDX-License-Identifier: Apache-2.0
#pragma once
// State of one world for ray casting: poses and visual properties of its geoms. It is copied out of
// MuJoCo in the parallel pass over worlds, so that casting needs no mjData.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "mjsense/rays/ray_geom.h"

namespace mjsense::rays {

// Poses of lights and cameras for rendering (mjData's light_xpos ... cam_xmat), world frame.
struct RayLight {
  double pos[3], dir[3];
};
struct RayCamera {
  double pos[3], mat[9];
};

class BoxList;
class FlexShapes;
class SkinShapes;
struct SharedGeometry;

class RayWorld {
 public:
  RayWorld(const mjModel* model, const SharedGeometry& shapes);
  RayWorld(RayWorld&&) noexcept;
  ~RayWorld();

  // Copies the world's current values; a geom that did not move costs only a comparison. Allocates
  // nothing, except that Embree allocates when a flex has moved. Only one thread per world may call
  // it.
  void update(const mjModel* model, const mjData* data);

  int num_geoms() const { return num_geoms_; }  // geoms of the model, without flexes
  int num_objects() const { return static_cast<int>(geoms_.size()); }  // geoms, then flexes
  // Incremented by every update; 0: never updated.
  std::uint64_t version() const { return version_; }

  const RayGeom& geom(int id) const { return geoms_[id]; }
  std::span<const RayGeom> geoms() const { return geoms_; }
  const BoxList& boxes() const { return *boxes_; }  // in the world frame
  // Bit g for group g, plus kTransparent if alpha is 0. 0 for padding.
  static constexpr std::uint32_t kTransparent = 0x100;
  std::span<const std::uint32_t> flags() const { return flags_; }
  std::span<const int> bodies() const { return bodies_; }  // body id, -1 for flexes and padding
  std::span<const int> materials() const { return materials_; }  // material id or -1
  // [num_objects, 4]: the material's colour, or the geom's own if it has no material
  std::span<const float> rgba() const { return rgba_; }
  const FlexShapes* flexes() const { return flexes_.get(); }  // null if the model has no flexes
  // Cameras bend skins when they need them. Null if the model has no skins or no cameras.
  SkinShapes* skins() const { return skins_.get(); }
  std::span<const RayLight> lights() const { return lights_; }
  std::span<const RayCamera> cameras() const { return cameras_; }

 private:
  struct Last;

  void update_appearance(const mjModel* model);  // groups, materials and colours of geoms
  void update_geoms(const mjModel* model, const mjData* data);
  void update_geom(const mjModel* model, const mjData* data, int id);
  void describe(const mjModel* model, int object, int material, int group, const float* own_rgba);
  void update_flexes(const mjModel* model, const mjData* data);
  void set_local_box(RayGeom& geom) const;
  void set_world_box(int object);

  int num_geoms_ = 0;
  std::uint64_t version_ = 0;
  std::vector<RayGeom> geoms_;
  const SharedGeometry* shapes_;
  std::unique_ptr<FlexShapes> flexes_;
  std::unique_ptr<SkinShapes> skins_;
  std::unique_ptr<BoxList> boxes_;
  std::unique_ptr<Last> last_;
  std::vector<std::uint32_t> flags_;
  std::vector<int> bodies_, materials_;
  std::vector<float> rgba_;
  std::vector<RayLight> lights_;
  std::vector<RayCamera> cameras_;
};

}  // namespace mjsense::rays
