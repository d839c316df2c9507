# SPDX-License-Identifier: Apache-2.0
"""The report of an evaluation as one HTML file, without scripts and with its images inside. Every text of a recording is
escaped."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from mjsense.core.png import png_of
from mjsense.core.representations import coloured, escaped
from mjsense.dataset import Dataset, Episode
from mjsense.evaluation.intervals import wilson
from mjsense.evaluation.rows import Group, Row, group_of
from mjsense.evaluation.summary import failures_of, figures_of, rate_text, tables_of

_FILMED = 12  # failed episodes with images
_FRAMES = 6  # of each
_CAMERAS = 2  # of each
_SIDE = 160  # pixels of the longer side of an image, at most
_LISTED = 1000  # episodes in the table of all
_GROUPS = 100  # rows of a table of groups

_STYLE = """
:root { color-scheme: light dark; --text: #1d2430; --soft: #5d6675; --line: #d8dde5; --bar: #2f7d5b; --band: #2f7d5b33;
  --page: #fff; --bad: #a4312a }
@media (prefers-color-scheme: dark) { :root { --text: #e4e8ee; --soft: #9aa4b2; --line: #39414d; --bar: #5cc296;
  --band: #5cc29633; --page: #14181e; --bad: #f08b83 } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--text); background: var(--page); max-width: 68rem; margin: 2rem auto;
  padding: 0 1rem }
h1 { font-size: 1.5rem; margin: 0 } h2 { font-size: 1.1rem; margin: 2rem 0 .5rem }
.rate { font-size: 2.6rem; font-weight: 600; line-height: 1.2; margin: .8rem 0 0 } .rate + p { margin-top: 0 }
  .soft, th { color: var(--soft); font-weight: 400 }
.warning { border-left: 4px solid var(--bad); padding: .3rem .8rem; margin: 1rem 0 }
table { border-collapse: collapse } td, th { text-align: left; padding: .15rem 1.2rem .15rem 0; vertical-align: top;
  overflow-wrap: anywhere }
td.number, th.number { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums }
  tbody tr { border-top: 1px solid var(--line) }
.scroll { overflow-x: auto; font-size: .85rem } svg { display: block; max-width: 100% } svg text { fill: var(--soft);
  font-size: 12px }
figure { margin: 1rem 0 } figure img { display: block; max-width: 100%; margin-top: 2px } figcaption { margin-bottom: .2rem }
summary { cursor: pointer; margin-top: 2rem } .bad { color: var(--bad) }
"""


def page_of(dataset: Dataset, rows: Sequence[Row], facts: Sequence[tuple[str, str]], warnings: Sequence[str]) -> str:
    """The page."""
    title = "Evaluation of " + (dict(facts).get("policy") or str(dataset.root))
    return "".join(
        (
            '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">',
            # Nothing is fetched or executed, even if a text were not escaped.
            "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'; "
            'img-src data:">',
            '<meta name="viewport" content="width=device-width">',
            f"<title>{escaped(title)}</title><style>{_STYLE}</style></head><body>",
            f"<h1>{escaped(title)}</h1>",
            *(f'<p class="warning">{escaped(warning)}</p>' for warning in warnings),
            _head(group_of(rows)),
            _pairs(figures_of(rows)),
            "<h2>What was evaluated</h2>",
            _pairs(facts),
            _curve(rows, float(dataset.fps)),
            *(_groups(word, groups) for word, groups in tables_of(rows).items()),
            _failures(dataset, rows),
            _episodes(rows),
            "</body></html>\n",
        )
    )


def _head(group: Group) -> str:
    low, high = group.interval
    return (
        f'<p class="rate">{group.rate:.1%}</p><p>{group.successes} of {group.episodes} episodes succeed. '
        f'<span class="soft">95 % interval (Wilson): {low:.1%} to {high:.1%}.</span></p>'
    )


def _pairs(pairs: Sequence[tuple[str, str]]) -> str:
    rows = "".join(f'<tr><td class="soft">{escaped(name)}</td><td>{escaped(text)}</td></tr>' for name, text in pairs)
    return f"<table><tbody>{rows}</tbody></table>"


def _curve(rows: Sequence[Row], fps: float) -> str:
    """Share of the episodes that have succeeded, over time, with Wilson's interval."""
    times = np.sort([row.time_to_success_s for row in rows if math.isfinite(row.time_to_success_s)])
    if not len(times):
        return ""
    width, height, left, bottom, top = 640, 240, 44, 34, 8
    end = max(float(times[-1]), *(row.steps / fps for row in rows), 1e-3)

    def x(time: float) -> float:
        return left + (width - left - 10) * time / end

    def y(share: float) -> float:
        return top + (height - top - bottom) * (1 - share)

    at = np.concatenate([[0], np.repeat(times, 2), [end]])
    count = np.concatenate([[0], np.repeat(np.arange(len(times) + 1), 2)[1:-1], [len(times)]])
    low, high = wilson(count, len(rows))

    def points(shares: np.ndarray) -> list[str]:
        return [f"{x(t):.1f},{y(s):.1f}" for t, s in zip(at, shares)]

    marks = [
        f'<line x1="{left}" x2="{width - 10}" y1="{y(s):.1f}" y2="{y(s):.1f}" stroke="var(--line)"/>'
        f'<text x="{left - 6}" y="{y(s) + 4:.1f}" text-anchor="end">{s:.0%}</text>'
        for s in (0, 0.25, 0.5, 0.75, 1)
    ]
    marks += [f'<text x="{x(t):.1f}" y="{height - bottom + 18}" text-anchor="middle">{t:g}</text>' for t in _ticks(end)]
    return (
        f'<h2>Success over time</h2><svg viewBox="0 0 {width} {height}" width="{width}" role="img" '
        f'aria-label="Share of episodes that have succeeded, over time">{"".join(marks)}'
        f'<polygon points="{" ".join([*points(low), *reversed(points(high))])}" fill="var(--band)"/>'
        f'<polyline points="{" ".join(points(count / len(rows)))}" fill="none" stroke="var(--bar)" stroke-width="2"/>'
        f'<text x="{width - 10}" y="{height - 2}" text-anchor="end">time since the start of the episode, s</text></svg>'
    )


def _ticks(end: float) -> list[float]:
    """About six round numbers from 0 to ``end``."""
    step = 10 ** math.floor(math.log10(end / 5))
    step *= next(factor for factor in (1, 2, 5, 10) if end / (step * factor) <= 7)
    return [round(k * step, 10) for k in range(int(end / step) + 1)]


def _groups(word: str, groups: Sequence[Group]) -> str:
    lines = "".join(
        f'<tr><td>{escaped(group.name)}</td><td class="number">{group.successes} of {group.episodes}</td>'
        f'<td class="number">{group.rate:.0%}</td><td>{_bar(group)}</td></tr>'
        for group in groups[:_GROUPS]
    )
    more = f'<p class="soft">{len(groups) - _GROUPS} more are in results.parquet.</p>' if len(groups) > _GROUPS else ""
    return f"<h2>By {escaped(word)}</h2><table><tbody>{lines}</tbody></table>{more}"


def _bar(group: Group) -> str:
    low, high = group.interval
    return (
        f'<svg viewBox="0 0 204 18" width="204" role="img" aria-label="{escaped(rate_text(group))}">'
        f'<line x1="2" x2="202" y1="9" y2="9" stroke="var(--line)"/>'
        f'<rect x="{2 + 200 * low:.1f}" y="4" width="{200 * (high - low):.1f}" height="10" rx="3" fill="var(--band)"/>'
        f'<circle cx="{2 + 200 * group.rate:.1f}" cy="9" r="4" fill="var(--bar)"/></svg>'
    )


def _failures(dataset: Dataset, rows: Sequence[Row]) -> str:
    reasons = failures_of(rows)
    if not reasons:
        return ""
    lines = "".join(f'<tr><td class="number">{count}</td><td>{escaped(reason)}</td></tr>' for reason, count in reasons)
    episodes = {episode.index: episode for episode in dataset.episodes}
    films = "".join(_film(episodes[row.position], row) for row in _chosen(rows))
    return f"<h2>Failures</h2><table><tbody>{lines}</tbody></table>{films}"


def _chosen(rows: Sequence[Row]) -> list[Row]:
    """Failed episodes whose images are shown: the first of each reason, then the second, and so on."""
    seen: dict[str, int] = {}
    order = []
    for row in rows:
        if not row.success:
            seen[row.failure] = turn = seen.get(row.failure, -1) + 1
            order.append((turn, row.position, row))
    return [row for *_, row in sorted(order, key=lambda entry: entry[:2])[:_FILMED]]


def _film(episode: Episode, row: Row) -> str:
    caption = f'episode {row.episode}: {escaped(row.instruction)} <span class="bad">{escaped(row.failure)}</span>'
    return f"<figure><figcaption>{caption}</figcaption>{''.join(_strips(episode))}</figure>"


def _strips(episode: Episode) -> Iterator[str]:
    """Images of the first cameras from the first to the last observation, one strip for each camera."""
    cameras = [name for name, stream in episode.streams.items() if stream.kind == "video" and stream.dtype == np.uint8]
    rows = np.unique(np.linspace(0, episode.length - 1, _FRAMES).round().astype(int)).tolist()
    for name in cameras[:_CAMERAS]:
        try:
            video = episode.video(name)
            images = [_small(video[t]) for t in rows]
        except (OSError, RuntimeError, ValueError) as error:
            yield f'<p class="soft">{escaped(name)}: {escaped(error, 300)}</p>'
            continue
        source = base64.b64encode(png_of(np.ascontiguousarray(np.concatenate(images, 1)))).decode("ascii")
        steps = ", ".join(map(str, rows))
        yield (
            f'<img alt="{escaped(name)}, steps {steps}" title="{escaped(name)}, steps {steps}" '
            f'src="data:image/png;base64,{source}">'
        )


def _small(image: np.ndarray) -> np.ndarray:
    step = -(-max(image.shape[:2]) // _SIDE)
    pixels = coloured(image[::step, ::step])
    if pixels is None:
        raise ValueError("its images cannot be shown")
    return np.pad(pixels, ((0, 0), (0, 2), (0, 0)), constant_values=255)


_COLUMNS = {
    "episode": "episode",
    "success": "result",
    "object": "object",
    "instruction": "instruction",
    "time_to_success_s": "success after, s",
    "steps": "steps",
    "retries": "retries",
    "jerk": "jerk, m/s³",
    "latency_s": "latency, s",
}


def _episodes(rows: Sequence[Row]) -> str:
    numbers = {"episode", "time_to_success_s", "steps", "retries", "jerk", "latency_s"}
    used = {name: word for name, word in _COLUMNS.items() if any(_cell(row, name) for row in rows)}

    def tag(kind: str, name: str, text: str) -> str:
        return f"<{kind}{' class=number' if name in numbers else ''}>{text}</{kind}>"

    head = "".join(tag("th", name, word) for name, word in used.items())
    lines = "".join("<tr>" + "".join(tag("td", name, _cell(row, name)) for name in used) + "</tr>" for row in rows[:_LISTED])
    more = f'<p class="soft">{len(rows) - _LISTED} more are in results.parquet.</p>' if len(rows) > _LISTED else ""
    return (
        f"<details><summary>All {len(rows)} episodes</summary>"
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>{lines}</tbody></table>{more}</div></details>'
    )


def _cell(row: Row, name: str) -> str:
    value: Any = getattr(row, name)
    if name == "success":
        return "success" if value else f'<span class="bad">{escaped(row.failure)}</span>'
    if isinstance(value, float):
        return f"{value:.4g}" if math.isfinite(value) else ""
    return "" if value == -1 else escaped(value)
