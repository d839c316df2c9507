# SPDX-License-Identifier: Apache-2.0
"""Streams: their names, and the datasets of a trajectory that contain them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mjsense.dataset.hdf5 import Group
from mjsense.dataset.hdf5_rows import Rows

VIDEOS = "obs/sensor_data/"
REPLAY = "replay/"
NUMBERS = "numbers/"  # the fields of JSON rows as arrays; older recordings have only the JSON rows
LARGE_ROW = 1 << 16  # bytes; rows of at least this size (segmentation) are read one by one and not kept


@dataclass(frozen=True)
class Stream:
    """What is stored in one row of a stream."""

    name: str
    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    unit: str
    frame: str
    description: str
    kind: Literal["array", "json", "video"] = "array"
    """``json``: a leaf of JSON rows, decoded to numbers. ``video``: a frame of a video."""

    def __repr__(self) -> str:
        about = " ".join(
            text for text in (f"[{self.unit}]" if self.unit else "", self.frame and f"in {self.frame}", self.description) if text
        )
        return f"{self.name}: {self.dtype} {list(self.shape)} {about}".rstrip()


def given_name(stream: str) -> str | None:
    """``actions/joint_pos/given/arm`` of ``actions/joint_pos/arm``, as observations name it; None for other streams."""
    parts = stream.split("/")
    return "/".join([*parts[:2], "given", *parts[2:]]) if parts[0] == "actions" and len(parts) > 2 else None


def is_mask(stream: str) -> bool:
    """Whether a stream says in which rows an action is given."""
    parts = stream.split("/")
    return parts[0] == "actions" and len(parts) > 3 and parts[2] == "given"


def unit_of(unit: str, leaf: str) -> str:
    """The unit of one move group in ``"arm: rad; gripper: 0 open .. 255 closed"``."""
    by_group = dict(part.split(": ", 1) for part in unit.split("; ") if ": " in part)
    return by_group.get(leaf, "") if by_group else unit


_OF_STEPS = {"rewards": ("biuf", "number"), **dict.fromkeys(("success", "fail", "terminated", "truncated"), ("b", "bool"))}
"""Kinds of NumPy types, and the word for them, of the datasets that every trajectory has."""
_OF_CAMERAS = {"intrinsic_cv": (3, 3), "extrinsic_cv": (3, 4), "cam2world_gl": (4, 4)}
"""Shapes of the parameters of cameras."""


def is_json(dataset: Rows) -> bool:
    """Whether a dataset contains JSON rows."""
    is_bytes = dataset.dtype == np.uint8 and dataset.ndim == 2
    if "encoding" in dataset.attrs or "spec" in dataset.attrs:
        if (is_json := dataset.attrs.text("encoding") == "json") and not is_bytes:
            raise ValueError(f"{dataset.where} is {dataset.dtype} {list(dataset.shape)}; JSON rows must be uint8 [T, N]")
        return is_json
    # MolmoSpaces' files have no attributes.
    return is_bytes and min(dataset.shape) > 0 and dataset[0][0] == ord("{")


def dataset_of(trajectory: Group, name: str) -> tuple[str, Rows] | None:
    """The dataset that contains a stream, and its place: the stream itself or, for a leaf or a mask, its array of numbers or the
    JSON rows of a prefix of its name."""
    places = [NUMBERS + name, name]
    while "/" in places[-1]:
        places.append(places[-1].rpartition("/")[0])
    for place in places:
        if (found := trajectory.get(place)) is not None:
            return (place, found) if isinstance(found, Rows) else None
    return None


def check_known(name: str, dataset: Rows) -> None:
    """Raises an error if rewards or flags are not one number or bool for each observation, or parameters of cameras no
    matrices."""
    kinds, word = _OF_STEPS.get(name, ("", ""))
    if kinds and (dataset.ndim != 1 or dataset.dtype.kind not in kinds):
        raise ValueError(f"{dataset.where} is {dataset.dtype} {list(dataset.shape)}; it must be one {word} for each observation")
    shape = _OF_CAMERAS.get(name.rpartition("/")[2]) if name.startswith("obs/sensor_param/") else None
    if shape and dataset.shape[1:] != shape:
        raise ValueError(
            f"{dataset.where} is {dataset.dtype} {list(dataset.shape)}; it must be a matrix of {shape[0]} x "
            f"{shape[1]} numbers for each observation"
        )
