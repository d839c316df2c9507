# SPDX-License-Identifier: Apache-2.0
"""rsl-rl: tasks as its ``VecEnv``. Needs ``pip install rsl-rl-lib``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

try:
    import torch  # pyright: ignore[reportMissingImports]
    from rsl_rl.env import VecEnv  # pyright: ignore[reportMissingImports]
    from tensordict import TensorDict  # pyright: ignore[reportMissingImports]
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(f"mjsense.tasks.rl.rsl needs rsl-rl: pip install rsl-rl-lib ({error})", name=error.name) from error

from mjsense.core.arrays import on_host
from mjsense.tasks.rl._numbers import Actions, Numbers, checked_env


class RslRlVecEnv(VecEnv):
    """A :class:`mjsense.tasks.TaskVectorEnv` for the runners of rsl-rl 5.

    Args:
        env: Result of ``make_vec(..., autoreset_mode="same_step")``.
        groups: Observation groups, each with the names of its sensors or streams (None: all). Their values are float32 ``[B, n]``
            rows of a TensorDict. By default one group ``policy`` with all streams.
        action_mean, action_scale: A command is ``action_mean + action_scale * action``; numbers or ``[n]``. By default the centre
            and half the width of the actuators' ranges. Commands are clipped to these ranges.
        device: Device of the trainer. Worlds of ``make_vec(..., backend="warp")`` on the same device exchange tensors with it
            without a copy to the host.
    """

    def __init__(
        self,
        env: Any,
        groups: Mapping[str, Sequence[str] | None] | None = None,
        *,
        action_mean: Any = None,
        action_scale: Any = None,
        device: str = "cpu",
    ) -> None:
        self.env = checked_env(env, "RslRlVecEnv")
        self.numbers = {name: Numbers(env, chosen) for name, chosen in (groups or {"policy": None}).items()}
        """Columns of each stream, by group."""
        self._commands = Actions(env.single_action_space, action_mean, action_scale)
        self.num_envs: int = env.num_envs
        self.num_actions: int = env.single_action_space.shape[0]
        self.max_episode_length: int = env.horizon
        self.device = device
        self.cfg: dict[str, Any] = {}
        self._on_device = not all(isinstance(rows, np.ndarray) for rows in env.rows.values())
        self.episode_length_buf = torch.zeros(self.num_envs, dtype=torch.long, device=device)
        """Number of steps of the current episodes. Writing it does not affect the episodes, because the task counts them
        separately."""
        observation, _ = env.reset()
        self._last = self._observation(observation)

    def _observation(self, observation: dict[str, Any]) -> Any:
        rows = {name: torch.as_tensor(numbers.of(observation, self.num_envs)) for name, numbers in self.numbers.items()}
        return TensorDict(rows, batch_size=[self.num_envs]).to(self.device)

    def get_observations(self) -> Any:
        """Observations of the last step."""
        return self._last

    def step(self, actions: Any) -> tuple[Any, Any, Any, dict[str, Any]]:
        """Performs one control step; worlds whose episode has ended start the next one. Returns (observations, rewards ``[B]``,
        dones ``[B]``, extras)."""
        actions = actions.detach()
        observation, reward, terminated, truncated, infos = self.env.step(
            self._commands.commands(actions if self._on_device else on_host(actions).astype(np.float64))
        )
        self._last = self._observation(observation)
        terminated, truncated = (torch.as_tensor(ended, device=self.device) for ended in (terminated, truncated))
        done = terminated | truncated
        self.episode_length_buf += 1
        self.episode_length_buf[done] = 0
        extras: dict[str, Any] = {"time_outs": truncated & ~terminated, "log": {}}
        if "final_info" in infos:
            extras["log"]["/success"] = float(infos["final_info"]["success"][infos["_final_info"]].mean())
        return self._last, torch.as_tensor(reward, dtype=torch.float32, device=self.device), done, extras

    def close(self) -> None:
        """Frees the worlds."""
        self.env.close()
