// SPDX-License-Identifier: Apache-2.0
#pragma once
// One model of several MJCF files: each hangs on a site or a body of those before it.

#include <array>
#include <span>
#include <string>
#include <string_view>

#include "mjsense/scene/entity.h"
#include "mjsense/scene/spec.h"

namespace mjsense {

// A model that hangs on another: a gripper on the flange of an arm.
struct ModelPart {
  std::string path;                        // of an MJCF, as ModelSource's
  std::string to;                          // site, else body, of the model so far
  std::string prefix;                      // of its names: "gripper/"
  std::array<double, 3> pos{0, 0, 0};      // m, of its root where it hangs
  std::array<double, 4> quat{1, 0, 0, 0};  // wxyz
};

// The model with its parts, attached in this order; their <option> and keyframes count for nothing.
// Throws ValueError, or KeyError where a part hangs on nothing, which begin with `place` and name
// the part's file.
SpecPtr compose_model(const ModelSource& model, std::span<const ModelPart> parts,
                      std::string_view place);

}  // namespace mjsense
