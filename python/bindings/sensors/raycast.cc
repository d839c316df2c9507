// SPDX-License-Identifier: Apache-2.0
// Bindings of ray-casting sensors beyond their rows.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>

#include "mjsense/core/fields/fields.h"
#include "mjsense/sensors/lidar/point_cloud.h"
#include "mjsense/sensors/raycast/raycast_sensor.h"
#include "python/bindings/bindings.h"
#include "python/bindings/fields.h"
#include "python/bindings/numpy.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {

namespace {

NumpyArray rows_of(const std::vector<std::array<double, 3>>& vectors) {
  auto array =
      std::make_shared<Array>(DType::kFloat32, Shape{static_cast<std::int64_t>(vectors.size()), 3});
  auto out = array->all<float>();
  for (std::size_t i = 0; i < vectors.size(); ++i) {
    for (int k = 0; k < 3; ++k) out[3 * i + k] = static_cast<float>(vectors[i][k]);
  }
  return to_numpy(array->view(), owner_of(array));
}

}  // namespace

void bind_raycast(nb::module_& m) {
  m.def(
      "pattern_rays",
      [](nb::handle config) {
        sensors::RayCastSensorCfg cfg;
        const FieldDecl& field = *struct_of<sensors::RayCastSensorCfg>().find("pattern");
        read_value(config, field, config, &cfg.pattern);
        const sensors::RayPattern rays = sensors::make_pattern(cfg.pattern, nullptr, "pattern");
        return std::pair(rows_of(rays.offsets), rows_of(rays.directions));
      },
      "Offsets and directions, float32 [n, 3], of a pattern.");
  m.def(
      "write_point_cloud",
      [](const std::string& path, nb::ndarray<const float, nb::c_contig, nb::device::cpu> points,
         std::optional<nb::ndarray<const float, nb::c_contig, nb::device::cpu>> intensity,
         std::optional<nb::ndarray<const float, nb::c_contig, nb::device::cpu>> distances) {
        const auto span = [](const auto& a) { return std::span<const float>(a.data(), a.size()); };
        sensors::write_point_cloud(path, span(points),
                                   intensity ? span(*intensity) : std::span<const float>{},
                                   distances ? span(*distances) : std::span<const float>{});
      },
      nb::arg("path"), nb::arg("points"), nb::arg("intensity") = nb::none(),
      nb::arg("distances") = nb::none(),
      "Writes points [..., 3] as .ply or .pcd; those with distance < 0 are left out.");
  m.def(
      "pinhole_fovy",
      [](const std::array<double, 9>& matrix, int height) {
        return sensors::PinholePattern::from_intrinsic_matrix(matrix, 1, height).fovy;
      },
      nb::arg("matrix"), nb::arg("height"), "Degrees, of a camera with this 3x3 matrix.");
  m.def("ray_counts", [](const SensorHandle& h) {
    const auto& sensor = h.as<sensors::RayCastSensor>();
    return nb::make_tuple(sensor.num_frames(), sensor.num_rays_per_frame());
  });
}

}  // namespace mjsense::python
