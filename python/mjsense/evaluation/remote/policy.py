# SPDX-License-Identifier: Apache-2.0
"""A policy that runs in another process or on another computer, behind openpi's protocol."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np

from mjsense.core.errors import printable
from mjsense.evaluation.remote.access import key_of
from mjsense.evaluation.remote.adapter import EPISODE, SEED, Adapter
from mjsense.evaluation.remote.adapters import BUILT_IN, adapter_of, check_name, fingerprint_of
from mjsense.evaluation.remote.client import Connections, checked_url
from mjsense.evaluation.remote.messages import pack
from mjsense.tasks.policy import Policy
from mjsense.tasks.task import group_slices


class RemotePolicy(Policy):
    """A policy behind openpi's protocol, such as one of ``mjsense serve``, openpi's ``serve_policy.py`` or MolmoSpaces' server.

    The worlds of a step send their observations at the same time, each on a connection of its own. Each episode has a new
    connection, because servers keep the state of an episode for each connection. A server that answers one connection only until
    it is closed needs ``num_worlds=1``. If a connection is lost, the message is sent again on a new one.

    Args:
        url: ``ws://HOST:PORT`` or ``wss://HOST:PORT``.
        adapter: ``droid``, ``features``, ``streams`` or a TOML file: the names and conventions of the messages. By default
            that of the server, if it is ``mjsense serve``; other servers need one.
        timeout: Time in which the server must answer. [s]
        patience: Time for which a server that cannot be reached is tried again. [s]
        key_file: File with the server's key, which is sent as ``Authorization: Api-Key KEY``.
        certificate: PEM file with the certificate of ``wss://HOST:PORT``, or of who signed it. By default
            those that the system trusts.
    """

    def __init__(
        self,
        url: str,
        *,
        adapter: str = "",
        timeout: float = 120.0,
        patience: float = 120.0,
        key_file: str = "",
        certificate: str = "",
    ) -> None:
        for name, value in (("timeout", timeout), ("patience", patience)):
            if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0 < value < math.inf:
                raise ValueError(f"policy '{url}': {name} is {value!r}: must be a positive number of seconds")
        self.url, self._timeout, self._patience = checked_url(url), float(timeout), float(patience)
        self._access = {"key": key_of(key_file), "certificate": certificate}
        if adapter:
            check_name(adapter)
        self._made: Connections | None = None
        self._server: dict[str, Any] = {}
        try:
            self._server = self._connections.server()
            if not adapter and not self._server:
                raise ValueError(
                    f"policy '{url}': the server is not mjsense serve: name an adapter, droid, features or FILE.toml (--adapter)"
                )
            stated = self._server.get("adapter", "streams")
            if not adapter and stated not in BUILT_IN:
                raise ValueError(f"policy '{url}': the server has an adapter file: name a copy of it (--adapter)")
        except BaseException:
            self._connections.close()
            raise
        self._adapter_name = adapter or str(stated)
        self.name = _text(self._server.get("name")) or "remote"
        horizon, ensemble = self._server.get("execution_horizon"), self._server.get("ensemble")
        self.execution_horizon: int | None = horizon if type(horizon) is int and horizon > 0 else None
        """Number of actions of a chunk that are executed, if the server states it."""
        self.ensemble: float | None = ensemble if isinstance(ensemble, float) and 0 <= ensemble < math.inf else None
        """Weight of the temporal ensemble, if the server states it."""

    # Set when the worlds are known.
    _adapter: Adapter
    _rows: dict[str, np.ndarray]

    @property
    def _connections(self) -> Connections:
        if self._made is None:
            self._made = Connections(self.url, timeout=self._timeout, patience=self._patience, **self._access)
            self._made.fingerprint = self._server.get("fingerprint")
        return self._made

    def __getstate__(self) -> dict[str, Any]:
        """A copy in another process has connections of its own."""
        return {**self.__dict__, "_made": None}

    def fingerprint(self) -> str:
        return f"{_text(self._server.get('fingerprint')) or self.url} {fingerprint_of(self._adapter_name)}"

    def _mjs_bind(self, sim: Any, streams: list[Any], layout: list[Any]) -> tuple[dict[str, Any], np.ndarray]:
        groups = group_slices(layout)
        observed = self._server.get("observation") if self._adapter_name == "streams" else None
        if isinstance(observed, list):
            observed = [_text(name) for name in observed]
        by_name = {spec.name: (sensor, spec, rows) for sensor, spec, rows in streams}
        self._adapter = adapter_of(self._adapter_name, by_name, groups, observed)
        low, high = (np.concatenate([[], *(row[k] for row in layout)]) for k in (1, 2))
        self._adapter.check({name: spec for name, (_, spec, _) in by_name.items()}, groups, low, high)
        self.observation = self._adapter.streams
        self._rows = {spec.name: rows for _, spec, rows in streams}
        return super()._mjs_bind(sim, streams, layout)

    def reset(self, ids: np.ndarray) -> None:
        self._connections.begin(ids.tolist())

    def act(self, obs: dict[str, Any]) -> Any:
        worlds = np.flatnonzero(self.wanted).tolist()
        lost = {world: self._connections.lost.get(world, 0) for world in worlds}
        answers = self._connections.ask({world: self._message(world) for world in worlds})
        for world in worlds:
            if self._connections.lost.get(world, 0) > lost[world]:
                print(
                    f"{self._place(world)}: the connection was lost. A new one continues the episode; a policy that "
                    "keeps a state begins anew.",
                    file=sys.stderr,
                )
        chunks = {world: self._commands(world, answers[world]) for world in worlds}
        lengths = {world: len(next(iter(groups.values()))) for world, groups in chunks.items()}
        steps = lengths[worlds[0]]
        for world in worlds:
            if lengths[world] != steps:
                raise ValueError(
                    f"{self._place(world)}: the server's answer has {lengths[world]} actions, and {steps} in "
                    f"{self._place(worlds[0])}"
                )
        made: dict[str, np.ndarray] = {}
        for group in self._adapter.actions:
            at = self.action_groups[group]
            made[group] = np.zeros((self.num_worlds, steps, at.stop - at.start))
            for world in worlds:
                made[group][world] = chunks[world][group]
        return made

    def _message(self, world: int) -> bytes:
        message = self._adapter.message(self._rows, world, self.instructions[world])
        if self._adapter_name == "streams":
            message |= {SEED: self._mjs_seed, EPISODE: int(self._mjs_episodes[world])}
        return pack(message, self._adapter.arrays)

    def _commands(self, world: int, answer: Any) -> dict[str, np.ndarray]:
        try:
            if isinstance(answer, BaseException):
                raise answer
            return self._adapter.commands(answer, self.action_groups)
        except (ValueError, OSError, RuntimeError) as error:
            kind = type(error) if type(error) in (ValueError, TimeoutError, ConnectionError) else RuntimeError
            raise kind(printable(f"{self._place(world)}: {error}")) from error.__cause__

    def _place(self, world: int) -> str:
        return f"policy '{self.name}', episode {self._mjs_episodes[world]}"


def _text(value: Any) -> str:
    """A text of the server's metadata; empty if it is none."""
    return value[:200] if isinstance(value, str) and value.isprintable() else ""


def policy_of(text: str, **options: Any) -> RemotePolicy:
    """The policy of ``ws://HOST:PORT``."""
    return RemotePolicy(text, **options)
