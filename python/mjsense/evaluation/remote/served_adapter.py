# SPDX-License-Identifier: Apache-2.0
"""An adapter on the side of the server: what clients send becomes the streams that the policy observes, and its commands become
their keys."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from mjsense.core.errors import did_you_mean
from mjsense.evaluation.remote.adapter import Adapter, Numbers, Observed


class ServedAdapter:
    """An adapter that is read backwards.

    Args:
        made: The adapter, with which a client could play the task.
        specs: Streams of the task, by name.
        groups: Columns of an action by move group.
        observed: Streams that the policy receives; None: those of the adapter.

    Raises:
        ValueError: A stream does not follow from the messages, or a move group has no key.
    """

    def __init__(
        self, made: Adapter, specs: Mapping[str, Any], groups: Mapping[str, slice], observed: Iterable[str] | None
    ) -> None:
        self._made, self._specs, self._groups = made, specs, groups
        self.prompt = made.prompt
        self.streams = list(made.streams if observed is None else observed)
        """The streams that it makes."""
        keys = {stream: key for key, one in reversed(list(made.observation.items())) for stream in one.streams}
        for stream in self.streams:
            if stream not in keys:
                raise ValueError(
                    f"adapter '{made.name}': it has no '{stream}', which the policy observes"
                    f"{did_you_mean(stream, keys, 'it has')}"
                )
        self._needed = {keys[stream]: made.observation[keys[stream]] for stream in self.streams}
        for key, one in self._needed.items():
            width = sum(self._width(stream) for stream in one.streams)
            some = one.numbers.columns is not None and sorted(one.numbers.columns) != list(range(width))
            if some or one.numbers.threshold is not None:
                raise ValueError(
                    f"adapter '{made.name}': '{key}' does not have all numbers of {' and '.join(one.streams)}, which the policy "
                    "observes"
                )
        for group, at in groups.items():
            if at.stop > at.start and group not in made.actions:
                raise ValueError(f"adapter '{made.name}': it has no key for the commands of the move group '{group}'")

    def rows(self, message: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Rows of the streams.

        Raises:
            ValueError: The message does not have them.
        """
        found: dict[str, np.ndarray] = {}
        for key, one in self._needed.items():
            if key not in message:
                raise ValueError(f"the observation has no '{key}', which the policy needs{did_you_mean(key, message, 'it has')}")
            found |= self._split(key, one, np.asarray(message[key]))
        return {stream: found[stream] for stream in self.streams}

    def answer(self, actions: np.ndarray) -> dict[str, np.ndarray]:
        """The answer to a client, of actions ``[H, n]``."""
        made: dict[str, np.ndarray] = {}
        widths: dict[str, int] = {}
        columns = {
            group: one.numbers.columns or tuple(range(self._groups[group].stop - self._groups[group].start))
            for group, one in self._made.actions.items()
        }
        for group, one in self._made.actions.items():
            widths[one.key] = max(widths.get(one.key, 0), one.width or 1 + max(columns[group]))
        for group, one in self._made.actions.items():
            array = made.setdefault(one.key, np.zeros((len(actions), widths[one.key])))
            array[:, list(columns[group])] = _undone(one.numbers).of(actions[:, self._groups[group]], group)
        return made

    def _split(self, key: str, one: Observed, value: np.ndarray) -> dict[str, np.ndarray]:
        if value.dtype.kind not in "biuf":
            raise ValueError(f"'{key}' is not an array of numbers")
        if one.layout == "chw" and value.ndim == 3:
            value = np.moveaxis(value, 0, -1)
        shapes = [tuple(self._specs[stream].shape) for stream in one.streams]
        expected = shapes[0] if len(shapes) == 1 else (sum(map(self._width, one.streams)),)
        if value.shape != expected:
            raise ValueError(f"'{key}' is {value.dtype} {value.shape}: must be {expected}")
        if one.numbers != Numbers():
            flat = _undone(one.numbers).of(value.reshape(-1), key)
            value = np.empty_like(flat)
            value[list(one.numbers.columns or range(len(flat)))] = flat
        if len(shapes) == 1:
            return {one.streams[0]: value.reshape(expected)}
        parts = np.split(value, np.cumsum([self._width(stream) for stream in one.streams])[:-1])
        return {stream: part.reshape(shape) for stream, part, shape in zip(one.streams, parts, shapes, strict=True)}

    def _width(self, stream: str) -> int:
        return int(np.prod(self._specs[stream].shape, dtype=int))


def _undone(numbers: Numbers) -> Numbers:
    """The conversion back, of values that are in the order of the message."""
    return Numbers(source=numbers.target, target=numbers.source)
