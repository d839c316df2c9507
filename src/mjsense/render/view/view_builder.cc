// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/view_builder.h"

#include <algorithm>
#include <bit>

#include "mjsense/rays/flex_shapes.h"
#include "mjsense/rays/ray_world.h"
#include "mjsense/rays/shared_geometry.h"
#include "mjsense/rays/skin_shapes.h"
#include "mjsense/render/view/fixed_layer.h"
#include "mjsense/render/view/frustum.h"
#include "mjsense/render/view/mirror.h"
#include "mjsense/render/view/shadow_reach.h"
#include "mjsense/render/view/view_lights.h"
#include "mjsense/render/view/view_sky.h"

namespace mjsense::render {

ViewBuilder::ViewBuilder(const mjModel* model, const SurfaceAssets& assets,
                         const ViewOptions& options)
    : assets_(&assets),
      options_(options),
      style_{.assets = &assets,
             .textures = options.textures,
             .physical = options.physical.on,
             .planes_are_infinite = options.warp.on && !options.warp.series_4},
      geoms_(max_geoms(model) + options.markers),
      light_space_(options.shadows ? options.shadow_samples * model->nlight : 0, geoms_.capacity()),
      soft_surfaces_(assets.num_flex_parts() + model->nskin) {
  candidates_.resize((static_cast<std::size_t>(model->ngeom + model->nflex) + 63) / 64);
  if (options.layered) {
    view_.layered = true;
    geom_index_.resize(geoms_.capacity());
    view_.geom_index = geom_index_.data();
    for (int i = 0; i < model->ngeom; ++i)
      fixed_.push_back(is_fixed_body(model, model->geom_bodyid[i]));
  }
  view_.near = options.near;
  view_.far = options.far;
  view_.shadows = options.shadows;
  view_.warp.on = options.warp.on;
  view_.warp.share_in_shadow = options.warp.share_in_shadow;
  const bool sky = options.warp.on ? options.warp.skybox : options.textures;
  view_.skybox = sky && !options.physical.hides_skybox ? assets.skybox() : nullptr;
  if (options.reflections && model->nmat > 0) {  // any world may set a material's reflectance
    ViewOptions flat = options;
    flat.reflections = flat.shadows = flat.layered = false;
    flat.physical.occlusion_reach = 0;
    mirrored_ = std::make_unique<ViewBuilder>(model, assets, flat);
  }
}

const View& ViewBuilder::build(const rays::RayWorld& world, const rays::SharedGeometry& shapes,
                               const Appearance& appearance, std::span<const Marker> markers,
                               const double position[3], const double rotation[9],
                               const PixelGrid& grid) {
  const Source from{world, shapes, appearance, markers, position, rotation};
  view_.grid = grid;
  for (int i = 0; i < 9; ++i) view_.r_wc[i] = static_cast<float>(rotation[i]);
  if (options_.physical.on) {
    set_physical(options_.physical, appearance.environment_tint(), rotation, view_.physical);
    view_.physical.shows_environment = !view_.skybox;
  }
  geoms_.clear();
  endless_ = nullptr;
  add_geoms(from);
  add_soft_geoms(from);
  add_markers(from);
  geoms_.sort(view_);
  for (int i = 0; view_.layered && i < view_.num_geoms; ++i) geom_index_[view_.geoms[i].id] = i;
  view_.fixed_tiles = nullptr;
  set_lights(world, appearance, options_, position, rotation, own_headlight_ ? nullptr : headlight_,
             view_);
  if (options_.shadows) light_space_.fill(view_);
  if (view_.physical.occlusion_reach > 0) geoms_.set_occluders(view_);
  if (view_.skybox && !view_.warp.on)
    set_sky(endless_, appearance.sky(), position, rotation, view_);
  if (mirrored_) set_mirror(from);
  return view_;
}

void ViewBuilder::add(const Source& from, const rays::RayGeom& geom, int id, std::uint32_t flags,
                      int material) {
  const float* rgba = from.appearance.rgba().data() + 4 * id;
  if (rgba[3] == 0 || !(flags & options_.groups) || id == excluded_geom_) return;
  if (!endless_ && is_endless(geom)) endless_ = &geom;
  ViewGeom& g = geoms_.place(geom, id, from.position, from.rotation);
  g.fixed = static_cast<std::size_t>(id) < fixed_.size() && fixed_[id];
  set_shape(from, geom, g);
  const Material* paint = material < 0 ? nullptr : &from.appearance.materials()[material];
  geoms_.add(view_, style_, geom, {rgba, paint, paint ? texture_of(*paint) : nullptr});
}

const Texture* ViewBuilder::texture_of(const Material& material) const {
  const bool whole = options_.physical.on && material.texture < 0;
  return assets_->texture(whole ? material.textures[mjTEXROLE_RGBA] : material.texture);
}

void ViewBuilder::add_geoms(const Source& from) {
  const rays::RayWorld& world = from.world;
  const int count = world.num_geoms();
  const auto add_geom = [&](int id) {
    add(from, world.geom(id), id, world.flags()[id], world.materials()[id]);
  };
  // Bounding boxes of skins and markers, which may receive shadows, are not stored.
  const bool unbounded = options_.shadows && (world.skins() || !from.markers.empty());
  if (view_.grid.distorted_rays || unbounded || options_.disable_culling ||
      view_.physical.all_geoms) {
    for (int i = 0; i < count; ++i) add_geom(i);
    return;
  }
  Frustum frustum(view_.grid, from.position, from.rotation);
  if (options_.shadows) reach_lights(world, from.appearance, options_.shadow_samples, frustum);
  if (view_.physical.occlusion_reach > 0) frustum.widen(view_.physical.occlusion_reach);
  find_candidates(world.boxes(), frustum, candidates_);
  for (std::size_t word = 0; word < candidates_.size(); ++word) {
    for (std::uint64_t bits = candidates_[word]; bits != 0; bits &= bits - 1) {
      const int i = static_cast<int>(64 * word) + std::countr_zero(bits);
      if (i < count) add_geom(i);
    }
  }
}

void ViewBuilder::add_soft_geoms(const Source& from) {
  const rays::RayWorld& world = from.world;
  int id = world.num_geoms();
  if (const rays::FlexShapes* flexes = world.flexes()) {
    for (const rays::FlexShapes::Part& part : flexes->parts()) {
      const int object = world.num_geoms() + part.flex;
      add(from, world.geom(object), id++, world.flags()[object], part.material);
    }
  }
  if (rays::SkinShapes* skins = world.skins()) {
    skins->bend(options_.groups);
    for (int i = 0; i < skins->size(); ++i)
      add(from, skins->geom(i), id++, skins->group(i), skins->material(i));
  }
}

void ViewBuilder::add_markers(const Source& from) {
  int id = first_marker();
  for (const Marker& marker : from.markers) {
    if (id++ == excluded_geom_) continue;
    ViewGeom& g = geoms_.place(marker.shape, id - 1, from.position, from.rotation);
    set_primitive(marker.shape.type, marker.object, marker.id, g);
    geoms_.add(view_, style_, marker.shape,
               {marker.rgba, &marker.material, texture_of(marker.material)});
  }
}

void ViewBuilder::set_shape(const Source& from, const rays::RayGeom& geom, ViewGeom& g) {
  const rays::RayWorld& world = from.world;
  const rays::SharedGeometry& shapes = from.shapes;
  set_primitive(geom.type, mjOBJ_GEOM, g.id, g);
  if (g.type == mjGEOM_MESH || g.type == mjGEOM_SDF) {
    g.bvh = shapes.mesh_scenes[geom.data];
    g.mesh = assets_->mesh(geom.data);
    g.clusters = shapes.clusters_of_mesh(geom.data);
    g.horizons = shapes.horizons_of_mesh(geom.data);
  } else if (g.type == mjGEOM_HFIELD) {
    g.height_field = &shapes.height_fields[geom.data];
    g.bvh = g.height_field->scene;
    g.clusters = shapes.clusters_of_height_field(geom.data);
    g.horizons = shapes.horizons_of_height_field(geom.data);
  } else if (g.type == rays::kFlexType) {
    const int part = g.id - world.num_geoms();
    const rays::FlexShapes::Part& shape = world.flexes()->parts()[part];
    g.object_type = mjOBJ_FLEX;
    g.bvh = shape.scene;
    g.mesh =
        soft_surface(part, *assets_->flex_part(part), shape.normals, shape.positions, shape.faces);
  } else if (g.type == rays::kSkinType) {
    const int id = geom.data;
    g.object_type = mjOBJ_SKIN;
    g.bvh = world.skins()->scene(id);
    const rays::SkinShapes& skins = *world.skins();
    g.mesh = soft_surface(assets_->num_flex_parts() + id, *assets_->skin(id), skins.normals(id),
                          skins.positions(id).data(), skins.faces(id));
  }
  if (g.object_type != mjOBJ_GEOM) {
    g.object_id = geom.data;
    g.type = mjGEOM_MESH;
    g.deforms = true;
  }
}

// Combines the world's shape with the shared texture coordinates.
const MeshSurface* ViewBuilder::soft_surface(int index, const MeshSurface& shared,
                                             const float* normals, const float* positions,
                                             const int* faces) {
  MeshSurface& surface = soft_surfaces_[index];
  surface = {normals, shared.uvs, positions, faces};
  return &surface;
}

void ViewBuilder::set_mirror(const Source& from) {
  const rays::RayWorld& world = from.world;
  MirrorSearch mirror(from.position, from.rotation);
  bool over = false;
  for (int id = 0; id < world.num_geoms() && !over; ++id) {
    const int material = world.materials()[id];
    if (material < 0 || !(world.flags()[id] & options_.groups)) continue;
    over = mirror.visit(world.geom(id), id, from.appearance.rgba()[4 * id + 3],
                        from.appearance.materials()[material].reflectance);
  }
  int id = first_marker();
  for (const Marker& marker : from.markers) {
    if (over) break;
    over = mirror.visit(marker.shape, id++, marker.rgba[3], marker.material.reflectance);
  }
  view_.mirror_id = mirror.id;
  view_.reflection = nullptr;
  if (mirror.id < 0) return;
  mirrored_->excluded_geom_ = mirror.id;
  mirrored_->own_headlight_ = false;
  for (int k = 0; k < 3; ++k) mirrored_->headlight_[k] = -from.rotation[3 * k + 2];
  mirrored_->style_.tint = view_.physical.on ? 1 : mirror.reflectance;
  view_.physical.reflectance = std::min(mirror.reflectance, 1.0f);
  view_.reflection = &mirrored_->build(world, from.shapes, from.appearance, from.markers,
                                       mirror.position, mirror.rotation, view_.grid);
}

}  // namespace mjsense::render
