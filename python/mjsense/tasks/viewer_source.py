# SPDX-License-Identifier: Apache-2.0
"""Tasks as the viewer reads them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from mjsense._core import robot_names
from mjsense.core.errors import UnknownNameError
from mjsense.sensors.configs import SceneFileCfg
from mjsense.tasks.env import TaskEnv
from mjsense.tasks.making import make_vec
from mjsense.tasks.task import task_names
from mjsense.tasks.vector import TaskVectorEnv
from mjsense.viewer.pictures import point_streams
from mjsense.viewer.poses import POSE, PoseStream
from mjsense.viewer.source import Control, LiveSource

_IMAGE = {"width": 320, "height": 240, "depth": True, "segmentation": True}


class TaskSource(LiveSource):
    """A task: worlds that run episodes, with the task's policy or with actions that the user sets."""

    def __init__(self, env: TaskVectorEnv, title: str = "") -> None:
        super().__init__(env.sim, title)
        self._env = env
        self.policy = True if env._has_policy else None
        self._results = {name: np.zeros((env.num_envs, 1)) for name in ("reward", "success")}
        if not env._started:
            env.reset(seed=env._seed)
        self._action = self._held()

    def instruction(self, world: int) -> str:
        return self._env.instructions[world]

    def step(self) -> None:
        env = self._env
        begins = bool(env._ended.any())
        done = None
        if self.policy:
            self._action = env.expert_action().astype(np.float64)
            done = env.expert_done
        _, reward, _, _, info = env.step(self._action, done)
        self._results["reward"][:, 0], self._results["success"][:, 0] = reward, info["success"]
        if begins:
            self._action = self._held()

    def reset(self, seed: int) -> None:
        self._env.reset(seed=seed)
        self._action = self._held()

    def _held(self) -> np.ndarray:
        """Actions that keep the worlds' present joint positions, as far as the observation tells them."""
        env = self._env
        space: Any = env.action_space
        action = np.clip(np.zeros(space.shape), space.low, space.high)
        for group, columns in env.action_groups.items():
            for name in (f"actions/joint_pos/{group}", f"qpos/{group}"):
                rows = env.rows.get(name)
                if rows is not None and rows.shape[1:] == (columns.stop - columns.start,):
                    action[:, columns] = rows
                    break
        return action

    def _sensor_rows(self) -> dict[str, tuple[str, np.ndarray]]:
        own = {
            name: (self._env.specs[name].unit, rows)
            for name, rows in self._env.rows.items()
            if rows.dtype.kind in "fiub" and rows.ndim < 4
        }
        return {**own, **{name: ("", rows) for name, rows in self._results.items()}, **super()._sensor_rows()}

    def _row(self, name: str) -> np.ndarray | None:
        for rows in (self._env.rows, self._results):
            if name in rows:
                return rows[name]
        return super()._row(name)

    def image_points(self, name: str, world: int) -> np.ndarray | None:
        names = point_streams(name.split("/")[0], self._env.rows)
        return np.concatenate([self._env.rows[one][world] for one in names]) if names else None

    def _pose_rows(self) -> dict[str, tuple[str, np.ndarray]]:
        return {
            name: (spec.frame, self._env.rows[name])
            for name, spec in self._env.specs.items()
            if spec.unit == POSE and PoseStream.can_draw(spec.frame)
        }

    def _planned(self, world: int) -> list[np.ndarray]:
        return [points for _, points in self._env.planned_paths(world)]

    def controls(self) -> list[Control]:
        space: Any = self._env.single_action_space
        low, high = (np.nan_to_num(limit.astype(np.float64), posinf=1.0, neginf=-1.0) for limit in (space.low, space.high))
        return [
            Control(f"{group} {i - columns.start}", float(low[i]), float(high[i]))
            for group, columns in self._env.action_groups.items()
            for i in range(columns.start, columns.stop)
        ]

    def control(self, world: int) -> np.ndarray:
        return self._action[world]

    def set_control(self, world: int, index: int, value: float) -> None:
        self._action[world, index] = value

    def joints(self) -> list[Control]:
        return []  # the task writes the state


def task_source(thing: Any, worlds: int, seed: int, options: dict[str, Any]) -> TaskSource:
    """The source of an environment, or of a task or scene: its name, file or object.

    Args:
        options: Options of :func:`mjsense.make_vec`, for tasks and scenes.
    """
    if isinstance(thing, TaskEnv):
        thing = thing.worlds
    if isinstance(thing, TaskVectorEnv):
        return TaskSource(thing)
    options = {"policy": "planner", "render_mode": "rgb_array", "num_envs": worlds, "seed": seed, **_IMAGE, **options}
    if not isinstance(thing, (str, Path, SceneFileCfg)):
        return TaskSource(make_vec(thing, **options), type(thing).__name__)
    if isinstance(thing, str) and thing in task_names():
        return TaskSource(make_vec(thing, **options), thing)
    if thing in robot_names():
        raise ValueError(f"'{thing}' is a robot: name a task, and the robot as an option (--robot {thing}, robot='{thing}')")
    title = thing.name if isinstance(thing, SceneFileCfg) else str(thing)
    try:
        return TaskSource(make_vec(options.pop("task", "pick"), scene=thing, **options), title)
    except UnknownNameError as error:
        raise UnknownNameError(
            f"'{thing}' is neither a file nor the name of a task ({', '.join(task_names())}) or scene: {error}"
        ) from None
