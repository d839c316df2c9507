// SPDX-License-Identifier: Apache-2.0
#pragma once
// Scenes over a model that was compiled elsewhere and whose spec is not available.
//
// Sensors look up names in a spec and may add MuJoCo's sensors and cameras to it. Therefore such a
// scene has an outline of the model as its base: all elements that sensors refer to, with the names
// and the order of the model, but with trivial geometry. The outline is compiled, and the sensors
// and cameras that it has in addition are appended to a copy of the model.

#include <mujoco/mujoco.h>

#include <string>
#include <vector>

#include "mjsense/scene/mj_spec.h"

namespace mjsense::scene {

// A model with the sizes, options and arrays of `fields`, whose `nbuffer` is ignored. Throws
// RuntimeError if MuJoCo rejects the sizes.
ModelPtr copy_fields(mjModel fields);

class Scene;

class CompiledModel {
 public:
  // Adds the outline of the model to the empty `spec`, in which a scene is built afterwards. Unnamed
  // elements get the names that they have in a scene's base. Both must outlive this object.
  CompiledModel(const mjModel* model, mjSpec* spec);

  // A copy of the model with the names of the outline and with the sensors and cameras that
  // `outline`, the compiled spec, has in addition. Throws ValueError, with the XML to add to the
  // model, if the spec contains any other additional element.
  ModelPtr extended(const mjModel* outline) const;
  // Replaces the compiled outline of a scene that no simulation uses yet by the extended model.
  void replace_model(Scene& scene) const;

 private:
  struct Names {
    mjtObj type;
    std::vector<std::string> names;
  };
  void check_additions(const mjModel* outline) const;
  [[noreturn]] void fail(mjtObj type, const std::string& name) const;

  const mjModel* model_;
  mjSpec* spec_;
  std::vector<Names> names_;  // of the outline, by type
};

}  // namespace mjsense::scene
