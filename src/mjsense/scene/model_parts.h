// SPDX-License-Identifier: Apache-2.0
#pragma once
// Composes one model from several MJCF files, each attached to a site or body of the earlier ones.

#include <array>
#include <span>
#include <string>
#include <string_view>

#include "mjsense/scene/entity.h"
#include "mjsense/scene/mj_spec.h"

namespace mjsense::scene {

// A model that is attached to another, such as a gripper to the flange of an arm.
struct ModelPart {
  std::string path;       // path of an MJCF file, as ModelSource::path
  std::string attach_to;  // name of a site, or else a body, of the model composed so far
  std::string prefix;     // prefix of its names: "gripper/"
  std::array<double, 3> pos{0, 0, 0};      // m, of its root relative to the attachment point
  std::array<double, 4> quat{1, 0, 0, 0};  // wxyz
};

// Returns the model with its parts attached in this order. The <option> values and keyframes of the
// parts are ignored. Throws ValueError, or KeyError if the attachment point does not exist; both
// begin with `context` and name the part's file.
SpecPtr compose_model(const ModelSource& model, std::span<const ModelPart> parts,
                      std::string_view context);

}  // namespace mjsense::scene
