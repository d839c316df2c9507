// SPDX-License-Identifier: Apache-2.0
#pragma once
// What surfaces look like, taken from the model once and shared by all cameras and worlds: textures
// with their mipmaps, and the normals and texture coordinates of mesh faces as MuJoCo's classic
// renderer uses them.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

namespace mjsense {

// A pyramid of images, RGBA8, in one array: level 0 first, row 0 first; a cube map has its six
// faces (+x -x +y -y +z -z) one after another in each level. Each row ends with a texel more, what
// lies right of its last (the first of a 2D texture, which repeats; the last of a cube's face):
// kernels read neighbours in pairs. Tables by level, for gathering.
struct Texture {
  static constexpr int kMaxLevels = 15;
  bool cube = false;
  int levels = 0;  // 0: cannot be drawn
  const std::uint32_t* texels = nullptr;
  float width[kMaxLevels] = {}, height[kMaxLevels] = {};
  int offset[kMaxLevels] = {};  // of the level's first texel
};

// Per face of a mesh, flex or skin, by face index. Null where there is none.
struct MeshSurface {
  const float* normals = nullptr;  // [F, 3 corners, 3]
  const float* uvs = nullptr;      // [F, 3 corners, 2]
  const float* density = nullptr;  // [F] texture units per metre
};

// What a mesh's faces look like; what there is none of is empty.
struct MeshTables {
  std::vector<float> normals;  // [F, 3 corners, 3]
  std::vector<float> uvs;      // [F, 3 corners, 2]
  std::vector<float> density;  // [F]
  MeshSurface surface() const;
};

class SurfaceAssets {
 public:
  // `meshes`: prepare all of them, shown or not, as a world may give a geom another one or another
  // group; false for views that need no normals.
  SurfaceAssets(const mjModel* model, bool meshes, bool textures);
  SurfaceAssets(const SurfaceAssets&) = delete;
  SurfaceAssets& operator=(const SurfaceAssets&) = delete;

  const Texture* texture(int id) const { return id < 0 ? nullptr : &textures_[id]; }
  const MeshSurface* mesh(int id) const { return &meshes_[id]; }
  // Without normals, which move.
  const MeshSurface* flex_part(int index) const { return &flex_parts_[index]; }  // of flex_parts()
  int num_flex_parts() const { return static_cast<int>(flex_parts_.size()); }
  const MeshSurface* skin(int id) const { return &skins_[id]; }
  const Texture* skybox() const { return skybox_; }  // null if the model has none

 private:
  void add_texture(const mjModel* model, int id);
  void add_flex(const mjModel* model, int id, bool textures);
  void add_skin(const mjModel* model, int id);
  void keep(std::shared_ptr<const MeshTables> tables, MeshSurface& surface);

  std::vector<Texture> textures_;
  std::vector<MeshSurface> meshes_, flex_parts_, skins_;
  std::vector<std::vector<std::uint32_t>> texels_;
  std::vector<std::shared_ptr<const MeshTables>> tables_;  // of meshes the process's, by content
  const Texture* skybox_ = nullptr;
};

}  // namespace mjsense
