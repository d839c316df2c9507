// SPDX-License-Identifier: Apache-2.0
#pragma once
// The skins of one world: meshes bent by bones, as MuJoCo draws them. Cameras see them; rays do
// not, as mj_ray does not.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <span>
#include <vector>

#include "mjsense/rays/ray_geom.h"
#include "mjsense/rays/soft_mesh.h"

namespace mjsense {

class SkinShapes {
 public:
  SkinShapes(RTCDevice device, const mjModel* model);

  // Takes where the world's bones are. No allocation; cheap, because nothing is bent yet.
  void update(const mjModel* model, const mjData* data);
  // Bends the skins of these groups (bit g) whose bones have moved. Called by one thread a world,
  // before it looks at them. One small allocation inside Embree for each.
  void bend(std::uint32_t groups);

  int size() const { return static_cast<int>(skins_.size()); }
  std::uint32_t group(int skin) const { return skins_[skin].group; }            // bit g
  int material(int skin) const { return skins_[skin].material; }                // id or -1
  std::span<const double> bones(int skin) const { return skins_[skin].bones; }  // [bones, 7] m
  // Its frame: at the first bone, world axes; its box. Type kSkinType.
  const RayGeom& geom(int skin) const { return skins_[skin].geom; }
  const float* normals(int skin) const { return skins_[skin].normals.data(); }  // [F, 3 corners, 3]
  void* scene(int skin) const { return skins_[skin].mesh.scene(); }             // RTCScene

 private:
  struct Skin {
    std::vector<double> bones;  // [bones, 7] position and quaternion of each one's body
    float inflate;              // m, along the normals
    bool stale;                 // the bones have moved since it was bent
    std::uint32_t group;
    int material;
    SoftMesh mesh;
    std::vector<float> smooth;   // [V, 3] unit normals of the vertices
    std::vector<float> normals;  // [F, 3, 3]
    RayGeom geom;
  };
  void bend(int id);
  void carry(int id);

  const mjModel* model_;  // for what no world changes: rest shape, bones, weights
  std::vector<Skin> skins_;
};

}  // namespace mjsense
