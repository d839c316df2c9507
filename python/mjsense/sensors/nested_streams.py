# SPDX-License-Identifier: Apache-2.0
"""Converts the streams of a suite to the nested dicts of environments and policies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mjsense.core.errors import did_you_mean

Streams = Mapping[str, tuple[str, Any, Any]]
"""stream name -> (sensor, spec, rows)"""


def _is_empty(spec: Any) -> bool:
    return 0 in spec.shape


def choose_streams(wanted: Sequence[str] | None, streams: Streams, texts: Sequence[str] = ()) -> list[str]:
    """Names of the streams to observe: those in `wanted`, by their own or their sensors' names; by default all numeric ones and
    ``texts``."""
    if wanted is None:
        plain = [name for name, (_, spec, _) in streams.items() if not _is_empty(spec) and (not spec.is_dict or name in texts)]
        return [name for name in plain if not name.startswith(("sensor_param_", "object_image_points"))]
    names: list[str] = []
    for one in wanted:
        found = [name for name, (sensor, spec, _) in streams.items() if name == one or (sensor == one and not _is_empty(spec))]
        if not found:
            known = [*(sensor for sensor, _, _ in streams.values()), *streams]
            raise ValueError(f"no sensor or stream '{one}'{did_you_mean(one, known, 'there are')}")
        names += [name for name in found if name not in names]
    return names


def stream_path(sensor: str, stream: str) -> tuple[str, ...]:
    """Keys of a stream in an observation: ("qpos", "arm")."""
    return (sensor, *stream[len(sensor) + 1 :].split("/")) if stream != sensor else (sensor,)


def nest(paths: Mapping[str, tuple[str, ...]], values: Mapping[str, Any]) -> dict[str, Any]:
    """{"qpos/arm": x} -> {"qpos": {"arm": x}}"""
    nested: dict[str, Any] = {}
    for name, path in paths.items():
        inner = nested
        for key in path[:-1]:
            inner = inner.setdefault(key, {})
        inner[path[-1]] = values[name]
    return nested
