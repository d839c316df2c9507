# SPDX-License-Identifier: Apache-2.0
"""Stable-Baselines3: tasks as its ``VecEnv``. Needs ``pip install stable-baselines3``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import gymnasium
import numpy as np

try:
    from stable_baselines3.common.vec_env import VecEnv  # pyright: ignore[reportMissingImports]
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        f"mjsense.tasks.rl.sb3 needs Stable-Baselines3: pip install stable-baselines3 ({error})", name=error.name
    ) from error

from mjsense.core.arrays import on_host
from mjsense.tasks.rl._numbers import Actions, Numbers, checked_env, is_depth, stream_of


class SB3VecEnv(VecEnv):
    """A :class:`mjsense.tasks.TaskVectorEnv` for the algorithms of Stable-Baselines3.

    Observations are one row of float32 ``[n]`` (``MlpPolicy``), or with images a dict of ``"state"``, unless there are only
    images, and the images (``MultiInputPolicy``): uint8 ``[H, W, 3]``, and depth in metres, float32 ``[1, H, W]``, which
    Stable-Baselines3 treats as an image with ``policy_kwargs={"normalize_images": False}`` and flattens otherwise. Actions are in
    [-1, 1].

    Args:
        env: Result of ``make_vec(..., autoreset_mode="same_step")``.
        observations: Names of the sensors or streams to observe; by default all of ``env``.
        action_mean, action_scale: A command is ``action_mean + action_scale * action``; numbers or ``[n]``. By default the centre
            and half the width of the actuators' ranges. Commands are clipped to these ranges.
    """

    def __init__(
        self, env: Any, observations: Sequence[str] | None = None, *, action_mean: Any = None, action_scale: Any = None
    ) -> None:
        self.env = checked_env(env, "SB3VecEnv")
        self.numbers = Numbers(self.env, observations, depth_images=True)
        """Columns of each stream."""
        self._images = self.numbers.images
        self._commands = Actions(env.single_action_space, action_mean, action_scale)
        self._actions: np.ndarray | None = None
        self._returns, self._lengths = np.zeros(env.num_envs), np.zeros(env.num_envs, int)
        space: Any = self.numbers.box()
        if self._images:
            state = {"state": space} if self.numbers.size else {}
            space = gymnasium.spaces.Dict({**state, **{name: _image_space(env.specs[name]) for name in self._images}})
        self.render_mode = env.render_mode
        super().__init__(env.num_envs, space, gymnasium.spaces.Box(-1, 1, env.single_action_space.shape, np.float32))

    def _observation(self, observation: Any, worlds: int) -> Any:
        numbers = on_host(self.numbers.of(observation, worlds))
        if not self._images:
            return numbers
        found = {"state": numbers} if self.numbers.size else {}
        for name in self._images:
            rows = on_host(stream_of(observation, self.env._paths[name]))
            found[name] = rows.reshape(worlds, *self.observation_space[name].shape)  # pyright: ignore[reportIndexIssue]
        return found

    def reset(self) -> Any:
        """Starts a new episode in every world; after ``seed(s)`` the first episodes of that seed."""
        seed = self._seeds[0]
        observation, _ = self.env.reset(seed=seed)
        self._reset_seeds()
        self._returns[:] = self._lengths[:] = 0
        return self._observation(observation, self.num_envs)

    def step_async(self, actions: np.ndarray) -> None:
        """Stores the actions ``[B, n]`` for :meth:`step_wait`."""
        self._actions = self._commands.commands(np.asarray(actions, np.float64))

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Performs the step. Infos of worlds whose episode ended contain ``terminal_observation``, ``TimeLimit.truncated``,
        ``episode`` and ``is_success``."""
        observation, *outcome, infos = self.env.step(self._actions)
        reward, terminated, truncated = map(on_host, outcome)
        done = terminated | truncated
        self._returns += reward
        self._lengths += 1
        out: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for world in np.flatnonzero(done):
            last = self._observation(infos["final_obs"][world], 1)
            final = infos["final_info"]
            out[world] = {
                "terminal_observation": {key: value[0] for key, value in last.items()} if self._images else last[0],
                "TimeLimit.truncated": bool(truncated[world] and not terminated[world]),
                "episode": {"r": float(self._returns[world]), "l": int(self._lengths[world])},
                "is_success": bool(final["success"][world]),
            }
            if "fault" in final and final["fault"][world]:
                out[world]["fault"] = final["fault"][world]
        self._returns[done] = self._lengths[done] = 0
        return self._observation(observation, self.num_envs), reward.astype(np.float32), done, out

    def close(self) -> None:
        """Frees the worlds."""
        self.env.close()

    def get_images(self) -> Sequence[Any]:
        """Images of the first camera in every world."""
        return list(self.env.render() or [None] * self.num_envs)

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the environment, repeated for each world."""
        return [getattr(self.env, attr_name)] * len(self._get_indices(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Sets an attribute of the environment, which all worlds share; raises ValueError for a subset of the worlds."""
        if len(self._get_indices(indices)) != self.num_envs:
            raise ValueError(f"set_attr('{attr_name}'): the worlds are one environment, and have it in common")
        setattr(self.env, attr_name, value)

    def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
        """Calls a method of the environment once and repeats its result for each world."""
        return [getattr(self.env, method_name)(*args, **kwargs)] * len(self._get_indices(indices))

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:
        """True for ``Monitor``, because episodes are counted here in the same manner."""
        return [wrapper_class.__name__ == "Monitor"] * len(self._get_indices(indices))


def _image_space(spec: Any) -> gymnasium.spaces.Box:
    """The space of a colour or depth image."""
    return (
        gymnasium.spaces.Box(0, np.inf, (1, *spec.shape), np.float32)
        if is_depth(spec)
        else gymnasium.spaces.Box(0, 255, spec.shape, np.uint8)
    )
