// SPDX-License-Identifier: Apache-2.0
#pragma once
// Objects whose size differs from episode to episode, each world's in its own model, so that nothing is compiled
// again. An object of size s has what MuJoCo's compiler would give it: lengths s, masses s^3 and inertias s^5 times
// those of its model, and what the solver scales constraints by to match.

#include <array>
#include <span>
#include <string>
#include <vector>

#include "mjsense/sim/simulation.h"

namespace mjsense {

class ObjectSizes {
 public:
  // Sizes between least and most: as many as planners can know the grasps of.
  static constexpr int kSteps = 6;
  // Evenly from least to most; one where they are equal.
  static std::vector<double> steps(const std::array<double, 2>& range);

  // Bodies with a free joint, and the sizes of each, meshes as ObjectMeshes has made them. Throws ValueError for one
  // that has moving parts.
  ObjectSizes(Simulation& simulation, std::span<const int> bodies,
              std::vector<std::vector<double>> sizes, std::string_view place);

  double size(int object, int step) const { return sizes_[object][step]; }
  // Which of its sizes each object of this world has. Writes the world's rows of the model; Worlds::model_changed()
  // follows.
  void set(int world, std::span<const int> steps) const;

 private:
  // A mesh in one size: its id, and the geom's pose, size and bounds with it.
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
  // A field of the model that worlds have their own rows of.
  template <class T>
  struct Own {
    T* rows = nullptr;
    const T* model = nullptr;
    int size = 0;
    T* of(int world) const { return rows + static_cast<std::ptrdiff_t>(world) * size; }
  };
  template <class T>
  static Own<T> own(mjBatch* batch, const char* field, const T* model);
  Shown shown(int geom, int mesh, double size) const;
  void widen(mjBatch* batch, int body, const std::vector<double>& sizes) const;
  void set_object(int world, const Object& object, int step, double size) const;

  const mjModel* m_;
  std::vector<Object> objects_;
  std::vector<std::vector<double>> sizes_;
  Own<double> geom_size_, geom_pos_, geom_quat_, geom_rbound_, geom_aabb_, body_mass_,
      body_inertia_, body_ipos_, body_pos_, subtree_mass_, body_invweight_, dof_invweight_, dof_m0_,
      site_pos_, site_size_;
  Own<int> geom_dataid_;
};

}  // namespace mjsense
