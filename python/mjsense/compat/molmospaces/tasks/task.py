# SPDX-License-Identifier: Apache-2.0
"""Tasks whose sensors the user composes."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

from mjsense.compat.molmospaces.env.abstract_sensors import CoreSensor
from mjsense.compat.molmospaces.env.sensors import RoleName
from mjsense.compat.peer.config import PeerConfig, PeerTaskConfig
from mjsense.sensors.nested_streams import nest, stream_path
from mjsense.sensors.suite import SensorSuite
from mjsense.sim.simulation import Simulation
from mjsense.tasks.making import make_vec
from mjsense.tasks.vector import TaskVectorEnv


class TaskConfig(PeerTaskConfig):
    """The objects of a task while its suite is composed. Names are placeholders for roles, whose bodies depend on the episode."""

    def __getattr__(self, name: str) -> Any:
        if name.endswith("_name") and not name.startswith("_"):
            roles = [role for role, _ in self._task._view.objects(0)]
            if name[: -len("_name")] in roles:
                return RoleName(name[: -len("_name")])
        return super().__getattr__(name)


class BaseMujocoTask:
    """One of mjsense's tasks with the sensors that ``_create_sensor_suite_from_config`` composes.

    ``mjsense.make_vec(MyTask)``, ``mjsense.make(MyTask)`` and ``mjsense.record(MyTask, out=...)`` accept it; the robot and the
    policy add their sensors. Without them it runs one world: ``reset()``, ``step(action)``, ``get_observations()``.
    """

    played: str = "pick"
    """The task that is run, one of :func:`mjsense.task_names`."""
    robot: Any = None
    """The robot: a name, the path of its file, or a :class:`mjsense.Robot`. None: the task's default."""

    def __init__(self, exp_config: Any = None, **options: Any) -> None:
        """
        Args:
            exp_config: a user-defined object. ``task_config.use_sensors = False`` in it disables all sensors.
            options: options of :func:`mjsense.make_vec` for the task's own environment.
        """
        self.exp_config = exp_config
        self._options = options
        self._registered: Any = None
        self._sensor_suite: SensorSuite | None = None
        self._worlds: TaskVectorEnv | None = None

    def _create_sensor_suite_from_config(self, config: Any) -> SensorSuite:
        """The suite: usually ``get_core_sensors(config)`` and the task's own sensors."""
        raise NotImplementedError(f"{type(self).__name__}: write _create_sensor_suite_from_config(config)")

    def register_policy(self, policy: Any) -> None:
        """The policy that drives the robot and adds its sensors: a :class:`BasePolicy`, a :class:`mjsense.Policy`, or a name.

        Call it once, and before the first ``reset()``."""
        if self._registered is not None:
            raise ValueError("Policy already registered")
        if self._worlds is not None:
            raise ValueError("register_policy: the task is played already; register the policy before the first reset()")
        self._registered = policy
        if hasattr(policy, "create_policy_sensors"):
            policy.task = self

    # ------------------------------------------------------------------------------------------------- on its own

    @property
    def worlds(self) -> TaskVectorEnv:
        """The environment that runs the task."""
        if self._worlds is None:
            self._worlds = make_vec(self, autoreset_mode="disabled", **self._options)  # type: ignore[arg-type]
        return self._worlds

    @property
    def env(self) -> Any:
        """The object that sensors receive as ``env``."""
        return self.worlds.sim.env

    @property
    def config(self) -> Any:
        """The experiment as sensors read it: ``task_config``, ``camera_config``."""
        return self.env.task.config

    @property
    def sensor_suite(self) -> SensorSuite | None:
        """The result of ``_create_sensor_suite_from_config``; None without sensors."""
        if self._worlds is None:
            self.worlds
        return self._sensor_suite

    def reset(self, seed: int | None = None) -> tuple[list[dict[str, Any]], dict[str, Any]]:
        """Begins the next episode. Returns the observations and an empty info."""
        _, info = self.worlds.reset(seed=seed)
        return self.get_observations(), info

    def step(self, action: Any) -> tuple[list[dict[str, Any]], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control step.

        Args:
            action: commands by move group, ``done`` if the episode ends with them; or all commands concatenated, ``[n]``.
        """
        done = None
        if isinstance(action, dict):
            done = np.full(self.worlds.num_envs, bool(action.get("done", False)))
            action = self._commands(action)
        rows = np.broadcast_to(np.asarray(action, np.float64), self.worlds.action_space.shape or ())
        _, reward, terminated, truncated, infos = self.worlds.step(rows, done)
        return self.get_observations(), reward, terminated, truncated, infos

    def _commands(self, action: dict[str, Any]) -> np.ndarray:
        groups = {name: columns for name, columns in self.worlds.action_groups.items() if columns.stop > columns.start}
        for name in action:
            if name not in self.worlds.action_groups and name not in ("done", "success"):
                raise ValueError(f"action: no move group named '{name}'; there are {', '.join(groups)}")
        missing = [name for name in groups if name not in action]
        if missing:
            raise ValueError(f"action: commands of {', '.join(missing)} are missing")
        return np.concatenate([np.atleast_1d(np.asarray(action[name], np.float64)) for name in groups])

    def get_observations(self) -> list[dict[str, Any]]:
        """One dict per world, uuid -> value, in the order of the suite. Values of dict sensors are dicts."""
        streams = [(sensor, spec, array) for sensor, spec, array in self.worlds._rollout.streams()]
        paths = {spec.name: stream_path(sensor, spec.name) for sensor, spec, _ in streams}
        out = []
        for world in range(self.worlds.num_envs):
            values = {
                spec.name: json.loads(array[world].tobytes().rstrip(b"\0") or b"{}") if spec.is_dict else array[world].copy()
                for _, spec, array in streams
            }
            out.append(nest(paths, values))
        return out

    def close(self) -> None:
        """Frees the world."""
        if self._worlds is not None:
            self._worlds.close()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(f"{type(self).__name__} has no attribute '{name}'")
        return getattr(self.env.task, name)

    # -------------------------------------------------------------------------------- called by mjsense: its part of a rollout

    def _mjs_name(self) -> str:
        return self.played

    def _mjs_uses_sensors(self) -> bool:
        return getattr(getattr(self.exp_config, "task_config", None), "use_sensors", True)

    def _mjs_compose(self, sim: Simulation) -> list[Any]:
        """The sensors of the suite that C++ does not have."""
        task = sim.env.task
        assert task is not None
        config = PeerConfig(task)
        config.task_config = TaskConfig(task)
        suite = self._create_sensor_suite_from_config(config)
        if not isinstance(suite, SensorSuite):
            raise TypeError(f"{type(self).__name__}._create_sensor_suite_from_config() must return a SensorSuite, not {suite!r}")
        self._sensor_suite = suite
        return [sensor for sensor in suite if not isinstance(sensor, CoreSensor)]

    def _mjs_select(self, suite: Sequence[tuple[str, str]]) -> list[str]:
        """Order of the suite: the task's sensors, the robot's, the policy's, then those passed to the call."""
        assert self._sensor_suite is not None
        known = {name for name, _ in suite}
        composed = [s.uuid for s in self._sensor_suite if s.uuid in known or not (isinstance(s, CoreSensor) and s.optional)]
        rest = [name for layer in ("robot ", "policy ", "the caller") for name, owner in suite if owner.startswith(layer)]
        return [*composed, *(name for name in rest if name not in composed)]
