// SPDX-License-Identifier: Apache-2.0
#pragma once
// Skins of one world: meshes deformed by bones, as MuJoCo draws them. Cameras draw them; rays
// ignore them, as mj_ray does.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <span>
#include <vector>

#include "mjsense/rays/deformable_mesh.h"
#include "mjsense/rays/ray_geom.h"

namespace mjsense::rays {

class SkinShapes {
 public:
  SkinShapes(RTCDevice device, const mjModel* model);

  // Copies the poses of the world's bones. Cheap and without allocation, because no skin is bent
  // yet.
  void update(const mjModel* model, const mjData* data);
  // Deforms the skins of these groups (bit g) whose bones have moved. Only one thread per world may
  // call it, before reading the skins. Embree makes one small allocation per deformed skin.
  void bend(std::uint32_t groups);

  int size() const { return static_cast<int>(skins_.size()); }
  std::uint32_t group(int skin) const { return skins_[skin].group; }  // bit g
  int material(int skin) const { return skins_[skin].material; }      // id or -1
  // [bones, 7]: m, quaternion
  std::span<const double> bones(int skin) const { return skins_[skin].bones; }
  // The skin's frame (at the first bone, world axes) and bounding box. Its type is kSkinType.
  const RayGeom& geom(int skin) const { return skins_[skin].geom; }
  const float* normals(int skin) const { return skins_[skin].normals.data(); }  // [F, 3 corners, 3]
  std::span<const float> positions(int skin) const { return skins_[skin].mesh.vertices(); }
  const int* faces(int skin) const {  // [F, 3] vertices
    return model_->skin_face + 3 * model_->skin_faceadr[skin];
  }
  void* scene(int skin) const { return skins_[skin].mesh.scene(); }  // RTCScene

 private:
  struct Skin {
    std::vector<double> bones;  // [bones, 7] position and quaternion of each bone's body
    float inflate;              // m, offset along the normals
    bool stale;                 // the bones have moved since the skin was last bent
    std::uint32_t group;
    int material;
    DeformableMesh mesh;
    std::vector<float> smooth;   // [V, 3] unit normals of the vertices
    std::vector<float> normals;  // [F, 3 corners, 3]
    RayGeom geom;
  };
  void bend(int id);
  void carry(int id);

  const mjModel* model_;  // for what no world changes: rest shape, bones, weights
  std::vector<Skin> skins_;
};

}  // namespace mjsense::rays
