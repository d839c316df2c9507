// SPDX-License-Identifier: Apache-2.0
#include "mjsense/render/abstract/scene_renderer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <numbers>
#include <numeric>
#include <tuple>

#include "mjsense/core/error.h"
#include "mjsense/core/model_indices.h"
#include "mjsense/core/system/thread_pool.h"
#include "mjsense/render/path/path_tracer.h"

namespace mjsense::render {
namespace {

constexpr float kUnbounded = 1e30f;
constexpr int kSpot = 0, kDirectional = 1, kPoint = 2,
              kImage = 3;  // mjtLightType, the same in all versions

bool finite(std::span<const float> values) {
  return std::ranges::all_of(values, [](float x) { return std::isfinite(x); });
}

// Depth that mujoco.Renderer gives where nothing is seen: the far plane's, with the error of single
// precision that its conversion has.
float far_depth(float near, float far, bool orthographic) {
  if (orthographic) return far;
  const float c = -0.5f * (-(far + near) / (far - near)) - 0.5f;
  const float d = -0.5f * (-(2.0f * far * near) / (far - near));
  return static_cast<float>(static_cast<double>(d) / c);
}

void set_box(float x, float y, float z, rays::RayGeom& shape) {
  shape.half[0] = x;
  shape.half[1] = y;
  shape.half[2] = z;
}

void set_box(const std::array<float, 6>& box, rays::RayGeom& shape) {
  std::copy_n(box.data(), 3, shape.center);
  std::copy_n(box.data() + 3, 3, shape.half);
}

void set_unrotated(rays::RayGeom& shape) {
  for (int k = 0; k < 9; ++k) shape.mat[k] = shape.rot[k] = k % 4 == 0;
}

}  // namespace

// A flex or skin: triangles that move.
struct SceneRenderer::Soft {
  rays::DeformableMesh mesh;
  std::vector<float> vertices;  // those that the mesh has
  std::vector<float> normals;
  std::vector<int> faces;  // of a flex: its corners in order
  MeshSurface surface;
  int num_faces = 0;
  float box[6];
};

// A shape without a primitive of its own.
struct SceneRenderer::Decoration {
  ShapeTriangles triangles;
  rays::SceneHandle scene;
  MeshSurface surface;
  float box[6];
};

SceneRenderer::SceneRenderer(const NamedArrays& arrays, const SceneSettings& settings,
                             StructReader geoms, StructReader lights, StructReader cameras,
                             const SoftArrays& soft)
    : model_(model_of_arrays(arrays)),
      indices_(indices_of_arrays(arrays, *model_)),
      settings_(settings),
      geom_reader_(std::move(geoms)),
      light_reader_(std::move(lights)),
      camera_reader_(std::move(cameras)),
      soft_(soft),
      assets_(model_.get()),
      device_(rays::ray_device()) {}

SceneRenderer::~SceneRenderer() = default;

void SceneRenderer::check_indices() const { check_element_indices(*indices_); }

void SceneRenderer::render(const SceneMemory& scene, int width, int height,
                           const ImageTargets& targets) {
  check_indices();
  if (assets_.begin_image()) kept_.clear();
  read_camera(scene, width, height);
  read_lights(scene);
  const bool color = targets.rgb != nullptr;
  const auto draw = [&](const ImageTargets& images, bool all) {
    read(scene, all);
    if (drawn_.size() > capacity_ || !builder_) {
      capacity_ = std::bit_ceil(std::max<std::size_t>(drawn_.size(), 64));
      builder_ = std::make_unique<ViewBuilder>(capacity_, kClassicLights);
      memory_ = std::make_unique<TileMemory>(static_cast<int>(capacity_));
    }
    DrawnScene view{.geoms = drawn_,
                    .lights = lights_,
                    .near = near_,
                    .far = far_,
                    .shadows = images.rgb && scene.shadow && settings_.shadows,
                    .reflections = images.rgb && scene.reflection,
                    .skybox = images.rgb && scene.skybox ? assets_.skybox() : nullptr,
                    .sky = {0.7f * far_,
                            settings_.haze_width,
                            {settings_.haze_rgb[0], settings_.haze_rgb[1], settings_.haze_rgb[2]}},
                    .haze = scene.haze,
                    .fog = scene.fog ? settings_.fog : Fog{},
                    .projected_textures = settings_.projected_textures,
                    .sized_soft_textures = settings_.sized_soft_textures,
                    .physical = images.rgb && physical_.on ? &physical_ : nullptr,
                    .intensities = intensities_,
                    .ranges = ranges_,
                    .environment_tint = environment_tint_};
    const View& built = builder_->build(view, position_, rotation_, grid_);
    if (built.physical.all_geoms) {
      trace_paths(built, images.rgb);
    } else {
      kept_.render(built, images, tiles_, memory_->scratch());
    }
  };
  if (color) {
    ImageTargets images = targets;
    images.depth = nullptr;
    images.segmentation = nullptr;
    images.samples = static_cast<int>(std::bit_floor(
        static_cast<unsigned>(std::clamp(settings_.samples, 1, ImageTargets::kMaxMultisamples))));
    images.multisampled = images.samples > 1;
    draw(images, true);
  }
  if (targets.depth || targets.segmentation) {
    ImageTargets images = targets;
    images.rgb = nullptr;
    draw(images, false);
    if (targets.depth)
      std::replace(targets.depth, targets.depth + static_cast<std::size_t>(width) * height, 0.0f,
                   far_depth(near_, far_, grid_.orthographic));
  }
}

void SceneRenderer::trace_paths(const View& view, std::uint8_t* rgb) {
  // Meshes and textures that are prepared on demand belong to one thread.
  const auto prepare = [](const Texture* texture) {
    if (texture && texture->on_demand) texture->on_demand->add_level(0);
  };
  prepare(view.skybox);
  for (int i = 0; i < view.num_geoms; ++i) {
    const ViewGeom& g = view.geoms[i];
    if (g.mesh_on_demand) g.mesh_on_demand->prepare_surface(g.surface.uses_mesh_uvs);
    prepare(g.surface.texture);
    for (const Texture* map : g.surface.maps) prepare(map);
  }
  if (around_ != physical_.environment) {
    sampler_ = std::make_shared<const EnvironmentSampler>(physical_.environment->light);
    around_ = physical_.environment;
  }
  PathTracer paths(physical_.path_samples, sampler_);
  paths.build(view);
  ThreadPool(0).run((view.grid.height + kTileSize - 1) / kTileSize,
                    [&](int row, int) { paths.render(row, row + 1, {.rgb = rgb}); });
}

// `all`: include geoms without segmentation id, which depth and segmentation do not show.
void SceneRenderer::read(const SceneMemory& scene, bool all) {
  drawn_.clear();
  decorations_.clear();
  segments_.assign(scene.num_geoms + 1, {-1, -1});
  for (int i = 0; i < scene.num_geoms; ++i) {
    AbstractGeom geom;
    geom_reader_.read(scene.geoms + i * scene.geom_stride, geom);
    if (geom.segid >= 0 && geom.segid <= scene.num_geoms)
      segments_[geom.segid] = {geom.objid, geom.objtype};
    if (!finite(geom.pos) || !finite(geom.mat) || !finite(geom.size) || !finite(geom.rgba))
      throw ValueError(fmt::format(
          "geom {} of the scene (object type {}, id {}) has a pose, size or colour that is not "
          "finite",
          i, geom.objtype, geom.objid));
    if (!all && geom.segid < 0) continue;
    if (all && geom.label)
      throw ValueError(fmt::format(
          "geom {} of the scene (object type {}, id {}) has a label, and labels are not "
          "drawn; remove it, or set scene_option.label to mjLABEL_NONE",
          i, geom.objtype, geom.objid));
    add(geom, scene, all);
  }
  // A segment belongs to the last geom that has its id, which matters for decoration geoms that
  // users add without an id of their own.
  for (DrawnGeom& drawn : drawn_) {
    const int segment = drawn.object_id;
    std::tie(drawn.object_id, drawn.object_type) =
        segment >= 0 && segment <= scene.num_geoms ? segments_[segment] : std::pair(-1, -1);
  }
}

void SceneRenderer::add(const AbstractGeom& geom, const SceneMemory& scene, bool colored) {
  // MuJoCo has not computed its pose: all its points are at one place.
  if (std::all_of(geom.mat, geom.mat + 9, [](float x) { return x == 0; })) return;
  DrawnGeom out{};
  std::copy_n(geom.rgba, 4, out.rgba);
  // Some programs hide elements with a negative alpha. Depth and segmentation show all elements.
  out.rgba[3] = colored ? std::max(out.rgba[3], 0.0f) : 1;
  out.object_type = geom.objtype;
  out.object_id = geom.segid;
  out.casts_shadows =
      geom.category != mjCAT_DECOR && geom.type != mjGEOM_LINE && geom.type != mjGEOM_LINEBOX;
  out.material = {.specular = geom.specular,
                  .shininess = geom.shininess,
                  .emission = geom.emission,
                  .reflectance = geom.reflectance,
                  .texture = -1,
                  .repeat = {geom.texrepeat[0], geom.texrepeat[1]},
                  .uniform = geom.texuniform != 0};
  if (geom.matid >= 0 && geom.matid < model_->nmat) {
    int texture = geom.texid;
    if (texture < 0) {
      texture = model_->mat_texid[mjNTEXROLE * geom.matid + mjTEXROLE_RGB];
      std::copy_n(model_->mat_texrepeat + 2 * geom.matid, 2, out.material.repeat);
      out.material.uniform = model_->mat_texuniform[geom.matid] != 0;
    }
    if (colored) out.texture = assets_.texture(texture);
    if (colored && physical_.on) {
      out.material.textures = textures_of(model_.get(), geom.matid);
      if (texture < 0) out.texture = assets_.texture(out.material.textures[mjTEXROLE_RGBA]);
      for (int i = 0; i < kNumTextureMaps; ++i)
        out.maps[i] =
            assets_.texture(texture_of(out.material.textures, static_cast<TextureMap>(i)));
    }
    if (model_->mat_metallic) out.material.metallic = model_->mat_metallic[geom.matid];
    if (model_->mat_roughness) out.material.roughness = model_->mat_roughness[geom.matid];
  }
  rays::RayGeom& shape = out.shape;
  shape.type = geom.type;
  shape.data = -1;
  std::copy_n(geom.pos, 3, shape.pos);
  std::copy_n(geom.mat, 9, shape.mat);
  std::copy_n(geom.mat, 9, shape.rot);
  const float* size = geom.size;
  std::copy_n(size, 3, shape.size);
  const bool solid = size[0] > 0 && size[1] > 0 && size[2] > 0;
  switch (geom.type) {
    case mjGEOM_PLANE:
      if (geom.dataid < 0 && !(size[0] > 0 && size[1] > 0)) return;
      set_box(kUnbounded, kUnbounded, kUnbounded, shape);
      break;
    case mjGEOM_SPHERE:
    case mjGEOM_ELLIPSOID:
      if (!solid) return;
      shape.type = size[0] == size[1] && size[1] == size[2] ? mjGEOM_SPHERE : mjGEOM_ELLIPSOID;
      if (geom.type == mjGEOM_ELLIPSOID) shape.type = geom.type;
      set_box(size[0], size[1], size[2], shape);
      break;
    case mjGEOM_CAPSULE:
    case mjGEOM_CYLINDER:
      if (!solid) return;
      set_box(size[0], size[0], size[2] + (geom.type == mjGEOM_CAPSULE ? size[0] : 0), shape);
      shape.size[1] = size[2];
      shape.size[2] = 0;
      break;
    case mjGEOM_BOX:
      if (!solid) return;
      set_box(size[0], size[1], size[2], shape);
      break;
    case mjGEOM_MESH:
    case mjGEOM_SDF: {
      if (geom.dataid < 0 || geom.dataid >= 2 * model_->nmesh) return;
      DrawnMesh* mesh = assets_.mesh(geom.dataid);
      if (!mesh) return;
      out.mesh_on_demand = mesh;
      out.mesh = mesh->surface();
      set_box(mesh->box(), shape);
      break;
    }
    case mjGEOM_HFIELD: {
      if (geom.dataid < 0 || geom.dataid >= model_->nhfield) return;
      out.height_field = &assets_.height_field(geom.dataid);
      const rays::SharedGeometry& fields = assets_.height_fields();
      out.bvh = out.height_field->scene;
      out.clusters = fields.clusters_of_height_field(geom.dataid);
      out.horizons = fields.horizons_of_height_field(geom.dataid);
      set_box(fields.bounds.height_fields[geom.dataid], shape);
      break;
    }
    case mjGEOM_FLEX:
      add_flex(geom, out, scene);
      return;
    case mjGEOM_SKIN:
      add_skin(geom, out);
      return;
    case mjGEOM_ARROW:
    case mjGEOM_ARROW1:
    case mjGEOM_ARROW2:
      add_triangles(out, arrow_triangles(geom.type, size));
      return;
    case mjGEOM_TRIANGLE:
      set_unrotated(shape);
      add_triangles(out, triangle_triangles(size, geom.mat));
      return;
    case mjGEOM_LINE:
    case mjGEOM_LINEBOX:
      add_lines(geom, out);
      return;
    case mjGEOM_LABEL:
    case mjGEOM_NONE:
      return;
    default:
      throw ValueError(fmt::format("a geom of the scene has the unknown type {}", geom.type));
  }
  drawn_.push_back(out);
}

void SceneRenderer::add_triangles(const DrawnGeom& like, ShapeTriangles triangles) {
  if (triangles.faces.empty()) return;
  DrawnGeom drawn = like;
  Decoration& d = *decorations_.emplace_back(std::make_unique<Decoration>());
  d.triangles = std::move(triangles);
  d.scene = rays::build_triangles(device_.get(), d.triangles.vertices, d.triangles.faces,
                                  rays::BuildQuality::kFast);
  d.surface.normals = d.triangles.normals.data();
  rays::box_around(d.triangles.vertices, d.box);
  std::copy_n(d.box, 3, drawn.shape.center);
  std::copy_n(d.box + 3, 3, drawn.shape.half);
  drawn.bvh = d.scene.get();
  drawn.mesh = &d.surface;
  drawn.texture = nullptr;
  drawn_.push_back(drawn);
}

// Lines are not lit. Their triangles have no normal, so that only the lights' ambient parts reach
// them; emission makes up for the rest of the colour.
void SceneRenderer::add_lines(const AbstractGeom& geom, const DrawnGeom& like) {
  DrawnGeom drawn = like;
  const double* r = drawn.shape.mat;
  float eye[3], ahead[3];
  for (int i = 0; i < 3; ++i) {
    eye[i] = ahead[i] = 0;
    for (int k = 0; k < 3; ++k) {
      eye[i] += static_cast<float>(r[3 * k + i] * (position_[k] - drawn.shape.pos[k]));
      ahead[i] += static_cast<float>(r[3 * k + i] * -rotation_[3 * k + 2]);
    }
  }
  ShapeTriangles out;
  const auto line = [&](const float* from, const float* to, float width) {
    add_line(from, to, eye, ahead, grid_.orthographic, width, grid_.dx, out);
  };
  const float* s = geom.size;
  if (geom.type == mjGEOM_LINE) {
    const float from[3] = {0, 0, 0}, to[3] = {0, 0, s[2]};
    line(from, to, s[0] * settings_.line_width);
  } else {
    for (int corner = 0; corner < 8; ++corner) {
      for (int axis = 0; axis < 3; ++axis) {
        if (corner >> axis & 1) continue;
        float from[3], to[3];
        for (int k = 0; k < 3; ++k) from[k] = to[k] = corner >> k & 1 ? s[k] : -s[k];
        to[axis] = s[axis];
        line(from, to, 1.5f * settings_.line_width);
      }
    }
  }
  float ambient = lights_.empty() ? 0.3f : 0.0f;
  for (const ViewLight& light : lights_) ambient += light.ambient[0];
  drawn.material.emission = std::max(0.0f, 1 - ambient);
  drawn.material.specular = 0;
  add_triangles(drawn, std::move(out));
}

void SceneRenderer::add_flex(const AbstractGeom& geom, const DrawnGeom& like,
                             const SceneMemory& scene) {
  DrawnGeom drawn = like;
  const int id = geom.objid;
  if (id < 0 || id >= soft_.num_flexes) return;
  const int used = soft_.flexfaceused[id];
  const float radius = geom.size[0];
  rays::RayGeom& shape = drawn.shape;
  if (radius > 0 && !(scene.flex_skin && used)) {
    DrawnGeom part = drawn;
    part.texture = nullptr;
    const int first_vertex = soft_.flexvertadr[id];
    const float* vertices = soft_.flexvert + 3 * first_vertex;
    if (scene.flex_vertices) {
      part.shape.type = mjGEOM_SPHERE;
      std::fill_n(part.shape.size, 3, radius);
      set_box(radius, radius, radius, part.shape);
      for (int v = 0; v < soft_.flexvertnum[id]; ++v) {
        std::copy_n(vertices + 3 * v, 3, part.shape.pos);
        drawn_.push_back(part);
      }
    }
    if (scene.flex_edges) {
      part.shape.type = mjGEOM_CYLINDER;
      for (int e = soft_.flexedgeadr[id]; e < soft_.flexedgeadr[id] + soft_.flexedgenum[id]; ++e) {
        const float *a = vertices + 3 * soft_.flexedge[2 * e],
                    *b = vertices + 3 * soft_.flexedge[2 * e + 1];
        double along[3], length = 0;
        for (int k = 0; k < 3; ++k) {
          along[k] = b[k] - a[k];
          length += along[k] * along[k];
          part.shape.pos[k] = 0.5 * (static_cast<double>(a[k]) + b[k]);
        }
        length = std::sqrt(length);
        if (!(length > 0)) continue;
        double* m = part.shape.mat;
        for (double& x : along) x /= length;
        const int minimum = std::abs(along[0]) < 0.5 ? 0 : 1;
        double x[3] = {}, size = 0;
        for (int k = 0; k < 3; ++k) x[k] = (k == minimum) - along[minimum] * along[k];
        for (double v : x) size += v * v;
        for (int k = 0; k < 3; ++k) {
          const int i = (k + 1) % 3, j = (k + 2) % 3;
          m[3 * k] = x[k] / std::sqrt(size);
          m[3 * k + 1] = (along[i] * x[j] - along[j] * x[i]) / std::sqrt(size);
          m[3 * k + 2] = along[k];
        }
        std::copy_n(m, 9, part.shape.rot);
        part.shape.size[0] = radius;
        part.shape.size[1] = static_cast<float>(0.5 * length);
        part.shape.size[2] = 0;
        set_box(radius, radius, part.shape.size[1], part.shape);
        drawn_.push_back(part);
      }
    }
  }
  // One material of several: size holds its range of faces.
  const bool slice = geom.dataid >= 0 && geom.size[2] > 0;
  const int first = slice ? static_cast<int>(geom.size[1]) : 0;
  const int count = slice ? static_cast<int>(geom.size[2]) : used;
  if (count == 0) return;
  const std::size_t start = soft_.flexfaceadr[id] + first;
  const float* vertices = soft_.flexface + 9 * start;
  std::unique_ptr<Soft>& place = flexes_[{id, first}];
  const std::span<const float> now(vertices, 9 * static_cast<std::size_t>(count));
  if (!place || place->num_faces != count) {
    place = std::make_unique<Soft>();
    place->num_faces = count;
    place->faces.resize(3 * static_cast<std::size_t>(count));
    std::iota(place->faces.begin(), place->faces.end(), 0);
    place->mesh = rays::DeformableMesh(device_.get(), place->faces, now);
    rays::box_around(now, place->box);
  } else if (!std::ranges::equal(now, place->mesh.vertices())) {
    std::ranges::copy(now, place->mesh.vertices().begin());
    place->mesh.refit();
    rays::box_around(now, place->box);
  }
  Soft& soft = *place;
  soft.surface = {.normals = soft_.flexnormal + 9 * start,
                  .uvs = geom.texcoord && drawn.texture ? soft_.flextexcoord + 6 * start : nullptr,
                  .positions = soft.mesh.vertices().data(),
                  .faces = soft.faces.data()};
  std::copy_n(soft.box, 3, shape.center);
  std::copy_n(soft.box + 3, 3, shape.half);
  drawn.bvh = soft.mesh.scene();
  drawn.mesh = &soft.surface;
  std::fill_n(shape.pos, 3, 0.0);
  set_unrotated(shape);
  drawn_.push_back(drawn);
}

void SceneRenderer::add_skin(const AbstractGeom& geom, const DrawnGeom& like) {
  DrawnGeom drawn = like;
  const int id = geom.objid;
  if (id < 0 || id >= model_->nskin || model_->skin_facenum[id] == 0) return;
  const std::span<const float> now(soft_.skinvert + 3 * soft_.skinvertadr[id],
                                   3 * static_cast<std::size_t>(soft_.skinvertnum[id]));
  const float* normals = soft_.skinnormal + 3 * soft_.skinvertadr[id];
  const int num_faces = model_->skin_facenum[id];
  const int* faces = model_->skin_face + 3 * model_->skin_faceadr[id];
  std::unique_ptr<Soft>& place = skins_[id];
  const bool first = !place;
  if (first) {
    place = std::make_unique<Soft>();
    place->mesh =
        rays::DeformableMesh(device_.get(), {faces, 3 * static_cast<std::size_t>(num_faces)}, now);
    place->normals.resize(9 * static_cast<std::size_t>(num_faces));
  }
  Soft& soft = *place;
  if (first || !std::ranges::equal(now, soft.mesh.vertices())) {
    std::ranges::copy(now, soft.mesh.vertices().begin());
    if (!first) soft.mesh.refit();
    rays::box_around(now, soft.box);
    for (int i = 0; i < 3 * num_faces; ++i)
      std::copy_n(normals + 3 * faces[i], 3, &soft.normals[3 * static_cast<std::size_t>(i)]);
  }
  soft.surface = {soft.normals.data(), assets_.skin(id).uvs, soft.mesh.vertices().data(), faces};
  rays::RayGeom& shape = drawn.shape;
  std::copy_n(soft.box, 3, shape.center);
  std::copy_n(soft.box + 3, 3, shape.half);
  std::fill_n(shape.pos, 3, 0.0);
  set_unrotated(shape);
  drawn.bvh = soft.mesh.scene();
  drawn.mesh = &soft.surface;
  drawn_.push_back(drawn);
}

// The square that MuJoCo's shadow map covers. Its first axis is perpendicular to the light's and to -x
// or y.
static void limit_shadows(const SceneSettings& settings, float cutoff, ViewLight& light) {
  const float* d = light.dir;
  float up[3] = {0, -d[2], d[1]};
  float length = up[1] * up[1] + up[2] * up[2];
  if (length <= 0.01f) {
    const float other[3] = {-d[2], 0, d[0]};
    std::copy_n(other, 3, up);
    length = up[0] * up[0] + up[2] * up[2];
  }
  for (int k = 0; k < 3; ++k) light.shadow_map_axes[0][k] = up[k] / std::sqrt(length);
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    light.shadow_map_axes[1][k] =
        d[i] * light.shadow_map_axes[0][j] - d[j] * light.shadow_map_axes[0][i];
  }
  light.shadow_map_half_size = settings.shadow_clip;
  light.shadow_map_near = settings.shadow_near;
  if (light.kind != LightKind::kDirectional) {
    const double fovy = std::min(2.0 * cutoff * settings.shadow_scale, 160.0);
    light.shadow_map_half_size = static_cast<float>(std::tan(fovy * std::numbers::pi / 360));
  }
}

// As in OpenGL, only the first lights are used. MuJoCo's renderer does not set the position of lights of
// other types than spot and directional, so that it is OpenGL's default: the camera's direction.
void SceneRenderer::read_lights(const SceneMemory& scene) {
  lights_.clear();
  intensities_.clear();
  ranges_.clear();
  environment_tint_ = {1, 1, 1};
  bool image_light = false;
  for (int i = 0; i < std::min(scene.num_lights, kClassicLights); ++i) {
    AbstractLight light;
    light_reader_.read(scene.lights + i * scene.light_stride, light);
    if (light.type == kImage && !image_light) {
      image_light = true;
      environment_tint_ = environment_factors(light.diffuse, light.intensity);
    }
    bool directional = light.type < 0 ? light.directional != 0 : light.type == kDirectional;
    const bool drawn_point = scene.point_lights && light.type == kPoint;
    if (!directional && light.type > kSpot && !drawn_point) {
      if (!settings_.point_lights_at_camera) continue;
      directional = true;
      light.castshadow = 0;
      for (int k = 0; k < 3; ++k) light.dir[k] = static_cast<float>(-rotation_[3 * k + 2]);
    }
    if (!finite(light.pos) || !finite(light.dir) || !finite(light.ambient) ||
        !finite(light.diffuse) || !finite(light.specular) || !finite(light.attenuation))
      throw ValueError(
          fmt::format("light {} of the scene has a pose or colour that is not finite", i));
    ViewLight& out = lights_.emplace_back();
    out = {};
    intensities_.push_back(light.intensity);
    ranges_.push_back(light.range);
    out.kind = directional ? LightKind::kDirectional : LightKind::kSpot;
    out.casts_shadows = light.castshadow != 0;
    std::copy_n(light.pos, 3, out.pos);
    std::copy_n(light.dir, 3, out.dir);
    std::copy_n(light.ambient, 3, out.ambient);
    std::copy_n(light.diffuse, 3, out.diffuse);
    std::copy_n(light.specular, 3, out.specular);
    out.attenuation[0] = 1;
    out.radius = light.bulbradius;
    if (out.casts_shadows && !drawn_point) limit_shadows(settings_, light.cutoff, out);
    if (directional) continue;
    if (!drawn_point) std::copy_n(light.attenuation, 3, out.attenuation);  // MuJoCo leaves it at 0
    out.exponent = light.exponent;
    out.cos_cutoff = static_cast<float>(std::cos(light.cutoff * std::numbers::pi / 180));
    if (drawn_point || light.cutoff >= 180) out.kind = LightKind::kPoint;
  }
}

// The camera between the left and the right one, as MuJoCo does without stereo.
void SceneRenderer::read_camera(const SceneMemory& scene, int width, int height) {
  AbstractCamera left, right;
  camera_reader_.read(scene.cameras[0], left);
  camera_reader_.read(scene.cameras[1], right);
  const auto mean = [&](auto member) { return 0.5f * (left.*member + right.*member); };
  double ahead[3], up[3], along = 0, forward_length = 0, up_length = 0;
  for (int k = 0; k < 3; ++k) {
    position_[k] = 0.5 * (static_cast<double>(left.pos[k]) + right.pos[k]);
    ahead[k] = static_cast<double>(left.forward[k]) + right.forward[k];
    up[k] = static_cast<double>(left.up[k]) + right.up[k];
    forward_length += ahead[k] * ahead[k];
  }
  for (double& x : ahead) x /= std::sqrt(forward_length);
  for (int k = 0; k < 3; ++k) along += up[k] * ahead[k];
  for (int k = 0; k < 3; ++k) {
    up[k] -= along * ahead[k];
    up_length += up[k] * up[k];
  }
  for (double& x : up) x /= std::sqrt(up_length);
  const float near = mean(&AbstractCamera::frustum_near), far = mean(&AbstractCamera::frustum_far);
  const float center = mean(&AbstractCamera::frustum_center),
              bottom = mean(&AbstractCamera::frustum_bottom),
              top = mean(&AbstractCamera::frustum_top);
  float half = mean(&AbstractCamera::frustum_width);
  const float frustum[] = {near, center, bottom, top, half};
  for (const AbstractCamera& camera : {left, right})
    if (!finite(camera.pos) || !finite(camera.forward) || !finite(camera.up) || !finite(frustum))
      throw ValueError("the scene's camera has a pose or field of view that is not finite");
  if (!(forward_length > 0) || !(up_length > 0) || !(near > 0))
    throw ValueError("the scene's camera has no direction or near plane");
  if (half == 0)
    half = 0.5f * static_cast<float>(width) / static_cast<float>(height) * (top - bottom);
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    rotation_[3 * k] = ahead[i] * up[j] - ahead[j] * up[i];
    rotation_[3 * k + 1] = up[k];
    rotation_[3 * k + 2] = -ahead[k];
  }
  near_ = near;
  far_ = far;
  grid_ = {};
  grid_.orthographic = left.orthographic != 0;
  const float scale = grid_.orthographic ? 1 : 1 / near;
  grid_.width = width;
  grid_.height = height;
  grid_.left = (center - half) * scale;
  grid_.top = top * scale;
  grid_.dx = 2 * half * scale / static_cast<float>(width);
  grid_.dy = -(top - bottom) * scale / static_cast<float>(height);
}

}  // namespace mjsense::render
