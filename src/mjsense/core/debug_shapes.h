// SPDX-License-Identifier: Apache-2.0
#pragma once
// What sensors show a human of their measurements: simple shapes in the world, as plain data. A
// viewer of MuJoCo takes them as geoms (append_to), any other one reads them.

#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense {

using Rgba = std::array<float, 4>;

struct DebugShape {
  mjtGeom kind;  // mjGEOM_SPHERE at `pos`; mjGEOM_ARROW, CYLINDER, LINE from `pos` to pos + vector
  Vec3 pos;      // m, world
  Vec3 vector;   // m, world; 0 of a sphere
  double width;  // m, radius; pixels of a line
  Rgba rgba;
  std::string label;  // "<sensor>_hit_3"
};

class DebugShapes {
 public:
  // meansize: m, the model's stat.meansize, the unit of the sizes that sensors draw in.
  explicit DebugShapes(double meansize) : meansize_(meansize) {}

  double meansize() const { return meansize_; }
  const std::vector<DebugShape>& list() const { return list_; }

  void add_sphere(Vec3 center, double radius, const Rgba& rgba, std::string label);
  void add_arrow(Vec3 from, Vec3 to, double width, const Rgba& rgba, std::string label);
  void add_line(Vec3 from, Vec3 to, double pixels, const Rgba& rgba, std::string label);
  // Three arrows, red x, green y, blue z: "<label>_x" ... `mat`: row-major R_WF.
  void add_frame(Vec3 origin, const double mat[9], double length, double width, std::string label);

  // Appends geoms to a scene of MuJoCo's; labels are texts in its picture, cut after 99 characters.
  // Returns how many shapes found no room.
  int append_to(mjvScene* scene, bool labels = false) const;

 private:
  double meansize_;
  std::vector<DebugShape> list_;
};

}  // namespace mjsense
