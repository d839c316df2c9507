# SPDX-License-Identifier: Apache-2.0
"""Tasks as gymnasium vector environments."""

from __future__ import annotations

import copy
from collections.abc import Callable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from mjsense import _core
from mjsense.core import mujoco_names
from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.core.errors import did_you_mean
from mjsense.core.installed_files import use_installed_meshes
from mjsense.scene.scene import Scene
from mjsense.scene.written_values import numbers
from mjsense.sensors.native_sensor import box_of
from mjsense.sensors.nested_streams import choose_streams, nest, stream_path
from mjsense.sim.simulation import Simulation
from mjsense.tasks.task import group_slices

_VIEW = "default_view"
"""Camera sensor that is added to the scene if there is a render_mode."""


@checked
class TaskVectorEnv(VectorEnv):
    """Plays episodes of a task in ``num_envs`` worlds; created by :func:`make_vec`.

    An observation is a dict by sensor. A sensor with several streams is a dict of them, nested by their paths:
    ``observation["qpos"]["arm"]``, ``observation["env_states"]["actors"]["mug"]``. Observations are copies, as gymnasium
    requires; ``env.rows`` contains the sensors' own arrays by stream, ``env.rows["qpos/arm"]``.

    ``terminated`` is true if the task ended the episode, the policy set ``done``, or at a success with
    ``terminate_upon_success``. ``truncated`` is true at the horizon or if the physics diverged. The end of an episode is handled
    according to ``autoreset_mode``:

    - ``next_step``: the next step starts a new episode and ignores its action;
    - ``same_step``: the new episode has started when ``step`` returns; ``infos["final_obs"]`` and ``infos["final_info"]`` are
      those of the end of the old episode;
    - ``disabled``: the world stops until ``reset(options={"reset_mask": mask})``. Until then each step returns the flags of its
      end again, its last observation and the reward 0. A step in which no world can move raises ``gymnasium.error.ResetNeeded``.

    ``infos["success"]`` is bool ``[num_envs]``; ``infos["_success"]`` is the mask of the worlds it applies to, as in gymnasium.
    ``infos["episode_info"]`` says which episode each world plays: ``seed``, ``number`` and ``house``, by which ``record`` plays
    the same episode, ``instruction`` and ``object``. (``infos["episode"]`` belongs to gymnasium's ``RecordEpisodeStatistics``.)

    With ``make_vec(episodes=[3, 7, 12])`` the worlds play exactly these episodes, each once, in this order. A world that finds
    none left
    rests: its flags and its masks are False. When all are played, :attr:`all_played` is true, and ``step`` raises
    ``gymnasium.error.ResetNeeded``; ``reset()`` begins the list again.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 15.15, "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        options: dict[str, Any],
        objects: Any,
        observations: Sequence[str] | None,
        render_mode: str | None,
        autoreset_mode: str | AutoresetMode,
        action_space: str,
        episodes: Sequence[int] | None = None,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be None or 'rgb_array', not {render_mode!r}")
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.render_mode = render_mode
        self.num_envs = options["num_worlds"]
        self._closed = False
        if options["seed"] is None:
            options["seed"] = int(np.random.SeedSequence().generate_state(1, np.uint64)[0])
        self._seed = options["seed"]
        self._has_policy = bool(options["policy"])
        if options["meshes"] == "real":
            use_installed_meshes()
        options["default_view"] = render_mode is not None
        self._rollout: Any = self._make_rollout(options, objects)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode, "render_fps": self._rollout.fps}
        streams = {spec.name: (sensor, spec, array) for sensor, spec, array in self._rollout.streams()}
        names = choose_streams(observations, streams, [sensor.uuid for sensor in objects[2]])
        self.rows: dict[str, np.ndarray] = {name: streams[name][2] for name in names}
        """The sensors' own arrays by stream, ``[B, ...]``, at the current state."""
        self.specs: dict[str, _core.SensorSpec] = {name: streams[name][1] for name in names}
        """Unit, frame and shape of each stream."""
        self._paths = {name: stream_path(streams[name][0], name) for name in names}
        self.sim: Simulation = self._rollout.simulation()
        """The worlds, for reading only; the task writes their state."""
        if render_mode is not None and self.sim.model.cam_bodyid[self.sim.model.camera(_VIEW).id] == 0:
            self._place_view()
        self.horizon: int = self._rollout.horizon
        """Number of control steps after which an episode is truncated."""
        self._next_episode = 0
        self._episodes = None if episodes is None else list(episodes)
        self._idle = np.zeros(self.num_envs, bool)
        kinds = {"seed": np.uint64, "number": np.int64, "house": np.int64, "instruction": object, "object": object}
        self._playing = {name: np.zeros(self.num_envs, kind) for name, kind in kinds.items()}
        self._ended = np.zeros(self.num_envs, bool)
        self._ends = np.zeros(self.num_envs, bool), np.zeros(self.num_envs, bool)  # terminated, truncated
        self._started = False
        layout = self._rollout.action_layout()
        self.action_groups: dict[str, slice] = group_slices(layout)
        """Columns of an action by move group."""
        low, high = (np.concatenate([[], *(row[k] for row in layout)]).astype(np.float32) for k in (1, 2))
        low[low <= -mujoco_names.MAXVAL], high[high >= mujoco_names.MAXVAL] = -np.inf, np.inf  # no limit
        self._command_range = _command_range(self.action_groups, low, high) if action_space == "normalised" else None
        if self._command_range is not None:
            low, high = np.full_like(low, -1), np.full_like(high, 1)
        self.single_action_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        boxes = {name: box_of(spec) for name, spec in self.specs.items()}
        self.single_observation_space = _space(nest(self._paths, boxes))
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.expert_done = np.zeros(self.num_envs, bool)
        """bool ``[num_envs]``: worlds for which the policy reported ``done`` in the last :meth:`expert_action`."""

    _made_by: tuple[Callable[..., TaskVectorEnv], dict[str, Any]] | None = None
    """:func:`make_vec` and its arguments."""

    def __reduce__(self) -> Any:
        """A copy, or what is pickled, is a new environment with the same arguments, in which no episode has begun."""
        return self._reduced(None, self.spec)

    def _reduced(self, wrapper: Callable[..., Any] | None, spec: Any) -> Any:
        """What ``__reduce__`` returns, of this environment or of a wrapper of it. Raises TypeError if an argument belongs to this
        environment."""
        if self._made_by is None:
            raise TypeError("TaskVectorEnv: only environments of make() and make_vec() can be copied or pickled")
        for name, value in self._made_by[1].items():
            try:
                copy.deepcopy(value)
            except Exception as error:
                raise TypeError(
                    f"this environment cannot be copied or pickled, because its argument {name} cannot: {error}; "
                    "make it with the name or the class instead of an object"
                ) from None
        return _made_again, (*self._made_by, wrapper), {"spec": spec}

    def _make_rollout(self, options: dict[str, Any], objects: Any) -> Any:
        return _core.Rollout(options, objects, Simulation._of)

    def _numbers(self, actions: Any) -> Any:
        """Actions as the rollout takes them."""
        return np.ascontiguousarray(numbers("actions", actions))

    def _copy(self, rows: Any) -> Any:
        return rows.copy()

    def _on_host(self, values: Any) -> np.ndarray:
        return values

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict]:
        """Starts a new episode in all worlds or in those of ``options["reset_mask"]``; with a seed, the first episodes of that
        seed. An environment that has never received a seed plays other episodes than all others. With ``episodes``, a reset of
        all worlds begins with the first of them. ``options["episodes"]`` gives the number of the episode of each of these
        worlds."""
        self._check_open()
        for name in options or ():
            if name not in ("reset_mask", "episodes"):
                raise ValueError(f"reset(): options has '{name}', expected 'reset_mask' or 'episodes'")
        mask = np.ones(self.num_envs, bool)
        if options and "reset_mask" in options:
            mask = np.asarray(options["reset_mask"], bool)
            if mask.shape != (self.num_envs,) or not (self._started or mask.all()):
                raise ValueError(f"reset_mask: shape {mask.shape}, expected ({self.num_envs},), after a first reset of all")
        if seed is not None:
            seed = self._one_seed(seed)
            super().reset(seed=seed)
            self._rollout.reseed(seed)
            self._seed = seed
            self._next_episode = 0
            mask[:] = True
        if self._episodes is not None and mask.all():
            self._next_episode = 0
        self._begin(np.flatnonzero(mask), self._given(options, int(mask.sum())))
        return self._observe(), self._episode_infos()

    def _one_seed(self, seed: Any) -> int:
        """Returns the seed from which episodes are numbered; gymnasium's list of seeds, s, s + 1, ..., is reduced to its first
        element."""
        if np.ndim(seed) == 1 and len(seed) == self.num_envs:
            if list(seed) != [seed[0] + i for i in range(self.num_envs)]:
                raise ValueError("seed: a list must be s, s + 1, ...: the worlds' episodes are numbered from one seed")
            seed = seed[0]
        if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or not 0 <= seed < 2**64:
            error = ValueError if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool) else TypeError
            raise error(f"seed must be an int of 64 bits from 0 on, not {seed!r}")
        return int(seed)

    def _given(self, options: dict[str, Any] | None, count: int) -> list[int] | None:
        """The numbers of the episodes in the options of a reset."""
        if not options or "episodes" not in options:
            return None
        numbers = [checked_episodes("reset()", [number])[0] for number in options["episodes"]]
        if self._episodes is not None:
            raise ValueError("reset(): options['episodes'] is given, but the environment was made with episodes of its own")
        if len(numbers) != count:
            raise ValueError(f"reset(): options['episodes'] has {counted(len(numbers), 'number')} for {counted(count, 'world')}")
        return numbers

    def _begin(self, worlds: np.ndarray, given: list[int] | None = None) -> None:
        numbers = range(self._next_episode, self._next_episode + len(worlds))
        episodes = list(numbers) if self._episodes is None else self._episodes[numbers.start : numbers.stop]
        if given is None:
            self._next_episode += len(episodes)
        else:
            episodes = given
        worlds, idle = worlds[: len(episodes)], worlds[len(episodes) :]
        if len(worlds):
            self._rollout.start(worlds.tolist(), episodes)
        for world in idle:
            self._rollout.stop(int(world))
        self._idle[worlds], self._idle[idle] = False, True
        self._ended[worlds], self._ended[idle] = False, True
        for flags in self._ends:
            flags[idle] = False
        self._started = True
        self._playing = {name: values.copy() for name, values in self._playing.items()}  # the old ones belong to the caller
        for world, episode in zip(worlds.tolist(), episodes, strict=True):
            about = (self._seed, episode, 0, self._rollout.instruction(world), self._rollout.object(world))
            for values, value in zip(self._playing.values(), about, strict=True):
                values[world] = value

    def _episode_infos(self) -> dict[str, Any]:
        playing = ~self._idle
        masks = {f"_{name}": playing for name in self._playing}
        return {"episode_info": {**self._playing, **masks}, "_episode_info": playing}

    @property
    def all_played(self) -> bool:
        """Whether every episode of ``make_vec(episodes=...)`` has ended; always False without that argument."""
        return self._episodes is not None and self._next_episode >= len(self._episodes) and bool(self._ended.all())

    def step(self, actions: Any, done: Any = None) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Performs one control step.

        Args:
            actions: ``[num_envs, n]``: commands of the move groups (see ``action_groups``), or with
                ``action_space="normalised"`` their images in -1 to 1.
            done: Optional, bool ``[num_envs]``: the policy has finished and the episode ends after this step.
        """
        values = self._checked(actions, (self.num_envs, *(self.single_action_space.shape or ())))
        flags = None if done is None else np.ascontiguousarray(done, dtype=bool)

        def play() -> None:
            self._rollout.set_actions(values, flags)
            self._rollout.step()

        return self._play(play)

    def step_chunk(
        self, actions: Any, stop_on_success: bool = False
    ) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """Performs several control steps with one observation after the last of them.

        A world stops early at the end of its episode or, with ``stop_on_success``, at its first success. Rewards are summed.

        Args:
            actions: ``[num_envs, steps, n]``; see :meth:`step`.
        """
        shape = self._numbers(actions).shape
        steps = shape[1] if len(shape) == 3 and shape[1] > 0 else "steps"
        values = self._checked(actions, (self.num_envs, steps, *(self.single_action_space.shape or ())))
        return self._play(lambda: self._rollout.step_chunk(values, stop_on_success))

    def _checked(self, actions: Any, shape: tuple[Any, ...]) -> np.ndarray:
        self._check_open()
        if not self._started:
            raise RuntimeError("call reset() before step()")
        actions = self._numbers(actions)
        if actions.shape != shape:
            raise ValueError(f"actions: shape {tuple(actions.shape)}, expected ({', '.join(map(str, shape))})")
        finite = self._on_host(abs(actions) < np.inf).reshape(self.num_envs, -1).all(1)
        if not finite.all():
            raise ValueError(f"actions of worlds {np.flatnonzero(~finite).tolist()} are not finite")
        if self._command_range is None:
            return actions
        low, high = (self._numbers(side) for side in self._command_range)
        return low + (actions.clip(-1, 1) + 1) / 2 * (high - low)

    def _play(self, play: Any) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        if self._idle.all() or (self.all_played and self.autoreset_mode != AutoresetMode.DISABLED):
            raise gymnasium.error.ResetNeeded("step(): all given episodes have been played: reset() begins them again")
        resting = self._ended.copy()
        stays = self.autoreset_mode == AutoresetMode.DISABLED
        if stays and resting.all():
            raise gymnasium.error.ResetNeeded("step(): the episodes of all worlds have ended: call reset() first")
        for world in np.flatnonzero(resting):
            self._rollout.stop(int(world))
        if not resting.all():
            play()
        reward, success, terminated, truncated, faults = self._rollout.outcomes()
        if resting.any():
            for values in (reward, success, terminated, truncated):
                values[resting] = 0
            if stays:
                for values, last in zip((terminated, truncated), self._ends, strict=True):
                    values[resting & last] = 1
        broken = [world for world in faults if not resting[world]]
        for world in broken:
            truncated[world] = 1
        infos: dict[str, Any] = {"success": success, "_success": ~resting, **self._episode_infos()}
        if broken:
            infos["fault"], infos["_fault"] = np.full(self.num_envs, "", object), np.zeros(self.num_envs, bool)
            for world in broken:
                infos["fault"][world], infos["_fault"][world] = faults[world], True
        self._ends = self._on_host(terminated).copy(), self._on_host(truncated).copy()
        self._ended = self._ends[0] | self._ends[1] | self._idle
        if self.autoreset_mode == AutoresetMode.NEXT_STEP and resting.any():
            self._begin(np.flatnonzero(resting & ~self._idle))
            infos |= self._episode_infos()
        elif self.autoreset_mode == AutoresetMode.SAME_STEP and (self._ended & ~self._idle).any():
            over = self._ended & ~self._idle
            last = self._observe()
            final = np.full(self.num_envs, None, object)
            for world in np.flatnonzero(over):
                final[world] = _row(last, int(world))
            infos = {"final_obs": final, "_final_obs": over, "final_info": {**infos, "_success": over}, "_final_info": over}
            self._begin(np.flatnonzero(over))
            infos |= {"success": np.where(over, False, success), "_success": ~over & ~self._idle, **self._episode_infos()}
        return self._observe(), reward, terminated, truncated, infos

    def expert_action(self) -> np.ndarray:
        """Actions of the policy given to ``make_vec(..., policy="planner")`` for the current state, ``[num_envs, n]``; sets
        ``expert_done``."""
        self._check_open()
        if not self._has_policy:
            raise ValueError("expert_action(): the environment has no policy: make it with policy='planner', or another one")
        self._rollout.act()
        actions, done = self._rollout.actions()
        self.expert_done = np.array(done, bool)
        commands = np.array(actions, np.float64)
        if self._command_range is not None:
            low, high = self._command_range
            commands = 2 * (commands - low) / (high - low) - 1
        return commands.astype(np.float32)

    def planned_paths(self, world: int = 0) -> list[tuple[str, np.ndarray]]:
        """The motion that the policy has planned in a world: the phase and the tool's positions, float64 ``[N, 3]`` m in the
        world frame, of each part. Empty if the policy makes no plans."""
        self._check_open()
        if not 0 <= world < self.num_envs:
            raise ValueError(f"world {world}: must be in [0, {self.num_envs})")
        return self._rollout.planned_paths(world)

    def _observe(self) -> dict[str, Any]:
        return nest(self._paths, {name: self._copy(rows) for name, rows in self.rows.items()})

    def render(self) -> tuple[np.ndarray, ...] | None:
        """Images of all worlds: of the first camera of the observation or, without one, of a default view."""
        if self.render_mode is None:
            return None
        self._check_open()
        pictures = [rows for rows in self.rows.values() if rows.ndim == 4 and rows.dtype == np.uint8]
        return tuple((pictures[0] if pictures else self.sim.scene[_VIEW].data.rgb).copy())

    def _place_view(self) -> None:
        """In a scene with its own robot, the default view is that of MuJoCo's free camera."""
        model = self.sim.model
        position, forward = mujoco_names.free_camera(model)
        azimuth = np.radians(model.vis.global_.azimuth)
        right = np.array([np.sin(azimuth), -np.cos(azimuth), 0])
        quat = _core.mat_to_quat(np.stack([right, np.cross(right, forward), -forward], axis=1).ravel().tolist())
        camera = model.camera(_VIEW).id
        for field, value in (("cam_pos", position), ("cam_quat", quat)):
            values = self.sim.model_field(field).copy()
            values[:, camera] = value
            self.sim.randomize(field, values)

    @property
    def instructions(self) -> list[str]:
        """The instruction of each world's episode, such as "Pick up the mug to the left of the plate"."""
        self._check_open()
        return [self._rollout.instruction(world) for world in range(self.num_envs)]

    @property
    def scene(self) -> Scene:
        """The scene: ``env.scene["name"]`` is a sensor or an entity."""
        return self.sim.scene

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("the environment is closed")

    def close_extras(self, **kwargs: Any) -> None:
        """Frees the worlds."""
        self._closed = True
        self.sim.close()
        self._rollout = None


def _autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    if isinstance(mode, AutoresetMode):
        return mode
    words = [known.name.lower() for known in AutoresetMode]
    if mode not in words:
        raise ValueError(f"autoreset_mode must be one of {', '.join(words)}, not {mode!r}{did_you_mean(mode, words)}")
    return AutoresetMode[mode.upper()]


def _row(observation: dict[str, Any], world: int) -> dict[str, Any]:
    """Observation of one world."""
    return {key: _row(value, world) if isinstance(value, dict) else value[world, ...] for key, value in observation.items()}


def _command_range(groups: dict[str, slice], low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """float64 ``[n]`` each. Raises ValueError if a group's commands have no range."""
    for name, columns in groups.items():
        if not np.isfinite([low[columns], high[columns]]).all():
            raise ValueError(
                f"action_space='normalised': the commands of move group '{name}' have no range; use action_space='commands'"
            )
    return low.astype(np.float64), high.astype(np.float64)


def _space(boxes: dict[str, Any]) -> gymnasium.spaces.Dict:
    return gymnasium.spaces.Dict({key: _space(box) if isinstance(box, dict) else box for key, box in boxes.items()})


def checked_episodes(place: str, episodes: Sequence[int]) -> list[int]:
    """Numbers of episodes as a list. Raises ValueError if there are none, one is not a number from 0 on, or one is there
    twice."""
    numbers = list(episodes)
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, (int, np.integer)) or not 0 <= number < 2**31:
            raise ValueError(f"{place}: episodes has {number!r}: must be ints from 0 on")
    if not numbers or len(set(numbers)) < len(numbers):
        raise ValueError(f"{place}: episodes must be a list of different numbers, not {numbers!r}")
    return [int(number) for number in numbers]


def _made_again(make: Callable[..., TaskVectorEnv], arguments: dict[str, Any], wrapper: Callable[..., Any] | None) -> Any:
    made = make(**arguments)
    return made if wrapper is None else wrapper(made)
