// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/view_builder.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "mjsense/rays/flex_shapes.h"
#include "mjsense/rays/ray_world.h"
#include "mjsense/rays/shared_geometry.h"
#include "mjsense/rays/skin_shapes.h"
#include "mjsense/render/light/material.h"
#include "mjsense/render/light/tone_map.h"
#include "mjsense/render/view/fixed_layer.h"
#include "mjsense/render/view/frustum.h"
#include "mjsense/render/view/image_window.h"
#include "mjsense/render/view/shadow_reach.h"
#include "mjsense/render/view/soft_lights.h"

namespace mjsense::render {
namespace {

constexpr float kOpaque = 0.995f;    // MuJoCo blends geoms with a lower alpha
constexpr float kFromBehind = 0.3f;  // MuJoCo's factor for the alpha of planes seen from below

// out = R^T v.
void rotate_back(const double r[9], const double v[3], double out[3]) {
  for (int i = 0; i < 3; ++i) out[i] = r[i] * v[0] + r[3 + i] * v[1] + r[6 + i] * v[2];
}

// Sets the fields of shapes that are defined by their sizes alone.
void set_primitive(int type, int object, int object_id, ViewGeom& g) {
  g.type = type;
  g.shows_back = type == mjGEOM_PLANE && g.eye[2] < 0;
  g.object_type = object;
  g.object_id = object_id;
  g.bvh = nullptr;
  g.clusters = nullptr;
  g.horizons = nullptr;
  g.mesh = nullptr;
  g.mesh_on_demand = nullptr;
  g.height_field = nullptr;
  g.deforms = false;
}

// The factors by which MuJoCo's visualiser scales a shape along its axes and, with texuniform, its
// texture.
std::array<float, 3> drawn_extent(const ViewGeom& g) {
  const float* s = g.size;
  switch (g.type) {
    case mjGEOM_SPHERE:
      return {s[0], s[0], s[0]};
    case mjGEOM_CAPSULE:
    case mjGEOM_CYLINDER:
      return {s[0], s[0], s[1]};
    default:
      return {s[0], s[1], s[2]};
  }
}

}  // namespace

bool hides_environment(const ViewGeom& g) {
  return g.casts_shadows && !g.transparent && !g.deforms && !g.height_field;
}

float highlight_threshold_of(float exponent) {
  if (!(exponent >= 4)) return -1;
  const float x = 0.9999f * std::max(0.3f, std::exp(-33 / exponent));
  return x * x;
}

ViewBuilder::ViewBuilder(const mjModel* model, const SurfaceAssets& assets,
                         const ViewOptions& options)
    : assets_(&assets),
      options_(options),
      unsorted_(max_geoms(model) + options.markers),
      sorted_(unsorted_.size()),
      light_space_(options.shadows ? options.shadow_samples * model->nlight : 0, unsorted_.size()),
      soft_surfaces_(assets.num_flex_parts() + model->nskin) {
  order_.reserve(unsorted_.size());
  candidates_.resize((static_cast<std::size_t>(model->ngeom + model->nflex) + 63) / 64);
  if (options.layered) {
    view_.layered = true;
    geom_index_.resize(unsorted_.size());
    for (int i = 0; i < model->ngeom; ++i)
      fixed_.push_back(is_fixed_body(model, model->geom_bodyid[i]));
  }
  view_.near = options.near;
  view_.far = options.far;
  view_.shadows = options.shadows;
  view_.warp.on = options.as_mujoco_warp;
  const bool sky = options.as_mujoco_warp ? options.warp_skybox : options.textures;
  view_.skybox = sky && !options.physical.hides_skybox ? assets.skybox() : nullptr;
  if (options.reflections && model->nmat > 0) {  // any world may set a material's reflectance
    ViewOptions flat = options;
    flat.reflections = flat.shadows = flat.layered = false;
    flat.physical.occlusion_reach = 0;
    mirrored_ = std::make_unique<ViewBuilder>(model, assets, flat);
  }
}

template <class SetShape>
void ViewBuilder::add_shape(const rays::RayGeom& source, int id, const float* rgba,
                            const Material* material, const double position[3],
                            const double rotation[9], SetShape shape, const Texture* const* maps) {
  const int index = static_cast<int>(order_.size());
  ViewGeom& g = unsorted_[index];
  g.id = id;
  g.fixed = static_cast<std::size_t>(id) < fixed_.size() && fixed_[id];
  place(source, position, rotation, g);
  const Texture* texture = shape(g);
  const bool hidden = view_.warp.on && g.shows_back;  // not a veil, as in MuJoCo
  const bool sight = find_window(view_, g) && rgba[3] > 0 && !hidden;
  if (!sight && !view_.shadows && !(view_.physical.occlusion_reach > 0) &&
      !view_.physical.all_geoms)
    return;
  set_surface(source, rgba, material, texture, maps, g);
  Order order{sight ? g.transparent : 2, g.min_depth, index};
  if (order.rank == 1) {
    const float* p = g.pos;
    const bool soft = g.object_type == mjOBJ_FLEX || g.object_type == mjOBJ_SKIN;
    const float reach = soft ? 0 : g.radius;  // as in MuJoCo
    order.key =
        g.type == mjGEOM_PLANE ? 1e10f : std::sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - reach;
  }
  order_.push_back(order);
}

void ViewBuilder::sort_geoms(const double rotation[9]) {
  std::sort(order_.begin(), order_.end(), [](const Order& a, const Order& b) {
    if (a.rank != b.rank) return a.rank < b.rank;
    if (a.key != b.key) return a.key < b.key;
    return a.index < b.index;
  });
  view_.num_opaque = view_.num_transparent = 0;
  for (std::size_t i = 0; i < order_.size(); ++i) {
    const ViewGeom& g = sorted_[i] = unsorted_[order_[i].index];
    if (view_.layered) geom_index_[g.id] = static_cast<int>(i);
    view_.num_opaque += order_[i].rank == 0;
    view_.num_transparent += order_[i].rank == 1;
  }
  view_.geoms = sorted_.data();
  view_.geom_index = geom_index_.data();
  view_.fixed_tiles = nullptr;
  view_.num_geoms = static_cast<int>(order_.size());
  for (int i = 0; i < 9; ++i) view_.r_wc[i] = static_cast<float>(rotation[i]);
}

const View& ViewBuilder::build(const rays::RayWorld& world, const rays::SharedGeometry& shapes,
                               const Appearance& appearance, std::span<const Marker> markers,
                               const double position[3], const double rotation[9],
                               const PixelGrid& grid) {
  view_.grid = grid;
  if (options_.physical.on) {
    set_physical(options_.physical, appearance.environment_tint(), rotation, view_.physical);
    view_.physical.shows_environment = !view_.skybox;
  }
  order_.clear();
  const rays::RayGeom* endless = nullptr;  // the first infinite plane
  const auto texture_of = [&](const Material& material) {
    const bool whole = options_.physical.on && material.texture < 0;
    return assets_->texture(whole ? material.textures[mjTEXROLE_RGBA] : material.texture);
  };
  const auto add = [&](const rays::RayGeom& source, int id, std::uint32_t flags, int material) {
    const float* rgba = appearance.rgba().data() + 4 * id;
    if (rgba[3] == 0 || !(flags & options_.groups) || id == excluded_geom_) return;
    if (!endless && source.type == mjGEOM_PLANE && source.size[0] == 0 && source.size[1] == 0)
      endless = &source;
    add_shape(source, id, rgba, material < 0 ? nullptr : &appearance.materials()[material],
              position, rotation, [&](ViewGeom& g) {
                set_shape(world, shapes, source, g);
                return material < 0 ? nullptr : texture_of(appearance.materials()[material]);
              });
  };
  const auto add_geom = [&](int id) {
    add(world.geom(id), id, world.flags()[id], world.materials()[id]);
  };
  int id = world.num_geoms();
  // Bounding boxes of skins and markers, which may receive shadows, are not stored.
  const bool unbounded = options_.shadows && (world.skins() || !markers.empty());
  if (grid.distorted_rays || unbounded || options_.disable_culling || view_.physical.all_geoms) {
    for (int i = 0; i < id; ++i) add_geom(i);
  } else {
    Frustum frustum(grid, position, rotation);
    if (options_.shadows) reach_lights(world, appearance, options_.shadow_samples, frustum);
    if (view_.physical.occlusion_reach > 0) frustum.widen(view_.physical.occlusion_reach);
    find_candidates(world.boxes(), frustum, candidates_);
    for (std::size_t word = 0; word < candidates_.size(); ++word) {
      for (std::uint64_t bits = candidates_[word]; bits != 0; bits &= bits - 1) {
        const int i = static_cast<int>(64 * word) + std::countr_zero(bits);
        if (i < id) add_geom(i);
      }
    }
  }
  if (const rays::FlexShapes* flexes = world.flexes()) {
    for (const rays::FlexShapes::Part& part : flexes->parts()) {
      const int object = world.num_geoms() + part.flex;
      add(world.geom(object), id++, world.flags()[object], part.material);
    }
  }
  if (rays::SkinShapes* skins = world.skins()) {
    skins->bend(options_.groups);
    for (int i = 0; i < skins->size(); ++i)
      add(skins->geom(i), id++, skins->group(i), skins->material(i));
  }
  id = first_marker();
  for (const Marker& marker : markers) {
    if (id++ == excluded_geom_) continue;
    add_shape(marker.shape, id - 1, marker.rgba, &marker.material, position, rotation,
              [&](ViewGeom& g) {
                set_primitive(marker.shape.type, marker.object, marker.id, g);
                return texture_of(marker.material);
              });
  }
  sort_geoms(rotation);
  set_lights(world, appearance, position, rotation);
  if (options_.shadows) light_space_.fill(view_);
  if (view_.physical.occlusion_reach > 0) set_occluders();
  if (view_.skybox && !view_.warp.on) set_sky(endless, appearance.sky(), position, rotation);
  if (mirrored_) set_mirror(world, shapes, appearance, markers, position, rotation);
  return view_;
}

template <class Build>
bool ViewBuilder::ends_mirror_search(const rays::RayGeom& g, int id, float alpha, float reflectance,
                                     const double position[3], const double rotation[9],
                                     Build build) {
  if (g.type != mjGEOM_PLANE && g.type != mjGEOM_BOX) return false;
  if (reflectance <= 0 || alpha < kOpaque) return false;
  const double normal[3] = {g.mat[2], g.mat[5], g.mat[8]};
  const double top = g.type == mjGEOM_BOX ? g.size[2] : 0;
  double above = -top;
  for (int k = 0; k < 3; ++k) above += (position[k] - g.pos[k]) * normal[k];
  // Below a mirror: a box ends the search; a plane, which is drawn as a veil, is skipped.
  if (above < 0) return g.type == mjGEOM_BOX;
  double p[3], r[9];
  for (int k = 0; k < 3; ++k) p[k] = position[k] - 2 * above * normal[k];
  for (int j = 0; j < 3; ++j) {
    double along = 0;
    for (int k = 0; k < 3; ++k) along += normal[k] * rotation[3 * k + j];
    for (int k = 0; k < 3; ++k) r[3 * k + j] = rotation[3 * k + j] - 2 * along * normal[k];
  }
  mirrored_->excluded_geom_ = id;
  mirrored_->own_headlight_ = false;
  for (int k = 0; k < 3; ++k) mirrored_->headlight_[k] = -rotation[3 * k + 2];
  mirrored_->tint_ = view_.physical.on ? 1 : reflectance;
  view_.physical.reflectance = std::min(reflectance, 1.0f);
  view_.reflection = &build(p, r);
  view_.mirror_id = id;
  return true;
}

ViewBuilder::ViewBuilder(std::size_t geoms, std::size_t lights)
    : unsorted_(geoms), sorted_(geoms), light_space_(static_cast<int>(lights), geoms) {
  order_.reserve(geoms);
}

const View& ViewBuilder::build(const DrawnScene& scene, const double position[3],
                               const double rotation[9], const PixelGrid& grid) {
  view_.grid = grid;
  view_.shows_plane_backs = true;
  view_.physical = {};
  if (scene.physical)
    set_physical(*scene.physical, scene.environment_tint, rotation, view_.physical);
  projected_ = scene.projected_textures;
  sized_soft_ = scene.sized_soft_textures;
  view_.near = scene.near;
  view_.far = scene.far;
  view_.shadows = scene.shadows;
  view_.skybox = scene.physical && scene.physical->hides_skybox ? nullptr : scene.skybox;
  view_.physical.shows_environment = !view_.skybox;
  order_.clear();
  const rays::RayGeom* endless = nullptr;  // the first infinite plane
  int id = 0;
  for (const DrawnGeom& geom : scene.geoms) {
    const rays::RayGeom& shape = geom.shape;
    if (!endless && shape.type == mjGEOM_PLANE && shape.size[0] == 0 && shape.size[1] == 0)
      endless = &shape;
    if (id++ == excluded_geom_) continue;
    add_shape(
        shape, id - 1, geom.rgba, &geom.material, position, rotation,
        [&](ViewGeom& g) {
          set_primitive(shape.type, geom.object_type, geom.object_id, g);
          if (geom.bvh || geom.mesh_on_demand)
            g.type = geom.height_field ? mjGEOM_HFIELD : mjGEOM_MESH;
          g.casts_shadows = geom.casts_shadows;
          g.bvh = geom.bvh;
          g.clusters = geom.clusters;
          g.horizons = geom.horizons;
          g.mesh = geom.mesh;
          g.mesh_on_demand = geom.mesh_on_demand;
          g.height_field = geom.height_field;
          g.deforms = geom.bvh && !geom.height_field;  // a flex, a skin or a decoration
          return geom.texture;
        },
        geom.maps);
  }
  sort_geoms(rotation);
  view_.num_lights = static_cast<int>(scene.lights.size());
  view_.global_ambient = scene.lights.empty() ? 0.3f : 0.0f;
  for (int i = 0; i < view_.num_lights; ++i) {
    const ViewLight& light = view_.lights[i] = scene.lights[i];
    const double from[3] = {light.pos[0], light.pos[1], light.pos[2]};
    const double to[3] = {light.dir[0], light.dir[1], light.dir[2]};
    place_light(from, to, position, rotation, view_.lights[i]);
    if (scene.physical)
      set_physical(*scene.physical, scene.intensities[i], scene.ranges[i], view_.lights[i]);
    for (int axis = 0; axis < 2; ++axis) {
      double in_camera[3];
      const double in_world[3] = {scene.lights[i].shadow_map_axes[axis][0],
                                  scene.lights[i].shadow_map_axes[axis][1],
                                  scene.lights[i].shadow_map_axes[axis][2]};
      rotate_back(rotation, in_world, in_camera);
      std::copy_n(in_camera, 3, view_.lights[i].shadow_map_axes[axis]);
    }
  }
  if (view_.shadows) light_space_.fill(view_);
  if (view_.physical.occlusion_reach > 0) set_occluders();
  view_.sky_distance = 0;
  view_.sky_fog_radius = scene.sky.distance;
  view_.fog = scene.fog;
  for (float& x : view_.fog.rgb) x = shown(x);
  if (view_.skybox) set_sky(scene.haze ? endless : nullptr, scene.sky, position, rotation);
  view_.mirror_id = -1;
  view_.reflection = nullptr;
  if (!scene.reflections) return view_;
  if (!mirrored_) mirrored_ = std::make_unique<ViewBuilder>(unsorted_.size(), 0);
  DrawnScene flat = scene;
  flat.reflections = flat.shadows = false;
  PhysicalOptions open;
  if (scene.physical) {
    open = *scene.physical;
    open.occlusion_reach = 0;
    flat.physical = &open;
  }
  id = 0;
  for (const DrawnGeom& geom : scene.geoms)
    if (ends_mirror_search(geom.shape, id++, geom.rgba[3], geom.material.reflectance, position,
                           rotation, [&](const double p[3], const double r[9]) -> const View& {
                             return mirrored_->build(flat, p, r, grid);
                           }))
      break;
  return view_;
}

// Mirrors the camera in the plane. Its pixel rays then meet the mirror at the same points and
// continue to what is reflected. The camera's rotation becomes a reflection, which does no harm.
void ViewBuilder::set_mirror(const rays::RayWorld& world, const rays::SharedGeometry& shapes,
                             const Appearance& appearance, std::span<const Marker> markers,
                             const double position[3], const double rotation[9]) {
  view_.mirror_id = -1;
  view_.reflection = nullptr;
  // Returns true if the search is over. As in MuJoCo, there is at most one mirror.
  const auto settles = [&](const rays::RayGeom& g, int id, float alpha, float reflectance) {
    return ends_mirror_search(g, id, alpha, reflectance, position, rotation,
                              [&](const double p[3], const double r[9]) -> const View& {
                                return mirrored_->build(world, shapes, appearance, markers, p, r,
                                                        view_.grid);
                              });
  };
  for (int id = 0; id < world.num_geoms(); ++id) {
    const int material = world.materials()[id];
    if (material < 0 || !(world.flags()[id] & options_.groups)) continue;
    if (settles(world.geom(id), id, appearance.rgba()[4 * id + 3],
                appearance.materials()[material].reflectance))
      return;
  }
  int id = first_marker();
  for (const Marker& marker : markers)
    if (settles(marker.shape, id++, marker.rgba[3], marker.material.reflectance)) return;
}

void ViewBuilder::place(const rays::RayGeom& source, const double position[3],
                        const double rotation[9], ViewGeom& g) const {
  const double offset[3] = {source.pos[0] - position[0], source.pos[1] - position[1],
                            source.pos[2] - position[2]};
  double p[3], eye[3];
  rotate_back(rotation, offset, p);
  rotate_back(source.mat, offset, eye);
  for (int i = 0; i < 3; ++i) {
    g.pos[i] = static_cast<float>(p[i]);
    g.eye[i] = static_cast<float>(-eye[i]);
    g.size[i] = source.size[i];
    g.aabb[i] = source.center[i];
    g.aabb[3 + i] = source.half[i];
    for (int j = 0; j < 3; ++j)
      g.rot[3 * i + j] =
          static_cast<float>(rotation[i] * source.mat[j] + rotation[3 + i] * source.mat[3 + j] +
                             rotation[6 + i] * source.mat[6 + j]);
  }
}

void ViewBuilder::set_shape(const rays::RayWorld& world, const rays::SharedGeometry& shapes,
                            const rays::RayGeom& source, ViewGeom& g) {
  set_primitive(source.type, mjOBJ_GEOM, g.id, g);
  if (g.type == mjGEOM_MESH || g.type == mjGEOM_SDF) {
    g.bvh = shapes.mesh_scenes[source.data];
    g.mesh = assets_->mesh(source.data);
    g.clusters = shapes.clusters_of_mesh(source.data);
    g.horizons = shapes.horizons_of_mesh(source.data);
  } else if (g.type == mjGEOM_HFIELD) {
    g.height_field = &shapes.height_fields[source.data];
    g.bvh = g.height_field->scene;
    g.clusters = shapes.clusters_of_height_field(source.data);
    g.horizons = shapes.horizons_of_height_field(source.data);
  } else if (g.type == rays::kFlexType) {
    const int part = g.id - world.num_geoms();
    const rays::FlexShapes::Part& shape = world.flexes()->parts()[part];
    g.object_type = mjOBJ_FLEX;
    g.bvh = shape.scene;
    g.mesh =
        soft_surface(part, *assets_->flex_part(part), shape.normals, shape.positions, shape.faces);
  } else if (g.type == rays::kSkinType) {
    const int id = source.data;
    g.object_type = mjOBJ_SKIN;
    g.bvh = world.skins()->scene(id);
    const rays::SkinShapes& skins = *world.skins();
    g.mesh = soft_surface(assets_->num_flex_parts() + id, *assets_->skin(id), skins.normals(id),
                          skins.positions(id).data(), skins.faces(id));
  }
  if (g.object_type != mjOBJ_GEOM) {
    g.object_id = source.data;
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

void ViewBuilder::set_surface(const rays::RayGeom& source, const float* rgba,
                              const Material* material, const Texture* texture,
                              const Texture* const* maps, ViewGeom& g) const {
  Surface& s = g.surface;
  s = {};
  std::copy_n(rgba, 4, s.rgba);
  const bool physical = view_.physical.on;
  for (int i = 0; i < 3; ++i)
    s.rgba[i] = physical ? static_cast<float>(srgb_decode(rgba[i])) : rgba[i] * tint_;
  if (g.shows_back) s.rgba[3] *= kFromBehind;
  g.transparent = s.rgba[3] < kOpaque || g.shows_back;
  s.specular = 0.5f;
  s.exponent = 128.0f * (material ? material->shininess : 0.5f);
  s.highlight_threshold = highlight_threshold_of(s.exponent);
  if (material) s.specular = material->specular;
  if (physical) {
    s.specular = static_cast<float>(dielectric_f0(s.specular));
    s.metallic = static_cast<float>(metallic_of(material ? material->metallic : -1));
    s.roughness = static_cast<float>(
        material ? roughness_of(material->roughness, material->shininess) : roughness_of(-1, 0.5));
  }
  if (!material) return;
  s.emission = material->emission;
  if (!options_.textures) return;
  s.texture = texture && texture->levels > 0 && !texture->grey ? texture : nullptr;
  if (physical) set_maps(*material, maps, s);
  if (s.maps[kOpacityMap]) g.transparent = true;
  if (!s.texture && !s.mapped) return;
  const bool uniform = material->uniform;
  const bool coordinates = g.mesh_on_demand ? g.mesh_on_demand->has_uvs() : g.mesh && g.mesh->uvs;
  s.uses_mesh_uvs = coordinates && (s.mapped || !s.texture->cube);
  // MuJoCo textures flexes by their own coordinates only.
  if (g.object_type == mjOBJ_FLEX && !s.uses_mesh_uvs) {
    s.texture = nullptr;
    s.mapped = false;
    return;
  }
  const bool soft = g.object_type == mjOBJ_FLEX || g.object_type == mjOBJ_SKIN;
  const std::array<float, 3> extent =
      soft && !sized_soft_ ? std::array<float, 3>{} : drawn_extent(g);
  s.projected_along_z = (g.mesh && !s.uses_mesh_uvs) || g.height_field || (projected_ && !g.mesh);
  const bool endless = g.type == mjGEOM_PLANE && (g.size[0] <= 0 || g.size[1] <= 0);
  for (int i = 0; i < 2; ++i) {
    s.uv_scale[i] = material->repeat[i];
    if (s.uv_scale[i] <= 0 && !s.projected_along_z) s.uv_scale[i] = 1;
    if (uniform && extent[i] > 0) s.uv_scale[i] *= extent[i];
    if (projected_ && s.uses_mesh_uvs) s.uv_scale[i] = 1;
    if (s.projected_along_z || endless) s.uv_offset[i] = -0.5f;
    if (s.projected_along_z && g.object_type == mjOBJ_SKIN) {
      if (!sized_soft_) {
        s.uv_scale[i] = s.uv_offset[i] = 0;
      } else {  // the texture stays fixed in the world; kernels divide by the size
        s.uv_offset[i] += (i ? -0.5f : 0.5f) * s.uv_scale[i] * static_cast<float>(source.pos[i]);
        if (g.size[i] > 0) s.uv_scale[i] *= g.size[i];
      }
    }
  }
  if (view_.warp.on && g.type == mjGEOM_PLANE) {  // mujoco_warp treats all planes as infinite ones
    for (int i = 0; i < 2; ++i) {
      const float size = std::max(g.size[i], 0.0f);
      s.uv_scale[i] = material->repeat[i] * (size > 0 ? size : 1);
      s.uv_offset[i] = -0.5f - 0.5f * size * material->repeat[i];
    }
  }
  // Cube maps: MuJoCo uses directions in the unit shape that it scales; for meshes and planes, in
  // metres.
  const bool in_meters = g.mesh || g.height_field || g.type == mjGEOM_PLANE;
  for (int i = 0; i < 3; ++i) {
    if (in_meters) {
      s.cube_scale[i] = uniform && !soft ? extent[i] : 1.0f;
    } else {
      s.cube_scale[i] = uniform || extent[i] <= 0 ? 1.0f : 1.0f / extent[i];
    }
  }
}

void ViewBuilder::set_maps(const Material& material, const Texture* const* maps, Surface& s) const {
  for (int i = 0; i < kNumTextureMaps; ++i) {
    const Texture* map =
        maps ? maps[i]
             : assets_->texture(texture_of(material.textures, static_cast<TextureMap>(i)));
    if (!map || map->levels == 0 || map->cube) continue;
    s.maps[i] = map;
    s.mapped = true;
  }
  const auto is_in = [&](TextureMap map) { return s.maps[map] || s.maps[kOrmMap]; };
  if (is_in(kRoughnessMap) && material.roughness < 0) s.roughness = 1;
  if (is_in(kMetallicMap) && material.metallic < 0) s.metallic = 1;
  if (s.maps[kEmissiveMap] && s.emission == 0) s.emission = 1;
}

// A colour of the sky as the kernels need it: radiance, if the view is physically based.
float ViewBuilder::shown(float color) const {
  return view_.physical.on ? static_cast<float>(srgb_decode(color)) * view_.physical.unit : color;
}

// The sky's cylinder and the haze are at least (1 - width) times the cylinder's radius away; the
// longest rays go through the image's corners.
float ViewBuilder::sky_min_depth(const Sky& sky) const {
  const PixelGrid& grid = view_.grid;
  if (grid.distorted_rays) return 0;
  const float x = std::max(std::abs(grid.left), std::abs(grid.left + grid.dx * grid.width));
  const float y = std::max(std::abs(grid.top), std::abs(grid.top + grid.dy * grid.height));
  return std::max(1 - sky.haze_width, 0.0f) * sky.distance / std::sqrt(1 + x * x + y * y);
}

// An orthographic view has no position relative to the sky: the sky hides nothing and there is no
// haze.
void ViewBuilder::set_sky(const rays::RayGeom* plane, const Sky& sky, const double position[3],
                          const double rotation[9]) {
  view_.sky_distance = view_.grid.orthographic ? 0 : sky.distance;
  view_.sky_min_depth = sky_min_depth(sky);
  Haze& haze = view_.haze;
  haze.height = 0;
  if (!plane) return;
  const double normal[3] = {plane->mat[2], plane->mat[5], plane->mat[8]};
  double up[3], height = 0;
  rotate_back(rotation, normal, up);
  for (int k = 0; k < 3; ++k) {
    height += (position[k] - plane->pos[k]) * normal[k];
    haze.up[k] = static_cast<float>(up[k]);
    haze.rgb[k] = shown(sky.haze_rgb[k]);
  }
  haze.height = static_cast<float>(height);
  haze.width = sky.haze_width;
}

void ViewBuilder::set_occluders() {
  using Boxes = OccluderBoxes;
  const std::size_t stride = sorted_.size() + kWindowPadding;
  occluder_boxes_.resize(Boxes::kRows * stride);
  view_.occluders = {occluder_boxes_.data(), stride};
  const auto set = [&](int row, int i, float value) { view_.occluders.row(row)[i] = value; };
  for (int i = 0; i < view_.num_geoms; ++i) {
    const ViewGeom& g = sorted_[i];
    const bool plane = g.type == mjGEOM_PLANE;
    for (int k = 0; k < 9; ++k) set(Boxes::kRotation + k, i, g.rot[k]);
    for (int k = 0; k < 3; ++k) {
      const float side = k == 2 ? 0 : g.size[k] > 0 ? g.size[k] : kEndless;  // of a plane
      set(Boxes::kOrigin + k, i, g.eye[k] - (plane ? 0 : g.aabb[k]));
      set(Boxes::kHalf + k, i, plane ? side : g.aabb[3 + k]);
    }
    set(Boxes::kReach, i,
        hides_environment(g) ? hiding_reach(g, view_.physical.occlusion_reach) : -kEndless);
  }
}

void ViewBuilder::set_lights(const rays::RayWorld& world, const Appearance& appearance,
                             const double position[3], const double rotation[9]) {
  view_.num_lights = 0;
  std::fill_n(view_.warp.ambient, 3, 0.0f);
  for (const ViewLight& light : appearance.lights()) {
    for (int k = 0; k < 3; ++k) view_.warp.ambient[k] += light.ambient[k];
  }
  // As in MuJoCo, so that the image is not black.
  view_.global_ambient = appearance.lights().empty() ? 0.3f : 0.0f;
  for (std::size_t i = 0; i < appearance.lights().size(); ++i) {
    ViewLight light = appearance.lights()[i];
    const int id = appearance.light_ids()[i];
    if (id < 0) {  // the headlight shines in the camera's viewing direction
      double d[3] = {0, 0, -1};
      if (!own_headlight_) rotate_back(rotation, headlight_, d);
      for (int k = 0; k < 3; ++k) light.dir[k] = static_cast<float>(d[k]);
      if (view_.physical.on) set_physical(options_.physical, 0, 0, light);
      view_.lights[view_.num_lights++] = light;
      continue;
    }
    const rays::RayLight& source = world.lights()[id];
    if (view_.physical.on)
      set_physical(options_.physical, appearance.light_intensities()[i],
                   appearance.light_ranges()[i], light);
    light.radius = appearance.light_radii()[i];
    const int count = light_samples(appearance, i, options_.shadow_samples);
    for (float* rgb : {light.ambient, light.diffuse, light.specular}) {
      for (int k = 0; k < 3 && count > 1; ++k) rgb[k] /= static_cast<float>(count);
    }
    for (int k = 0; k < count; ++k) {
      double from[3] = {source.pos[0], source.pos[1], source.pos[2]};
      if (count > 1) sample_position(source.pos, appearance.light_radii()[i], k, count, from);
      place_light(from, source.dir, position, rotation, light);
      view_.lights[view_.num_lights++] = light;
    }
  }
}

void ViewBuilder::place_light(const double light_position[3], const double direction[3],
                              const double position[3], const double rotation[9],
                              ViewLight& light) {
  const double offset[3] = {light_position[0] - position[0], light_position[1] - position[1],
                            light_position[2] - position[2]};
  double p[3], d[3];
  rotate_back(rotation, offset, p);
  rotate_back(rotation, direction, d);
  for (int k = 0; k < 3; ++k) {
    light.pos[k] = static_cast<float>(p[k]);
    light.dir[k] = static_cast<float>(d[k]);
  }
}

}  // namespace mjsense::render
