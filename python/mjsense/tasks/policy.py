# SPDX-License-Identifier: Apache-2.0
"""Policies written in Python: compute the next commands for all worlds at once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.sensors.given_sensor import list_of_sensors
from mjsense.sensors.nested_streams import choose_streams, nest, stream_path
from mjsense.tasks.task import episode_rng, group_slices, snake_case

if TYPE_CHECKING:
    from mjsense.sim.simulation import Simulation


class Policy:
    """Base class of user-defined policies. Implement ``act``. A function ``obs -> actions``, such as a trained network, is a
    policy too.

    Shapes: ``B`` worlds, ``n`` commands of all controlled move groups, ``H`` steps.
    """

    name: str = ""
    """Name in files and messages; by default the class's name in snake case."""
    observation: Sequence[str] | None = None
    """Names of the sensors ("qpos") or streams ("qpos/arm") that ``act`` receives; None: all numeric ones, as in ``make_vec``."""
    phases: Mapping[str, int] = {}
    """Phase name -> number, if the policy has phases. ``self.phase`` ``[B]`` then contains the current phases and
    ``self.num_retries`` ``[B]`` the number of retries; both are recorded."""

    # Set before initialize().
    sim: Simulation
    """The simulation."""
    num_worlds: int
    """Number of worlds, ``B``."""
    action_groups: dict[str, slice]
    """Columns of an action by move group."""
    action_low: np.ndarray
    """Lower bounds of commands, float64 ``[n]``."""
    action_high: np.ndarray
    """Upper bounds of commands, float64 ``[n]``."""
    wanted: np.ndarray
    """Worlds for which ``act`` must return actions, bool ``[B]``: active worlds without remaining actions of their chunk."""
    instructions: list[str]
    """The instruction of each world's episode, such as "Pick up the mug"; known from ``reset`` on."""
    phase: np.ndarray
    num_retries: np.ndarray

    _mjs_own: Sequence[Any] = ()

    # -------------------------------------------------------------------------------------------- to be implemented or overridden

    def initialize(self) -> None:
        """Called once after the worlds are created."""

    def reset(self, ids: np.ndarray) -> None:
        """Called when new episodes start in these worlds. ``self.sim`` already shows them; ``obs`` does not yet."""

    def act(self, obs: dict[str, Any]) -> Any:
        """Returns the next commands.

        Args:
            obs: Rows of the suite ``[B, ...]``, read-only and live, nested as in ``make_vec``: ``obs["qpos"]["arm"]``.

        Returns:
            ``[B, n]``, or ``[B, H, n]`` for the next ``H`` steps, or a dict: move group -> ``[B, k]`` or ``[B, H, k]`` (omitted
            groups hold their position), or ``"action"`` -> ``[B, n]``. The dict may also contain ``"done"`` and ``"success"``,
            ``[B]``: the episode ends after this step, and the policy's own verdict (NaN: none); and ``"hold"``, bool
            ``[B]`` or ``[B, move groups]``: these groups hold their position. In a world whose commands are not finite, the
            episode ends as a failure.
        """
        raise NotImplementedError(f"{type(self).__name__}: write act(obs)")

    def sensors(self) -> Iterable[Any]:
        """Additional sensors for observations and recordings with this policy."""
        return ()

    def info(self, world: int) -> Mapping[str, str]:
        """Additional texts for ``obs_scene``, such as the name of the network."""
        return {}

    def failure(self, world: int) -> str:
        """Short reason why the policy gave up; equal for equal reasons. It becomes part of the episode's ``outcome`` in files."""
        return ""

    # --------------------------------------------------------------------------------------------------------- reading

    def rng(self, world: int) -> np.random.Generator:
        """Random number generator of this world's episode; it depends only on the seed and the episode."""
        rng = self._mjs_rngs[world]
        if rng is None:
            rng = self._mjs_rngs[world] = episode_rng(self._mjs_seed, int(self._mjs_episodes[world]), "policy")
        return rng

    # ------------------------------------------------------------------------------- called by mjsense (the C++ adapter)

    def _mjs_name(self) -> str:
        return self.name or snake_case(type(self).__name__)

    def _mjs_settings(self) -> dict[str, Any]:
        return {"name": self._mjs_name(), "phases": dict(self.phases)}

    def _mjs_make_sensors(self) -> list[Any]:
        self._mjs_own = list_of_sensors(self.sensors())  # keep a reference, because C++ does not keep them alive
        return self._mjs_sensors()

    def _mjs_sensors(self) -> list[Any]:
        return list(self._mjs_own)

    def _mjs_bind(self, sim: Simulation, streams: list[Any], layout: list[Any]) -> tuple[dict[str, Any], np.ndarray]:
        self.sim, self.num_worlds = sim, sim.num_worlds
        self.action_groups = group_slices(layout)
        self.action_low, self.action_high = (np.concatenate([[], *(row[k] for row in layout)]) for k in (1, 2))
        self.wanted = np.zeros(self.num_worlds, bool)
        self.phase, self.num_retries = (np.zeros(self.num_worlds, np.int64) for _ in range(2))
        self._mjs_rngs: list[np.random.Generator | None] = [None] * self.num_worlds
        self._mjs_episodes = np.zeros(self.num_worlds, np.int64)
        self._mjs_seed = 0
        self.instructions = [""] * self.num_worlds
        rows = {spec.name: (sensor, spec, array) for sensor, spec, array in streams}
        names = choose_streams(self.observation, rows)
        obs = nest({name: stream_path(rows[name][0], name) for name in names}, {name: rows[name][2] for name in names})
        self.initialize()
        return obs, self.wanted

    def _mjs_reset(self, ids: list[int], episodes: list[int], seed: int, instructions: list[str]) -> None:
        self._mjs_seed = seed
        for world, episode, instruction in zip(ids, episodes, instructions):
            self._mjs_episodes[world], self._mjs_rngs[world], self.instructions[world] = episode, None, instruction
        self.reset(np.array(ids))


class FunctionPolicy(Policy):
    """A function ``obs -> actions`` as a policy."""

    def __init__(
        self, function: Callable[[dict[str, Any]], Any], name: str = "", observation: Sequence[str] | None = None
    ) -> None:
        self.name = name or snake_case(getattr(function, "__name__", type(function).__name__).strip("<>"))
        self.observation = observation
        self._function = function

    def act(self, obs: dict[str, Any]) -> Any:
        return self._function(obs)


_POLICIES: dict[str, Callable[[], Policy]] = {}


def register_policy(name: str, make: Callable[[], Policy]) -> None:
    """Registers a user-defined policy, so that ``mjs.record(policy=name)`` finds it.

    Args:
        name: A name that is not in use.
        make: The policy class, or a function that returns a policy.
    """
    if name in policy_names():
        raise ValueError(f"a policy named '{name}' is already registered")
    if not name or not callable(make):
        raise TypeError(f"register_policy: {name!r} must be a name and {make!r} a class or a function")
    _POLICIES[name] = make


def policy_names() -> list[str]:
    """Names of all policies, registered ones last."""
    return [*_core.policy_names(), *_POLICIES]


def policy_of(policy: Any) -> tuple[str, Policy | None]:
    """Returns (name for messages and files, the object if the policy is written in Python); "" for None."""
    if policy is None:
        return "", None
    if isinstance(policy, str):
        if policy not in _POLICIES:
            return policy, None
        policy = _POLICIES[policy]()
    if isinstance(policy, type) and (issubclass(policy, Policy) or hasattr(policy, "_mjs_policy")):
        policy = policy()
    if hasattr(policy, "_mjs_policy"):  # of mjsense.compat.molmospaces
        policy = policy._mjs_policy()
    if not isinstance(policy, Policy):
        if not callable(policy):
            names = ", ".join(policy_names())
            raise TypeError(f"policy must be a mjsense.Policy, a function or the name of one ({names}), not {policy!r}")
        policy = FunctionPolicy(policy)
    return policy._mjs_name(), policy
