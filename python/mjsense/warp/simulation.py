# SPDX-License-Identifier: Apache-2.0
"""Simulations on mujoco_warp: B worlds on one device, with sensors of the same configurations as on the CPU."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import mujoco_warp as mjw
import numpy as np
import warp as wp

from mjsense.core import mujoco_names
from mjsense.core.arguments import KnownAttributes, Seed, checked
from mjsense.core.arrays import ids_of_worlds, on_host
from mjsense.core.counted import counted
from mjsense.core.errors import did_you_mean
from mjsense.scene.physics_options import PREFIX
from mjsense.scene.randomizable import check_randomizable, valid_values
from mjsense.sensors.sensor import Sensor
from mjsense.sim.simulation import Simulation
from mjsense.warp import arrays, builtin, host_rows, kernels, limits, physics
from mjsense.warp.graphs import Graphs
from mjsense.warp.scene_sensors import SceneSensors
from mjsense.warp.sensor import Worlds, scalar_view, unsupported
from mjsense.warp.state import MEMORY, STATE, Component, DerivedFields
from mjsense.warp.stepper import FINITE, Stepper
from mjsense.warp.world_models import WorldModels

if TYPE_CHECKING:
    from mjsense.scene.scene import Scene


@checked
class WarpSimulation(KnownAttributes):
    """B parallel worlds of a scene on mujoco_warp, made by
    ``mjs.Simulation(scene, num_worlds, backend="warp", device="cuda:0")``.

    Arrays are on the device: torch tensors if torch is installed, otherwise ``wp.array``. After ``step()``, ``reset()`` and
    ``forward()``, every sensor belongs to the current state.
    """

    def __init__(
        self,
        compiled: Simulation,
        num_worlds: int,
        device: str | None = None,
        nconmax: int | None = None,
        njmax: int | None = None,
    ) -> None:
        """
        Args:
            compiled: One world of the scene on the CPU.
            num_worlds: Number of worlds, ``B``.
            device: ``"cpu"``, ``"cuda:0"`` ...; by default the first CUDA device, or the CPU without one.
            nconmax: Contacts for which each world has memory, on average over the worlds; by default an estimate.
            njmax: Constraint rows for which each world has memory; by default an estimate.
        """
        if num_worlds < 1:
            raise ValueError(f"num_worlds must be at least 1, not {num_worlds}")
        self._device = arrays.device_of(device)
        self.device = str(self._device)
        """Name of the device, ``"cuda:0"``."""
        self.scene: Scene = compiled.scene
        """The scene that all worlds share; ``sim.scene["name"].data`` is a sensor's measurement."""
        self.num_worlds = num_worlds
        """Number of worlds, ``B``."""
        self.decimation: int = compiled.decimation
        """Physics steps (substeps) per control step."""
        self.physics_dt: float = compiled.physics_dt
        """Duration of a physics step, s."""
        self.step_dt: float = compiled.step_dt
        """Duration of a control step, s."""
        self._compiled = compiled
        self._seed = int(compiled.seed)
        self._closed = False
        self._failures: list[tuple[int, str]] = []
        self._graphs = Graphs(self._device, enabled=self._device.is_cuda)
        self._views: dict[str, Any] = {}
        self._behind = False  # True after step_raw(): derived quantities belong to the state before the step
        model: Any = compiled.model
        with wp.ScopedDevice(self._device):
            builtin.check_types(model)
            try:
                self._model = mjw.put_model(copy.copy(model))  # that of the simulation is read-only
            except NotImplementedError as error:
                raise ValueError(f"the model is not available with backend='warp': {error}") from None
            self._model.opt.warn_overflow = 0
            physics.check_options(self._model)
            self._limits = limits.sizes(model, nconmax, njmax)
            self._data = mjw.make_data(model, nworld=num_worlds, nconmax=self._limits.nconmax, njmax=self._limits.njmax)
            self._worlds = _worlds(self._compiled, self._model, self._data, self._device)
            self._stepper = Stepper(self._worlds)
            self._models = WorldModels(self._model, self._data, self._device, self._graphs.clear)
            self._every_world = wp.full(num_worlds, True, dtype=wp.bool)
            self._time = wp.zeros(num_worlds, dtype=wp.float64)
            self._sensors = SceneSensors(self, self._worlds, self._stepper, self._graphs)
        self._complete = True
        self._sensors.initialize()
        self.reset()

    # ---------------------------------------------------------------------------------------------------------- sensors

    def add(self, sensor: Any) -> Any:
        """Adds a sensor written in Python that is not part of the scene, and returns it. Others belong in
        ``SceneCfg.sensors``."""
        self._check_open()
        if not isinstance(sensor, Sensor):
            raise NotImplementedError(f"Simulation.add() is for sensors written in Python with backend='warp', not {sensor!r}")
        self._sensors.add(sensor)
        return sensor

    def refresh(self, sensors: Sequence[Any]) -> None:
        """Computes several sensors (as returned by ``scene["name"]``)."""
        for sensor in sensors:
            self._sensors.refresh(self._sensors.by_name[sensor.uuid if isinstance(sensor, Sensor) else sensor.name])

    def _host_rows(self, sensors: Sequence[Any]) -> host_rows.HostRows:
        """The rows of these sensors for a recorder."""
        fields = [self._sensors.by_name[sensor.name].fields for sensor in sensors]
        return host_rows.HostRows(sensors, fields, self.num_worlds, self._device)

    # ---------------------------------------------------------------------------------------------------------- physics

    def step(self, control_steps: int = 1) -> None:
        """Advances every world by control steps of ``decimation`` substeps each."""
        self._check_open()
        if control_steps < 1:
            raise ValueError(f"control_steps must be at least 1, not {control_steps}")
        failures: list[tuple[int, str]] = []
        if self._behind:
            self.forward()
        for _ in range(control_steps):
            self._sensors.state_changed()
            self._graphs.run("step", self._stepper.control_step)
            self._sensors.computed_by_step()
            self._report()
            failures += self._failures
            for sensor in self._sensors.on_host:
                sensor.substep()
        self._failures = failures

    def step_raw(self, substeps: int = 1) -> None:
        """Steps all worlds as mujoco_warp does: derived quantities stay one substep behind the state, as in MuJoCo and mjlab."""
        self._check_open()
        for _ in range(substeps):
            behind = self._behind
            self._graphs.run("step_raw behind" if behind else "step_raw", lambda: self._stepper.raw_step(behind))
            self._behind = True
        self._sensors.state_changed(has_forces=True)
        self._report()

    def update_sensors(self, dt: float = 0.0) -> None:
        """Updates the sensors' per-substep state (air time, history) once, after ``step_raw(1)``. ``dt`` is in s, the timestep or
        0."""
        if dt not in (0.0, self.physics_dt):
            raise ValueError(
                f"update_sensors(): dt is {dt} s, and the timestep is {self.physics_dt} s; others are not available "
                "with backend='warp'"
            )
        with wp.ScopedDevice(self._device):
            for sensor in (*self._stepper.substepped, *self._sensors.on_host):
                sensor.substep()

    def reset_sensors(self, world_ids: Any = None) -> None:
        """Resets the sensors' episode state in these worlds without resetting the physics."""
        mask = self._mask(world_ids)
        self._sensors.state_changed(has_forces=self._behind)
        with wp.ScopedDevice(self._device):
            self._stepper.reset_sensors(mask, on_host=True)

    def reset(self, world_ids: Any = None, *, seed: Seed | None = None, key: int | str | None = None) -> None:
        """Starts a new episode.

        Args:
            world_ids: Worlds to reset, ids or a mask, on the device or not; by default all.
            seed: If given, the random numbers of all worlds restart from this seed.
            key: Keyframe (name or index) to start from; by default the model's own pose. ``"init_state"`` combines the first
                keyframes of the entities.
        """
        self._check_open()
        mask = self._mask(world_ids)
        row = self._key_row(key)
        with wp.ScopedDevice(self._device):
            if seed is not None:
                self._seed = seed
                self._worlds.seed.assign(np.array([seed], np.uint64))
                self._worlds.tick.zero_()
                self._worlds.episode.zero_()
            self._stepper.reset(mask, row)
            self._settle()

    def _start_state(self, key: int | None) -> dict[str, np.ndarray]:
        """Components of the state after a reset, on the host, float64 ``[...]``."""
        row = self._key_row(key)
        shapes = {name: tuple(self._component(name).shape[1:]) for name in self._stepper.starts if name not in MEMORY}
        return {name: self._stepper.starts[name].numpy()[row].astype(np.float64).reshape(shape) for name, shape in shapes.items()}

    def _begin_episodes(self, ids: np.ndarray, keys: Sequence[int], key: int | None, components: dict[str, np.ndarray]) -> None:
        """Begins episodes with these keys of random numbers, in start states of which components are replaced."""
        mask, all_keys = self._mask(ids), np.zeros(self.num_worlds, np.uint32)
        all_keys[ids] = keys
        clocks = self._worlds
        with wp.ScopedDevice(self._device):
            inputs = [mask, wp.array(all_keys, dtype=wp.uint32), clocks.key, clocks.tick, clocks.episode]
            wp.launch(kernels.rekey, self.num_worlds, inputs)
            self._stepper.reset(mask, self._key_row(key))
            for name, values in components.items():
                arrays.write(self._component(name), values, ids)
            self._stepper.apply_ctrl(mask)
            self._settle()

    def forward(self, world_ids: Any = None) -> None:
        """Updates derived quantities and sensors after the state was written."""
        self._check_open()
        mask = self._mask(world_ids)
        with wp.ScopedDevice(self._device):
            self._stepper.apply_ctrl(mask)
            self._settle()

    def _settle(self) -> None:
        """Makes derived quantities and sensors those of the state."""
        self._sensors.state_changed()
        self._behind = False
        self._stepper.settle()
        self._stepper.store_again()
        self._sensors.refresh_every_step()
        self._report()

    def _report(self) -> None:
        """Collects the failures of the last call and raises RuntimeError if contacts or constraints did not fit."""
        with wp.ScopedDevice(self._device):
            status = self._stepper.read_status()
        self._failures = []
        if not status.any():
            return
        for world in np.flatnonzero(status & (kernels.OVERFLOW - 1)).tolist():
            names = [name for bit, name in enumerate(FINITE) if status[world] & (1 << bit)]
            self._failures.append((world, f"{', '.join(names)}: NaN, infinity or a number beyond 1e10; the world was reset"))
        if self._failures:
            failed = arrays.share(self._stepper.failed)
            for sensor in self._sensors.on_host:
                sensor.reset(failed)
        if (status & kernels.OVERFLOW).any():
            limits.check_overflow(self._data, self._limits)
        stale = np.flatnonzero(status & kernels.STALE)
        if len(stale):
            raise RuntimeError(
                f"step(): the positions or velocities of world {stale[0]} were written without a forward() afterwards, "
                "and the step began with derived quantities of the old state: call sim.forward(), or write with "
                "sim.set_state(...)"
            )

    # ------------------------------------------------------------------------------------------------------------ state

    def set_state(self, world_ids: Any = None, *, forward: bool = True, **components: Any) -> None:
        """Writes components of the state, ``set_state(qpos=..., qvel=...)``, then calls forward().

        Values are on the device or not, with the shape ``[n]`` (the same for every world) or ``[worlds, n]``; ``time`` (s) is a
        number or has the shape ``[worlds]``. Sensors' update periods, histories and delays count the steps since the reset,
        whatever ``time`` is.
        """
        self._check_open()
        ids = None if world_ids is None else ids_of_worlds(world_ids, self.num_worlds)
        rows, count = (slice(None), self.num_worlds) if ids is None else (ids, len(ids))
        for name, value in components.items():
            array = self._component(name)
            shape = tuple(value.shape) if hasattr(value, "shape") else np.shape(value)
            if shape not in ((count, *array.shape[1:]), array.shape[1:], (1, *array.shape[1:])):
                raise ValueError(f"{name}: shape {shape} is neither {(count, *array.shape[1:])} nor {array.shape[1:]}")
        if not np.isfinite(on_host(components.get("time", 0.0))).all():
            raise ValueError("time: values must be finite")
        for name, value in components.items():
            arrays.write(self._component(name), value, rows)
        if "time" in components:
            with wp.ScopedDevice(self._device):
                self._stepper.set_times(self._mask(world_ids), self._time)
        if forward:
            self.forward(world_ids)

    qpos = Component("Joint positions [B, nq] (m, rad).")
    qvel = Component("Joint velocities [B, nv] (m/s, rad/s).")
    act = Component("Actuator activations [B, na].")
    ctrl = Component("Controls [B, nu] of the next step.")
    qfrc_applied = Component("Applied generalized forces [B, nv].")
    xfrc_applied = Component("Applied forces (N) and torques (N m) [B, nbody, 6], world frame.")
    mocap_pos = Component("Mocap positions [B, nmocap, 3] (m).")
    mocap_quat = Component("Mocap orientations [B, nmocap, 4].")
    eq_active = Component("Which equality constraints are active [B, neq].")
    userdata = Component("User data [B, nuserdata].")

    def _component(self, name: str) -> wp.array:
        self._check_open()
        if name == "ctrl":
            return self._stepper.ctrl
        if name == "time":
            return self._current_times()
        if name not in STATE:
            raise ValueError(f"the state has no component '{name}'{did_you_mean(name, [*STATE, 'ctrl', 'time'], 'there are')}")
        return scalar_view(getattr(self._data, name))

    def _shared(self, name: str) -> Any:
        if name not in self._views:
            self._views[name] = arrays.share(self._component(name))
        self._check_open()
        return self._views[name]

    @property
    def data(self) -> DerivedFields:
        """Fields of mjData at the current state, ``[B, ...]`` on the device: ``sim.data.xpos``."""
        return DerivedFields(self)

    @property
    def warp_model(self) -> mjw.Model:
        """mujoco_warp's model."""
        return self._model

    @property
    def warp_data(self) -> mjw.Data:
        """mujoco_warp's data. Its ``ctrl`` are the controls of the last step; write those of the next one to ``sim.ctrl``."""
        return self._data

    @property
    def time(self) -> Any:
        """Simulation time of each world, s, float64 ``[B]``; overwritten by the next read. It is 0 after a reset, or the
        keyframe's time, and ``set_state(time=...)`` changes it. Unless it began elsewhere than at 0, it is an exact multiple of
        the substep."""
        return arrays.share(self._current_times())

    def _current_times(self) -> wp.array:
        with wp.ScopedDevice(self._device):
            wp.launch(kernels.times, self.num_worlds, [self.physics_dt, self._worlds.substep, self._worlds.start, self._time])
        return self._time

    @property
    def failures(self) -> list[tuple[int, str]]:
        """``(world, reason)`` of the worlds that failed in the last call; only these worlds were reset."""
        return self._failures

    @property
    def model(self) -> Any:
        """A copy of the compiled model for look-ups, without values that differ between worlds."""
        return self._compiled.model

    @property
    def seed(self) -> int:
        """Seed of the random numbers (noise, delays); set another one with ``reset(seed=...)``."""
        return self._seed

    # ---------------------------------------------------------------------------------------------------- randomisation

    def randomize(self, field: str, values: Any, world_ids: Any = None) -> None:
        """Sets a field of the model per world: ``randomize("geom_friction", values)``.

        Values have the shape ``[worlds, ...]`` or broadcast to it. Only floating-point fields that mujoco_warp keeps by world can
        differ; for others the error lists them.
        """
        self._check_open()
        if field.startswith(PREFIX):
            raise NotImplementedError(
                f"randomize('{field}') is not available with backend='warp': set SceneCfg(options=...), or use backend='cpu'"
            )
        check_randomizable(self._compiled.model, field)
        self._models.array(field)
        for sensor in self._sensors.by_name.values():
            if field in sensor.fixed_fields:
                raise unsupported(sensor.name, f"randomize('{field}')")
        rows = np.arange(self.num_worlds) if world_ids is None else ids_of_worlds(world_ids, self.num_worlds)
        like = np.zeros((len(rows), *getattr(self.model, field).shape), np.float32)
        values = valid_values(self._compiled.model, field, on_host(values), like, rows)
        self._models.write(field, values, rows)
        self.forward(world_ids)

    def model_field(self, name: str) -> Any:
        """A field of the model with one value per world, ``[B, ...]``; see :meth:`randomize`."""
        self._models.array(name)  # raises an error for other fields
        return arrays.share(scalar_view(self._models.by_world(name)))

    # ---------------------------------------------------------------------------------------------------------- general

    def _mask(self, world_ids: Any) -> wp.array:
        if world_ids is None:
            return self._every_world
        mask = np.zeros(self.num_worlds, bool)
        mask[ids_of_worlds(world_ids, self.num_worlds)] = True
        return wp.array(mask, dtype=wp.bool, device=self._device)

    def _key_row(self, key: int | str | None) -> int:
        """Row of the start states."""
        model = self.model
        if isinstance(key, str):
            found = mujoco_names.name2id(model, mujoco_names.Obj.KEY, key)
            if found < 0:
                raise ValueError(f"no keyframe '{key}'; there are {[model.key(i).name for i in range(model.nkey)]}")
            key = found
        if key is not None and not 0 <= key < model.nkey:
            raise ValueError(f"keyframe {key}: the model has {model.nkey}")
        return 0 if key is None else key + 1

    @property
    def closed(self) -> bool:
        """True after close()."""
        return self._closed

    def close(self) -> None:
        """Frees the worlds once no array of them is referenced any more. Every later call raises RuntimeError."""
        self._closed = True
        self._views.clear()
        self._graphs.clear()
        self._compiled.close()

    def _check_open(self) -> None:
        if self._closed:
            raise RuntimeError("the simulation is closed")

    def __enter__(self) -> WarpSimulation:
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    def __repr__(self) -> str:
        if self._closed:
            return "<simulation, closed>"
        return f"<simulation: {counted(self.num_worlds, 'world')} of {self.scene!r} on {self.device}, {self.step_dt:g} s a step>"

    def __getattr__(self, name: str) -> Any:
        if name[0] != "_" and hasattr(type(self._compiled), name):
            raise NotImplementedError(f"Simulation.{name} is not available with backend='warp'; use backend='cpu'")
        raise AttributeError(f"{type(self).__name__} has no attribute '{name}'")


Simulation.register(WarpSimulation)


def _worlds(compiled: Simulation, model: mjw.Model, data: mjw.Data, device: Any) -> Worlds:
    """What sensors can read, with all clocks at 0."""
    count = data.nworld
    seed, key = wp.array([compiled.seed], dtype=wp.uint64), wp.array(np.arange(count), dtype=wp.uint32)
    substep, tick, episode = (wp.zeros(count, dtype=wp.int64) for _ in range(3))
    start, first = wp.zeros(count, dtype=wp.float64), wp.zeros(count, dtype=wp.bool)
    clocks = seed, key, substep, start, tick, episode, first
    return Worlds(compiled, model, data, count, device, compiled.decimation, compiled.physics_dt, *clocks)
