// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/scene_assets.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <span>
#include <utility>

#include "mjsense/core/content_cache.h"
#include "mjsense/core/model_indices.h"

namespace mjsense::render {
namespace {

// Only what the model's height fields or skins need.
mjModel part_of(const mjModel* model, bool height_fields) {
  mjModel part = *model;
  part.nmesh = part.ntex = 0;
  (height_fields ? part.nskin : part.nhfield) = 0;
  return part;
}

}  // namespace

SceneAssets::SceneAssets(const mjModel* model)
    : model_(model),
      mesh_stamps_(model->nmesh),
      texture_stamps_(model->ntex),
      height_field_stamps_(model->nhfield) {
  reload();
  begin_image();
}

bool SceneAssets::Stamp::changed(const void* data, std::size_t bytes) {
  const auto* at = static_cast<const unsigned char*>(data);
  const std::size_t words = bytes / sizeof(std::uint64_t);
  const std::size_t step = std::max<std::size_t>(1, words / kPlaces);
  std::array<std::uint64_t, 2 * kPlaces + 1> compared;
  std::size_t count = 0;
  const auto compare = [&](const void* from, std::size_t size) {
    compared[count] = 0;
    std::memcpy(&compared[count++], from, size);
  };
  for (std::size_t i = 0; i < words; i += step)
    compare(at + i * sizeof(std::uint64_t), sizeof(std::uint64_t));
  if (const std::size_t rest = bytes % sizeof(std::uint64_t)) compare(at + bytes - rest, rest);
  const std::uint64_t hash = hash_of(std::as_bytes(std::span(compared.data(), count)), bytes);
  return std::exchange(value, hash) != hash;
}

bool SceneAssets::begin_image() {
  improved_ = false;
  for (const std::unique_ptr<DrawnMesh>& mesh : meshes_)
    if (mesh) mesh->begin_image();
  bool changed = false;
  const mjModel* m = model_;
  for (int i = 0; i < m->nmesh; ++i) {
    if (!mesh_stamps_[i].changed(m->mesh_vert + 3 * m->mesh_vertadr[i],
                                 3 * sizeof(float) * m->mesh_vertnum[i]))
      continue;
    changed = true;
    meshes_[2 * i].reset();
    meshes_[2 * i + 1].reset();
  }
  for (int i = 0; i < m->ntex; ++i) {
    const std::size_t bytes =
        static_cast<std::size_t>(m->tex_width[i]) * m->tex_height[i] * m->tex_nchannel[i];
    if (!texture_stamps_[i].changed(m->tex_data + m->tex_adr[i], bytes)) continue;
    changed = true;
    textures_[i].reset();
  }
  bool fields = height_field_sizes_.changed(m->hfield_size, 4 * sizeof(mjtNum) * m->nhfield);
  for (int i = 0; i < m->nhfield; ++i) {
    const std::size_t values = static_cast<std::size_t>(m->hfield_nrow[i]) * m->hfield_ncol[i];
    fields |=
        height_field_stamps_[i].changed(m->hfield_data + m->hfield_adr[i], values * sizeof(float));
  }
  if (fields) height_fields_.reset();
  return changed || fields;
}

void SceneAssets::reload() {
  meshes_.clear();
  meshes_.resize(2 * model_->nmesh);
  textures_.clear();
  textures_.resize(model_->ntex);
  height_fields_.reset();
  skins_.reset();
}

DrawnMesh* SceneAssets::mesh(int id) {
  std::unique_ptr<DrawnMesh>& place = meshes_[id];
  if (!place) place = std::make_unique<DrawnMesh>(model_, id, improved_);
  return place->empty() ? nullptr : place.get();
}

const Texture* SceneAssets::texture(int id) {
  if (id < 0 || id >= model_->ntex) return nullptr;
  std::unique_ptr<DrawnTexture>& place = textures_[id];
  if (!place) place = std::make_unique<DrawnTexture>(model_, id);
  return place->texture().levels > 0 ? &place->texture() : nullptr;
}

DrawnTexture::DrawnTexture(const mjModel* model, int id)
    : model_(model), id_(id), texture_(texture_levels(model, id)) {
  texture_.on_demand = this;
}

// One level more than needed, because the texture is read anew each time.
void DrawnTexture::add_level(int level) {
  stored_ = stored_texture(model_, id_, std::max(0, level - 1));
  texture_ = stored_->texture;
  if (texture_.finest > 0) texture_.on_demand = this;
}

PreparedAssets SceneAssets::prepared() const {
  PreparedAssets out;
  for (const std::unique_ptr<DrawnMesh>& mesh : meshes_) {
    if (!mesh) continue;
    ++out.meshes;
    out.clusters += mesh->has_clusters();
    out.trees += mesh->has_tree();
    out.surfaces += mesh->has_surface();
  }
  for (const std::unique_ptr<DrawnTexture>& texture : textures_) {
    if (!texture || !texture->texture().texels) continue;
    ++out.textures;
    out.levels += texture->texture().levels - texture->texture().finest;
  }
  return out;
}

const Texture* SceneAssets::skybox() {
  for (int i = 0; i < model_->ntex; ++i)
    if (model_->tex_type[i] == mjTEXTURE_SKYBOX) return texture(i);
  return nullptr;
}

const rays::HeightField& SceneAssets::height_field(int id) {
  if (!height_fields_) {
    const mjModel part = part_of(model_, true);
    height_fields_ = std::make_unique<rays::SharedGeometry>(&part);
  }
  return height_fields_->height_fields[id];
}

const MeshSurface& SceneAssets::skin(int id) {
  if (!skins_) {
    for (int i = 0; i < model_->nskin; ++i) check_skin_indices(*model_, i);
    const mjModel part = part_of(model_, false);
    skins_ = std::make_unique<SurfaceAssets>(&part, false, true);
  }
  return *skins_->skin(id);
}

}  // namespace mjsense::render
