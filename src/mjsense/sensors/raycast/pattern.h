#pragma once
// Ray patterns: where a sensor's rays start and where they point, in the sensor's frame.

#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace mjsense {

// N rays; offsets in m, directions of length 1.
struct RayPattern {
  std::vector<std::array<double, 3>> offsets;     // [N]
  std::vector<std::array<double, 3>> directions;  // [N]
  std::vector<double> times;  // [N] s, when the ray is cast: 0 now, < 0 before; empty: all now
  std::size_t size() const { return directions.size(); }
};

// Parallel rays from a grid in the frame's xy plane. Along each axis at -size/2 + k * resolution:
// both ends where resolution divides size, else it stops short. x varies fastest. Size 0 is one
// ray.
struct GridPattern {
  bool operator==(const GridPattern&) const = default;
  std::array<double, 2> size{1.0, 1.0};  // m
  double resolution = 0.1;               // m
  std::array<double, 3> direction{0, 0, -1};
};

// Rays from one point through the edges (not the centres) of an image's pixels, looking along -z.
// u = linspace(-1, 1, width) varies fastest; the first row is the bottom of MuJoCo's image.
struct PinholePattern {
  bool operator==(const PinholePattern&) const = default;
  int width = 16, height = 12;
  double fovy = 45.0;  // degrees; horizontally tan(fovx / 2) = tan(fovy / 2) * width / height
  std::string camera;  // resolution and field of view of this camera instead; not its pose

  // K row-major, 3x3: fovy = 2 atan(height / (2 fy)); fx, cx and cy play no part.
  static PinholePattern from_intrinsic_matrix(const std::array<double, 9>& k, int width,
                                              int height);
  static PinholePattern from_mujoco_camera(std::string camera_name);
};

// Parallel rays from rings around the frame's z axis: the centre first, then ring after ring,
// counter-clockwise from +x.
struct RingPattern {
  bool operator==(const RingPattern&) const = default;
  struct Ring {
    bool operator==(const Ring&) const = default;
    double radius = 0.1;  // m
    int num_samples = 8;
  };
  std::vector<Ring> rings;
  bool include_center = true;
  std::array<double, 3> direction{0, 0, -1};

  static RingPattern single_ring(double radius = 0.1, int num_samples = 8);
};

// The caller's own rays. One direction for all offsets, or one offset for all directions, will do.
struct UserPattern {
  bool operator==(const UserPattern&) const = default;
  std::vector<std::array<double, 3>> offsets{{0, 0, 0}};      // m
  std::vector<std::array<double, 3>> directions{{0, 0, -1}};  // any length but 0
  std::vector<double> times;  // s <= 0, one a ray or none: the frame is where it was then
};

using PatternCfg = std::variant<GridPattern, PinholePattern, RingPattern, UserPattern>;

// Throws ValueError for more rays than a sensor may have.
void check_ray_count(double rays, std::string_view place);

// Throws ValueError for anything that gives no rays, endless ones or NaN. `place` starts every message:
// "sensor 'scan'".
void validate(const GridPattern& grid, std::string_view place);
void validate(const PinholePattern& pinhole, std::string_view place);
void validate(const RingPattern::Ring& ring, std::string_view place);
void validate(const RingPattern& rings, std::string_view place);
void validate(const UserPattern& user, std::string_view place);
void validate(const PatternCfg& cfg, std::string_view place);

// Validates; KeyError for an unknown camera. `model` may be null unless a pattern names a camera.
RayPattern make_pattern(const PatternCfg& cfg, const mjModel* model, std::string_view place);

}  // namespace mjsense
