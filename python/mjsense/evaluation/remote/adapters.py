# SPDX-License-Identifier: Apache-2.0
"""Adapters by name: streams as they are, the features of an export, and openpi's policies of the DROID data set."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mjsense.core.errors import did_you_mean
from mjsense.core.input_files import read_toml
from mjsense.evaluation.lerobot_features import Features
from mjsense.evaluation.remote.adapter import ACTIONS, Adapter, Commanded, Numbers, Observed
from mjsense.evaluation.remote.adapter_file import adapter_of_table
from mjsense.sensors.nested_streams import Streams, choose_streams

DROID = """\
# The policies that openpi trains on the DROID data set, with joint positions as actions. Robot: franka.
prompt = "prompt"

[observation."observation/exterior_image_1_left"]
streams = "exo_camera_1"
size = "224x224"

[observation."observation/wrist_image_left"]
streams = "wrist_camera"
size = "224x224"

[observation."observation/joint_position"]
streams = "qpos/arm"

[observation."observation/gripper_position"]
streams = "qpos/gripper"
columns = [0]
from = [0.0, 0.8]  # rad, open and closed
to = [0.0, 1.0]

[actions.arm]
key = "actions"
width = 8
columns = [0, 1, 2, 3, 4, 5, 6]
targets = true

[actions.gripper]
key = "actions"
width = 8
columns = [7]
threshold = 0.5
from = [0.0, 1.0]
to = [0.0, 255.0]
"""
BUILT_IN = ("streams", "features", "droid")
"""Names of adapters."""


def adapter_of(name: str, streams: Streams, groups: Mapping[str, slice], observed: Sequence[str] | None = None) -> Adapter:
    """An adapter by its name or its file.

    Args:
        name: ``streams``, ``features``, ``droid`` or the path of a TOML file.
        groups: Columns of an action by move group.
        observed: Sensors or streams that ``streams`` sends; None: all numeric ones, as in ``make_vec``.
    """
    if name == "streams":
        return _of_streams(choose_streams(observed, streams), groups)
    if name == "features":
        return _of_features({stream: spec for stream, (_, spec, _) in streams.items()}, groups)
    return declared(name)


def check_name(name: str) -> None:
    """Raises an error if there is no such adapter, or if its file is not valid."""
    if name not in ("streams", "features"):
        declared(name)


def declared(name: str) -> Adapter:
    """The adapter of a TOML file, or ``droid``."""
    import tomllib  # slow to import

    if name == "droid":
        return adapter_of_table(tomllib.loads(DROID), name)
    if not name.endswith(".toml"):
        raise ValueError(f"adapter '{name}' is neither a file .toml nor a name{did_you_mean(name, BUILT_IN, 'names are')}")
    return adapter_of_table(read_toml(name), name)


def fingerprint_of(name: str) -> str:
    """A text of what an adapter does."""
    return name if name in ("streams", "features") else repr(replace(declared(name), name=""))


def _of_streams(names: Iterable[str], groups: Mapping[str, slice]) -> Adapter:
    """Streams and commands as they are, as :class:`mjsense.evaluation.PolicyServer` takes them."""
    actions: dict[str, Commanded] = {}
    width = max((at.stop for at in groups.values()), default=0)
    for group, at in groups.items():
        if at.stop > at.start:
            actions[group] = Commanded(ACTIONS, width, Numbers(tuple(range(at.start, at.stop))))
    return Adapter("streams", {name: Observed((name,)) for name in names}, actions)


def _of_features(specs: Mapping[str, Any], groups: Mapping[str, slice]) -> Adapter:
    """The columns of :func:`mjsense.export` without a map: joint positions of all move groups, colour cameras, joint targets."""
    features = Features(specs, groups)
    actions: dict[str, Commanded] = {}
    for group, at in groups.items():
        columns = np.flatnonzero((features.action >= at.start) & (features.action < at.stop))
        if len(columns):
            numbers, targets = Numbers(tuple(columns.tolist())), f"actions/joint_pos/{group}" in specs
            actions[group] = Commanded("action", len(features.action), numbers, targets)
    return Adapter("features", {name: Observed(streams) for name, streams in features.streams.items()}, actions)
