// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/surface_assets.h"

#include <algorithm>
#include <cmath>

#include "mjsense/core/content_cache.h"
#include "mjsense/rays/flex_surface.h"

namespace mjsense::render {
namespace {

// If the cosine between a vertex normal and the face's normal is below this, the corner is on a
// crease and MuJoCo shades it flat.
constexpr float kCrease = 0.8f;

// Writes (b - a) x (c - a) and returns its length.
float cross(const float* a, const float* b, const float* c, float* out) {
  const float e1[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
  const float e2[3] = {c[0] - a[0], c[1] - a[1], c[2] - a[2]};
  for (int i = 0; i < 3; ++i)
    out[i] = e1[(i + 1) % 3] * e2[(i + 2) % 3] - e1[(i + 2) % 3] * e2[(i + 1) % 3];
  return std::sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]);
}

}  // namespace

void MeshTables::add_coordinates(const float* texcoord, std::span<const int> texcoords) {
  uvs.resize(2 * texcoords.size());
  for (std::size_t i = 0; i < texcoords.size(); ++i)
    std::copy_n(texcoord + 2 * texcoords[i], 2, uvs.data() + 2 * i);
}

std::shared_ptr<const MeshTables> mesh_tables(const mjModel* m, int id, bool coordinates,
                                              bool creases) {
  const int faces = m->mesh_facenum[id], first = m->mesh_faceadr[id];
  const bool has_uv = m->mesh_texcoordadr[id] >= 0;
  // The mesh's range of an array with `width` numbers per row.
  const auto part = [](auto* all, int begin, int count, int width) {
    return std::span(all + static_cast<std::size_t>(begin) * width,
                     static_cast<std::size_t>(count) * width);
  };
  const auto vert = part(m->mesh_vert, m->mesh_vertadr[id], m->mesh_vertnum[id], 3);
  const auto normal = part(m->mesh_normal, m->mesh_normaladr[id], m->mesh_normalnum[id], 3);
  const auto vertices = part(m->mesh_face, first, faces, 3);
  const auto normals = part(m->mesh_facenormal, first, faces, 3);
  std::span<float> texcoord;
  std::span<int> texcoords;
  if (has_uv && coordinates) {
    texcoord = part(m->mesh_texcoord, m->mesh_texcoordadr[id], m->mesh_texcoordnum[id], 2);
    texcoords = part(m->mesh_facetexcoord, first, faces, 3);
  }
  static ContentCache<MeshTables> all;
  const bool form[] = {has_uv, coordinates, creases};
  ContentKey key;
  key.add(std::span<const bool>(form));
  for (const auto& values : {vert, normal, texcoord}) key.add(values);
  for (const auto& values : {vertices, normals, texcoords}) key.add(values);
  return all.get(key, [&] {
    auto tables = std::make_shared<MeshTables>();
    tables->normals.resize(static_cast<std::size_t>(faces) * 9);
    float* out = tables->normals.data();
    for (int f = 0; f < faces; ++f, out += 9) {
      const int *v = &vertices[3 * f], *n = &normals[3 * f];
      for (int k = 0; k < 3; ++k) std::copy_n(&normal[3 * n[k]], 3, out + 3 * k);
      if (has_uv && !creases) continue;
      float flat[3];
      const float length = cross(&vert[3 * v[0]], &vert[3 * v[1]], &vert[3 * v[2]], flat);
      for (float& x : flat) x = length > 0 ? x / length : 0;
      for (int k = 0; k < 3; ++k) {
        float* smooth = out + 3 * k;
        const float cosine = smooth[0] * flat[0] + smooth[1] * flat[1] + smooth[2] * flat[2];
        if (cosine < kCrease) std::copy_n(flat, 3, smooth);
      }
    }
    if (has_uv && coordinates) tables->add_coordinates(texcoord.data(), texcoords);
    return tables;
  });
}

MeshSurface MeshTables::surface(const float* positions, const int* faces) const {
  const auto data = [](const std::vector<float>& v) { return v.empty() ? nullptr : v.data(); };
  return {data(normals), data(uvs), positions, faces};
}

void SurfaceAssets::keep(std::shared_ptr<const MeshTables> tables, MeshSurface& surface,
                         const float* positions, const int* faces) {
  surface = tables->surface(positions, faces);
  tables_.push_back(std::move(tables));
}

SurfaceAssets::SurfaceAssets(const mjModel* model, bool meshes, bool textures,
                             const WarpLook& warp) {
  textures_.resize(model->ntex);
  meshes_.resize(model->nmesh);
  skins_.resize(model->nskin);
  for (int i = 0; i < model->nflex; ++i) add_flex(model, i, textures);
  for (int i = 0; i < model->nskin && textures; ++i) add_skin(model, i);
  for (int i = 0; i < model->ntex && textures; ++i)
    textures_[i] = stored_.emplace_back(stored_texture(model, i))->texture;
  for (int i = 0; i < model->ntex && !skybox_; ++i)
    if (model->tex_type[i] == mjTEXTURE_SKYBOX && textures_[i].levels > 0 && !textures_[i].grey)
      skybox_ = &textures_[i];
  for (int i = 0; i < model->nmesh && meshes; ++i)
    keep(mesh_tables(model, i, true, warp.on), meshes_[i],
         model->mesh_vert + 3 * model->mesh_vertadr[i],
         model->mesh_face + 3 * model->mesh_faceadr[i]);
  if (!warp.on) return;
  for (MeshSurface& mesh : meshes_)
    if (!warp.vertex_normals) mesh.normals = nullptr;
  for (Texture& texture : textures_) texture.levels = std::min(texture.levels, 1);
}

void SurfaceAssets::add_flex(const mjModel* model, int id, bool textures) {
  const rays::FlexSurface s = rays::flex_surface(model, id);
  for (const rays::FlexSurface::Part& part : s.parts) {
    flex_parts_.emplace_back();
    if (s.texcoords.empty() || !textures) continue;
    auto tables = std::make_shared<MeshTables>();
    tables->add_coordinates(model->flex_texcoord + 2 * model->flex_texcoordadr[id],
                            std::span(s.texcoords).subspan(3 * part.first, 3 * part.count));
    keep(std::move(tables), flex_parts_.back());
  }
}

void SurfaceAssets::add_skin(const mjModel* model, int id) {
  if (model->skin_texcoordadr[id] < 0) return;
  auto tables = std::make_shared<MeshTables>();
  tables->add_coordinates(
      model->skin_texcoord + 2 * model->skin_texcoordadr[id],
      {model->skin_face + 3 * model->skin_faceadr[id], 3 * std::size_t(model->skin_facenum[id])});
  keep(std::move(tables), skins_[id]);
}

}  // namespace mjsense::render
