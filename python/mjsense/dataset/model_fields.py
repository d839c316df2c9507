# SPDX-License-Identifier: Apache-2.0
"""Values that an episode writes into the archived model and its state, checked against what they change and index.

MuJoCo uses most integers of a model as addresses in memory and checks none of them. A recording may come from anyone, so only
fields that may differ between worlds are taken, with the shape and the type that they have in the model, finite, and with ids of
elements that exist.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense.core import libmujoco
from mjsense.core.counted import counted
from mjsense.core.mujoco_names import Joint
from mjsense.scene.physics_options import PREFIX
from mjsense.scene.randomizable import field_of, is_randomizable, valid_values

if TYPE_CHECKING:
    import mujoco

MAX_VALUE = 1e10
"""mjMAXVAL; larger limits mean none."""
MAX_INVERSE = 1e16
"""Of inverses of masses and inertias: MuJoCo's smallest number is 1e-15."""
MAX_STATE = 1e15
"""Of numbers of a state, which are finite with single precision too."""
MAX_NUMBERS = 1 << 26
"""Of one array of an episode; it has 512 MiB."""
MAX_SUBSTEPS = 100_000
_INVERSES = ("invweight0", "acc0")
_PARTS = tuple(
    """
    qpos0 qpos_spring body_ jnt_ dof_ geom_ site_ cam_ light_ flex_ flexedge_ mat_ pair_ eq_ tendon_ wrap_prm actuator_
    sensor_ key_
    """.split()
)
"""Beginnings of the names of fields that may differ between worlds."""
_RANGES = {
    "jnt_limited": "jnt_range",
    "jnt_actfrclimited": "jnt_actfrcrange",
    "tendon_limited": "tendon_range",
    "tendon_actfrclimited": "tendon_actfrcrange",
    "actuator_ctrllimited": "actuator_ctrlrange",
    "actuator_forcelimited": "actuator_forcerange",
    "actuator_actlimited": "actuator_actrange",
}
"""Whether something is limited, and to what."""
_BOXES = "bvh_aabb"
"""The boxes of bodies contain objects that are larger in an episode. Of the others, which fields name as structure, this is the
only one."""


@dataclass(frozen=True)
class ReplayInputs:
    """What an episode stores for replay. docs/formats.md describes the arrays."""

    state: np.ndarray
    written: np.ndarray
    ctrl: np.ndarray | None
    mocap: np.ndarray | None
    held: np.ndarray


def check_model_fields(fields: Mapping[str, Any], model: mujoco.MjModel, about: str) -> dict[str, np.ndarray]:
    """The values of ``replay/model/*``, with the shapes of the model; NaN where the model's value stays.

    Args:
        fields: Datasets of HDF5, or arrays, by the name of the field.
        model: The archived model.
        about: File and trajectory, for errors.

    Raises:
        ValueError: A field is unknown, has another type or shape, or a value that the model cannot have.
    """
    values = {name: _checked(name, dataset, model, f"{about}: replay/model/{name}") for name, dataset in fields.items()}
    for flag, name in _RANGES.items():
        if flag in values or name in values:
            _check_ranges(flag, name, values, model, about)
    return values


def _check_ranges(flag: str, name: str, values: Mapping[str, np.ndarray], model: mujoco.MjModel, about: str) -> None:
    """A range of what is limited is not empty: MuJoCo compiles no other."""
    archived = getattr(model, name)
    ranges = values.get(name, archived)
    ranges = np.where(np.isnan(ranges), archived, ranges)
    limited = np.ravel(values.get(flag, getattr(model, flag))) != 0
    changed = (ranges != archived).any(-1) | (limited & (np.ravel(getattr(model, flag)) == 0))
    if (wrong := changed & limited & ~(ranges[:, 0] < ranges[:, 1])).any():
        row = int(np.argmax(wrong))
        raise ValueError(
            f"{about}: replay/model/{name if name in values else flag}[{row}]: is limited to {ranges[row].tolist()}, "
            "expected a range whose end is larger than its beginning"
        )


def _checked(name: str, dataset: Any, model: mujoco.MjModel, place: str) -> np.ndarray:
    like = field_of(model, name) if name.startswith((*_PARTS, _BOXES, PREFIX)) else None
    if not isinstance(like, np.ndarray) or (name != _BOXES and not is_randomizable(model, name)):
        raise ValueError(f"{place}: no field of a model that may differ between episodes")
    like = np.atleast_1d(like)  # scalars of mjOption are stored as one number
    if not hasattr(dataset, "dtype"):
        raise ValueError(f"{place}: is a group, expected an array of {like.dtype}")
    shape = tuple(dataset.shape)
    if dataset.dtype != like.dtype or _packed(shape) != _packed(like.shape):
        raise ValueError(f"{place}: is {dataset.dtype} {[*shape]}, expected {like.dtype} {[*like.shape]}")
    values = np.asarray(dataset[()]).reshape(like.shape)
    if values.dtype.kind == "f":
        limit = MAX_INVERSE if name.endswith(_INVERSES) else MAX_VALUE
        if (wrong := ~np.isnan(values) & ~(np.abs(values) <= limit)).any():
            index = tuple(np.argwhere(wrong)[0].tolist())
            raise ValueError(f"{place}{[*index]}: is {values[index]}, expected a number of at most {limit:g}")
        complete = np.where(np.isnan(values), like, values)
    else:
        complete = values
    if name == _BOXES:
        if (wrong := complete[:, 3:] < 0).any():
            row, column = np.argwhere(wrong)[0].tolist()
            raise ValueError(f"{place}{[row, column + 3]}: is {complete[row, column + 3]}, expected a size of at least 0")
        return values
    try:
        valid_values(model, name, complete[None], np.broadcast_to(like, (1, *like.shape)), np.zeros(1, int))
    except ValueError as error:
        raise ValueError(f"{place}: {str(error).removeprefix(f'{name}: ')}") from None
    return values


def _packed(shape: tuple[int, ...]) -> tuple[int, ...]:
    """A shape without its last dimension if that is 1: the recorder stores arrays with one value per element flat."""
    return shape[:-1] if len(shape) > 1 and shape[-1] == 1 else shape


INPUTS = {
    "state": ("float64", 2, False),
    "written": ("float64", 2, True),
    "ctrl": ("float64", 3, False),
    "mocap": ("float64", 4, False),
    "held": ("int32", 1, False),
}
"""Arrays of ``replay/``: type, number of dimensions, and whether NaN has a meaning. All but ``held`` have a row per observation;
no step led to row 0, whose controls and poses have none."""


def read_input(group: Mapping[str, Any], name: str, length: int, about: str) -> Any:
    """One of :data:`INPUTS` of an episode with ``length`` rows; None if it has none."""
    if name not in group:
        return None
    dataset, (dtype, dimensions, with_nan) = group[name], INPUTS[name]
    shape: list[int] = [*getattr(dataset, "shape", ())]
    rows = shape[0] if name == "held" and shape else length
    if (
        getattr(dataset, "dtype", None) != dtype
        or len(shape) != dimensions
        or shape[0] != rows
        or (name == "mocap" and shape[3] != 7)
    ):
        expected = f"{dtype} with {dimensions} dimensions" + ("" if name == "held" else f" and {counted(length, 'row')}")
        raise ValueError(f"{about}: replay/{name}: is {getattr(dataset, 'dtype', 'a group')} {shape}, expected {expected}")
    if (count := math.prod(shape)) > MAX_NUMBERS:
        raise ValueError(f"{about}: replay/{name}: has {counted(count, 'number')}, the limit is {MAX_NUMBERS}")
    values = dataset[()]
    low, high = (np.fmin, np.fmax) if with_nan else (np.minimum, np.maximum)
    used = values[1:] if name in ("ctrl", "mocap") else values
    if (
        dtype == "float64"
        and used.size
        and not (abs(low.reduce(used, None)) <= MAX_STATE and abs(high.reduce(used, None)) <= MAX_STATE)
    ):
        wrong = ~(np.abs(values) <= MAX_STATE) & ~(np.isnan(values) & with_nan)
        wrong[: len(values) - len(used)] = False
        if wrong.any():
            index = tuple(np.argwhere(wrong)[0].tolist())
            raise ValueError(f"{about}: replay/{name}{[*index]}: is {values[index]}, expected a number of at most {MAX_STATE:g}")
    return values


def check_inputs(inputs: ReplayInputs, model: mujoco.MjModel, size: int, substeps: float, about: str) -> None:
    """Checks the rows of ``replay/`` against the model.

    Args:
        size: Numbers of the model's state.
        substeps: Physics steps of one row.
    """
    found = inputs.state.shape[1]
    if found != size:
        raise ValueError(
            f"{about}: the recorded state has {counted(found, 'number')}, that of MuJoCo "
            f"{'.'.join(map(str, libmujoco.SERIES))} has {size}. "
            "Replay needs a MuJoCo of the series that recorded."
        )
    if inputs.written.shape != inputs.state.shape:
        raise ValueError(f"{about}: replay/written has the shape {[*inputs.written.shape]}, expected {[*inputs.state.shape]}")
    if not 0.51 <= substeps <= MAX_SUBSTEPS:
        raise ValueError(f"{about}: a row has {substeps:g} physics steps (policy_dt_ms, timestep), expected 1 to {MAX_SUBSTEPS}")
    for row, joint in enumerate(inputs.held.tolist()):
        if not 0 <= joint < model.njnt or model.jnt_type[joint] != Joint.FREE:
            raise ValueError(f"{about}: replay/held[{row}]: is {joint}, expected the id of a free joint, 0 to {model.njnt - 1}")
    if inputs.ctrl is None:
        return
    ticks, nu = inputs.ctrl.shape[1:]
    if nu != model.nu:
        raise ValueError(f"{about}: replay/ctrl has {nu} controls, expected {model.nu}")
    if ticks < 1 or round(substeps) % ticks:
        raise ValueError(
            f"{about}: replay/ctrl has {ticks} control ticks, expected a divisor of the {round(substeps)} physics steps of a row"
        )
    if inputs.mocap is not None and inputs.mocap.shape[1:3] != (ticks, model.nmocap):
        raise ValueError(f"{about}: replay/mocap has the shape {[*inputs.mocap.shape]}, expected [T, {ticks}, {model.nmocap}, 7]")
