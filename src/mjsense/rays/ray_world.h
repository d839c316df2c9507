// SPDX-License-Identifier: Apache-2.0
#pragma once
// What rays see of one world: poses and visual properties of its geoms, copied out of MuJoCo in the
// parallel pass over worlds, so that casting needs no mjData.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "mjsense/rays/ray_geom.h"

namespace mjsense {

// Lights and cameras for rendering (mjData's light_xpos ... cam_xmat).
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

  // Copies the world's present values; what did not move costs a comparison. No allocation but
  // Embree's own for a flex that moved. Called by one thread a world.
  void update(const mjModel* model, const mjData* data);

  int num_geoms() const { return num_geoms_; }  // of the model, without flexes
  int num_objects() const { return static_cast<int>(geoms_.size()); }  // geoms, then flexes
  std::uint64_t version() const { return version_; }  // grows with every update; 0: never updated

  const RayGeom& geom(int id) const { return geoms_[id]; }
  std::span<const RayGeom> geoms() const { return geoms_; }
  const BoxList& boxes() const { return *boxes_; }  // in the world
  // Bit g of group g; kTransparent if its alpha is 0; 0 for padding.
  static constexpr std::uint32_t kTransparent = 0x100;
  std::span<const std::uint32_t> flags() const { return flags_; }
  std::span<const int> bodies() const { return bodies_; }  // body id, -1 for flexes and padding
  std::span<const int> materials() const { return materials_; }  // material id or -1
  // [num_objects, 4], resolved: the material's if it has one
  std::span<const float> rgba() const { return rgba_; }
  const FlexShapes* flexes() const { return flexes_.get(); }  // null: the model has none
  // What cameras may bend when they need it; null: there are no skins, or no cameras.
  SkinShapes* skins() const { return skins_.get(); }
  std::span<const RayLight> lights() const { return lights_; }
  std::span<const RayCamera> cameras() const { return cameras_; }

 private:
  struct Last;

  void update_looks(const mjModel* model);  // groups, materials, colours of geoms
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

}  // namespace mjsense
