# SPDX-License-Identifier: Apache-2.0
"""The file of an adapter. Each reader takes its keys out of a table, so that the rest is unknown."""

from __future__ import annotations

import re
from typing import Any, get_args

import numpy as np

from mjsense.core.errors import did_you_mean
from mjsense.evaluation.remote.adapter import ACTIONS, PROMPT, Adapter, Commanded, Numbers, Observed
from mjsense.evaluation.remote.messages import Arrays

_MAX_SIDE = 8192  # pixels


def adapter_of_table(table: dict[str, Any], name: str) -> Adapter:
    """The adapter that the table of a TOML file describes."""
    reader = _Reader(f"adapter '{name}'", dict(table))
    prompt, arrays = reader.take("prompt", str, PROMPT), reader.take("arrays", str, "openpi")
    if arrays not in get_args(Arrays):
        raise ValueError(f"adapter '{name}': arrays is '{arrays}': must be one of {', '.join(get_args(Arrays))}")
    observation = {key: one.observed() for key, one in reader.tables("observation")}
    actions = {group: one.commanded() for group, one in reader.tables("actions")}
    reader.end()
    if not actions:
        raise ValueError(f"adapter '{name}': the table 'actions' is missing or empty")
    if prompt in observation:
        raise ValueError(f"adapter '{name}': the key '{prompt}' is that of the instruction and of an observation")
    return Adapter(name, observation, actions, prompt, arrays)


class _Reader:
    def __init__(self, place: str, table: dict[str, Any]) -> None:
        self.place, self._table, self._known = place, table, list[str]()

    def take(self, key: str, kind: type, default: Any = None) -> Any:
        self._known.append(key)
        value = self._table.pop(key, default)
        if value is not default and (not isinstance(value, kind) or isinstance(value, bool)):
            words = {str: "a text", int: "a whole number", list: "a list", dict: "a table"}
            raise ValueError(f"{self.place}: {key} is {value!r:.80}: must be {words[kind]}")
        return value

    def end(self) -> None:
        for key in self._table:
            raise ValueError(f"{self.place}: unknown key '{key}'{did_you_mean(key, self._known, 'the keys are')}")

    def tables(self, key: str) -> list[tuple[str, _Reader]]:
        made = []
        for name, table in self.take(key, dict, {}).items():
            if not isinstance(table, dict):
                raise ValueError(f"{self.place}: {key}.{name} is {table!r:.80}: must be a table")
            made.append((name, _Reader(f"{self.place}: {key}.{name}", dict(table))))
        return made

    def observed(self) -> Observed:
        self._known.append("streams")
        streams = self._table.pop("streams", [])
        streams = [streams] if isinstance(streams, str) else streams
        if not isinstance(streams, list) or not streams or not all(isinstance(stream, str) for stream in streams):
            raise ValueError(f"{self.place}: streams must be the name of a stream or a list of names")
        size, layout, dtype = self._size(), self.take("layout", str, "hwc"), self.take("dtype", str, "")
        if layout not in ("hwc", "chw"):
            raise ValueError(f"{self.place}: layout is '{layout}': must be hwc or chw")
        if dtype not in ("", "float32", "float64"):
            raise ValueError(f"{self.place}: dtype is '{dtype}': must be float32 or float64")
        return Observed(tuple(streams), self._numbers(), size, layout, dtype)

    def commanded(self) -> Commanded:
        key, targets = self.take("key", str, ACTIONS), self._table.pop("targets", False)
        self._known.append("targets")
        if not isinstance(targets, bool):
            raise ValueError(f"{self.place}: targets is {targets!r:.80}: must be true or false")
        width = self.take("width", int)
        if width is not None and width < 1:
            raise ValueError(f"{self.place}: width is {width}: must be at least 1")
        return Commanded(key, width, self._numbers(), targets)

    def _size(self) -> tuple[int, int] | None:
        text = self.take("size", str)
        if text is None:
            return None
        match = re.fullmatch(r"([1-9][0-9]{0,4})x([1-9][0-9]{0,4})", text, re.ASCII)
        if match is None or max(int(match[1]), int(match[2])) > _MAX_SIDE:
            raise ValueError(f"{self.place}: size is '{text}': must be width and height of at most {_MAX_SIDE}, such as 224x224")
        return int(match[1]), int(match[2])

    def _numbers(self) -> Numbers:
        columns = self.take("columns", list)
        if columns is not None and (not columns or not all(type(column) is int and column >= 0 for column in columns)):
            raise ValueError(f"{self.place}: columns is {columns!r:.80}: must be a list of numbers from 0 on")
        threshold = self._table.pop("threshold", None)
        self._known.append("threshold")
        if threshold is not None and not _is_number(threshold):
            raise ValueError(f"{self.place}: threshold is {threshold!r:.80}: must be a number")
        source, target = self._range("from"), self._range("to")
        if (source is None) != (target is None):
            raise ValueError(f"{self.place}: from and to belong together: one of them is missing")
        if source is not None and source[0] == source[1]:
            raise ValueError(f"{self.place}: from is {list(source)}: must be two different numbers")
        self.end()
        return Numbers(None if columns is None else tuple(columns), threshold, source, target)

    def _range(self, key: str) -> tuple[float, float] | None:
        value = self.take(key, list)
        if value is None:
            return None
        if len(value) != 2 or not all(map(_is_number, value)):
            raise ValueError(f"{self.place}: {key} is {value!r:.80}: must be two numbers")
        return float(value[0]), float(value[1])


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and bool(np.isfinite(value))
