// SPDX-License-Identifier: Apache-2.0
#include "python/bindings/foreign_arrays.h"

#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "mjsense/rays/foreign_rays.h"
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

 private:
  const ProcessGuard process_;
  std::mutex mutex_;
  std::shared_ptr<worlds::ForeignArrays> arrays_;
  std::shared_ptr<rays::ForeignRays> rays_;
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
      .def(
          "set_option",
          [](PyForeignArrays& self, const std::string& name, const std::vector<double>& values) {
            self.work([&](worlds::ForeignArrays& arrays) { arrays.set_option(name, values); });
          },
          nb::arg("name"), nb::arg("values"), "World w gets values[w % len(values)].");
}

}  // namespace mjsense::python
