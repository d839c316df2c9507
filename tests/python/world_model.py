# SPDX-License-Identifier: Apache-2.0
"""Plain MuJoCo's model of one world: the scene's, with what that world has of its own."""

import copy

import mujoco

# What scenes vary that physics sees.
FIELDS = ("body_pos", "body_quat", "body_mass", "body_inertia", "body_ipos", "body_subtreemass", "body_invweight0", "dof_invweight0", "dof_M0",
          "geom_size", "geom_pos", "geom_quat", "geom_rbound", "geom_aabb", "geom_dataid", "site_pos", "site_size")  # fmt: skip


def model_of(sim, world):
    model = copy.copy(sim.model)
    for name in FIELDS:
        field = getattr(model, name)
        field[:] = sim.model_field(name)[world]
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_MIDPHASE  # its tree of boxes is that of the scene's model
    return model
