// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/scenes/object_meshes.h"

#include <fmt/format.h>

#include <algorithm>

#include "mjsense/core/error.h"
#include "mjsense/observe/frame.h"
#include "mjsense/scene/mj_spec.h"
#include "mjsense/scene/resolve.h"

namespace mjsense::tasks::scenes {
namespace {

std::string name_of_size(const std::string& mesh, int step) {
  return fmt::format("{}@{}", mesh, step);
}

template <class T>
std::vector<T> rows(const T* all, int first, int count, int width) {
  const T* begin = all + static_cast<std::ptrdiff_t>(first) * width;
  return {begin, begin + static_cast<std::ptrdiff_t>(count) * width};
}

}  // namespace

ObjectMeshes::ObjectMeshes(scene::SceneCfg things, std::span<const Object> objects) {
  if (objects.empty()) return;
  const scene::Scene scene(std::move(things));
  const mjModel* m = scene.model();
  for (const Object& object : objects) {
    const int body = scene::resolve(m, mjOBJ_BODY, object.body, "sizes of objects");
    for (int g = 0; g < m->ngeom; ++g) {
      if (m->geom_type[g] != mjGEOM_MESH ||
          !observe::is_descendant_or_self(m, m->geom_bodyid[g], body))
        continue;
      const int id = m->geom_dataid[g];
      const std::string name = scene::name_of(m, mjOBJ_MESH, id);
      if (std::ranges::count(meshes_, name, &Mesh::name) > 0) continue;
      Mesh& mesh = meshes_.emplace_back();
      mesh.name = name;
      mesh.sizes = object.sizes;
      const int faces = m->mesh_faceadr[id], many = m->mesh_facenum[id];
      mesh.vertices = rows(m->mesh_vert, m->mesh_vertadr[id], m->mesh_vertnum[id], 3);
      mesh.normals = rows(m->mesh_normal, m->mesh_normaladr[id], m->mesh_normalnum[id], 3);
      mesh.faces = rows(m->mesh_face, faces, many, 3);
      mesh.face_normals = rows(m->mesh_facenormal, faces, many, 3);
      if (m->mesh_texcoordadr[id] < 0) continue;
      mesh.texcoords = rows(m->mesh_texcoord, m->mesh_texcoordadr[id], m->mesh_texcoordnum[id], 2);
      mesh.face_texcoords = rows(m->mesh_facetexcoord, faces, many, 3);
    }
  }
}

void ObjectMeshes::add(mjSpec* spec) const {
  const auto set_int = [](mjIntVec* to, const std::vector<int>& from) {
    mjs_setInt(to, from.data(), static_cast<int>(from.size()));
  };
  const auto set_float = [](mjFloatVec* to, const std::vector<float>& from) {
    mjs_setFloat(to, from.data(), static_cast<int>(from.size()));
  };
  for (const Mesh& mesh : meshes_) {
    const mjsMesh* original = mjs_asMesh(mjs_findElement(spec, mjOBJ_MESH, mesh.name.c_str()));
    for (std::size_t k = 0; k < mesh.sizes.size(); ++k) {
      mjsMesh* copy = mjs_addMesh(spec, nullptr);
      mjs_setName(copy->element, name_of_size(mesh.name, static_cast<int>(k)).c_str());
      copy->inertia = original->inertia;
      copy->smoothnormal = original->smoothnormal;
      copy->maxhullvert = original->maxhullvert;
      std::ranges::fill(copy->scale, mesh.sizes[k]);
      set_float(copy->uservert, mesh.vertices);
      set_float(copy->usernormal, mesh.normals);
      set_int(copy->userface, mesh.faces);
      set_int(copy->userfacenormal, mesh.face_normals);
      if (mesh.texcoords.empty()) continue;
      set_float(copy->usertexcoord, mesh.texcoords);
      set_int(copy->userfacetexcoord, mesh.face_texcoords);
    }
  }
}

int ObjectMeshes::find(const mjModel* model, int mesh, int step) {
  return mj_name2id(model, mjOBJ_MESH,
                    name_of_size(scene::name_of(model, mjOBJ_MESH, mesh), step).c_str());
}

}  // namespace mjsense::tasks::scenes
