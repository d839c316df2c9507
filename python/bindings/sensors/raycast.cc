// Ray sensors and their patterns in Python.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>

#include "mjsense/sensors/lidar/lidar_sensor.h"
#include "mjsense/sensors/lidar/point_cloud.h"
#include "mjsense/sensors/raycast/raycast_sensor.h"
#include "mjsense/sensors/terrain_height/terrain_height_sensor.h"
#include "python/bindings/bindings.h"
#include "python/bindings/configs.h"
#include "python/bindings/numpy.h"
#include "python/bindings/sensor_handle.h"

namespace mjsense::python {

template <class Fields>
void fields(Fields& f, GridPattern& c) {
  f("size", c.size);
  f("resolution", c.resolution);
  f("direction", c.direction);
}

template <class Fields>
void fields(Fields& f, PinholePattern& c) {
  f("width", c.width);
  f("height", c.height);
  f("fovy", c.fovy);
  f("camera_name", c.camera);
}

template <class Fields>
void fields(Fields& f, RingPattern::Ring& c) {
  f("radius", c.radius);
  f("num_samples", c.num_samples);
}

template <class Fields>
void fields(Fields& f, RingPattern& c) {
  f("rings", c.rings);
  f("include_center", c.include_center);
  f("direction", c.direction);
}

template <class Fields>
void fields(Fields& f, UserPattern& c) {
  f("offsets", c.offsets);
  f("directions", c.directions);
  f("times", c.times);
}

// A pattern's class says which it is: its attribute `kind`.
void read_custom(FromPython&, nb::handle value, PatternCfg& out) {
  nb::object kind = nb::getattr(value, "kind", nb::none());
  const std::string name = nb::isinstance<nb::str>(kind) ? nb::cast<std::string>(kind) : "";
  const auto read = [&](auto pattern) {
    FromPython reader(value);
    fields(reader, pattern);
    out = std::move(pattern);
  };
  if (name == "grid") return read(GridPattern{});
  if (name == "pinhole") return read(PinholePattern{});
  if (name == "ring") return read(RingPattern{});
  if (name == "user") return read(UserPattern{});
  const std::string text = "not a ray pattern: " + nb::cast<std::string>(nb::repr(value));
  throw nb::type_error(text.c_str());
}

template <class Fields>
void fields(Fields& f, RayCastVizCfg& c) {
  f("show_rays", c.show_rays);
  f("show_normals", c.show_normals);
  f("hit_color", c.hit_color);
  f("ray_color", c.ray_color);
  f("miss_color", c.miss_color);
  f("normal_color", c.normal_color);
  f("hit_radius", c.hit_radius);
  f("ray_width", c.ray_width);
  f("normal_length", c.normal_length);
}

template <class Fields>
void fields(Fields& f, RayCastSensorCfg& c) {
  f("name", c.name);
  f("frame", c.frame);
  f("pattern", c.pattern);
  f("ray_alignment", c.ray_alignment);
  f("max_distance", c.max_distance);
  f("exclude_parent_body", c.exclude_parent_body);
  f("include_geom_groups", c.include_geom_groups);
  f("debug_vis", c.debug_vis);
  f("viz", c.viz);
  f("min_distance", c.min_distance);
  f("hit_ids", c.hit_ids);
}

template <class Fields>
void fields(Fields& f, TerrainHeightSensorCfg& c) {
  fields(f, static_cast<RayCastSensorCfg&>(c));
  f("reduction", c.reduction);
}

template <class Fields>
void fields(Fields& f, SpinningScan& c) {
  f("channels", c.channels);
  f("elevation_min_deg", c.elevation_min_deg);
  f("elevation_max_deg", c.elevation_max_deg);
  f("elevations_deg", c.elevations_deg);
  f("samples", c.samples);
  f("azimuth_start_deg", c.azimuth_start_deg);
  f("azimuth_span_deg", c.azimuth_span_deg);
  f("rate_hz", c.rate_hz);
}

template <class Fields>
void fields(Fields& f, TableScan& c) {
  f("file", c.file);
  f("angles", c.angles);
  f("rays_per_scan", c.rays_per_scan);
  f("rate_hz", c.rate_hz);
}

// As for patterns.
void read_custom(FromPython&, nb::handle value, std::variant<SpinningScan, TableScan>& out) {
  nb::object kind = nb::getattr(value, "kind", nb::none());
  const std::string name = nb::isinstance<nb::str>(kind) ? nb::cast<std::string>(kind) : "";
  const auto read = [&](auto scan) {
    FromPython reader(value);
    fields(reader, scan);
    out = std::move(scan);
  };
  if (name == "spinning") return read(SpinningScan{});
  if (name == "table") return read(TableScan{});
  const std::string text = "not a lidar's scan: " + nb::cast<std::string>(nb::repr(value));
  throw nb::type_error(text.c_str());
}

template <class Fields>
void fields(Fields& f, LidarSensorCfg& c) {
  fields(f, static_cast<RayCastSensorCfg&>(c));
  f("scan", c.scan);
  f("motion_distortion", c.motion_distortion);
  f("range_noise_std", c.range_noise_std);
  f("range_noise_relative", c.range_noise_relative);
  f("range_resolution", c.range_resolution);
  f("dropout", c.dropout);
}

CfgKind lidar_kind() { return cfg_kind<LidarSensorCfg>("lidar"); }
CfgKind raycast_kind() { return cfg_kind<RayCastSensorCfg>("raycast"); }
CfgKind terrain_height_kind() { return cfg_kind<TerrainHeightSensorCfg>("terrain_height"); }

namespace {

nb::object rows_of(const std::vector<std::array<double, 3>>& vectors) {
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
  add_cfg_check<GridPattern>("GridPatternCfg");
  add_cfg_check<PinholePattern>("PinholeCameraPatternCfg");
  add_cfg_check<RingPattern::Ring>("Ring");
  add_cfg_check<RingPattern>("RingPatternCfg");
  add_cfg_check<UserPattern>("UserPatternCfg");
  add_cfg_check<RayCastVizCfg>("RayCastVizCfg");
  add_cfg_check<SpinningScan>("SpinningScanCfg");
  add_cfg_check<TableScan>("TableScanCfg");
  m.def(
      "pattern_rays",
      [](nb::handle config) {
        PatternCfg pattern;
        FromPython reader(config);
        read_custom(reader, config, pattern);
        const RayPattern rays = make_pattern(pattern, nullptr, "pattern");
        return nb::make_tuple(rows_of(rays.offsets), rows_of(rays.directions));
      },
      "Offsets and directions, float32 [n, 3], of a pattern.");
  m.def(
      "write_point_cloud",
      [](const std::string& path, nb::ndarray<const float, nb::c_contig, nb::device::cpu> points,
         std::optional<nb::ndarray<const float, nb::c_contig, nb::device::cpu>> intensity,
         std::optional<nb::ndarray<const float, nb::c_contig, nb::device::cpu>> distances) {
        const auto span = [](const auto& a) { return std::span<const float>(a.data(), a.size()); };
        write_point_cloud(path, span(points),
                          intensity ? span(*intensity) : std::span<const float>{},
                          distances ? span(*distances) : std::span<const float>{});
      },
      nb::arg("path"), nb::arg("points"), nb::arg("intensity") = nb::none(),
      nb::arg("distances") = nb::none(),
      "Writes points [..., 3] as .ply or .pcd; those with distance < 0 are left out.");
  m.def("ray_counts", [](const SensorHandle& h) {
    const auto& sensor = h.as<RayCastSensor>();
    return nb::make_tuple(sensor.num_frames(), sensor.num_rays_per_frame());
  });
}

}  // namespace mjsense::python
