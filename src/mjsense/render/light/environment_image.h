// SPDX-License-Identifier: Apache-2.0
#pragma once
// Linear radiance of the surroundings in all directions, as an equirectangular image.

#include <mujoco/mujoco.h>

#include <string>
#include <string_view>
#include <vector>

#include "mjsense/render/light/microfacets.h"

namespace mjsense::render {

// The world's z axis is up. The top row looks up, the centre of the image along +x, the quarter left
// of it along +y.
struct EnvironmentImage {
  int width, height;       // width = 2 * height
  std::vector<float> rgb;  // [height, width, 3], not negative

  // The direction of the point (x, y), in pixels from the left and top border.
  Vec3 direction(double x, double y) const;
  // A direction as angles in units of pi: 0 at the centre and at the top.
  struct Angles {
    float azimuth, polar;
  };
  static Angles angles_of(const Vec3& direction);
  // Interpolated between pixels.
  std::array<float, 3> at(Angles angles) const;
  std::array<float, 3> at(const Vec3& direction) const { return at(angles_of(direction)); }
  // Solid angle of each pixel of a row, sr.
  double solid_angle(int row) const;
  // Half of its size.
  EnvironmentImage halved() const;
};

// The surroundings that a cube texture of the model shows as its skybox.
EnvironmentImage skybox_image(const mjModel* model, int texture);

// Whether `name` is the path of a file; names of surroundings have no suffix.
inline bool is_environment_file(std::string_view name) {
  return name.ends_with(".hdr") || name.ends_with(".exr");
}

// The bytes of a file. Throws ValueError that names it.
std::string read_environment_file(const std::string& path);

// A Radiance picture: 32-bit RGBE, equirectangular, of at most 8192 x 4096 pixels. Throws ValueError
// that names the file.
EnvironmentImage parse_radiance(const std::string& path, std::string_view bytes);

// A function that converts an OpenEXR picture to a Radiance picture; the Python package sets one. Throws
// ValueError that names the file.
using ExrReader = std::string (*)(const std::string& path, const std::string& bytes);
void set_exr_reader(ExrReader reader);

// Either of them, by the suffix of the path.
EnvironmentImage parse_environment(const std::string& path, const std::string& bytes);

}  // namespace mjsense::render
