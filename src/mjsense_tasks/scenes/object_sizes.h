// SPDX-License-Identifier: Apache-2.0
#pragma once
// Object sizes that vary between episodes. Sizes are written to each world's own model fields, so
// that no recompilation is needed. An object of size s has what MuJoCo's compiler would compute for
// it: lengths scale with s, masses with s^3, inertias with s^5, and the constants that scale the
// solver's constraints accordingly.

#include <array>
#include <span>
#include <string>
#include <vector>

#include "mjsense/sim/simulation.h"
#include "mjsense_tasks/scenes/world_field.h"

namespace mjsense::tasks::scenes {

class ObjectSizes {
 public:
  // Number of sizes between the minimum and the maximum. Limited, so that planners can prepare the
  // grasps of each size.
  static constexpr int kSteps = 6;
  // Evenly spaced from minimum to maximum; a single size if they are equal.
  static std::vector<double> steps(const std::array<double, 2>& range);

  // `bodies` have a free joint, `sizes` are the sizes of each, and their meshes were added by
  // ObjectMeshes. Throws ValueError for an object with moving parts.
  ObjectSizes(sim::Simulation& simulation, std::span<const int> bodies,
              std::vector<std::vector<double>> sizes, std::string_view context);

  double size(int object, int step) const { return sizes_[object][step]; }
  // Sets the index of the size of each object in this world. Writes the world's rows of the model;
  // call Worlds::model_changed() afterwards.
  void set(int world, std::span<const int> steps) const;

 private:
  // A mesh at one size: its id, and the pose, size and bounds of the geom that uses it.
  struct Shown {
    int mesh;
    double pos[3], quat[4], size[3], bound, aabb[6];
  };
  struct MeshGeom {
    int geom;
    std::vector<Shown> shown;  // [sizes]
  };
  struct Object {
    int body, dof;
    std::vector<int> bodies, geoms, sites;
    std::vector<MeshGeom> meshes;
  };
  Shown shown(int geom, int mesh, double size) const;
  void widen(mjBatch* batch, int body, const std::vector<double>& sizes) const;
  void set_object(int world, const Object& object, int step, double size) const;

  const mjModel* m_;
  std::vector<Object> objects_;
  std::vector<std::vector<double>> sizes_;
  WorldField<double> geom_size_, geom_pos_, geom_quat_, geom_rbound_, geom_aabb_, body_mass_,
      body_inertia_, body_ipos_, body_pos_, subtree_mass_, body_invweight_, dof_invweight_, dof_m0_,
      site_pos_, site_size_;
  WorldField<int> geom_dataid_;
};

}  // namespace mjsense::tasks::scenes
