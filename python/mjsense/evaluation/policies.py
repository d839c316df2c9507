# SPDX-License-Identifier: Apache-2.0
"""Policies by a text: a registered name, or a prefix and what it needs, such as ``replay:DIR`` and ``net.py:Network``."""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import sys
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.errors import did_you_mean
from mjsense.evaluation.protocol import BatchedPolicy
from mjsense.tasks.policy import Policy, policy_names, policy_of

PREFIXES = {
    "replay": "mjsense.evaluation.replayed:policy_of",
    "lerobot": "mjsense.evaluation.lerobot_policy:policy_of",
    "python": "mjsense.evaluation.policies:of_module",
    "ws": "mjsense.evaluation.remote.policy:policy_of",
    "wss": "mjsense.evaluation.remote.policy:policy_of",
}
"""Prefix -> the function ``f(text, **options) -> Policy`` that makes the policy of a text with this prefix."""


def policy_from(policy: Any, **options: Any) -> Policy | str:
    """The policy that is meant: a text (see :data:`PREFIXES`), an object, a class, or a function from observations to actions.

    Args:
        options: Arguments of the policy: of its class, or of the function of the prefix.

    Returns:
        A policy, or the name of one that is written in C++, such as ``planner``.
    """
    if not isinstance(policy, str):
        return _of_object(policy, options)
    prefix, colon, _ = policy.partition(":")
    if colon and prefix in PREFIXES:
        module, _, function = PREFIXES[prefix].partition(":")
        return getattr(importlib.import_module(module), function)(policy, **options)
    file, colon, name = policy.rpartition(":")
    if colon and file.endswith(".py"):
        return _of_object(_member(_module_of_file(file), name, policy), options)
    if policy == "random":
        return _of_object(RandomPolicy, options)
    known = policy_names()
    if policy not in known:
        forms = "replay:DIR, lerobot:DIR, python:MODULE:CLASS, FILE.py:CLASS or ws://HOST:PORT"
        raise ValueError(
            f"policy '{policy}' is neither a name nor {forms}{did_you_mean(policy, ['random', *known], 'names are')}"
        )
    if options:
        raise ValueError(f"policy '{policy}' has no option '{min(options)}'")
    return policy_of(policy)[1] or policy


def of_module(text: str, **options: Any) -> Policy | str:
    """The policy of ``python:MODULE:NAME``."""
    module, colon, name = text.partition(":")[2].rpartition(":")
    if not colon or not module:
        raise ValueError(f"policy '{text}': expected python:MODULE:CLASS")
    if "" not in sys.path:
        sys.path.insert(0, "")  # modules of the working directory, as `python -m` finds them
    try:
        found = importlib.import_module(module)
    except ModuleNotFoundError as error:
        if error.name is not None and not f"{module}.".startswith(f"{error.name}."):
            raise
        raise ValueError(f"policy '{text}': there is no module '{module}'") from None
    return _of_object(_member(found, name, text), options)


def _module_of_file(file: str) -> Any:
    path = Path(file).resolve()
    if not path.is_file():
        raise ValueError(f"policy: there is no file '{file}'")
    if str(path.parent) not in sys.path:
        sys.path.insert(0, str(path.parent))  # modules next to it, as for a program
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ValueError(f"policy: '{file}' is not a Python file")
    module = importlib.util.module_from_spec(spec)
    before = sys.modules.get(path.stem)
    sys.modules[path.stem] = module  # dataclasses and pickles look their module up
    try:
        spec.loader.exec_module(module)
    except BaseException:
        if before is None:
            del sys.modules[path.stem]
        else:
            sys.modules[path.stem] = before
        raise
    return module


def _member(module: Any, name: str, text: str) -> Any:
    found = getattr(module, name, None)
    if found is None:
        known = [one for one, value in vars(module).items() if inspect.isclass(value) and value.__module__ == module.__name__]
        hint = did_you_mean(name, known, "its classes are") if known else "; it defines no class"
        raise ValueError(f"policy '{text}': '{module.__name__}' has no '{name}'{hint}")
    return found


def _of_object(policy: Any, options: dict[str, Any]) -> Policy:
    if inspect.isclass(policy):
        try:
            inspect.signature(policy).bind(**options)
        except TypeError as error:
            raise TypeError(f"policy {policy.__name__}: {error}; its arguments are policy options") from None
        policy = policy(**options)
    elif options:
        raise ValueError(f"policy {policy!r} is not a class, and has no option '{min(options)}'")
    if not isinstance(policy, Policy) and not hasattr(policy, "_mjs_policy") and hasattr(policy, "act"):
        return BatchedPolicy(policy)
    if callable(getattr(policy, "get_action", None)) and not hasattr(policy, "_mjs_policy"):
        from mjsense.compat.molmospaces.policy.base_policy import PolicyOfWorlds

        return PolicyOfWorlds(policy)  # of molmo_spaces
    made = policy_of(policy)[1]
    if made is None:
        raise TypeError(f"policy is {policy!r}: expected a policy")
    return made


class RandomPolicy(Policy):
    """Commands that are uniformly distributed in their ranges. They depend only on the seed and the episode."""

    name = "random"
    observation = ()

    def initialize(self) -> None:
        for name, columns in self.action_groups.items():
            if not _has_range(self.action_low[columns], self.action_high[columns]):
                raise ValueError(f"policy 'random': the commands of move group '{name}' have no range")

    def act(self, obs: dict[str, Any]) -> np.ndarray:
        actions = np.zeros((self.num_worlds, len(self.action_low)))
        for world in np.flatnonzero(self.wanted).tolist():
            actions[world] = self.rng(world).uniform(self.action_low, self.action_high)
        return actions


def _has_range(low: np.ndarray, high: np.ndarray) -> bool:
    return bool((low > -1e9).all() and (high < 1e9).all())  # MuJoCo's "no limit" is 1e10
