// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/foreign_arrays.h"

#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "mjsense/rays/foreign_rays.h"
#include "mjsense/render/foreign_images.h"
#include "mjsense/worlds/foreign_arrays.h"
#include "python/bindings/mujoco_callbacks.h"
#include "python/bindings/process_guard.h"

namespace mjsense::python {
namespace {

namespace nb = nanobind;

// The caller keeps the memory of the arrays. Threads take turns, without the GIL.
class PyForeignArrays {
 public:
  PyForeignArrays(std::uintptr_t model, int num_worlds, int threads) {
    nb::gil_scoped_release unlock;
    arrays_ = make_shared_guarded<worlds::ForeignArrays>(reinterpret_cast<const mjModel*>(model),
                                                         num_worlds, threads);
  }
  template <class Body>
  auto work(Body&& body) {
    process_.check("mujoco_warp's worlds");
    refuse_python_callbacks();
    nb::gil_scoped_release unlock;
    std::lock_guard lock(mutex_);
    return body(*arrays_);
  }
  bool add(const std::string& kind, const std::string& field, std::uintptr_t address,
           const std::string& dtype, std::int64_t rows, std::int64_t columns, bool input) {
    const ArrayView view =
        ArrayView::dense(reinterpret_cast<void*>(address), dtype_from_name(dtype), {rows, columns});
    return work([&](worlds::ForeignArrays& arrays) {
      return kind == "data"    ? arrays.add_data(field, view, input)
             : kind == "model" ? arrays.add_model(field, view)
                               : arrays.add_contacts(field, view);
    });
  }

  // Addresses of the arrays of ForeignRaysQuery.
  void cast(int count, const std::array<std::uintptr_t, 6>& arrays, std::uint32_t groups,
            nb::bytes hidden) {
    rays::ForeignRaysQuery query;
    query.count = count;
    query.origins = reinterpret_cast<const float*>(arrays[0]);
    query.directions = reinterpret_cast<const float*>(arrays[1]);
    query.exclude = reinterpret_cast<const int*>(arrays[2]);
    query.distances = reinterpret_cast<float*>(arrays[3]);
    query.geoms = reinterpret_cast<int*>(arrays[4]);
    query.normals = reinterpret_cast<float*>(arrays[5]);
    query.groups = groups;
    query.hidden = {static_cast<const std::uint8_t*>(hidden.data()), hidden.size()};
    work([&](worlds::ForeignArrays& own) {
      if (!rays_) rays_ = make_shared_guarded<rays::ForeignRays>(own.worlds());
      own.take_poses();
      rays_->cast(own.worlds(), query);
    });
  }

  // id, width, height; left, top, dx, dy of the pixels or nothing; addresses of rgb, depth and
  // segmentation, 0: not requested.
  using Camera =
      std::tuple<int, int, int, std::optional<std::array<float, 4>>, std::array<std::uintptr_t, 3>>;

  void render(const std::vector<Camera>& given, const std::array<std::size_t, 3>& rows,
              unsigned groups, bool textures, bool shadows, bool skybox, std::uint32_t background,
              bool series_4, bool vertex_normals, float share_in_shadow) {
    std::vector<render::ForeignCamera> cameras;
    for (const auto& [id, width, height, pixels, arrays] : given) {
      render::ForeignCamera& camera = cameras.emplace_back();
      camera.camera = id;
      camera.width = width;
      camera.height = height;
      if (pixels)
        camera.grid = render::PixelGrid{width,        height,       (*pixels)[0],
                                        (*pixels)[1], (*pixels)[2], (*pixels)[3]};
      camera.rgb = reinterpret_cast<std::uint32_t*>(arrays[0]);
      camera.depth = reinterpret_cast<float*>(arrays[1]);
      camera.segmentation = reinterpret_cast<std::int32_t*>(arrays[2]);
    }
    const render::ForeignImagesOptions options{
        groups, textures, shadows, {true, series_4, vertex_normals, share_in_shadow, skybox}};
    work([&](worlds::ForeignArrays& own) {
      own.take_poses();
      if (!rays_) rays_ = make_shared_guarded<rays::ForeignRays>(own.worlds());
      if (!images_ || !(options == image_options_)) {
        images_ = make_shared_guarded<render::ForeignImages>(own.worlds(), options);
        image_options_ = options;
      }
      images_->render(own.worlds(), *rays_, cameras, {rows[0], rows[1], rows[2]}, background);
    });
  }

 private:
  const ProcessGuard process_{};
  std::mutex mutex_;
  std::shared_ptr<worlds::ForeignArrays> arrays_;
  std::shared_ptr<rays::ForeignRays> rays_;
  render::ForeignImagesOptions image_options_;
  std::shared_ptr<render::ForeignImages> images_;
};

}  // namespace

void bind_foreign_arrays(nb::module_& m) {
  nb::class_<PyForeignArrays>(m, "ForeignArrays",
                              "Worlds that are shown in arrays of another program.")
      .def(nb::init<std::uintptr_t, int, int>(), nb::arg("model"), nb::arg("num_worlds"),
           nb::arg("threads"), "The mjModel at this address is copied.")
      .def(
          "clear",
          [](PyForeignArrays& self, int max_contacts, int max_constraints) {
            self.work([&](worlds::ForeignArrays& arrays) {
              arrays.clear(max_contacts, max_constraints);
            });
          },
          nb::arg("max_contacts"), nb::arg("max_constraints"),
          "Forgets all arrays. The data has room for this many contacts of all worlds, and rows of "
          "constraints of each.")
      .def("add", &PyForeignArrays::add, nb::arg("kind"), nb::arg("field"), nb::arg("address"),
           nb::arg("dtype"), nb::arg("rows"), nb::arg("columns"), nb::arg("input") = false,
           "False if MuJoCo has no such field. kind: data, model or contact.")
      .def(
          "run",
          [](PyForeignArrays& self, int call, std::uintptr_t mask) {
            self.work([&](worlds::ForeignArrays& arrays) {
              arrays.run(static_cast<worlds::RawCall>(call), reinterpret_cast<const bool*>(mask));
            });
          },
          nb::arg("call"), nb::arg("mask") = 0,
          "Calls mj_step (0), mj_forward (1), mj_step1 (2), mj_step2 (3), or mj_resetData (4) for "
          "the worlds of the mask: the address of B bools, or 0 for all.")
      .def("cast", &PyForeignArrays::cast, nb::arg("count"), nb::arg("arrays"), nb::arg("groups"),
           nb::arg("hidden"),
           "Casts rays into the worlds. arrays: addresses of origins, directions, excluded bodies, "
           "distances, geoms and normals. hidden: a byte for each geom.")
      .def("render", &PyForeignArrays::render, nb::arg("cameras"), nb::arg("rows"),
           nb::arg("groups"), nb::arg("textures"), nb::arg("shadows"), nb::arg("skybox"),
           nb::arg("background"), nb::arg("series_4"), nb::arg("vertex_normals"),
           nb::arg("share_in_shadow"),
           "Draws images. cameras: id, width, height, (left, top, dx, dy) or None, addresses of "
           "rgb, "
           "depth and segmentation of world 0. rows: numbers from one world to the next in them.")
      .def(
          "set_constants",
          [](PyForeignArrays& self, const std::vector<std::string>& fields, bool restore) {
            self.work(
                [&](worlds::ForeignArrays& arrays) { arrays.set_constants(fields, restore); });
          },
          nb::arg("fields"), nb::arg("restore"),
          "Writes these fields of the model, which mj_setConst derives, into their arrays. "
          "restore: also the fields of the data that follow from positions.")
      .def(
          "set_option",
          [](PyForeignArrays& self, const std::string& name, const std::vector<double>& values) {
            self.work([&](worlds::ForeignArrays& arrays) { arrays.set_option(name, values); });
          },
          nb::arg("name"), nb::arg("values"), "World w gets values[w % len(values)].");
}

}  // namespace mjsense::python
