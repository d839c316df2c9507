# SPDX-License-Identifier: Apache-2.0
"""Environments with the observations, attributes and infos that ``lerobot-eval`` expects."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space

import mjsense as mjs
from mjsense.evaluation.lerobot_features import IMAGES, OTHERS, STATE, Features

PIXELS, AGENT_POS = "pixels", "agent_pos"


class LeRobotVectorEnv(VectorEnv):
    """Worlds of a task that run in lock step.

    LeRobot's seed of an episode is the number of the episode, as in ``mjsense evaluate``: with ``lerobot-eval --seed=0`` the
    episodes are 0, 1, and so on. With ``episodes``, the seed ``s`` stands for ``episodes[s % len(episodes)]``: as many successive
    seeds as there are numbers play each of them once. A world whose episode has ended stands still until the next reset.

    Args:
        options: Arguments of :func:`mjsense.make_vec`.
        num_envs: Number of worlds.
        episodes: Numbers of episodes; by default all.
        map: The map of the export, if it had one: a TOML file.
    """

    def __init__(
        self, options: dict[str, Any], num_envs: int = 1, episodes: Sequence[int] | None = None, map: Any = None
    ) -> None:
        view = None if options.get("cameras") != [] else "rgb_array"
        # As in `mjsense evaluate`, an episode ends at its first success.
        given = {"terminate_upon_success": True, "seed": 0, **options}
        self._env = mjs.make_vec(**given, num_envs=num_envs, autoreset_mode="disabled", render_mode=view)
        self._features = Features(self._env.specs, self._env.action_groups, map)
        if self._features.held:
            raise ValueError(
                f"the action of the map has no command of the move group '{self._features.held[0]}'; add its stream to the map"
            )
        self._task, self._episodes = str(options["task"]), episodes
        self._next_seed = 0
        self._playing = np.zeros(num_envs, bool)
        self.num_envs = num_envs
        rate = round(self._env.metadata["render_fps"])  # LeRobot writes videos with it, whose rates are whole numbers
        self.metadata = {**self._env.metadata, "render_fps": rate, "autoreset_mode": AutoresetMode.DISABLED}
        self.render_mode = "rgb_array"
        self.shapes: dict[str, tuple[int, ...]] = {name: self._features.shape(name) for name in self._features.streams}
        """Shape of each feature of LeRobot; images are (height, width, 3)."""
        spaces: dict[str, Any] = {}
        for feature, shape in self.shapes.items():
            if feature.startswith(IMAGES):
                inner = spaces.setdefault(PIXELS, gymnasium.spaces.Dict())
                inner[feature.removeprefix(IMAGES)] = gymnasium.spaces.Box(0, 255, shape, np.uint8)
            else:
                spaces[key_of(feature)] = gymnasium.spaces.Box(-np.inf, np.inf, shape, np.float32)
        self.single_observation_space = gymnasium.spaces.Dict(spaces)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        bounds = self._env.single_action_space
        assert isinstance(bounds, gymnasium.spaces.Box)
        columns = self._features.action
        self.single_action_space = gymnasium.spaces.Box(bounds.low[columns], bounds.high[columns], dtype=np.float32)
        self.action_space = batch_space(self.single_action_space, num_envs)

    @property
    def horizon(self) -> int:
        """Number of steps after which an episode is truncated."""
        return self._env.horizon

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
        if seed is None:
            seed = self._next_seed
        seeds = [seed + i for i in range(self.num_envs)] if np.ndim(seed) == 0 else list(seed)
        self._next_seed = seeds[-1] + 1
        numbers = seeds if self._episodes is None else [self._episodes[one % len(self._episodes)] for one in seeds]
        _, infos = self._env.reset(options={"episodes": numbers})
        self._playing[:] = True
        return self._observe(), infos

    def step(self, actions: Any) -> tuple[dict[str, Any], np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]:
        commands = self._features.commands(np.asarray(actions, np.float64))
        _, reward, terminated, truncated, infos = self._env.step(commands)
        ended = (terminated | truncated) & self._playing
        self._playing &= ~ended
        if ended.any():
            infos = {**infos, "final_info": {"is_success": infos["success"] & ended, "_is_success": ended}, "_final_info": ended}
        return self._observe(), reward, terminated, truncated, infos

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """The attribute of every world, or what the method returns, as in gymnasium's ``SyncVectorEnv``."""
        if name == "task_description":
            return tuple(self._env.instructions)
        if name == "task":
            return (self._task,) * self.num_envs
        if name == "_max_episode_steps":
            return (self.horizon,) * self.num_envs
        if name == "render":
            return self.render()
        raise AttributeError(
            f"the environment has no attribute '{name}'; it has task_description, task, _max_episode_steps, render"
        )

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """See :meth:`call`."""
        return self.call(name)

    def render(self) -> tuple[np.ndarray, ...]:
        """Images of the first camera."""
        pictures = [feature for feature in self._features.streams if feature.startswith(IMAGES)]
        return tuple(self._features.rows(pictures[0], self._env.rows).copy()) if pictures else self._env.render() or ()

    def close_extras(self, **kwargs: Any) -> None:
        self._env.close()

    def _observe(self) -> dict[str, Any]:
        found: dict[str, Any] = {}
        for feature in self._features.streams:
            rows = self._features.rows(feature, self._env.rows)
            if feature.startswith(IMAGES):
                found.setdefault(PIXELS, {})[feature.removeprefix(IMAGES)] = rows.copy()
            else:
                found[key_of(feature)] = rows
        return found


class LeRobotEnv(gymnasium.Env):
    """One world, for versions of LeRobot that make vector environments of single ones. The arguments are those of
    :class:`LeRobotVectorEnv`."""

    def __init__(self, options: dict[str, Any], episodes: Sequence[int] | None = None, map: str | None = None) -> None:
        self._env = LeRobotVectorEnv(options, 1, episodes, map)
        self.metadata = {name: value for name, value in self._env.metadata.items() if name != "autoreset_mode"}
        self.render_mode = self._env.render_mode
        self.observation_space, self.action_space = self._env.single_observation_space, self._env.single_action_space
        self._max_episode_steps = self._env.horizon

    @property
    def task(self) -> str:
        """Name of the task."""
        return self._env.call("task")[0]

    @property
    def task_description(self) -> str:
        """The instruction of the episode."""
        return self._env.call("task_description")[0]

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
        observation, _ = self._env.reset(seed=seed)
        return _first(observation), {"is_success": False}

    def step(self, action: Any) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, infos = self._env.step(np.asarray(action)[None])
        success = "final_info" in infos and bool(infos["final_info"]["is_success"][0])
        return _first(observation), float(reward[0]), bool(terminated[0]), bool(truncated[0]), {"is_success": success}

    def render(self) -> np.ndarray:  # pyright: ignore[reportIncompatibleMethodOverride]  # gymnasium's type has a parameter
        return self._env.render()[0]

    def close(self) -> None:
        self._env.close()


def key_of(feature: str) -> str:
    """The key of an observation from which LeRobot makes a feature."""
    if feature == STATE:
        return AGENT_POS
    if not feature.startswith(OTHERS):
        raise ValueError(f"LeRobot's environments have no feature '{feature}'; its name must begin with {OTHERS}, or have no dot")
    return feature.removeprefix(OTHERS)


def _first(observation: dict[str, Any]) -> dict[str, Any]:
    return {name: _first(value) if isinstance(value, dict) else value[0] for name, value in observation.items()}
