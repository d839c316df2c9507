// SPDX-License-Identifier: Apache-2.0
// Bindings of images of abstract scenes. python/mjsense/sim/renderer.py defines the public class, which
// lets only one thread at a time call a renderer.

#include <mujoco/mujoco.h>
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <bit>
#include <cstdint>
#include <string>

#include "mjsense/core/error.h"
#include "mjsense/core/fields/fields.h"
#include "mjsense/render/abstract/scene_renderer.h"
#include "mjsense/render/light/environment_image.h"
#include "mjsense/sensors/camera/physical_options.h"
#include "python/bindings/bindings.h"

namespace mjsense::python {

namespace nb = nanobind;

namespace {

using AnyArray = nb::ndarray<nb::ro, nb::c_contig, nb::device::cpu>;

render::NamedArrays named_arrays(const nb::dict& arrays) {
  render::NamedArrays out;
  for (auto [key, value] : arrays) {
    const auto name = nb::cast<std::string>(key);
    AnyArray array;
    if (!nb::try_cast<AnyArray>(value, array))
      throw ValueError("the model's field '" + name + "' is not a contiguous array");
    render::NamedArray& named = out[name];
    named.data = const_cast<void*>(static_cast<const void*>(array.data()));
    for (std::size_t i = 0; i < array.ndim(); ++i)
      named.shape.push_back(static_cast<std::int64_t>(array.shape(i)));
    const nb::dlpack::dtype type = array.dtype();
    const auto code = static_cast<nb::dlpack::dtype_code>(type.code);
    named.kind = code == nb::dlpack::dtype_code::Float  ? 'f'
                 : code == nb::dlpack::dtype_code::Int  ? 'i'
                 : code == nb::dlpack::dtype_code::UInt ? 'u'
                                                        : 'b';
    named.bytes = type.bits / 8;
  }
  return out;
}

// {field: (offset, bytes)}
render::StructLayout layout_of(const nb::dict& fields) {
  render::StructLayout out;
  for (auto [key, value] : fields) {
    const auto place = nb::cast<nb::tuple>(value);
    out[nb::cast<std::string>(key)] = {nb::cast<std::ptrdiff_t>(place[0]),
                                       nb::cast<std::size_t>(place[1])};
  }
  return out;
}

template <class T>
void bind_soft(const render::NamedArrays& arrays, const char* name, const T*& out) {
  const auto found = arrays.find(name);
  if (found == arrays.end()) throw ValueError(std::string("MjvScene has no field '") + name + "'");
  if (found->second.bytes != static_cast<int>(sizeof(T)))
    throw ValueError(std::string("MjvScene.") + name + " has elements of " +
                     std::to_string(found->second.bytes) + " bytes");
  out = static_cast<const T*>(found->second.data);
}

render::SoftArrays soft_arrays(const nb::dict& fields) {
  const render::NamedArrays arrays = named_arrays(fields);
  render::SoftArrays soft;
#define MJSENSE_SOFT(name) bind_soft(arrays, #name, soft.name)
  MJSENSE_SOFT(flexedgeadr);
  MJSENSE_SOFT(flexedgenum);
  MJSENSE_SOFT(flexedge);
  MJSENSE_SOFT(flexvertadr);
  MJSENSE_SOFT(flexvertnum);
  MJSENSE_SOFT(flexfaceadr);
  MJSENSE_SOFT(flexfaceused);
  MJSENSE_SOFT(flexvert);
  MJSENSE_SOFT(flexface);
  MJSENSE_SOFT(flexnormal);
  MJSENSE_SOFT(flextexcoord);
  MJSENSE_SOFT(skinfacenum);
  MJSENSE_SOFT(skinvertadr);
  MJSENSE_SOFT(skinvertnum);
  MJSENSE_SOFT(skinvert);
  MJSENSE_SOFT(skinnormal);
#undef MJSENSE_SOFT
  soft.num_flexes = static_cast<int>(arrays.at("flexvertadr").rows());
  return soft;
}

const char* address(const nb::handle& value) {
  return reinterpret_cast<const char*>(nb::cast<std::uintptr_t>(value));
}

render::SceneMemory memory_of(const nb::dict& scene) {
  render::SceneMemory m{};
  m.geoms = address(scene["geoms"]);
  m.geom_stride = nb::cast<std::ptrdiff_t>(scene["geom_stride"]);
  m.lights = address(scene["lights"]);
  m.light_stride = nb::cast<std::ptrdiff_t>(scene["light_stride"]);
  m.cameras[0] = address(scene["left_camera"]);
  m.cameras[1] = address(scene["right_camera"]);
  return m;
}

// A renderer and the memory of the scene that it draws.
struct BoundRenderer {
  render::SceneRenderer renderer;
  render::SceneMemory memory;

  BoundRenderer(const nb::dict& model, const nb::dict& settings, const nb::dict& layouts,
                const nb::dict& scene, const nb::dict& soft)
      : renderer(named_arrays(model), settings_of(settings),
                 render::StructReader::geoms(layout_of(nb::cast<nb::dict>(layouts["geom"]))),
                 render::StructReader::lights(layout_of(nb::cast<nb::dict>(layouts["light"]))),
                 render::StructReader::cameras(layout_of(nb::cast<nb::dict>(layouts["camera"]))),
                 soft_arrays(soft)),
        memory(memory_of(scene)) {}

  static void set_rgb(nb::handle from, float* rgb) {
    const auto values = nb::cast<nb::tuple>(from);
    for (int i = 0; i < 3; ++i) rgb[i] = nb::cast<float>(values[i]);
  }

  static render::SceneSettings settings_of(const nb::dict& from) {
    render::SceneSettings out;
    out.samples = nb::cast<int>(from["samples"]);
    out.shadows = nb::cast<bool>(from["shadows"]);
    out.shadow_clip = nb::cast<float>(from["shadow_clip"]);
    out.shadow_scale = nb::cast<float>(from["shadow_scale"]);
    out.shadow_near = nb::cast<float>(from["shadow_near"]);
    out.haze_width = nb::cast<float>(from["haze"]);
    set_rgb(from["haze_rgb"], out.haze_rgb);
    out.fog.start = nb::cast<float>(from["fog_start"]);
    out.fog.slope = nb::cast<float>(from["fog_slope"]);
    set_rgb(from["fog_rgb"], out.fog.rgb);
    out.line_width = nb::cast<float>(from["line_width"]);
    out.projected_textures = nb::cast<bool>(from["projected_textures"]);
    out.point_lights_at_camera = nb::cast<bool>(from["point_lights_at_camera"]);
    out.sized_soft_textures = nb::cast<bool>(from["sized_soft_textures"]);
    return out;
  }

  void render(int num_geoms, int num_lights, nb::tuple flags, int width, int height,
              std::uintptr_t rgb, std::uintptr_t depth, std::uintptr_t segmentation) {
    render::SceneMemory scene = memory;
    scene.num_geoms = num_geoms;
    scene.num_lights = num_lights;
    bool* const all[] = {&scene.shadow,     &scene.reflection, &scene.skybox,
                         &scene.haze,       &scene.fog,        &scene.flex_vertices,
                         &scene.flex_edges, &scene.flex_skin,  &scene.point_lights};
    for (std::size_t i = 0; i < std::size(all); ++i) *all[i] = nb::cast<bool>(flags[i]);
    render::ImageTargets targets;
    targets.rgb = reinterpret_cast<std::uint8_t*>(rgb);
    targets.depth = reinterpret_cast<float*>(depth);
    targets.segmentation = reinterpret_cast<std::int32_t*>(segmentation);
    const nb::gil_scoped_release release;
    renderer.render(scene, width, height, targets);
  }
};

using Ints = nb::ndarray<const std::int32_t, nb::c_contig, nb::device::cpu>;
using Bodies = nb::ndarray<const std::int32_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using Segmentation = nb::ndarray<std::int32_t, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;

// Copies the object ids and types of `found`, [H, W, 2], and adds the id of the body: -1 for objects
// that belong to no body. 0.4 ms for 640 x 480 pixels, for which NumPy's functions need 1.8 ms.
void add_bodies(const Ints& found, const Bodies& geom_bodies, const Bodies& site_bodies,
                Segmentation out) {
  const std::size_t pixels = out.shape(0) * out.shape(1);
  if (found.size() != 2 * pixels) throw ValueError("the segmentation must have the image's size");
  const auto body_of = [&](std::int32_t id, std::int32_t type) {
    if (type != mjOBJ_GEOM && type != mjOBJ_SITE) return -1;
    const Bodies& bodies = type == mjOBJ_GEOM ? geom_bodies : site_bodies;
    return id >= 0 && static_cast<std::size_t>(id) < bodies.shape(0) ? bodies.data()[id] : -1;
  };
  const std::int32_t* from = found.data();
  std::int32_t* to = out.data();
  for (std::size_t i = 0; i < pixels; ++i, from += 2, to += 3) {
    to[0] = from[0];
    to[1] = from[1];
    to[2] = body_of(from[0], from[1]);
  }
}

// render::ExrReader.
std::string radiance_of_exr(const std::string& path, const std::string& bytes) {
  const nb::gil_scoped_acquire gil;
  const nb::object read = nb::module_::import_("mjsense.core.exr").attr("radiance_file");
  const auto made = nb::cast<nb::bytes>(read(path, nb::bytes(bytes.data(), bytes.size())));
  return {made.c_str(), made.size()};
}

}  // namespace

void bind_renderer(nb::module_& m) {
  render::set_exr_reader(&radiance_of_exr);
  m.def("scene_index_fields", &render::scene_index_fields,
        "Arrays of integers of an mjModel that MuJoCo reads when it updates a scene.");
  m.def("add_bodies", &add_bodies, nb::arg("segmentation"), nb::arg("geom_bodies"),
        nb::arg("site_bodies"), nb::arg("out"));
  nb::class_<BoundRenderer>(m, "SceneRenderer")
      .def(nb::init<nb::dict, nb::dict, nb::dict, nb::dict, nb::dict>())
      .def("render", &BoundRenderer::render)
      .def("set_shading",
           [](BoundRenderer& r, const std::string& word, const std::string& environment,
              int samples_per_pixel) {
             sensors::RgbCfg cfg;
             cfg.shading = from_word<sensors::Shading>(word, "Renderer", "shading");
             cfg.environment = environment;
             cfg.samples_per_pixel = samples_per_pixel;
             check_fields(cfg, "Renderer");
             r.renderer.check_indices();
             r.renderer.set_physical(sensors::physical_options(cfg, r.renderer.model()));
           })
      .def("check_indices", [](const BoundRenderer& r) { r.renderer.check_indices(); })
      .def("reload",
           [](BoundRenderer& r) {
             r.renderer.check_indices();
             r.renderer.reload();
           })
      .def("prepared", [](const BoundRenderer& r) {
        const render::PreparedAssets found = r.renderer.prepared();
        nb::dict out;
        out["meshes"] = found.meshes;
        out["clusters"] = found.clusters;
        out["trees"] = found.trees;
        out["surfaces"] = found.surfaces;
        out["textures"] = found.textures;
        out["levels"] = found.levels;
        return out;
      });
}

}  // namespace mjsense::python
