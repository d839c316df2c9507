// SPDX-License-Identifier: Apache-2.0
#pragma once
// Ray patterns: start points and directions of a sensor's rays, in the sensor's frame.

#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "mjsense/core/fields/field_traits.h"

namespace mjsense::sensors {

// N rays; offsets in m, unit directions.
struct RayPattern {
  std::vector<std::array<double, 3>> offsets;     // [N]
  std::vector<std::array<double, 3>> directions;  // [N]
  std::vector<double> times;  // [N] s, time of the ray: 0 now, < 0 before; empty: all now
  std::size_t size() const { return directions.size(); }
};

// Points along each axis are at -size/2 + k * resolution. They reach both ends if resolution
// divides size; otherwise they stop before the upper end. x varies fastest. Size 0 gives one ray.
struct GridPattern {
  bool operator==(const GridPattern&) const = default;
  std::array<double, 2> size{1.0, 1.0};
  double resolution = 0.1;
  std::array<double, 3> direction{0, 0, -1};
};
template <class V>
void visit_fields(V& v, GridPattern& c) {
  v.object("GridPatternCfg", "Parallel rays from the points of a grid, x fastest.", "grid")
      .frozen();
  v("size", c.size, "Size of the grid in x and y, centred on the frame.").unit("m").at_least(0);
  v("resolution", c.resolution, "Distance between rays.").unit("m").positive();
  v("direction", c.direction, "Direction of all rays; any non-zero length.");
}

// u = linspace(-1, 1, width) varies fastest; horizontally tan(fovx / 2) = tan(fovy / 2) * width /
// height.
struct PinholePattern {
  bool operator==(const PinholePattern&) const = default;
  int width = 16, height = 12;
  double fovy = 45.0;
  std::string camera;

  // K row-major, 3x3: fovy = 2 atan(height / (2 fy)); fx, cx and cy are not used.
  static PinholePattern from_intrinsic_matrix(const std::array<double, 9>& k, int width,
                                              int height);
  static PinholePattern from_mujoco_camera(std::string camera_name);
};
template <class V>
void visit_fields(V& v, PinholePattern& c) {
  v.object("PinholeCameraPatternCfg",
           "Rays of a pinhole camera that looks along -Z, through the edges (not the centres) of "
           "its pixels, bottom row first.",
           "pinhole")
      .frozen();
  v("width", c.width, "Number of rays in a row.").at_least(1);
  v("height", c.height, "Number of rows.").at_least(1);
  v("fovy", c.fovy, "Vertical field of view.").unit("degrees").positive();
  v("camera_name", c.camera,
    "Camera of the model whose resolution and angles are used instead; its pose is not used.")
      .or_none();
}

// The centre first, then the rings in order, each counter-clockwise from +x.
struct RingPattern {
  bool operator==(const RingPattern&) const = default;
  struct Ring {
    bool operator==(const Ring&) const = default;
    double radius = 0.1;
    int num_samples = 8;
  };
  std::vector<Ring> rings;
  bool include_center = true;
  std::array<double, 3> direction{0, 0, -1};

  static RingPattern single_ring(double radius = 0.1, int num_samples = 8);
};
template <class V>
void visit_fields(V& v, RingPattern::Ring& c) {
  v.object("RingPatternCfg.Ring", "One circle of rays.").frozen();
  v("radius", c.radius, "Radius around the frame's z axis.").unit("m").at_least(0);
  v("num_samples", c.num_samples, "Number of rays on the circle.").at_least(1);
}
template <class V>
void visit_fields(V& v, RingPattern& c) {
  v.object("RingPatternCfg",
           "Parallel rays from points on circles in the XY plane, after the ray from the centre.",
           "ring")
      .frozen();
  v("rings", c.rings, "The circles.");
  v("include_center", c.include_center, "Add a ray from the centre.");
  v("direction", c.direction, "Direction of all rays; any non-zero length.");
}

struct UserPattern {
  bool operator==(const UserPattern&) const = default;
  std::vector<std::array<double, 3>> offsets{{0, 0, 0}};
  std::vector<std::array<double, 3>> directions{{0, 0, -1}};
  std::vector<double> times;
};
template <class V>
void visit_fields(V& v, UserPattern& c) {
  v.object("UserPatternCfg",
           "User-defined rays. A single direction or a single offset applies to all rays.", "user")
      .frozen();
  v("offsets", c.offsets, "Start points, [n, 3].").unit("m");
  v("directions", c.directions, "Directions, [n, 3], of any non-zero length.");
  v("times", c.times,
    "Times, [n] or empty: each ray starts from the pose that the frame had at its time.")
      .unit("s")
      .at_most(0);
}

using PatternCfg = std::variant<GridPattern, PinholePattern, RingPattern, UserPattern>;

}  // namespace mjsense::sensors

namespace mjsense {
template <>
inline constexpr const char* kChoiceName<sensors::PatternCfg> = "RayPatternCfg";
}  // namespace mjsense

namespace mjsense::sensors {

// Throws ValueError if there are more rays than a sensor may have.
void check_ray_count(double rays, std::string_view context);

// Check fields that depend on each other: there must be rays, and not too many. Throw ValueError;
// `context` starts every message: "sensor 'scan'".
void validate(const GridPattern& grid, std::string_view context);
void validate(const PinholePattern& pinhole, std::string_view context);
void validate(const RingPattern& rings, std::string_view context);
void validate(const UserPattern& user, std::string_view context);

// Throws ValueError for errors found by check_fields(), and KeyError for an unknown camera. `model`
// may be null unless the pattern names a camera.
RayPattern make_pattern(const PatternCfg& cfg, const mjModel* model, std::string_view context);

}  // namespace mjsense::sensors
