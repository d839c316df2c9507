# SPDX-License-Identifier: Apache-2.0
"""Policies that know nothing of mjsense: objects with a method ``act``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mjsense.tasks.policy import Policy
from mjsense.tasks.task import snake_case


class BatchedPolicy(Policy):
    """An object with the method ``act(observations)`` as a policy.

    ``observations`` has the rows of the ``k`` worlds that need actions now, nested as in ``make_vec``:
    ``observations["qpos"]["arm"]`` is ``[k, 7]``. Two entries are added: ``"world_ids"``, int ``[k]``, and ``"instructions"``, a
    list of ``k`` texts. ``act`` returns their actions ``[k, n]``, or ``[k, H, n]`` for the next ``H`` steps, as NumPy arrays or
    PyTorch tensors.

    Optional: ``reset(world_ids)`` is called when new episodes start in these worlds; ``observation``, a list of names, chooses
    the sensors or streams that ``act`` receives; ``name``; ``fingerprint()`` returns a text of what the policy depends on, which
    is compared when a recording is resumed.
    """

    def __init__(self, model: Any, name: str = "") -> None:
        if not callable(getattr(model, "act", None)):
            raise TypeError(f"{type(model).__name__} is not a policy: it has no method act(observations)")
        self.model = model
        self.name = name or getattr(model, "name", "") or snake_case(type(model).__name__)
        self.observation = getattr(model, "observation", None)
        if callable(fingerprint := getattr(model, "fingerprint", None)):
            self.fingerprint = fingerprint

    def reset(self, ids: np.ndarray) -> None:
        if callable(reset := getattr(self.model, "reset", None)):
            reset(ids)

    def act(self, obs: dict[str, Any]) -> np.ndarray:
        worlds = np.flatnonzero(self.wanted)
        given = {**_rows(obs, worlds), "world_ids": worlds, "instructions": [self.instructions[world] for world in worlds]}
        actions = as_numbers(self.model.act(given))
        n = len(self.action_low)
        if actions.ndim not in (2, 3) or actions.shape[0] != len(worlds) or actions.shape[-1] != n or 0 in actions.shape:
            groups = ", ".join(f"{name} {at.stop - at.start}" for name, at in self.action_groups.items())
            raise ValueError(
                f"policy '{self.name}': act() returned actions of shape {actions.shape} for the episodes "
                f"{', '.join(map(str, self._mjs_episodes[worlds]))}; expected ({len(worlds)}, {n}) or "
                f"({len(worlds)}, H, {n}) with the "
                f"columns {groups}"
            )
        all_rows = np.zeros((self.num_worlds, *actions.shape[1:]))
        all_rows[worlds] = actions
        return all_rows


def _rows(obs: Mapping[str, Any], worlds: np.ndarray) -> dict[str, Any]:
    return {name: _rows(value, worlds) if isinstance(value, Mapping) else value[worlds] for name, value in obs.items()}


def as_numbers(actions: Any) -> np.ndarray:
    """Actions that a model returned, as float64."""
    if hasattr(actions, "detach"):
        actions = actions.detach().cpu()
        if str(actions.dtype) == "torch.bfloat16":  # NumPy has no such type
            actions = actions.float()
    return np.asarray(actions, np.float64)
