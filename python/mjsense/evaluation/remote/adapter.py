# SPDX-License-Identifier: Apache-2.0
"""How a policy in another process names, sizes and scales observations and actions: which stream becomes which key of its
messages."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mjsense.core.counted import counted
from mjsense.core.errors import did_you_mean
from mjsense.core.optional import optional
from mjsense.evaluation.remote.messages import Arrays
from mjsense.sensors.row_declarations import is_image

PROMPT, ACTIONS = "prompt", "actions"
"""Keys of the instruction and of the actions, unless an adapter chooses others."""
MAX_ACTIONS = 1 << 20
"""Numbers of the actions of an answer, which are kept for each world."""
SEED, EPISODE = "mjsense/seed", "mjsense/episode"
"""Keys of the episode's seed and number in messages to ``mjsense serve``."""
MJSENSE = "mjsense"
"""Key of what ``mjsense serve`` says about its policy in the first message."""


@dataclass(frozen=True)
class Numbers:
    """Which numbers of a row are taken, and how they are converted: first by the threshold, then by the ranges."""

    columns: tuple[int, ...] | None = None
    """Columns in the order in which they are sent; None: all."""
    threshold: float | None = None
    """Greater numbers become 1, others 0."""
    source: tuple[float, float] | None = None
    """``from``: two values, which become those of ``target``. Numbers between are interpolated, others are clipped."""
    target: tuple[float, float] | None = None
    """``to``"""

    def of(self, values: np.ndarray, what: str) -> np.ndarray:
        """The numbers of ``values`` ``[..., n]``."""
        if self.columns is not None:
            if max(self.columns) >= values.shape[-1]:
                raise ValueError(
                    f"{what} has {counted(values.shape[-1], 'column')}, and the adapter takes column {max(self.columns)}"
                )
            values = values[..., list(self.columns)]
        if (self.threshold is not None or self.source is not None) and values.dtype.kind != "f":
            values = values.astype(np.float64)
        if self.threshold is not None:
            values = np.where(np.isnan(values), np.nan, (values > self.threshold).astype(values.dtype))
        if self.source is not None and self.target is not None:
            (a, b), (c, d) = self.source, self.target
            values = np.clip(c + (values - a) * ((d - c) / (b - a)), min(c, d), max(c, d)).astype(values.dtype)
        return values


@dataclass(frozen=True)
class Observed:
    """A value of an observation."""

    streams: tuple[str, ...]
    """Streams of numbers are concatenated; a camera is the only one."""
    numbers: Numbers = field(default_factory=Numbers)
    size: tuple[int, int] | None = None
    """Width and height to which an image is resized, with its aspect ratio, and padded with black."""
    layout: str = "hwc"
    """Axes of an image: ``hwc`` or ``chw``."""
    dtype: str = ""
    """Type of the numbers; empty: that of the streams."""


@dataclass(frozen=True)
class Commanded:
    """Where an answer has the commands of a move group."""

    key: str = ACTIONS
    width: int | None = None
    """Number of columns that the answer must have; None: any."""
    numbers: Numbers = field(default_factory=Numbers)
    targets: bool = False
    """Whether the commands are joint targets. A controller that takes other commands is then refused."""


@dataclass(frozen=True)
class Adapter:
    """The conversion of observations to messages, and of answers to actions."""

    name: str
    observation: Mapping[str, Observed]
    """By the key of the message."""
    actions: Mapping[str, Commanded]
    """By move group. Groups that are left out hold their position."""
    prompt: str = PROMPT
    """Key of the instruction; empty: it is not sent."""
    arrays: Arrays = "openpi"

    @property
    def streams(self) -> tuple[str, ...]:
        """All streams that it needs."""
        return tuple(dict.fromkeys(stream for one in self.observation.values() for stream in one.streams))

    def check(self, specs: Mapping[str, Any], groups: Mapping[str, slice], low: np.ndarray, high: np.ndarray) -> None:
        """Raises ValueError if the streams, or the move groups with these limits of their commands, do not suit the adapter."""
        for key, one in self.observation.items():
            for stream in one.streams:
                if stream not in specs:
                    raise ValueError(
                        f"adapter '{self.name}': there is no stream '{stream}' for "
                        f"'{key}'{did_you_mean(stream, specs, 'there are')}"
                    )
            plain = len(one.streams) == 1 and one.numbers == Numbers()
            rows = [stream for stream in one.streams if len(specs[stream].shape) > 1]
            if rows and not plain:
                raise ValueError(
                    f"adapter '{self.name}': '{key}' contains '{rows[0]}' of shape {specs[rows[0]].shape}, whose "
                    "numbers can neither be "
                    "chosen, converted nor concatenated"
                )
            if (one.size is not None or one.layout != "hwc") and not (plain and is_image_spec(specs[one.streams[0]])):
                raise ValueError(f"adapter '{self.name}': '{key}' has a size or a layout, and '{one.streams[0]}' is not an image")
            if one.layout == "chw" and len(specs[one.streams[0]].shape) != 3:
                raise ValueError(f"adapter '{self.name}': '{key}' has the layout chw, and '{one.streams[0]}' has no channels")
        for group, one in self.actions.items():
            if group not in groups:
                raise ValueError(
                    f"adapter '{self.name}': there is no move group '{group}'{did_you_mean(group, groups, 'there are')}"
                )
            if one.targets and not _takes_targets(
                specs.get(f"actions/joint_pos/{group}"), low[groups[group]], high[groups[group]]
            ):
                raise ValueError(
                    f"adapter '{self.name}': the commands of the move group '{group}' are joint targets, and its "
                    "controller takes other "
                    "commands (arm_controller)"
                )
            width, columns, to = groups[group].stop - groups[group].start, one.numbers.columns, one.numbers.target
            if columns is not None and len(columns) != width:
                raise ValueError(
                    f"adapter '{self.name}': {counted(len(columns), 'column')} for the move group '{group}', which takes {width}"
                )
            if to is not None and not (low[groups[group]].max() <= min(to) and max(to) <= high[groups[group]].min()):
                raise ValueError(
                    f"adapter '{self.name}': commands of the move group '{group}' from {to[0]:g} to {to[1]:g}; it takes "
                    f"{low[groups[group]].max():g} to {high[groups[group]].min():g}"
                )

    def message(self, rows: Mapping[str, np.ndarray], world: int, instruction: str) -> dict[str, Any]:
        """The observation of a world.

        Args:
            rows: Rows of all worlds ``[B, ...]`` by stream.
        """
        made: dict[str, Any] = {key: _value(one, key, rows, world) for key, one in self.observation.items()}
        return {**made, self.prompt: instruction} if self.prompt else made

    def commands(self, answer: Any, groups: Mapping[str, slice]) -> dict[str, np.ndarray]:
        """Commands ``[H, n]`` of each move group.

        Raises:
            ValueError: The answer does not have them.
        """
        if not isinstance(answer, dict):
            raise ValueError(f"the server's answer is a {type(answer).__name__} instead of a map")
        made: dict[str, np.ndarray] = {}
        for group, one in self.actions.items():
            if one.key not in answer:
                raise ValueError(f"the server's answer has no '{one.key}'{did_you_mean(one.key, answer, 'it has')}")
            values = _chunk(answer[one.key], one.key)
            if one.width is not None and values.shape[1] != one.width:
                raise ValueError(f"the server's answer has '{one.key}' of shape {values.shape}: must be (H, {one.width})")
            values = one.numbers.of(values, f"'{one.key}' of the answer")
            width = groups[group].stop - groups[group].start
            if values.shape[1] != width:
                raise ValueError(
                    f"the server's answer has '{one.key}' of shape {values.shape}; the move group '{group}' takes (H, {width})"
                )
            made[group] = values
        if len({len(values) for values in made.values()}) > 1:
            lengths = ", ".join(f"{len(values)} of '{group}'" for group, values in made.items())
            raise ValueError(f"the server's answer has chunks of different lengths: {lengths}")
        return made


def is_image_spec(spec: Any) -> bool:
    """Whether a stream is a colour or grey image."""
    return is_image(spec.dtype, spec.shape)


def _takes_targets(spec: Any, low: np.ndarray, high: np.ndarray) -> bool:
    """Whether commands with these limits are the joint targets of this stream, whose bounds are those of the controls."""
    if spec is None or spec.shape != low.shape:
        return False
    bounded = np.isfinite([spec.low, spec.high]).all()
    return not bounded or bool(np.allclose([spec.low, spec.high], [low.min(), high.max()], rtol=1e-6))


def _value(one: Observed, key: str, rows: Mapping[str, np.ndarray], world: int) -> np.ndarray:
    parts = [rows[stream][world] for stream in one.streams]
    if one.size is not None or one.layout != "hwc":
        image = parts[0] if one.size is None else resized(parts[0], *one.size)
        value = np.moveaxis(image, -1, 0) if one.layout == "chw" else image
    elif len(parts) == 1 and one.numbers == Numbers():
        value = parts[0]
    else:
        value = one.numbers.of(np.concatenate([np.atleast_1d(part) for part in parts]), f"'{key}'")
    return np.asarray(value, dtype=one.dtype or None)


def _chunk(value: Any, key: str) -> np.ndarray:
    """Numbers ``[H, n]`` of an answer: an array or nested lists, with or without steps."""
    try:
        array = np.asarray(value)
    except ValueError:  # lists of different lengths
        array = np.asarray("lists")
    if array.dtype.kind not in "biuf":
        raise ValueError(f"the server's answer has '{key}' that is not an array of numbers")
    if array.size > MAX_ACTIONS:
        raise ValueError(f"the server's answer has '{key}' of shape {array.shape}: must have at most {MAX_ACTIONS} numbers")
    if array.ndim not in (1, 2) or 0 in array.shape:
        raise ValueError(f"the server's answer has '{key}' of shape {array.shape}: must be (n,) or (H, n)")
    return array.reshape(-1, array.shape[-1]).astype(np.float64)


def resized(image: np.ndarray, width: int, height: int) -> np.ndarray:
    """An image ``[h, w, c]`` of this size: scaled with its aspect ratio, and centred between black bars, as ``resize_with_pad``
    of openpi does."""
    if image.shape[:2] == (height, width):
        return image
    pillow = optional("PIL.Image", "evaluate", "an adapter that resizes images")
    ratio = max(image.shape[1] / width, image.shape[0] / height)
    inner = max(int(image.shape[1] / ratio), 1), max(int(image.shape[0] / ratio), 1)
    scaled = np.asarray(pillow.fromarray(np.ascontiguousarray(image)).resize(inner, pillow.Resampling.BILINEAR))
    made = np.zeros((height, width, *image.shape[2:]), image.dtype)
    top, left = (height - inner[1]) // 2, (width - inner[0]) // 2
    made[top : top + inner[1], left : left + inner[0]] = scaled
    return made
