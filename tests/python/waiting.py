# SPDX-License-Identifier: Apache-2.0
"""A policy whose episodes have idle steps."""

import numpy as np

import mjsense as mjs

MOVES, WAITS = 5, 12  # steps


class Waiting(mjs.Policy):
    """Raises one joint, waits, and raises it again."""

    observation = ("qpos",)

    def initialize(self):
        self.step = 0

    def act(self, obs):
        raised = min(self.step, MOVES) + max(0, self.step - MOVES - WAITS)
        self.step += 1
        arm = np.tile([0, -0.7853, 0, -2.35619, 0, 1.57079, 0], (self.num_worlds, 1))
        arm[:, 3] += 0.05 * raised
        return {"arm": arm, "gripper": np.zeros((self.num_worlds, 1))}
