# SPDX-License-Identifier: Apache-2.0
"""Plots of streams of recordings and of live worlds, by matplotlib."""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense.core.arguments import Seed, checked
from mjsense.core.errors import UnknownNameError, did_you_mean
from mjsense.core.new_output import expect_folder
from mjsense.core.optional import optional
from mjsense.core.representations import coloured
from mjsense.dataset import Dataset, Episode
from mjsense.dataset.dataset import groups_of
from mjsense.viewer.curves import COLOURS, MAX_CURVES
from mjsense.viewer.open import source_of
from mjsense.viewer.source import LiveSource

if TYPE_CHECKING:
    from matplotlib.figure import Figure  # pyright: ignore[reportMissingImports]  # optional

_FRAMES = 8  # images of a film strip
_ROW, _WIDTH = 1.9, 9.0  # inches
_PLOT_WIDTH = 6.8  # inches of an axis, about
_COMPONENTS = {3: "xyz", 7: ("x", "y", "z", "qw", "qx", "qy", "qz")}
"""Names of the components of points and vectors, and of poses."""


@dataclass
class _Tracks:
    """Streams over time; several episodes follow each other."""

    units: dict[str, str]
    """By stream, in the order of the plot; images have the unit ``None``."""
    images: set[str] = field(default_factory=set)
    times: list[float] = field(default_factory=list)
    rows: dict[str, list[np.ndarray]] = field(default_factory=dict)
    marks: list[tuple[float, str]] = field(default_factory=list)
    """Starts of episodes."""


@checked
def plot(
    thing: Any,
    streams: Sequence[str],
    *,
    episodes: Sequence[int] = (0,),
    world: int = 0,
    seconds: float = 10.0,
    seed: Seed = 0,
    out: str | Path | None = None,
    **options: Any,
) -> Figure:
    """Draws streams over time. Streams of the same unit share an axis; images are film strips.

    Args:
        thing: A recording (its path or a :class:`Dataset`), or live worlds as in :func:`view`, which are stepped.
        streams: Names or patterns of streams; the last part of a name is enough (``tcp_pose``).
        episodes: Positions of a recording's episodes, drawn one after the other.
        world: World of live worlds.
        seconds: How long live worlds are stepped. [s]
        seed: Seed of live worlds that are given by name.
        out: File to write: PNG, PDF or SVG.
        options: Options of :func:`make_vec` for a task or a scene.

    Returns:
        The ``matplotlib.figure.Figure``.

    Raises:
        UnknownNameError: there is no such stream; the message has similar names.
        ModuleNotFoundError: matplotlib is not installed.
    """
    if not streams:
        raise ValueError("plot() needs the name of a stream")
    figures = optional("matplotlib.figure", "plot", "plot()")
    if out is not None:
        _check_picture(Path(out), figures.Figure().canvas.get_supported_filetypes())
    source = source_of(thing, seed=seed, **options)
    tracks = _recorded(source, streams, episodes) if isinstance(source, Dataset) else _live(source, streams, world, seconds)
    figure = _drawn(figures.Figure, tracks)
    if out is not None:
        figure.savefig(out, dpi=110)
    return figure


def _check_picture(path: Path, kinds: Iterable[str]) -> None:
    if path.suffix.lower().removeprefix(".") not in kinds:
        raise ValueError(f"'{path}' does not end in the name of a format: expected one of .{', .'.join(kinds)}")
    expect_folder(path)


def _expand(names: Iterable[str], known: Iterable[str]) -> list[str]:
    """The known streams that names, patterns and last parts of names stand for."""
    known, found = list(known), []
    for name in names:
        chosen = [one for one in known if one == name] or [one for one in known if one.endswith(f"/{name}")]
        chosen = chosen or [one for one in known if fnmatch.fnmatchcase(one, name) or one.startswith(f"{name}/")]
        if not chosen:
            raise UnknownNameError(f"no stream '{name}'{did_you_mean(name, [*known, *groups_of(known)], 'there are')}")
        found += [one for one in chosen if one not in found]
    return found


def _recorded(dataset: Dataset, names: Sequence[str], episodes: Sequence[int]) -> _Tracks:
    streams = dataset.streams
    usable = [
        name
        for name, s in streams.items()
        if s.kind == "video" or (s.dtype.kind in "fiub" and np.prod(s.shape, dtype=int) <= MAX_CURVES)
    ]
    chosen = _expand(names, usable)
    tracks = _Tracks({name: streams[name].unit for name in chosen}, {name for name in chosen if streams[name].kind == "video"})
    period = 1 / float(dataset.fps)
    for position in episodes:
        if not 0 <= position < len(dataset.episodes):
            raise ValueError(f"episode {position}: must be in [0, {len(dataset.episodes)})")
        episode = dataset.episodes[position]
        start = tracks.times[-1] + period if tracks.times else 0.0
        tracks.marks.append((start, f"{episode.index}: {episode.outcome}"))
        tracks.times += [start + t * period for t in range(episode.length)]
        for name in chosen:
            tracks.rows.setdefault(name, []).extend(_rows(episode, name, name in tracks.images))
    return tracks


def _rows(episode: Episode, name: str, image: bool) -> Sequence[Any]:
    if not image:
        return list(np.asarray(episode[name], np.float64).reshape(episode.length, -1))
    return [(episode.video(name), t) for t in range(episode.length)]  # decoded when it is drawn


def _live(source: LiveSource, names: Sequence[str], world: int, seconds: float) -> _Tracks:
    if not 0 <= world < source.num_worlds:
        raise ValueError(f"world {world}: must be in [0, {source.num_worlds})")
    streams, pictures = source.streams(), source.pictures()
    chosen = _expand(names, [*streams, *pictures])
    tracks = _Tracks(
        {name: streams[name].unit if name in streams else "" for name in chosen}, {name for name in chosen if name in pictures}
    )
    count = max(1, round(seconds / source.period))
    kept = set(np.linspace(0, count - 1, _FRAMES).round().astype(int).tolist())
    episodes, last = 0, np.inf
    for step in range(count):
        if source.time(world) < last:
            tracks.marks.append((step * source.period, f"episode {episodes}"))
            episodes += 1
        last = source.time(world)
        tracks.times.append(step * source.period)
        for name in chosen:
            rows = tracks.rows.setdefault(name, [])
            if name in tracks.images:
                rows.append((np.array(source.picture(name, world))[None], 0) if step in kept else None)  # type: ignore[arg-type]
            else:
                rows.append(np.array(source.value(name, world)))
        source.step()
    return tracks


def _drawn(make: Any, tracks: _Tracks) -> Any:
    groups: list[list[str]] = []  # streams of one axis
    for name, unit in tracks.units.items():
        same = next(
            (g for g in groups if name not in tracks.images and g[0] not in tracks.images and tracks.units[g[0]] == unit), None
        )
        if same is None:
            groups.append([name])
        else:
            same.append(name)
    heights = [_film_height(tracks.rows[names[0]]) if names[0] in tracks.images else _ROW for names in groups]
    figure = make(figsize=(_WIDTH, sum(heights) + 0.35 * len(groups) + 0.4), layout="constrained")
    axes = figure.subplots(len(groups), 1, squeeze=False, height_ratios=heights)[:, 0]
    times, end = np.array(tracks.times), tracks.times[-1] if len(tracks.times) > 1 else 1.0
    for axis, names in zip(axes, groups):
        if names[0] in tracks.images:
            _film(axis, names[0], tracks, end)
            continue
        curve = 0
        for name in names:
            values, short = np.array(tracks.rows[name], np.float64), name.rsplit("/", 1)[-1]
            # No line from the end of an episode to the start of the next.
            gaps = np.searchsorted(times, [start for start, _ in tracks.marks[1:]])
            at, values = np.insert(times, gaps, np.nan), np.insert(values, gaps, np.nan, axis=0)
            components = _COMPONENTS.get(values.shape[1], ()) if tracks.units[name].startswith(("m", "N")) else ()
            for k in range(values.shape[1]):
                label = f"{short} {components[k] if components else k}" if values.shape[1] > 1 else short
                axis.plot(at, values[:, k], color=COLOURS[curve % len(COLOURS)], linewidth=1.2, label=label)
                curve += 1
        unit = tracks.units[names[0]]
        axis.set_ylabel(f"[{unit}]" if unit else "", fontsize=9)
        axis.set_title(", ".join(names), fontsize=9, loc="left", pad=14 if axis is axes[0] else None)
        axis.legend(fontsize=7, loc="center left", bbox_to_anchor=(1.0, 0.5), ncols=1 + (curve > 8), frameon=False)
        axis.grid(alpha=0.3)
        axis.set_xlim(0, end)
        for start, text in tracks.marks:
            axis.axvline(start, color="0.4", linewidth=0.8, linestyle="--")
            if axis is axes[0]:
                axis.annotate(
                    text,
                    (start, 1),
                    xycoords=("data", "axes fraction"),
                    xytext=(3, 3),
                    textcoords="offset points",
                    fontsize=7,
                    color="0.3",
                )
    axes[-1].set_xlabel("time [s]", fontsize=9)
    for axis in axes:
        axis.tick_params(labelsize=8)
    return figure


def _film_height(rows: list[Any]) -> float:
    """Height of a film strip in inches at which its images have their proportions."""
    frames, t = next(row for row in rows if row is not None)
    height, width = np.shape(frames[t])[:2]
    return _PLOT_WIDTH / _FRAMES * height / width


def _film(axis: Any, name: str, tracks: _Tracks, end: float) -> None:
    """Images at equal distances in time, above the same time axis."""
    present = [(t, row) for t, row in zip(tracks.times, tracks.rows[name]) if row is not None]
    chosen = np.unique(np.linspace(0, len(present) - 1, min(_FRAMES, len(present))).round().astype(int))
    width = end / len(chosen)
    for k, i in enumerate(chosen):
        frames, t = present[i][1]
        image = np.asarray(frames[t])
        pixels = coloured(image[..., None] if image.ndim == 2 else image)
        if pixels is not None:
            axis.imshow(pixels, extent=(k * width, (k + 0.97) * width, 0, 1), aspect="auto")
        axis.text(
            (k + 0.03) * width,
            0.03,
            f"{present[i][0]:.2f} s",
            fontsize=6,
            color="white",
            bbox={"facecolor": "black", "pad": 1, "linewidth": 0},
        )
    axis.set_xlim(0, end)
    axis.set_ylim(0, 1)
    axis.set_yticks([])
    axis.set_title(name, fontsize=9, loc="left")
