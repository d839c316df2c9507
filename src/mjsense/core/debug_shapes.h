// SPDX-License-Identifier: Apache-2.0
#pragma once
// Debug visualisation of sensors: simple shapes in the world, as plain data. MuJoCo viewers append
// them as geoms (append_to()); other viewers read the list.

#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <vector>

#include "mjsense/core/pose.h"

namespace mjsense {

using Rgba = std::array<float, 4>;

struct DebugShape {
  mjtGeom kind;  // mjGEOM_SPHERE at `pos`; mjGEOM_ARROW, CYLINDER, LINE from `pos` to pos + vector
  Vec3 pos;      // m, world frame
  Vec3 vector;   // m, world frame; 0 for a sphere
  double width;  // m, radius; pixels for a line
  Rgba rgba;
  std::string label;  // "<sensor>_hit_3"
};

class DebugShapes {
 public:
  // meansize: m, the model's stat.meansize. Sensors scale their shapes by it.
  explicit DebugShapes(double meansize) : meansize_(meansize) {}

  double meansize() const { return meansize_; }
  const std::vector<DebugShape>& list() const { return list_; }

  void add_sphere(Vec3 center, double radius, const Rgba& rgba, std::string label);
  void add_arrow(Vec3 from, Vec3 to, double width, const Rgba& rgba, std::string label);
  void add_line(Vec3 from, Vec3 to, double pixels, const Rgba& rgba, std::string label);
  // Three arrows, red x, green y, blue z, labelled "<label>_x" etc. `mat`: row-major R_WF.
  void add_frame(Vec3 origin, const double mat[9], double length, double width,
                 const std::string& label);

  // Appends geoms to an mjvScene. MuJoCo draws labels as text and truncates them to 99 characters.
  // Returns the number of shapes that did not fit.
  int append_to(mjvScene* scene, bool labels = false) const;

 private:
  double meansize_;
  std::vector<DebugShape> list_;
};

}  // namespace mjsense
