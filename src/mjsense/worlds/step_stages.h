// SPDX-License-Identifier: Apache-2.0
#pragma once
// mj_step in stages, so that a step can start from stages that are already computed.

#include <mujoco/mujoco.h>

namespace mjsense::worlds {

// Whether mj_step may be split into stages, so that a step starts from stages that are already
// computed and skips those that are not read. Otherwise mj_step is called as a whole: callbacks and
// plugins may count their calls, MuJoCo's delays and histories sample sensors at every substep, and
// sleep, IPC and the discrete integrator do more than the stages.
bool can_split_step(const mjModel* m);

// mj_forward up to the velocity stage. Without `sensors`, MuJoCo's own sensors keep their old
// values. Unlike in mj_forward, energies are computed before the sensors that report them: with
// <flag energy="enable"/>, MuJoCo's e_kinetic reports the energy of the previous forward.
void position_and_velocity(const mjModel* m, mjData* d, bool sensors);

// mj_step from the stage that is already computed. Without `sensors`, MuJoCo's own are skipped: they
// cannot be read between the stages before the integration and those after it. With them, those of the
// stage that is already computed must be, too.
void step_from(mjtStage stage, const mjModel* m, mjData* d, bool sensors = false);

// mj_step as a whole. In the histories of MuJoCo's sensors, e_kinetic is the energy of the state at
// which it was measured, as in position_and_velocity().
void whole_step(const mjModel* m, mjData* d);

// The poses of all bodies, also of static and sleeping ones. With sleep, MuJoCo does not compute
// those again, so that they must follow a change of the model in this way.
void all_poses(const mjModel* m, mjData* d);

}  // namespace mjsense::worlds
