# SPDX-License-Identifier: Apache-2.0
"""Episodes of tasks written in Python on mujoco_warp, for :func:`mjsense.make_vec`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core.arrays import on_host
from mjsense.scene.scene import Scene
from mjsense.scene.written_values import numbers
from mjsense.sensors.configs import SceneCfg
from mjsense.sim.simulation import Simulation
from mjsense.tasks.task import Task, WorldState
from mjsense.tasks.vector import TaskVectorEnv
from mjsense.warp import arrays
from mjsense.warp.arrays import torch
from mjsense.warp.host_rows import stream_of
from mjsense.warp.scene_robot import SceneRobot

_WRITTEN = ("qpos", "qvel", "ctrl", "mocap_pos", "mocap_quat")
"""Components of the state that a task's sample() can write."""


class WarpTaskVectorEnv(TaskVectorEnv):
    """A :class:`mjsense.tasks.TaskVectorEnv` in worlds on mujoco_warp. Observations, rewards and the ends of episodes are torch
    tensors on the device; actions may be. Infos are NumPy arrays, except the observations in ``final_obs``.

    A world whose episode has ended continues to move until its next episode begins.
    """

    def _make_rollout(self, options: dict[str, Any], objects: Any) -> Any:
        rollout = WarpRollout(options, objects)
        self._device: str = rollout.simulation().device
        return rollout

    def _numbers(self, actions: Any) -> Any:
        if not torch().is_tensor(actions):
            actions = numbers("actions", actions)
        return arrays.tensor(actions, torch().float32, self._device)

    def _copy(self, rows: Any) -> Any:
        return rows.clone()

    def _on_host(self, values: Any) -> np.ndarray:
        return on_host(values)

    def step_chunk(self, actions: Any, stop_on_success: bool = False) -> Any:
        """Not available: worlds cannot stop early on this backend."""
        raise NotImplementedError("step_chunk() is not available with backend='warp': call step() for each action")


class WarpRollout:
    """What :class:`mjsense.tasks.TaskVectorEnv` calls: the episodes of a task in all worlds (``rollout::Rollout`` in C++)."""

    def __init__(self, options: dict[str, Any], objects: Any) -> None:
        if torch() is None:
            raise ImportError('make_vec(backend="warp") needs torch: pip install "mjsense[torch]"')
        self._task: Task = objects[0]
        settings = self._task._mjs_settings()
        self._name: str = settings["name"]
        self._seed: int = options["seed"]
        self._ends_at_success: bool = options["terminate_upon_success"]
        self.horizon: int = options["horizon"] or settings["horizon"]
        period = options["policy_dt_ms"] or settings["policy_dt_ms"] or 66
        self.fps = 1000 / period
        self._sim = self._make_simulation(options, period, settings["sim_dt_ms"] or 2)
        model = self._sim.model
        groups = settings["move_groups"]
        self._robot = SceneRobot(model, settings["robot_entity"], groups, f"task '{self._name}'")
        self._call("initialize", self._task._mjs_bind, self._sim, self._robot.layout)
        sensors = [*self._robot.sensors(model), *self._task._mjs_sensors()] if options["use_sensors"] else []
        self._sensors = [self._sim.add(sensor) for sensor in (*sensors, *objects[2])]
        self._key = 0 if model.nkey else None
        first = self._sim._start_state(self._key)
        self._first = {name: first[name] for name in _WRITTEN}
        count = self._sim.num_worlds
        starts = {name: np.repeat(values[None], count, 0) for name, values in self._first.items()}
        self._starts = SimpleNamespace(model=model, **starts)
        self._steps = np.zeros(count, int)
        self._faults: dict[int, str] = {}
        self._done: np.ndarray | None = None
        zeros = {"device": self._sim.device}
        self._reward = torch().zeros(count, **zeros)
        self._success, self._over = (torch().zeros(count, dtype=torch().bool, **zeros) for _ in range(2))

    def _make_simulation(self, options: dict[str, Any], period: int, timestep: int) -> Any:
        if period % timestep:
            raise ValueError(
                f"task '{self._name}': policy_dt_ms = {period} must be a positive multiple of sim_dt_ms = {timestep}"
            )
        cfg = self._call("scene", self._task.scene)
        if not isinstance(cfg, SceneCfg):
            raise TypeError(f"task '{self._name}': scene() must return a mjsense.SceneCfg, not {cfg!r}")
        cfg = replace(cfg, options=replace(cfg.options, timestep=timestep / 1000))
        limits = {name: options[name] for name in ("device", "nconmax", "njmax")}
        return Simulation(Scene(cfg), options["num_worlds"], period // timestep, seed=self._seed, backend="warp", **limits)

    def _call(self, method: str, function: Any, *arguments: Any) -> Any:
        """Calls a method of the task; errors name it."""
        try:
            return function(*arguments)
        except Exception as error:
            error.add_note(f"in task '{self._name}': {method}()")
            raise

    def simulation(self) -> Any:
        return self._sim

    def action_layout(self) -> list[tuple[str, list[float], list[float]]]:
        return self._robot.layout

    def streams(self) -> list[tuple[str, Any, Any]]:
        """(sensor, spec, rows on the device) of each stream."""
        found = []
        for sensor in self._sensors:
            for field, rows in zip(sensor._mjs_fields, sensor._mjs_rows, strict=True):
                name, spec = stream_of(sensor, field.name)
                (known,) = _core.written_rows(name, spec, 1).specs().values()
                found.append((sensor.uuid, known, rows))
        return found

    def reseed(self, seed: int) -> None:
        self._seed = seed
        self._sim.reset(seed=seed)

    def start(self, worlds: Sequence[int], episodes: Sequence[int]) -> None:
        if not worlds:
            return
        ids, task, starts = np.array(worlds), self._task, vars(self._starts)
        for name, values in self._first.items():
            starts[name][ids] = values
        for world, episode in zip(worlds, episodes, strict=True):
            base = self._call("sample", task._mjs_sample, world, episode, self._seed, self._starts)
            if base is not None:
                self._call("sample", self._robot.place, WorldState(self._starts, world, episode), base)
        self._sim._begin_episodes(ids, episodes, self._key, {name: starts[name][ids] for name in _WRITTEN})
        self._steps[ids] = 0
        self._faults = {world: text for world, text in self._faults.items() if world not in set(worlds)}
        self._note_failures()
        self._call("begin", task._mjs_begin, worlds)
        self._sim.refresh(self._sensors)
        self._evaluate(np.isin(np.arange(len(self._steps)), ids))

    def stop(self, world: int) -> None:
        """Worlds continue to move; the environment ignores them."""

    def set_actions(self, actions: Any, done: np.ndarray | None) -> None:
        self._robot.command(self._sim.ctrl, actions)
        self._done = done

    def step(self) -> None:
        self._sim.step()
        self._steps += 1
        self._note_failures()
        self._sim.refresh(self._sensors)
        self._evaluate(np.ones(len(self._steps), bool))

    def _note_failures(self) -> None:
        for world, text in self._sim.failures:
            self._faults.setdefault(world, text)

    def _evaluate(self, worlds: np.ndarray) -> None:
        """Evaluates the worlds of the mask."""
        ids = np.flatnonzero([bool(worlds[w]) and w not in self._faults for w in range(len(worlds))])
        reward, success, over, _ = self._call("evaluate", self._task._mjs_ask, ids)
        reward, success = self._tensor("reward", reward, self._reward), self._tensor("success", success, self._success)
        over = success & self._ends_at_success | (False if over is None else self._tensor("terminated", over, self._over))
        if self._done is not None:
            over = over | torch().as_tensor(self._done, device=over.device)
            self._done = None
        mask = torch().as_tensor(worlds, device=reward.device)
        for kept, new in ((self._reward, reward), (self._success, success), (self._over, over)):
            kept[mask] = new[mask]
        for world in np.flatnonzero(on_host(~torch().isfinite(self._reward))).tolist():
            self._faults.setdefault(world, f"task '{self._name}': the reward is {float(self._reward[world])}")

    def _tensor(self, what: str, value: Any, like: Any) -> Any:
        tensor = arrays.tensor(value, like.dtype, like.device)
        if tensor.shape != like.shape:
            raise ValueError(
                f"task '{self._name}': {what} has shape {tuple(tensor.shape)}, expected {tuple(like.shape)}: one value a world"
            )
        return tensor

    def outcomes(self) -> tuple[Any, np.ndarray, Any, Any, dict[int, str]]:
        """(reward, success, terminated, truncated, faults): tensors, except success, which is part of the infos."""
        reward, success, over = self._reward.clone(), on_host(self._success).copy(), self._over.clone()
        truncated = torch().as_tensor(self._steps >= self.horizon, device=over.device)
        faults = list(self._faults)
        reward[faults], over[faults] = 0.0, False
        success[faults] = False
        return reward, success, over, truncated, dict(self._faults)

    def instruction(self, world: int) -> str:
        return self._call("description", self._task._mjs_description, world)

    def object(self, world: int) -> str:
        bodies = list(self._call("objects", self._task._mjs_roles, world).values())
        return bodies[0].rpartition("/")[2] if bodies else ""

    def act(self) -> None:
        raise ValueError("expert_action(): policies are not available with backend='warp'")
