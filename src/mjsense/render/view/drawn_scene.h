// SPDX-License-Identifier: Apache-2.0
#pragma once
// A scene whose geoms do not come from a RayWorld: each has everything that its image depends on.

#include <span>

#include "mjsense/rays/ray_geom.h"
#include "mjsense/render/view/appearance.h"
#include "mjsense/render/view/physical_light.h"
#include "mjsense/render/view/view.h"

namespace mjsense::render {

struct DrawnGeom {
  rays::RayGeom shape;  // `center` and `half` are set
  float rgba[4];
  Material material;
  const Texture* texture;                // null: none
  const Texture* maps[kNumTextureMaps];  // null: none
  int object_id, object_type;            // for segmentation
  bool casts_shadows;
  const MeshSurface* mesh;       // null unless the shape has triangles
  MeshOnDemand* mesh_on_demand;  // as in ViewGeom
  void* bvh;
  const rays::Clusters* clusters;
  const rays::Horizons* horizons;
  const rays::HeightField* height_field;
};

struct DrawnScene {
  std::span<const DrawnGeom> geoms;
  std::span<const ViewLight> lights;  // poses in the world frame
  float near, far;                    // m
  bool shadows, reflections;
  const Texture* skybox;  // null: none
  Sky sky;
  bool haze;
  Fog fog;
  // 2D textures are projected along z onto all shapes, except onto triangles with texture coordinates,
  // where they are not repeated, as MuJoCo did before 3.12.
  bool projected_textures;
  // As in MuJoCo before 3.13: with texuniform, textures of flexes and skins are repeated by their
  // geom's size; the texture of a skin without coordinates is projected along z of the world, instead
  // of showing one point of it.
  bool sized_soft_textures;
  const PhysicalOptions* physical;  // null: classic
  // By light, for physically based shading: candela or lux (0: not set), m.
  std::span<const float> intensities, ranges;
  Rgb64 environment_tint{1, 1, 1};  // environment_factors() of the image light
};

}  // namespace mjsense::render
