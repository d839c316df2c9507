// SPDX-License-Identifier: Apache-2.0
#pragma once
// Appearance data that all cameras and worlds share, prepared once per model: textures with their
// mipmaps, and the normals and texture coordinates of mesh faces as MuJoCo's classic renderer
// uses them.

#include <mujoco/mujoco.h>

#include <memory>
#include <span>
#include <vector>

#include "mjsense/render/view/stored_texture.h"
#include "mjsense/render/view/warp_look.h"

namespace mjsense::render {

// Tables of a mesh, flex or skin by face index. Null if it has none.
struct MeshSurface {
  const float* normals = nullptr;  // [F, 3 corners, 3]
  const float* uvs = nullptr;      // [F, 3 corners, 2]
  // For textures: the vertices' current positions, m, and the corners of the faces, [F, 3] vertices.
  const float* positions = nullptr;
  const int* faces = nullptr;
};

// Storage of MeshSurface; a table that does not exist is empty.
struct MeshTables {
  std::vector<float> normals;  // [F, 3 corners, 3]
  std::vector<float> uvs;      // [F, 3 corners, 2]

  MeshSurface surface(const float* positions, const int* faces) const;
  // Fills the uvs: corner i of the faces, three for each, has the coordinates texcoord[texcoords[i]].
  void add_coordinates(const float* texcoord, std::span<const int> texcoords);
};

// Tables of the model's mesh `id`, shared by all models of the process that have an equal mesh.
// `coordinates`: also uvs, if the mesh has texture coordinates. `creases`: also meshes with texture
// coordinates are shaded flat at creases.
std::shared_ptr<const MeshTables> mesh_tables(const mjModel* model, int id, bool coordinates,
                                              bool creases = false);

class SurfaceAssets {
 public:
  // `meshes`: prepare all meshes, including those that no geom uses, because a world may change a
  // geom's mesh or group. False for views that need no normals.
  // `model` must outlive this object, which refers to the positions and faces of its meshes.
  // `warp`: textures have no mipmaps.
  SurfaceAssets(const mjModel* model, bool meshes, bool textures, const WarpLook& warp = {});
  SurfaceAssets(const SurfaceAssets&) = delete;
  SurfaceAssets& operator=(const SurfaceAssets&) = delete;

  const Texture* texture(int id) const { return id < 0 ? nullptr : &textures_[id]; }
  const MeshSurface* mesh(int id) const { return &meshes_[id]; }
  // Without normals, positions and faces of flexes and skins, which change with the shape.
  // index as in flex_parts()
  const MeshSurface* flex_part(int index) const { return &flex_parts_[index]; }
  int num_flex_parts() const { return static_cast<int>(flex_parts_.size()); }
  const MeshSurface* skin(int id) const { return &skins_[id]; }
  const Texture* skybox() const { return skybox_; }  // null if the model has none

 private:
  void add_flex(const mjModel* model, int id, bool textures);
  void add_skin(const mjModel* model, int id);
  void keep(std::shared_ptr<const MeshTables> tables, MeshSurface& surface,
            const float* positions = nullptr, const int* faces = nullptr);

  std::vector<Texture> textures_;
  std::vector<MeshSurface> meshes_, flex_parts_, skins_;
  std::vector<std::shared_ptr<const StoredTexture>> stored_;
  // Tables of meshes are shared by all models of the process that have equal meshes.
  std::vector<std::shared_ptr<const MeshTables>> tables_;
  const Texture* skybox_ = nullptr;
};

}  // namespace mjsense::render
