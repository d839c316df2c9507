# SPDX-License-Identifier: Apache-2.0
"""A planner that drives the robot."""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.compat.peer.matrices import matrix_of_pose
from mjsense.compat.peer.worlds import PeerWorlds


class PeerPolicy:
    """A planner that drives the robot, in the world whose sensor is being computed."""

    def __init__(self, env: PeerWorlds, view: _core.TaskView) -> None:
        self._env = env
        self._view: Any = view

    def get_all_phases(self) -> dict[str, int]:
        """Numbers of the phases."""
        return self._view.phases

    def get_phase(self) -> str:
        """Name of the current phase."""
        number = self._view.plan(self._env.current_batch_index)[0]
        return next((name for name, n in self._view.phases.items() if n == number), "unknown")

    @property
    def retry_count(self) -> int:
        return self._view.plan(self._env.current_batch_index)[1]

    @property
    def target_poses(self) -> dict[str, np.ndarray]:
        """Planned grasp pose, 4x4 in the world, under the key "grasp"."""
        pose = self._view.plan(self._env.current_batch_index)[2]
        return {"grasp": matrix_of_pose(pose) if np.any(pose[3:]) else np.eye(4)}


# Classes of MolmoSpaces that its sensors pass to isinstance() with a policy.
_PLANNERS = (
    ("molmo_spaces.policy.base_policy", "PlannerPolicy"),
    (
        "molmo_spaces.policy.solvers.object_manipulation.base_object_manipulation_planner_policy",
        "BaseObjectManipulationPlannerPolicy",
    ),
)


def register() -> None:
    """Registers the class as a virtual subclass of those of these classes that have been imported."""
    for module, name in _PLANNERS:
        if module in sys.modules and not issubclass(PeerPolicy, getattr(sys.modules[module], name)):
            getattr(sys.modules[module], name).register(PeerPolicy)
