# SPDX-License-Identifier: Apache-2.0
"""LeRobot's features, as :func:`mjsense.exporting.export_lerobot` writes them, of worlds that run."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Mapping as Table
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.errors import did_you_mean
from mjsense.exporting.mapping import Mapping

STATE, IMAGES, OTHERS = "observation.state", "observation.images.", "observation."
_PLACES = ("obs/agent/", "obs/extra/", "obs/sensor_data/")
_TARGETS, _COMMANDS = "actions/joint_pos/", "actions/commanded_action/"


class Features:
    """The features of an export with the same map, made of the current rows of a suite.

    Shapes: ``k`` worlds, ``n`` numbers of an action, ``c`` numbers of the commands of all move groups.

    Args:
        specs: Specification of each stream of the suite.
        groups: Columns of a command by move group.
        map: The map that the export had: a :class:`Mapping`, a TOML file or a dict; None: the export had none.
    """

    def __init__(
        self, specs: Table[str, Any], groups: Table[str, slice], map: Mapping | str | Path | dict[str, Any] | None = None
    ) -> None:
        mapping = Mapping.of(map)
        self._specs, self._groups = specs, groups
        cameras = {name: name for name, spec in specs.items() if _is_colour(spec)} if mapping.cameras is None else mapping.cameras
        self.streams: dict[str, tuple[str, ...]] = {
            STATE: self._expanded(STATE, mapping.state or ("obs/agent/qpos",)),
            **{IMAGES + name: (camera,) for name, camera in cameras.items()},
            **{_key(name): self._expanded(name, streams) for name, streams in mapping.features.items()},
        }
        """Streams of the suite by feature of an observation. A camera may be one that is not rendered."""
        self.action = self._action(mapping)
        """Columns of a command that are the numbers of an action, int ``[n]``."""
        commanded = [
            name for name, columns in groups.items() if np.isin(np.arange(columns.start, columns.stop), self.action).any()
        ]
        self.held: tuple[str, ...] = tuple(name for name in groups if name not in commanded)
        """Move groups without a number in the action: they hold their position."""

    def shape(self, feature: str) -> tuple[int, ...]:
        """Shape of a feature of an observation; images are ``(height, width, 3)``."""
        specs = [self._specs[stream] for stream in self.streams[feature]]
        return tuple(specs[0].shape) if feature.startswith(IMAGES) else (sum(int(np.prod(spec.shape)) for spec in specs),)

    def check(self, wanted: Iterable[str], owner: str) -> None:
        """Raises ValueError unless these features of an observation can be made."""
        for feature in wanted:
            if feature not in self.streams:
                rest = did_you_mean(feature, self.streams, "the features here are")
                raise ValueError(f"{owner} needs the feature '{feature}'{rest}. The map of the export names others (map=FILE)")
            if (camera := self.streams[feature][0]) not in self._specs:
                cameras = [name for name, spec in self._specs.items() if _is_colour(spec)]
                raise ValueError(
                    f"{owner} needs '{feature}' of the camera '{camera}'{did_you_mean(camera, cameras, 'the cameras here are')}"
                )

    def rows(self, feature: str, rows: Table[str, np.ndarray], worlds: np.ndarray | slice = slice(None)) -> np.ndarray:
        """Rows of a feature: images uint8 ``[k, height, width, 3]``, numbers float32 ``[k, size]``.

        Args:
            rows: Rows of the suite by stream, ``[B, ...]``.
        """
        parts = [rows[stream][worlds] for stream in self.streams[feature]]
        if feature.startswith(IMAGES):
            return parts[0]
        return np.concatenate([part.reshape(len(part), -1) for part in parts], 1).astype(np.float32)

    def commands(self, actions: np.ndarray) -> np.ndarray:
        """Commands of all move groups ``[..., c]`` of actions ``[..., n]``. Columns without a number are 0."""
        commands = np.zeros((*actions.shape[:-1], max((columns.stop for columns in self._groups.values()), default=0)))
        commands[..., self.action] = actions
        return commands

    def layout(self) -> str:
        """The numbers of an action in words: ``arm 7, gripper 1``."""
        named = {name: columns for name, columns in self._groups.items() if name not in self.held}
        return ", ".join(f"{name} {columns.stop - columns.start}" for name, columns in named.items())

    def _expanded(self, feature: str, names: Iterable[str]) -> tuple[str, ...]:
        """Streams of the suite, in the order of an export."""
        found: list[str] = []
        for name in names:
            short = _short(name)
            inner = [short] if short in self._specs else sorted(one for one in self._specs if one.startswith(f"{short}/"))
            inner = [one for one in inner if "/given/" not in one and 0 not in self._specs[one].shape]
            if not inner:
                raise ValueError(
                    f"feature '{feature}': there is no stream '{name}' here{did_you_mean(short, self._specs, 'there are')}"
                )
            found += inner
        return tuple(dict.fromkeys(found))

    def _action(self, mapping: Mapping) -> np.ndarray:
        if mapping.action is None:
            known = [group for group in sorted(self._groups) if self._size(_TARGETS + group)]
            names = [_TARGETS + group for group in known]
            names += [_COMMANDS + group for group in sorted(self._groups) if group not in known]
        else:
            names = list(self._expanded("action", mapping.action))
        columns: list[int] = []
        for name in names:
            group = name.rpartition("/")[2]
            if not name.startswith((_TARGETS, _COMMANDS)) or group not in self._groups:
                raise ValueError(f"feature 'action': '{name}' is not a command; expected {_COMMANDS}GROUP or {_TARGETS}GROUP")
            given, taken = self._specs[name], self._specs.get(_COMMANDS + group, self._specs[name])
            if (given.unit, tuple(given.shape)) != (taken.unit, tuple(taken.shape)):
                raise ValueError(
                    f"feature 'action': it has '{name}' ({given.shape[0]} numbers, {given.unit}), but the "
                    f"controller of '{group}' takes "
                    f"{taken.shape[0]} numbers ({taken.unit}). Choose the controller with arm_controller, or other "
                    "streams in the map"
                )
            columns += range(self._groups[group].start, self._groups[group].stop)
        return np.array(columns, int)

    def _size(self, stream: str) -> int:
        return int(np.prod(self._specs[stream].shape)) if stream in self._specs else 0


def _short(stream: str) -> str:
    """The name in a suite of a stream of a recording: ``qpos`` of ``obs/agent/qpos``."""
    for place in _PLACES:
        stream = stream.removeprefix(place)
    return stream


def _key(name: str) -> str:
    """LeRobot's name of a feature of an observation, as an export writes it."""
    return name if "." in name else OTHERS + name


def _is_colour(spec: Any) -> bool:
    return len(spec.shape) == 3 and spec.shape[2] == 3 and np.dtype(spec.dtype) == np.uint8
