// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/view/drawn_scene_view.h"

#include <mujoco/mujoco.h>

#include <algorithm>

#include "mjsense/render/view/mirror.h"
#include "mjsense/render/view/view_lights.h"
#include "mjsense/render/view/view_sky.h"

namespace mjsense::render {

DrawnSceneView::DrawnSceneView(std::size_t geoms, std::size_t lights)
    : geoms_(geoms), light_space_(static_cast<int>(lights), geoms) {}

const View& DrawnSceneView::build(const DrawnScene& scene, const double position[3],
                                  const double rotation[9], const PixelGrid& grid) {
  view_.grid = grid;
  for (int i = 0; i < 9; ++i) view_.r_wc[i] = static_cast<float>(rotation[i]);
  view_.shows_plane_backs = true;
  view_.physical = {};
  if (scene.physical)
    set_physical(*scene.physical, scene.environment_tint, rotation, view_.physical);
  style_.physical = view_.physical.on;
  style_.projected_textures = scene.projected_textures;
  style_.sized_soft_textures = scene.sized_soft_textures;
  view_.near = scene.near;
  view_.far = scene.far;
  view_.shadows = scene.shadows;
  view_.skybox = scene.physical && scene.physical->hides_skybox ? nullptr : scene.skybox;
  view_.physical.shows_environment = !view_.skybox;
  geoms_.clear();
  const rays::RayGeom* endless = nullptr;  // the first infinite plane
  int id = 0;
  for (const DrawnGeom& geom : scene.geoms) {
    if (!endless && is_endless(geom.shape)) endless = &geom.shape;
    add(geom, id++, position, rotation);
  }
  geoms_.sort(view_);
  set_lights(scene, position, rotation, view_);
  if (view_.shadows) light_space_.fill(view_);
  if (view_.physical.occlusion_reach > 0) geoms_.set_occluders(view_);
  view_.sky_fog_radius = scene.sky.distance;
  set_fog(scene.fog, view_);
  view_.sky_distance = 0;
  if (view_.skybox) set_sky(scene.haze ? endless : nullptr, scene.sky, position, rotation, view_);
  view_.mirror_id = -1;
  view_.reflection = nullptr;
  if (scene.reflections) set_mirror(scene, position, rotation);
  return view_;
}

void DrawnSceneView::add(const DrawnGeom& geom, int id, const double position[3],
                         const double rotation[9]) {
  if (id == excluded_geom_) return;
  ViewGeom& g = geoms_.place(geom.shape, id, position, rotation);
  set_primitive(geom.shape.type, geom.object_type, geom.object_id, g);
  if (geom.bvh || geom.mesh_on_demand) g.type = geom.height_field ? mjGEOM_HFIELD : mjGEOM_MESH;
  g.casts_shadows = geom.casts_shadows;
  g.bvh = geom.bvh;
  g.clusters = geom.clusters;
  g.horizons = geom.horizons;
  g.mesh = geom.mesh;
  g.mesh_on_demand = geom.mesh_on_demand;
  g.height_field = geom.height_field;
  g.deforms = geom.bvh && !geom.height_field;  // a flex, a skin or a decoration
  geoms_.add(view_, style_, geom.shape, {geom.rgba, &geom.material, geom.texture, geom.maps});
}

void DrawnSceneView::set_mirror(const DrawnScene& scene, const double position[3],
                                const double rotation[9]) {
  MirrorSearch mirror(position, rotation);
  int id = 0;
  for (const DrawnGeom& geom : scene.geoms) {
    if (mirror.visit(geom.shape, id++, geom.rgba[3], geom.material.reflectance)) break;
  }
  if (mirror.id < 0) return;
  DrawnScene flat = scene;
  flat.reflections = flat.shadows = false;
  PhysicalOptions open;
  if (scene.physical) {
    open = *scene.physical;
    open.occlusion_reach = 0;
    flat.physical = &open;
  }
  if (!mirrored_) mirrored_ = std::make_unique<DrawnSceneView>(geoms_.capacity(), 0);
  mirrored_->excluded_geom_ = mirror.id;
  mirrored_->style_.tint = view_.physical.on ? 1 : mirror.reflectance;
  view_.physical.reflectance = std::min(mirror.reflectance, 1.0f);
  view_.mirror_id = mirror.id;
  view_.reflection = &mirrored_->build(flat, mirror.position, mirror.rotation, view_.grid);
}

}  // namespace mjsense::render
