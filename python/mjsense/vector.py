# SPDX-License-Identifier: Apache-2.0
"""Tasks as gymnasium vector environments."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

import gymnasium
import mujoco
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

from mjsense import _core
from mjsense._arguments import Seed, checked
from mjsense._parts import Policies, Scenes, Tasks, parts_of
from mjsense._streams import choose_streams, nest, stream_path
from mjsense.assets import use_installed_meshes
from mjsense.native_sensor import box_of
from mjsense.simulation import Simulation
from mjsense.task import group_slices


@checked
class TaskVectorEnv(VectorEnv):
    """``num_envs`` worlds that play episodes of a task; made by :func:`make_vec`.

    An observation is a dict by sensor; a sensor with several streams is a dict of them in turn, nested by their path:
    ``observation["qpos"]["arm"]``, ``observation["env_states"]["actors"]["mug"]``. Observations are copies (gymnasium's rule);
    ``env.rows`` are the sensors' own arrays by stream, ``env.rows["qpos/arm"]``.

    ``terminated``: the task says that the episode is over, the policy said ``done``, or success with ``terminate_upon_success``.
    ``truncated``: the horizon, or physics that diverged. When an episode has ended, by ``autoreset_mode``:

    - ``next_step``: the world begins the next one in the next step, whose action it ignores;
    - ``same_step``: it has begun the next one already when ``step`` returns; ``infos["final_obs"]`` and ``infos["final_info"]``
      are of the last moment of the old one;
    - ``disabled``: it stands still until ``reset(options={"reset_mask": mask})``.

    ``infos["success"]`` is bool ``[num_envs]``; ``infos["_success"]`` says for which worlds, as gymnasium's masks do.
    """

    metadata = {"render_modes": ["rgb_array"], "autoreset_mode": AutoresetMode.NEXT_STEP}

    def __init__(
        self,
        options: dict[str, Any],
        objects: Any,
        observations: Sequence[str] | None,
        render_mode: str | None,
        autoreset_mode: str | AutoresetMode,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ValueError(f"render_mode must be None or 'rgb_array', not {render_mode!r}")
        self.autoreset_mode = _autoreset_mode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.render_mode = render_mode
        self.num_envs = options["num_worlds"]
        self._closed = False
        self._seed = options["seed"]
        if options["meshes"] == "real":
            use_installed_meshes()
        self._rollout: Any = _core.Rollout(options, objects, Simulation._of)
        streams = {spec.name: (sensor, spec, array) for sensor, spec, array in self._rollout.streams()}
        names = choose_streams(observations, streams)
        self.rows: dict[str, np.ndarray] = {name: streams[name][2] for name in names}
        """The streams' own arrays [B, ...], as they are now."""
        self.specs: dict[str, _core.SensorSpec] = {name: streams[name][1] for name in names}
        """Unit, frame and shape of each stream."""
        self._paths = {name: stream_path(streams[name][0], name) for name in names}
        self.sim: Simulation = self._rollout.simulation()
        """The worlds. Read them as you like; the task writes them."""
        self.horizon: int = self._rollout.horizon
        """Control steps after which an episode is truncated."""
        self._next_episode = 0
        self._ended = np.zeros(self.num_envs, bool)
        self._started = False
        layout = self._rollout.action_layout()
        self.action_groups: dict[str, slice] = group_slices(layout)
        """Columns of the action by move group."""
        low, high = (np.concatenate([[], *(row[k] for row in layout)]).astype(np.float32) for k in (1, 2))
        low[low <= -mujoco.mjMAXVAL], high[high >= mujoco.mjMAXVAL] = -np.inf, np.inf  # nothing limits them
        self.single_action_space = gymnasium.spaces.Box(low, high, dtype=np.float32)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        boxes = {name: box_of(spec) for name, spec in self.specs.items()}
        self.single_observation_space = _space(nest(self._paths, boxes))
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.expert_done = np.zeros(self.num_envs, bool)
        """Which worlds the policy said to be done in, with the last :meth:`expert_action`."""

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict]:
        """Begins a new episode in every world, or in those of ``options["reset_mask"]``; with a seed, the first ones of that seed."""
        self._check_open()
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
        self._begin(np.flatnonzero(mask))
        return self._observe(), {}

    def _one_seed(self, seed: Any) -> int:
        """Episodes are numbered from one seed; gymnasium's list of seeds, s, s + 1, ..., stands for its first."""
        if np.ndim(seed) == 1 and len(seed) == self.num_envs:
            if list(seed) != [seed[0] + i for i in range(self.num_envs)]:
                raise ValueError("seed: a list must be s, s + 1, ...: the worlds' episodes are numbered from one seed")
            seed = seed[0]
        if isinstance(seed, bool) or not isinstance(seed, (int, np.integer)) or not 0 <= seed < 2**64:
            error = ValueError if isinstance(seed, (int, np.integer)) and not isinstance(seed, bool) else TypeError
            raise error(f"seed must be an int of 64 bits from 0 on, not {seed!r}")
        return int(seed)

    def _begin(self, worlds: np.ndarray) -> None:
        episodes = list(range(self._next_episode, self._next_episode + len(worlds)))
        self._next_episode += len(worlds)
        self._rollout.start(worlds.tolist(), episodes)
        self._ended[worlds] = False
        self._started = True

    def step(self, actions: Any, done: Any = None) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        """One control step.

        Args:
            actions: ``[num_envs, n]``: actuator commands of the move groups, see ``action_groups``.
            done: bool ``[num_envs]``, if you like: the policy has finished, the episode ends after this step.
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
        """Several control steps with one observation, after the last.

        A world stops early where its episode ends, with ``stop_on_success`` also at its first success. Rewards are summed.

        Args:
            actions: ``[num_envs, steps, n]``.
        """
        shape = np.shape(actions)
        steps = shape[1] if len(shape) == 3 and shape[1] > 0 else "steps"
        values = self._checked(actions, (self.num_envs, steps, *(self.single_action_space.shape or ())))
        return self._play(lambda: self._rollout.step_chunk(values, stop_on_success))

    def _checked(self, actions: Any, shape: tuple[Any, ...]) -> np.ndarray:
        self._check_open()
        if not self._started:
            raise RuntimeError("call reset() before step()")
        actions = np.ascontiguousarray(actions, dtype=np.float64)
        if actions.shape != shape:
            raise ValueError(f"actions: shape {actions.shape}, expected ({', '.join(map(str, shape))})")
        finite = np.isfinite(actions).reshape(self.num_envs, -1).all(1)
        if not finite.all():
            raise ValueError(f"actions of worlds {np.flatnonzero(~finite).tolist()} are not finite")
        return actions

    def _play(self, play: Any) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        resting = self._ended.copy()
        for world in np.flatnonzero(resting):
            self._rollout.stop(int(world))
        if not resting.all():
            play()
        reward, success, terminated, truncated, faults = self._rollout.outcomes()
        for values in (reward, success, terminated, truncated):
            values[resting] = 0
        for world in faults:
            truncated[world] = not resting[world]
        infos: dict[str, Any] = {"success": success, "_success": ~resting}
        broken = [world for world in faults if not resting[world]]
        if broken:
            infos["fault"], infos["_fault"] = np.full(self.num_envs, "", object), np.zeros(self.num_envs, bool)
            for world in broken:
                infos["fault"][world], infos["_fault"][world] = faults[world], True
        self._ended = terminated | truncated
        if self.autoreset_mode == AutoresetMode.NEXT_STEP and resting.any():
            self._begin(np.flatnonzero(resting))
        elif self.autoreset_mode == AutoresetMode.DISABLED:
            self._ended |= resting
        elif self.autoreset_mode == AutoresetMode.SAME_STEP and self._ended.any():
            over = self._ended.copy()
            last = self._observe()
            final = np.full(self.num_envs, None, object)
            for world in np.flatnonzero(over):
                final[world] = _row(last, int(world))
            infos = {"final_obs": final, "_final_obs": over, "final_info": {**infos, "_success": over}, "_final_info": over}
            self._begin(np.flatnonzero(over))
            infos |= {"success": np.where(over, False, success), "_success": ~over}
        return self._observe(), reward, terminated, truncated, infos

    def expert_action(self) -> np.ndarray:
        """What the policy of ``make_vec(..., policy="planner")`` would do now, ``[num_envs, n]``; ``expert_done`` is its word."""
        self._check_open()
        self._rollout.act()
        actions, done = self._rollout.actions()
        self.expert_done = np.array(done, bool)
        return np.array(actions, dtype=np.float32)

    def _observe(self) -> dict[str, Any]:
        return nest(self._paths, {name: rows.copy() for name, rows in self.rows.items()})

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


def _autoreset_mode(mode: str | AutoresetMode) -> AutoresetMode:
    if isinstance(mode, AutoresetMode):
        return mode
    words = [known.name.lower() for known in AutoresetMode]
    if mode not in words:
        raise ValueError(f"autoreset_mode must be one of {', '.join(words)}, not {mode!r}")
    return AutoresetMode[mode.upper()]


def _row(observation: dict[str, Any], world: int) -> dict[str, Any]:
    """One world's observation."""
    return {key: _row(value, world) if isinstance(value, dict) else value[world, ...] for key, value in observation.items()}


def _space(boxes: dict[str, Any]) -> gymnasium.spaces.Dict:
    return gymnasium.spaces.Dict({key: _space(box) if isinstance(box, dict) else box for key, box in boxes.items()})


@checked
def make_vec(
    task: Tasks = "pick",
    robot: str | Path | None = None,
    *,
    scene: Scenes = "",
    policy: Policies = None,
    observations: Sequence[str] | None = None,
    sensors: Iterable[Any] = (),
    # options of a recording
    num_envs: int = 1,
    threads: int = 0,
    seed: Seed = 0,
    camera_system: str = "",
    cameras: Sequence[str] | None = None,
    width: int | None = None,
    height: int | None = None,
    depth: bool = False,
    segmentation: bool = False,
    samples: int = 1,
    shadows: bool = True,
    meshes: Literal["auto", "shapes", "real"] = "auto",
    horizon: int | None = None,
    action_noise: bool = False,
    perturb: float = 0.0,
    terminate_upon_success: bool = False,
    # end of options
    use_sensors: bool = True,
    autoreset_mode: str | AutoresetMode = "next_step",
    render_mode: str | None = None,
) -> TaskVectorEnv:
    """A task as a gymnasium vector environment.

    Args:
        task: a :class:`Task`, its class, or a registered name (:func:`task_names`).
        robot: a registered name (:func:`robot_names`) or the path of a ``.toml``; None is the task's own.
        scene: a name, a file, a :class:`SceneFileCfg`, or a function that makes a :class:`SceneCfg`; by default the task's own.
        policy: what :meth:`TaskVectorEnv.expert_action` asks: a :class:`Policy`, a function or a registered name.
        observations: names of sensors ("qpos") or of single streams ("qpos/arm") to observe; if not given, all that are numbers.
        sensors: of your own, as in :func:`record`: observed with the suite. An error of one in a world ends that world's episode:
            ``truncated``, and ``info["fault"]`` says why.

        Options:
        num_envs: Number of worlds that run in parallel.
        threads: Number of simulation threads; 0: one per available CPU.
        seed: Random seed; the same seed gives the same episodes.
        camera_system: Name or file of the camera system; by default the cameras of the robot's model.
        cameras: Names of the cameras to render, in this order; by default all, an empty list renders none.
        width: Width of the images; by default the robot's. [pixels]
        height: Height of the images; by default the robot's. [pixels]
        depth: Add a lossless depth image for every camera.
        segmentation: Add a lossless segmentation image for every camera: (id, mjtObj) of each pixel.
        samples: Rays per pixel of rgb; more samples give smoother edges and take longer.
        shadows: Draw shadows.
        meshes: Geometry used to draw the robot: ``shapes`` (primitives), ``real`` (its meshes), or ``auto``: the meshes
            if the robot's environment variable (``MJSENSE_FRANKA_MESHES``) names their folder. Physics is not affected.
        horizon: Maximum number of control steps of an episode; by default the task's.
        action_noise: Add noise to the commands of the arm.
        perturb: Fraction of episodes that are disturbed on purpose: the object is pushed, or slips from the gripper.
        terminate_upon_success: End an episode at its first success.
        Others:
        use_sensors: Task, robot and policy bring their sensors; without them only those that are given.
        autoreset_mode: next_step, same_step or disabled.
        render_mode: None or rgb_array.
    """
    options = dict(locals())
    for name in ("observations", "sensors", "autoreset_mode", "render_mode"):
        del options[name]
    options["num_worlds"] = options.pop("num_envs")
    objects = parts_of(options, sensors)
    return TaskVectorEnv(options, objects, observations, render_mode, autoreset_mode)
