// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mujoco/mujoco.h>

#include <map>

namespace mjsense {

// Number of the model's elements of an mjtObj; 0 for types without elements.
inline int count_of(const mjModel* m, int type) {
  static const std::map<int, mjtSize mjModel::*> counts = {
      // clang-format off
      {mjOBJ_BODY, &mjModel::nbody}, {mjOBJ_XBODY, &mjModel::nbody}, {mjOBJ_JOINT, &mjModel::njnt},
      {mjOBJ_DOF, &mjModel::nv},
      {mjOBJ_GEOM, &mjModel::ngeom}, {mjOBJ_SITE, &mjModel::nsite}, {mjOBJ_CAMERA, &mjModel::ncam},
      {mjOBJ_LIGHT, &mjModel::nlight}, {mjOBJ_FLEX, &mjModel::nflex}, {mjOBJ_MESH, &mjModel::nmesh},
      {mjOBJ_SKIN, &mjModel::nskin}, {mjOBJ_HFIELD, &mjModel::nhfield}, {mjOBJ_TEXTURE, &mjModel::ntex},
      {mjOBJ_MATERIAL, &mjModel::nmat}, {mjOBJ_PAIR, &mjModel::npair}, {mjOBJ_EXCLUDE, &mjModel::nexclude},
      {mjOBJ_EQUALITY, &mjModel::neq}, {mjOBJ_TENDON, &mjModel::ntendon}, {mjOBJ_ACTUATOR, &mjModel::nactuator},
      {mjOBJ_SENSOR, &mjModel::nsensor}, {mjOBJ_NUMERIC, &mjModel::nnumeric}, {mjOBJ_TEXT, &mjModel::ntext},
      {mjOBJ_TUPLE, &mjModel::ntuple}, {mjOBJ_KEY, &mjModel::nkey}, {mjOBJ_PLUGIN, &mjModel::nplugin},
      // clang-format on
  };
  const auto found = counts.find(type);
  return found == counts.end() ? 0 : static_cast<int>(m->*found->second);
}

}  // namespace mjsense
