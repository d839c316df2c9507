// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/scene_geoms.h"

#include <fmt/format.h>
#include <mujoco/mujoco.h>

#include <algorithm>
#include <tuple>

#include "mjsense/core/error.h"
#include "mjsense/render/abstract/shape_box.h"

namespace mjsense::render {
namespace {

constexpr float kUnbounded = 1e30f;

void check(const AbstractGeom& geom, int index, bool colored) {
  if (!is_finite(geom.pos) || !is_finite(geom.mat) || !is_finite(geom.size) ||
      !is_finite(geom.rgba))
    throw ValueError(fmt::format(
        "geom {} of the scene (object type {}, id {}) has a pose, size or colour that is not "
        "finite",
        index, geom.objtype, geom.objid));
  if (colored && geom.label)
    throw ValueError(
        fmt::format("geom {} of the scene (object type {}, id {}) has a label, and labels are not "
                    "drawn; remove it, or set scene_option.label to mjLABEL_NONE",
                    index, geom.objtype, geom.objid));
}

}  // namespace

void SceneGeoms::read(const SceneMemory& scene, const Look& look) {
  drawn_.clear();
  decorations_.clear();
  segments_.assign(scene.num_geoms + 1, {-1, -1});
  for (int i = 0; i < scene.num_geoms; ++i) {
    AbstractGeom geom;
    reader_.read(scene.geoms + i * scene.geom_stride, geom);
    if (geom.segid >= 0 && geom.segid <= scene.num_geoms)
      segments_[geom.segid] = {geom.objid, geom.objtype};
    check(geom, i, look.colored);
    if (look.colored || geom.segid >= 0) add(geom, scene, look);
  }
  // A segment belongs to the last geom that has its id, which matters for decoration geoms that
  // users add without an id of their own.
  for (DrawnGeom& drawn : drawn_) {
    const int segment = drawn.object_id;
    std::tie(drawn.object_id, drawn.object_type) =
        segment >= 0 && segment <= scene.num_geoms ? segments_[segment] : std::pair(-1, -1);
  }
}

void SceneGeoms::set_material(const AbstractGeom& geom, const Look& look, DrawnGeom& out) {
  std::copy_n(geom.rgba, 4, out.rgba);
  // Some programs hide elements with a negative alpha. Depth and segmentation show all elements.
  out.rgba[3] = look.colored ? std::max(out.rgba[3], 0.0f) : 1;
  out.material = {.specular = geom.specular,
                  .shininess = geom.shininess,
                  .emission = geom.emission,
                  .reflectance = geom.reflectance,
                  .texture = -1,
                  .repeat = {geom.texrepeat[0], geom.texrepeat[1]},
                  .uniform = geom.texuniform != 0};
  if (geom.matid < 0 || geom.matid >= model_->nmat) return;
  int texture = geom.texid;
  if (texture < 0) {
    texture = model_->mat_texid[mjNTEXROLE * geom.matid + mjTEXROLE_RGB];
    std::copy_n(model_->mat_texrepeat + 2 * geom.matid, 2, out.material.repeat);
    out.material.uniform = model_->mat_texuniform[geom.matid] != 0;
  }
  if (look.colored) out.texture = assets_.texture(texture);
  if (look.colored && look.physical) {
    out.material.textures = textures_of(model_, geom.matid);
    if (texture < 0) out.texture = assets_.texture(out.material.textures[mjTEXROLE_RGBA]);
    for (int i = 0; i < kNumTextureMaps; ++i)
      out.maps[i] = assets_.texture(texture_of(out.material.textures, static_cast<TextureMap>(i)));
  }
  if (model_->mat_metallic) out.material.metallic = model_->mat_metallic[geom.matid];
  if (model_->mat_roughness) out.material.roughness = model_->mat_roughness[geom.matid];
}

// Returns false if nothing is drawn.
bool SceneGeoms::set_primitive_shape(const AbstractGeom& geom, rays::RayGeom& shape) const {
  const float* size = geom.size;
  if (geom.type == mjGEOM_PLANE) {
    set_box(kUnbounded, kUnbounded, kUnbounded, shape);
    return geom.dataid >= 0 || (size[0] > 0 && size[1] > 0);
  }
  switch (geom.type) {
    case mjGEOM_CAPSULE:
    case mjGEOM_CYLINDER:
      set_box(size[0], size[0], size[2] + (geom.type == mjGEOM_CAPSULE ? size[0] : 0), shape);
      shape.size[1] = size[2];
      shape.size[2] = 0;
      break;
    case mjGEOM_SPHERE:
      if (size[0] != size[1] || size[1] != size[2]) shape.type = mjGEOM_ELLIPSOID;
      [[fallthrough]];
    default:
      set_box(size[0], size[1], size[2], shape);
  }
  return size[0] > 0 && size[1] > 0 && size[2] > 0;
}

bool SceneGeoms::set_mesh(const AbstractGeom& geom, DrawnGeom& out) {
  if (geom.dataid < 0 || geom.dataid >= 2 * model_->nmesh) return false;
  DrawnMesh* mesh = assets_.mesh(geom.dataid);
  if (!mesh) return false;
  out.mesh_on_demand = mesh;
  out.mesh = mesh->surface();
  set_box(mesh->box(), out.shape);
  return true;
}

bool SceneGeoms::set_height_field(const AbstractGeom& geom, DrawnGeom& out) {
  if (geom.dataid < 0 || geom.dataid >= model_->nhfield) return false;
  out.height_field = &assets_.height_field(geom.dataid);
  const rays::SharedGeometry& fields = assets_.height_fields();
  out.bvh = out.height_field->scene;
  out.clusters = fields.clusters_of_height_field(geom.dataid);
  out.horizons = fields.horizons_of_height_field(geom.dataid);
  set_box(fields.bounds.height_fields[geom.dataid], out.shape);
  return true;
}

void SceneGeoms::add(const AbstractGeom& geom, const SceneMemory& scene, const Look& look) {
  // MuJoCo has not computed its pose: all its points are at one place.
  if (std::all_of(geom.mat, geom.mat + 9, [](float x) { return x == 0; })) return;
  DrawnGeom out{};
  set_material(geom, look, out);
  out.object_type = geom.objtype;
  out.object_id = geom.segid;
  out.casts_shadows =
      geom.category != mjCAT_DECOR && geom.type != mjGEOM_LINE && geom.type != mjGEOM_LINEBOX;
  rays::RayGeom& shape = out.shape;
  shape.type = geom.type;
  shape.data = -1;
  std::copy_n(geom.pos, 3, shape.pos);
  std::copy_n(geom.mat, 9, shape.mat);
  std::copy_n(geom.mat, 9, shape.rot);
  std::copy_n(geom.size, 3, shape.size);
  switch (geom.type) {
    case mjGEOM_PLANE:
    case mjGEOM_SPHERE:
    case mjGEOM_ELLIPSOID:
    case mjGEOM_CAPSULE:
    case mjGEOM_CYLINDER:
    case mjGEOM_BOX:
      if (set_primitive_shape(geom, shape)) drawn_.push_back(out);
      return;
    case mjGEOM_MESH:
    case mjGEOM_SDF:
      if (set_mesh(geom, out)) drawn_.push_back(out);
      return;
    case mjGEOM_HFIELD:
      if (set_height_field(geom, out)) drawn_.push_back(out);
      return;
    case mjGEOM_FLEX:
      return soft_.add_flex(geom, out, scene, drawn_);
    case mjGEOM_SKIN:
      return soft_.add_skin(geom, out, drawn_);
    case mjGEOM_ARROW:
    case mjGEOM_ARROW1:
    case mjGEOM_ARROW2:
      return decorations_.add(out, arrow_triangles(geom.type, geom.size), drawn_);
    case mjGEOM_TRIANGLE:
      set_unrotated(shape);
      return decorations_.add(out, triangle_triangles(geom.size, geom.mat), drawn_);
    case mjGEOM_LINE:
    case mjGEOM_LINEBOX:
      return decorations_.add_lines(geom, out, look.camera, look.line_width, look.ambient, drawn_);
    case mjGEOM_LABEL:
    case mjGEOM_NONE:
      return;
    default:
      throw ValueError(fmt::format("a geom of the scene has the unknown type {}", geom.type));
  }
}

}  // namespace mjsense::render
