// SPDX-License-Identifier: Apache-2.0
#include "mjsense/sensors/lidar/point_cloud.h"

#include <fmt/format.h>

#include <vector>

#include "mjsense/core/error.h"
#include "mjsense/core/files/regular_file.h"

namespace mjsense::sensors {

void write_point_cloud(const std::string& path, std::span<const float> points,
                       std::span<const float> intensity, std::span<const float> distances) {
  const std::size_t n = points.size() / 3;
  if (points.size() % 3 != 0 || (!intensity.empty() && intensity.size() != n) ||
      (!distances.empty() && distances.size() != n))
    throw ValueError(fmt::format(
        "point cloud '{}': {} coordinates, {} intensities, {} distances are inconsistent", path,
        points.size(), intensity.size(), distances.size()));
  std::vector<float> rows;
  rows.reserve(4 * n);
  for (std::size_t i = 0; i < n; ++i) {
    if (!distances.empty() && distances[i] < 0) continue;
    rows.insert(rows.end(), {points[3 * i], points[3 * i + 1], points[3 * i + 2],
                             intensity.empty() ? 0.0f : intensity[i]});
  }
  const std::size_t count = rows.size() / 4;
  std::string header;
  if (path.ends_with(".ply")) {
    header = fmt::format(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty float x\nproperty float "
        "y\nproperty float z\n"
        "property float intensity\nend_header\n",
        count);
  } else if (path.ends_with(".pcd")) {
    header = fmt::format(
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 "
        "1\nWIDTH {0}\nHEIGHT 1\n"
        "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {0}\nDATA binary\n",
        count);
  } else {
    throw ValueError(fmt::format("point cloud '{}': the name must end in .ply or .pcd", path));
  }
  write_file(path, {std::as_bytes(std::span(header)), std::as_bytes(std::span(rows))});
}

}  // namespace mjsense::sensors
