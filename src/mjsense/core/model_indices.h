// SPDX-License-Identifier: Apache-2.0
#pragma once
// Integers of a model that address memory: ids, and first elements with their number. MuJoCo computes
// them when it compiles a model and checks none of them afterwards, but programs may write them.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

namespace mjsense {

// Throws ValueError, which names the field, the place, the value and the range, if an integer of an
// element (a body, a geom, a mesh, ...) addresses something that the model does not have. Arrays that
// are null are skipped. Contents of meshes, skins and flexes are not read: the cost is one pass over
// arrays with a row for each element.
void check_element_indices(const mjModel& m);

// The same for the faces of a mesh and its convex hull, and for the faces of a skin. The integers of
// these elements themselves must be valid.
void check_mesh_indices(const mjModel& m, int mesh);
void check_skin_indices(const mjModel& m, int skin);

// All of these, and what only the physics uses.
void check_model_indices(const mjModel& m);

// A field with ids of elements, and the mjModel size that bounds them.
struct IdField {
  std::string name;
  int lowest;  // -1: none is allowed
  int* mjModel::*ids;
  mjtSize mjModel::*rows;
  int columns;
  mjtSize mjModel::*count;
  std::string count_name;
};
// The fields with ids that scenes for images depend on (mjv_updateScene()).
const std::vector<IdField>& drawn_id_fields();

}  // namespace mjsense
