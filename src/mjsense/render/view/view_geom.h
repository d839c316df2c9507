// SPDX-License-Identifier: Apache-2.0
#pragma once
// A geom of a view: its pose, shape and material in the camera's frame.

#include <algorithm>

#include "mjsense/render/view/surface_assets.h"
#include "mjsense/render/view/texture_maps.h"

namespace mjsense::rays {
class Horizons;
struct Clusters;
struct HeightField;
}  // namespace mjsense::rays

namespace mjsense::render {

// The material of a geom. Colours are in [0, 1]; in a physically based view, rgb is linear.
struct Surface {
  float rgba[4];
  float specular, emission;   // physically based: F0 of dielectrics, instead of `specular`
  float roughness, metallic;  // 0..1, for physically based views
  float exponent;             // 128 * shininess
  float highlight_threshold;  // (N . H)^2 below which the specular highlight is 0, or -1
  const Texture* texture;     // of the colours; null: none
  const Texture* maps[kNumTextureMaps];  // for physically based views; null: none
  bool mapped;                           // whether there are any
  // For 2D textures and maps: coordinates are multiplied by uv_scale, then uv_offset is added.
  float uv_scale[2], uv_offset[2];
  float cube_scale[3];     // for cube maps: multiplies the direction in which the texture is read
  bool uses_mesh_uvs;      // 2D textures with the mesh's own texture coordinates
  bool projected_along_z;  // 2D textures projected along the geom's z axis

  bool operator==(const Surface&) const = default;
};

// A mesh whose parts are built when a kernel first needs them. It belongs to one thread.
class MeshOnDemand {
 public:
  virtual bool has_uvs() const = 0;
  virtual const rays::Clusters& clusters() = 0;
  virtual const rays::Horizons& horizons() = 0;
  virtual void* bvh() = 0;         // RTCScene
  virtual void* shadow_bvh() = 0;  // RTCScene
  // Fills ViewGeom::mesh of its geom. `uvs`: with texture coordinates, if the mesh has them.
  virtual void prepare_surface(bool uvs) = 0;

 protected:
  ~MeshOnDemand() = default;
};

// C is the camera's frame, G the geom's.
struct alignas(64) ViewGeom {
  float rot[9];     // R_CG, row-major
  float pos[3];     // p_CG, m
  float eye[3];     // position of the camera in G: -R_CG^T p_CG, m
  float size[3];    // as mjModel's geom_size, m
  float aabb[6];    // bounding box in G: centre, half sizes; m
  float center[3];  // centre of the bounding sphere in C, m
  float radius;     // of the bounding sphere, m; infinite for planes
  float window[4];  // minimum X, maximum X, minimum Y, maximum Y of the pixels it may cover
  float min_depth;  // lower bound of its planar depth, m
  int type;         // mjtGeom; mjGEOM_MESH for a flex or skin
  int id;           // index among all geoms, parts of flexes, skins and markers of the model
  int object_id, object_type;  // for segmentation: MuJoCo's id and mjtObj
  bool fixed;                  // cannot move, so it belongs to the fixed layer of the image
  bool casts_shadows = true;
  bool transparent;  // blended over the surfaces farther away; casts shadows and receives none
  // A plane seen from its back, which is drawn as a faint veil. Depth and segmentation contain it
  // only if View::shows_plane_backs.
  bool shows_back;
  bool deforms;  // its triangles may change while this structure does not
  void* bvh;     // RTCScene of a mesh, a height field's surface, a flex or a skin; else null
  const rays::Clusters* clusters;  // the triangles of `bvh`, for rasterising; null: use rays only
  const rays::Horizons* horizons;  // horizons of the mesh's faces; null without clusters
  const MeshSurface* mesh;         // null: not a mesh, flex or skin
  // If not null, provides the data of `bvh`, `clusters` and `horizons`, which are null then, and
  // fills `mesh`.
  MeshOnDemand* mesh_on_demand;
  const rays::HeightField* height_field;  // null for other types
  Surface surface;

  bool operator==(const ViewGeom&) const = default;
};

// Whether other geoms get less light from the environment because of this one: not if it is transparent, or
// if its bounding box says little about its shape.
bool hides_environment(const ViewGeom& geom);

// Distance from the geom up to which it hides the environment, m; at most `reach`. For shapes that count as
// rounded it is 3.5 times their thickness, where a sphere hides less than 2 % of the environment.
inline float hiding_reach(const ViewGeom& geom, float reach) {
  const float* half = geom.aabb + 3;
  const bool box = geom.type == mjGEOM_BOX || geom.type == mjGEOM_PLANE;
  const float own = box ? 4 * geom.radius : 7 * std::min({half[0], half[1], half[2]});
  return std::min(own, reach);
}

}  // namespace mjsense::render
