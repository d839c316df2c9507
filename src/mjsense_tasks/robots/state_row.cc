// SPDX-License-Identifier: Apache-2.0
#include "mjsense_tasks/robots/state_row.h"

#include "mjsense/worlds/worlds.h"

namespace mjsense::tasks::robots {

StateRow state_row(mjData* data) {
  return {data->qpos, data->qvel, data->ctrl, data->mocap_pos, data->mocap_quat};
}

StateRow state_row(worlds::Worlds& worlds, int world) {
  const auto row = [&](const char* name) {
    const ArrayView view = worlds.state_component(name);
    return reinterpret_cast<double*>(view.data + world * view.strides[0]);
  };
  return {row("qpos"), row("qvel"), row("ctrl"), row("mocap_pos"), row("mocap_quat")};
}

}  // namespace mjsense::tasks::robots
