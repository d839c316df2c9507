# SPDX-License-Identifier: Apache-2.0
"""The physics of all worlds: mujoco_warp's step in parts, so that derived quantities belong to the current state.

The parts are those of ``mujoco_warp.step``. A step begins with the positions and velocities that the previous one computed last.
"""

from __future__ import annotations

import mujoco_warp as mjw
import warp as wp
from mujoco_warp._src import smooth

_INTEGRATE = {
    mjw.IntegratorType.EULER: mjw.euler,
    mjw.IntegratorType.RK4: mjw.rungekutta4,
    mjw.IntegratorType.IMPLICIT: mjw.implicit,
    mjw.IntegratorType.IMPLICITFAST: mjw.implicit,
}


def check_options(model: mjw.Model) -> None:
    """Raises ValueError for options with which mujoco_warp's step cannot be divided."""
    if model.opt.integrator not in _INTEGRATE:
        raise ValueError(
            f"integrator {mjw.IntegratorType(model.opt.integrator).name} is not available with backend='warp'; use backend='cpu'"
        )
    if model.opt.enableflags & mjw.EnableBit.SLEEP:
        raise ValueError("the option sleep is not available with backend='warp'; use backend='cpu'")


_FIXED_POSES = ("body_pos", "body_quat", "geom_pos", "geom_quat")


def place_fixed_geoms(field: str, model: mjw.Model, data: mjw.Data) -> None:
    """Computes the poses of geoms that cannot move, if a change of this field changes them; mujoco_warp computes them only
    once."""
    if field not in _FIXED_POSES:
        return
    mjw.kinematics(model, data)
    every = wp.ones_like(model.body_weldid)
    poses = [model.geom_pos, model.geom_quat, data.xpos, data.xquat]
    inputs = [model.body_rootid, every, model.body_mocapid, model.geom_bodyid, *poses]
    wp.launch(smooth._geom_local_to_global, (data.nworld, model.ngeom), inputs, [data.geom_xpos, data.geom_xmat])


def compute_velocities(model: mjw.Model, data: mjw.Data) -> None:
    """Everything that depends on positions and velocities: poses, contacts, constraints, passive forces and their sensors."""
    mjw.step1(model, data)


def compute_forces(model: mjw.Model, data: mjw.Data) -> None:
    """Actuation, accelerations and constraint forces, and the sensors that measure them."""
    mjw.fwd_actuation(model, data)
    mjw.fwd_acceleration(model, data)
    mjw.solve(model, data)
    sensed = not model.opt.disableflags & mjw.DisableBit.SENSOR and model.sensor_rne_postconstraint
    if model.opt.run_rne_postconstraint or sensed:
        mjw.rne_postconstraint(model, data)
    mjw.sensor_acc(model, data, skip_rne_postconstraint=True)


def integrate(model: mjw.Model, data: mjw.Data) -> None:
    """Advances the state by a timestep."""
    _INTEGRATE[mjw.IntegratorType(model.opt.integrator)](model, data)
