# SPDX-License-Identifier: Apache-2.0
"""Sensors on the device: the base class, what every sensor can read, and the registry of implementations."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import TYPE_CHECKING, Any, TypeVar

import mujoco_warp as mjw
import numpy as np
import warp as wp

if TYPE_CHECKING:
    from mjsense.sensors.native_sensor import NativeSensor
    from mjsense.sim.simulation import Simulation

DTYPES: dict[str, Any] = {
    "float32": wp.float32,
    "float64": wp.float64,
    "int32": wp.int32,
    "int64": wp.int64,
    "uint8": wp.uint8,
    "bool": wp.bool,
}
"""Warp's type for each dtype of a sensor's field."""


class Stage(IntEnum):
    """The last stage of the physics that a sensor reads."""

    NONE = 0
    POS = 1
    VEL = 2
    ACC = 3


@dataclass
class Worlds:
    """What every sensor can read. All arrays are on the device."""

    compiled: Simulation
    """One world of the same scene on the CPU. It has validated the scene and has its names and ids."""
    model: mjw.Model
    data: mjw.Data
    num_worlds: int
    device: Any
    decimation: int
    physics_dt: float
    """Duration of a physics step, s."""
    seed: wp.array
    """Seed of the random numbers, uint64 ``[1]``."""
    key: wp.array
    """Key of each world's random numbers, uint32 ``[B]``."""
    substep: wp.array
    """Physics steps since each world's reset, int64 ``[B]``."""
    start: wp.array
    """The time is ``start + substep * physics_dt``; a reset and a written time change it, s, float64 ``[B]``."""
    tick: wp.array
    """Physics steps since the last seeding, int64 ``[B]``."""
    episode: wp.array
    """Resets since the last seeding, int64 ``[B]``; the first episode is 1."""
    first: wp.array
    """True if there was no step since the reset, bool ``[B]``."""
    sensors: dict[str, WarpSensor] = field(default_factory=dict)
    """The sensors made so far, by their name in the scene."""
    shared: dict[str, Any] = field(default_factory=dict)
    """Objects that several sensors use, such as the lists of contacts by world."""

    @property
    def step_dt(self) -> float:
        """Duration of a control step, s."""
        return self.physics_dt * self.decimation

    def zeros(self, shape: tuple[int, ...] | int, dtype: Any) -> wp.array:
        return wp.zeros(shape, dtype=dtype, device=self.device)

    def array(self, values: Any, dtype: Any) -> wp.array:
        """A copy of these values on the device."""
        return wp.array(np.asarray(values), dtype=dtype, device=self.device)


class WarpSensor:
    """The implementation of a sensor on the device.

    ``update()``, ``substep()`` and ``reset()`` may launch kernels only: they are captured in a CUDA graph.
    """

    needs: Stage = Stage.POS
    """The last stage of the physics that update() and substep() read."""
    every_step = False
    """True if update() must run once in each control step, even if the sensor is not read."""
    wants_substep = False
    """True if substep() must run after every physics step."""
    stores_writes = False
    """True if substep() must also run after the state was written; it replaces what it stored at that time."""
    substep_fills_rows = False
    """True if the rows are complete after the last substep(), without update()."""
    on_host = False
    """True if its methods run Python code of the user. They are called outside of CUDA graphs."""
    fixed_fields: tuple[str, ...] = ()
    """Fields of the model that the sensor reads only when it is made; randomize() refuses them."""
    inputs: tuple[WarpSensor, ...] = ()
    """Sensors whose fields update() reads; they are updated first."""

    def __init__(self, worlds: Worlds, sensor: NativeSensor) -> None:
        self.worlds = worlds
        self.name: str = sensor.name
        self.cfg = sensor.cfg
        self.fields: Mapping[str, wp.array] = {}
        """Arrays ``[B, ...]`` by name, with the dtypes and shapes of the same sensor on the CPU. The name of a single field is
        ''."""

    def update(self) -> None:
        """Fills the rows of all worlds. It may run several times for the same step of a world; state must not advance then."""

    def substep(self) -> None:
        """Updates state that must see every physics step."""

    def reset(self, mask: wp.array) -> None:
        """Clears the state of the worlds in which a new episode begins (bool ``[B]``); update() follows before rows are read."""


REGISTRY: dict[str, type[WarpSensor]] = {}

S = TypeVar("S", bound=WarpSensor)


def implements(*kinds: str) -> Callable[[type[S]], type[S]]:
    """Registers a class as the implementation of sensors of these kinds (:attr:`NativeSensor.kind`)."""

    def register(cls: type[S]) -> type[S]:
        REGISTRY.update(dict.fromkeys(kinds, cls))
        return cls

    return register


def declared(worlds: Worlds, sensor: NativeSensor) -> dict[str, wp.array]:
    """Arrays of zeros for the fields that the sensor has on the CPU."""
    return {name: worlds.zeros((worlds.num_worlds, *spec.shape), DTYPES[spec.dtype]) for name, spec in sensor.specs.items()}


def unsupported(sensor: str, what: str) -> ValueError:
    """The error for an option that this backend does not have."""
    return ValueError(f"sensor '{sensor}': {what} is not available with backend='warp'; use backend='cpu'")


def scalar_view(array: wp.array) -> wp.array:
    """The same memory with a scalar dtype: ``[B, n]`` of vec3 becomes float32 ``[B, n, 3]``."""
    shape = getattr(array.dtype, "_shape_", ())
    return _view(array, (*array.shape, *shape)) if shape else array


def rows_view(array: wp.array) -> wp.array:
    """The same memory as scalars ``[B, n]``."""
    flat = scalar_view(array)
    return _view(array, (flat.shape[0], math.prod(flat.shape[1:])))


def vec3_view(array: wp.array) -> wp.array:
    """float32 ``[..., 3]`` as an array of vec3 with one dimension less, on the same memory."""
    view = wp.array(ptr=array.ptr, dtype=wp.vec3, shape=array.shape[:-1], device=array.device, capacity=array.capacity)
    view._ref = array
    return view


def _view(array: wp.array, shape: tuple[int, ...]) -> wp.array:
    scalar = getattr(array.dtype, "_wp_scalar_type_", array.dtype)
    view = wp.array(ptr=array.ptr, dtype=scalar, shape=shape, device=array.device, capacity=array.capacity)
    view._ref = array  # keeps the memory
    return view
