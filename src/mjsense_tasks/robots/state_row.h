// SPDX-License-Identifier: Apache-2.0
#pragma once
// Pointers to the state components of one world that an episode's start writes. They point into the
// mjData or the worlds' state; call forward() after writing.

#include <mujoco/mujoco.h>

namespace mjsense::worlds {
class Worlds;
}  // namespace mjsense::worlds

namespace mjsense::tasks::robots {

struct StateRow {
  double* qpos = nullptr;        // [nq]
  double* qvel = nullptr;        // [nv]
  double* ctrl = nullptr;        // [nu]
  double* mocap_pos = nullptr;   // [nmocap, 3]; null without mocap bodies
  double* mocap_quat = nullptr;  // [nmocap, 4]
};

StateRow state_row(mjData* data);
StateRow state_row(worlds::Worlds& worlds, int world);

}  // namespace mjsense::tasks::robots
