# SPDX-License-Identifier: Apache-2.0
"""Curves of streams in the viewer's panel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from mjsense.viewer.text import label, labels

MAX_CURVES = 32
"""Maximum number of components of a stream that is shown as curves."""
COLOURS = ("#1f77b4", "#ff7f0e", "#2ca02c", "#d62728", "#9467bd", "#8c564b", "#e377c2", "#7f7f7f", "#bcbd22", "#17becf")
"""Colours of the components of a stream, in turn."""
_KEPT = 600  # samples of a live stream
_NONE = "(choose a stream)"
_CHARTS = 3  # at most at the same time


class StreamInfo(NamedTuple):
    """A stream that can be drawn as curves."""

    unit: str
    width: int
    """Number of components."""


class Curves:
    """Charts of streams that the user chooses by name.

    Args:
        rows: Returns the time [n] in s and the values [n, width] of a stream. None: values are added by :meth:`append`.
        now: Returns the row that the scene shows, which gets a dot; used with ``rows``.
    """

    def __init__(
        self,
        gui: Any,
        streams: dict[str, StreamInfo],
        later: Callable[[Any, Callable[[], None]], None],
        rows: Callable[[str], tuple[np.ndarray, np.ndarray]] | None = None,
        now: Callable[[], int] | None = None,
    ) -> None:
        self._gui, self._streams, self._rows, self._now = gui, streams, rows, now
        self._charts: list[tuple[str, Any] | None] = [None] * _CHARTS
        self._history: dict[str, list[tuple[float, np.ndarray]]] = {}
        self._names = labels(streams)
        self._choices = []
        self._folders = []
        for slot in range(_CHARTS):
            choice = gui.add_dropdown(f"Stream {slot + 1}", [_NONE, *self._names], initial_value=_NONE)
            self._folders.append(gui.add_folder(f"Curves {slot + 1}", visible=False))
            later(choice, lambda slot=slot: self._choose(slot))
            self._choices.append(choice)

    def choose(self, name: str) -> None:
        """Shows a stream in the first chart."""
        self._choices[0].value = next(shown for shown, one in self._names.items() if one == name)
        self._choose(0)

    @property
    def chosen(self) -> list[str]:
        """Names of the streams that are shown."""
        return [chart[0] for chart in self._charts if chart]

    def append(self, time: float, read: Callable[[str], np.ndarray]) -> None:
        """Adds the current values of the chosen streams. Going back in time starts the curves again."""
        for name in dict.fromkeys(self.chosen):
            kept = self._history.setdefault(name, [])
            if kept and kept[-1][0] == time:
                continue
            if kept and time < kept[-1][0]:
                kept.clear()
            kept.append((time, np.array(read(name), np.float64)))
            del kept[:-_KEPT]

    def clear(self) -> None:
        """Forgets the values of live streams."""
        self._history.clear()

    def reload(self) -> None:
        """Makes the charts again, for other rows."""
        for slot in range(_CHARTS):
            self._choose(slot)

    def refresh(self) -> None:
        """Sends the values to the browser."""
        for chart in self._charts:
            if chart:
                chart[1].data = self._data(chart[0])

    def _choose(self, slot: int) -> None:
        name = self._names.get(self._choices[slot].value, _NONE)
        if old := self._charts[slot]:
            old[1].remove()
            self._charts[slot] = None
        self._folders[slot].visible = name != _NONE
        self._history = {key: kept for key, kept in self._history.items() if key in self.chosen}
        if name == _NONE:
            return
        info = self._streams[name]
        series: list[dict[str, Any]] = [{"label": "s"}] + [
            {
                "label": f"{i}" if info.width > 1 else label(name.rsplit("/", 1)[-1]),
                "stroke": COLOURS[i % len(COLOURS)],
                "width": 1.5,
            }
            for i in range(info.width)
        ]
        if self._now is not None:
            series.append(
                {"label": "now", "stroke": "#000000", "width": 0, "points": {"show": True, "size": 8, "fill": "#000000"}}
            )
        self._folders[slot].label = label(f"{name} [{info.unit}]" if info.unit else name)
        with self._folders[slot]:
            data = self._data(name)
            scales = {
                "x": {"time": False, "auto": True},
                "y": {"auto": True} if self._rows is None else {"range": _range(data[1:])},
            }
            chart = self._gui.add_uplot(data, tuple(series), scales=scales, height=180)
        self._charts[slot] = name, chart

    def _data(self, name: str) -> tuple[np.ndarray, ...]:
        width = self._streams[name].width
        if self._rows is not None:
            times, values = self._rows(name)
        else:
            kept = self._history.get(name, [])
            times = np.array([t for t, _ in kept])
            values = _filled(np.array([row for _, row in kept]).reshape(-1, width))
        if not len(times):  # a chart of no points cannot find its time axis later
            times, values = np.zeros(1), np.full((1, width), np.nan)
        values = values.reshape(len(times), width)
        if self._now is not None:
            dot, at = np.full((len(times), 1), np.nan), min(self._now(), len(times) - 1)
            dot[at] = values[at, 0]
            values = np.concatenate([values, dot], axis=1)
        return (times, *np.ascontiguousarray(values.T, np.float64))


def _range(columns: Sequence[np.ndarray]) -> tuple[float, float]:
    """Limits of an axis for values some of which may be NaN, which the browser's own limits cannot be."""
    finite = np.concatenate([column[np.isfinite(column)] for column in columns])
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _filled(values: np.ndarray) -> np.ndarray:
    """Live values without NaN, for the same reason: the last number before, or 0."""
    known = np.isfinite(values)
    last = np.maximum.accumulate(np.where(known, np.arange(len(values))[:, None], 0), axis=0)
    return np.nan_to_num(np.take_along_axis(values, last, 0), posinf=0.0, neginf=0.0)
