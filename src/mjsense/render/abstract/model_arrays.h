// SPDX-License-Identifier: Apache-2.0
#pragma once
// The parts of a model that an image depends on but that are not in the abstract scene: meshes,
// height fields, skins, textures and materials. They are read from named arrays, so that the model
// may belong to any version of MuJoCo.

#include <mujoco/mujoco.h>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace mjsense::render {

struct NamedArray {
  void* data;
  std::vector<std::int64_t> shape;
  char kind;  // 'i', 'u', 'f' or 'b', as in NumPy
  int bytes;  // per element

  std::int64_t rows() const { return shape.empty() ? 0 : shape[0]; }
};
using NamedArrays = std::map<std::string, NamedArray>;

// A struct of which only the fields for meshes, height fields, skins, textures and materials are
// set; their pointers are those of `arrays`. Throws ValueError, which names the field, if an array
// is missing or has another type or shape than expected.
std::unique_ptr<mjModel> model_of_arrays(const NamedArrays& arrays);

// Names of further arrays of integers that MuJoCo reads when it updates an abstract scene.
std::vector<std::string> scene_index_fields();
// `drawn`, the result of model_of_arrays(), with those of these arrays that there are, for
// check_element_indices(), which this function calls too.
std::unique_ptr<mjModel> indices_of_arrays(const NamedArrays& arrays, const mjModel& drawn);

}  // namespace mjsense::render
