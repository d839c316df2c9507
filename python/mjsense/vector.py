# SPDX-License-Identifier: Apache-2.0
"""Tasks as gymnasium vector environments."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from mjsense import _core
from mjsense._arguments import Seed, checked
from mjsense.assets import use_installed_meshes
from mjsense.sensor import _box
from mjsense.simulation import Simulation


@checked
class TaskVectorEnv(VectorEnv):
    """``num_envs`` worlds that play episodes of a task; made by :func:`make_vec`.

    An observation is a dict by sensor; a sensor with several streams is a dict of them in turn, nested by their path:
    ``observation["qpos"]["arm"]``, ``observation["env_states"]["actors"]["mug"]``. Observations are copies (gymnasium's rule);
    ``env.rows`` are the sensors' own arrays by stream, ``env.rows["qpos/arm"]``. A world whose episode has ended begins the next one in
    the next step, whose action it ignores (autoreset mode NEXT_STEP).
    """

    metadata = {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(self, options: dict[str, Any], observations: Sequence[str] | None, render_mode: str | None) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be None or 'rgb_array', not {render_mode!r}")
        self._options, self._wanted, self.render_mode = options, observations, render_mode
        self.num_envs = options["num_worlds"]
        self._closed = False
        self._build(options["seed"])
        layout = self._rollout.action_layout()
        self.action_groups: dict[str, slice] = {}
        """Columns of the action by move group."""
        start = 0
        for name, low, _ in layout:
            self.action_groups[name] = slice(start, start + len(low))
            start += len(low)
        low, high = (np.concatenate([row[k] for row in layout]).astype(np.float32) for k in (1, 2))
        self.single_action_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        boxes = {name: _box(spec) for name, spec in self.specs.items()}
        self.single_observation_space = _space(_nest(self._paths, boxes))
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def _build(self, seed: int) -> None:
        self._options["seed"] = seed
        use_installed_meshes()
        self._rollout = _core.Rollout(self._options)
        streams = {spec.name: (sensor, spec, array) for sensor, spec, array in self._rollout.streams()}
        names = _streams(self._wanted, streams)
        self.rows: dict[str, np.ndarray] = {name: streams[name][2] for name in names}
        """The streams' own arrays [B, ...], as they are now."""
        self.specs: dict[str, _core.SensorSpec] = {name: streams[name][1] for name in names}
        """Unit, frame and shape of each stream."""
        self._paths = {name: _path(streams[name][0], name) for name in names}
        self.sim = Simulation._of(self._rollout.simulation())
        """The worlds. Read them as you like; the task writes them."""
        self._next_episode = 0
        self._ended = np.zeros(self.num_envs, bool)
        self._started = False

    def reset(self, *, seed: Seed | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict]:
        """Begins a new episode in every world; with a seed, the first ones of that seed."""
        self._check_open()
        mask = np.ones(self.num_envs, bool)
        if options and "reset_mask" in options:
            mask = np.asarray(options["reset_mask"], bool)
            if mask.shape != (self.num_envs,) or not (self._started or mask.all()):
                raise ValueError(f"reset_mask: shape {mask.shape}, expected ({self.num_envs},), after a first reset of all")
        if seed is not None:
            if seed != self._options["seed"]:
                self._build(int(seed))
                mask[:] = True
            self._next_episode = 0
        self._begin(np.flatnonzero(mask))
        return self._observe(), {}

    def _begin(self, worlds: np.ndarray) -> None:
        episodes = list(range(self._next_episode, self._next_episode + len(worlds)))
        self._next_episode += len(worlds)
        self._rollout.start(worlds.tolist(), episodes)
        self._ended[worlds] = False
        self._started = True

    def step(self, actions: Any) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control step. Actions ``[num_envs, n]``: actuator commands of the move groups, see ``action_groups``."""
        self._check_open()
        if not self._started:
            raise RuntimeError("call reset() before step()")
        actions = np.ascontiguousarray(actions, dtype=np.float64)
        if actions.shape != self.action_space.shape:
            raise ValueError(f"actions: shape {actions.shape}, expected {self.action_space.shape}")
        if not np.isfinite(actions).all():
            raise ValueError(f"actions of worlds {np.flatnonzero(~np.isfinite(actions).all(1)).tolist()} are not finite")
        fresh = self._ended.copy()
        if fresh.any():
            for world in np.flatnonzero(fresh):
                self._rollout.stop(int(world))
        if not fresh.all():
            self._rollout.set_actions(actions)
            self._rollout.step()
        if fresh.any():
            self._begin(np.flatnonzero(fresh))
        reward = np.zeros(self.num_envs)
        terminated, truncated, success = (np.zeros(self.num_envs, bool) for _ in range(3))
        faults = np.full(self.num_envs, "", object)
        for world in np.flatnonzero(~fresh):
            reward[world], success[world], terminated[world], truncated[world], faults[world] = self._rollout.outcome(int(world))
        broken = faults != ""
        truncated |= broken
        self._ended = terminated | truncated
        infos: dict[str, Any] = {"success": success, "_success": ~fresh}
        if broken.any():
            infos |= {"fault": faults, "_fault": broken}
        return self._observe(), reward, terminated, truncated, infos

    def expert_action(self) -> np.ndarray:
        """What the task's own policy would do now, ``[num_envs, n]``. Needs ``make_vec(..., policy="planner")``."""
        self._check_open()
        self._rollout.act()
        return np.array(self._rollout.actions(), dtype=np.float32)

    def _observe(self) -> dict[str, Any]:
        return _nest(self._paths, {name: rows.copy() for name, rows in self.rows.items()})

    def render(self) -> tuple[np.ndarray, ...] | None:
        """The first camera's picture of every world."""
        if self.render_mode is None:
            return None
        pictures = [rows for name, rows in self.rows.items() if rows.ndim == 4 and rows.dtype == np.uint8]
        if not pictures:
            raise RuntimeError("this environment observes no camera")
        return tuple(pictures[0].copy())

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("the environment is closed")

    def close_extras(self, **kwargs: Any) -> None:
        """Frees the worlds."""
        self._closed = True
        self.sim.close()
        self._rollout = None  # type: ignore[assignment]


def _streams(wanted: Sequence[str] | None, streams: dict[str, tuple[str, _core.SensorSpec, np.ndarray]]) -> list[str]:
    """Names of the streams to observe: those wanted, by their own names or their sensors'; else all that are numbers."""
    if wanted is None:
        plain = [name for name, (_, spec, array) in streams.items() if not spec.is_dict and array.size > 0]
        return [name for name in plain if not name.startswith(("sensor_param_", "object_image_points"))]
    names: list[str] = []
    for one in wanted:
        found = [name for name, (sensor, _, array) in streams.items() if name == one or (sensor == one and array.size > 0)]
        if not found:
            raise ValueError(f"no sensor or stream '{one}'; there are {', '.join(streams)}")
        names += [name for name in found if name not in names]
    return names


def _path(sensor: str, stream: str) -> tuple[str, ...]:
    """Where a stream stands in an observation: ("qpos", "arm")."""
    return (sensor, *stream[len(sensor) + 1 :].split("/")) if stream != sensor else (sensor,)


def _nest(paths: dict[str, tuple[str, ...]], values: dict[str, Any]) -> dict[str, Any]:
    nested: dict[str, Any] = {}
    for name, path in paths.items():
        inner = nested
        for key in path[:-1]:
            inner = inner.setdefault(key, {})
        inner[path[-1]] = values[name]
    return nested


def _space(boxes: dict[str, Any]) -> gymnasium.spaces.Dict:
    return gymnasium.spaces.Dict({key: _space(box) if isinstance(box, dict) else box for key, box in boxes.items()})


@checked
def make_vec(
    task: str = "pick",
    robot: str = "franka",
    *,
    policy: str | None = None,
    observations: Sequence[str] | None = None,
    # options of a recording
    num_envs: int = 1,
    threads: int = 0,
    seed: Seed = 0,
    cameras: Sequence[str] | None = None,
    width: int | None = None,
    height: int | None = None,
    depth: bool = False,
    samples: int = 1,
    shadows: bool = True,
    horizon: int | None = None,
    action_noise: bool = False,
    # end of options
    render_mode: str | None = None,
) -> TaskVectorEnv:
    """A task as a gymnasium vector environment.

    Args:
        task, robot: their registered names.
        policy: name of a policy that :meth:`TaskVectorEnv.expert_action` asks; none if not given.
        observations: names of sensors ("qpos") or of single streams ("qpos/arm") to observe; if not given, all that are numbers.

        Options:
        num_envs: How many run at one time.
        threads: Of the simulation; 0: every CPU this process may use.
        seed: Same seed, same episodes.
        cameras: Names of the robot's cameras, in this order; by default all, none for an empty list.
        width: Of pictures; by default the robot's. [pixels]
        height: Of pictures; by default the robot's. [pixels]
        depth: Also the depth of every camera, losslessly.
        samples: Rays a pixel of rgb: smooth edges for time.
        shadows: Pictures have shadows.
        horizon: Control steps after which an episode is cut; by default the task's.
        action_noise: Commands reach the arm with noise.
        Others:
        render_mode: None or rgb_array.
    """
    options = dict(locals())
    del options["observations"], options["render_mode"]
    options |= {"policy": policy or "", "num_worlds": options.pop("num_envs")}
    return TaskVectorEnv(options, observations, render_mode)
