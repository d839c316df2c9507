// SPDX-License-Identifier: Apache-2.0
#include "mjsense/worlds/step_stages.h"

namespace mjsense::worlds {

bool can_split_step(const mjModel* m) {
  const int whole = mjENBL_SLEEP | mjENBL_IPC | mjENBL_SPECULATIVE | mjENBL_FWDINV;
  const bool callbacks = mjcb_passive || mjcb_control || mjcb_contactfilter || mjcb_sensor ||
                         mjcb_act_dyn || mjcb_act_gain || mjcb_act_bias;
  return m->opt.integrator != mjINT_DISCRETE && !(m->opt.enableflags & whole) && !callbacks &&
         m->nhistory == 0 && m->nplugin == 0;
}

void position_and_velocity(const mjModel* m, mjData* d, bool sensors) {
  const bool energy = m->opt.enableflags & mjENBL_ENERGY;
  mj_fwdPosition(m, d);
  if (energy) {
    mj_energyPos(m, d);
    mj_energyVel(m, d);  // of the inertia and qvel, which are there
  }
  if (sensors) mj_sensorPos(m, d);
  if (!d->flg_energypos) d->energy[0] = d->energy[1] = 0;
  mj_fwdVelocity(m, d);
  if (sensors) mj_sensorVel(m, d);
}

void step_from(mjtStage stage, const mjModel* m, mjData* d, bool sensors) {
  if (stage < mjSTAGE_VEL) position_and_velocity(m, d, sensors);
  if (stage < mjSTAGE_ACC) mj_forwardSkip(m, d, mjSTAGE_VEL, !sensors);
  mj_checkAcc(m, d);
  switch (m->opt.integrator) {
    case mjINT_EULER:
      return mj_Euler(m, d);
    case mjINT_RK4:
      return mj_RungeKutta(m, d, 4);
    default:
      return mj_implicit(m, d);
  }
}

void whole_step(const mjModel* m, mjData* d) {
  if (m->nhistory > 0 && (m->opt.enableflags & mjENBL_ENERGY)) position_and_velocity(m, d, false);
  mj_step(m, d);
}

void all_poses(const mjModel* m, mjData* d) {
  mjModel awake = *m;
  awake.opt.enableflags &= ~mjENBL_SLEEP;
  mj_fwdKinematics(&awake, d);
}

}  // namespace mjsense::worlds
