# SPDX-License-Identifier: Apache-2.0
"""The part of the experiment's configuration that sensors read."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, Protocol


class TaskOfWorld(Protocol):
    """The part of a task that its configuration reads: the view, and the world whose sensor is being computed."""

    _view: Any

    @property
    def _world(self) -> int: ...


class PeerConfig:
    """Configuration of a task: its type and periods, its objects (``task_config``), its cameras (``camera_config``)."""

    def __init__(self, task: TaskOfWorld) -> None:
        view = task._view
        self.task_type: str = view.type
        self.task_horizon: int = view.horizon
        self.policy_dt_ms: int = view.policy_dt_ms
        self.ctrl_dt_ms = self.sim_dt_ms = view.sim_dt_ms
        self.robot_config = SimpleNamespace(name=view.robot_name)
        self.task_config = PeerTaskConfig(task)
        cameras = view.cameras()
        specs = [SimpleNamespace(name=c["name"], record_depth=c["depth"], skip_erosion=False, is_warped=False) for c in cameras]
        size = (cameras[0]["width"], cameras[0]["height"]) if cameras else (0, 0)
        self.camera_config = SimpleNamespace(cameras=specs, img_resolution=size)


class PeerTaskConfig:
    """The objects of the episode: ``pickup_obj_name``, ``pickup_obj_start_pose``, ``pickup_obj_goal_pose``.

    Other roles have the same three attributes.
    """

    use_sensors = True
    action_dtype = "float32"

    def __init__(self, task: TaskOfWorld) -> None:
        self._task = task
        self.task_type: str = task._view.type
        self.added_objects: dict[str, str] = {}

    @property
    def referral_expressions(self) -> dict[str, list[tuple[str, float]]]:
        """Expressions that refer to the objects, with weights."""
        return self._task._view.referrals(self._task._world)

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("_"):
            view, world = self._task._view, self._task._world
            roles = dict(view.objects(world))
            for role, body in roles.items():
                if name == f"{role}_name":
                    return body
                if name == f"{role}_start_pose":
                    return view.start_pose(world, role).tolist()
                if name == f"{role}_goal_pose":
                    goal = view.goal_pose(world, role)
                    return None if goal is None else goal.tolist()
        raise AttributeError(f"the task's configuration has no '{name}'")
