# SPDX-License-Identifier: Apache-2.0
"""Simulations on mujoco_warp: B worlds on one device, with sensors of the same configurations as on the CPU."""

from __future__ import annotations

import difflib
import typing
from collections.abc import Callable, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp
from mujoco_warp._src import types

from mjsense import _core, _mujoco, data
from mjsense._arguments import KnownAttributes, Seed, checked
from mjsense.sensor import Sensor
from mjsense.warp import (
    arrays,
    builtin,
    camera,
    contact,
    effect_sensor,
    host_rows,
    imu,
    kernels,
    lidar,
    limits,
    physics,
    rays,
    user,
)
from mjsense.warp.sensor import REGISTRY, Stage, WarpSensor, Worlds, rows_view, scalar_view, unsupported

if TYPE_CHECKING:
    from mjsense.scene import Scene
    from mjsense.simulation import Simulation

__all__ = [
    "WarpSimulation",
    "builtin",
    "camera",
    "contact",
    "effect_sensor",
    "imu",
    "lidar",
    "rays",
]  # each registers its sensors

_STATE = ("qpos", "qvel", "act", "qfrc_applied", "xfrc_applied", "mocap_pos", "mocap_quat", "eq_active", "userdata")
"""Components of the state, except ctrl, whose values for the next step are not those of the physics."""
_MEMORY = ("qacc_warmstart", "plastic", "history")
"""Fields of Data that a reset restores as well."""
_FINITE = ("qpos", "qvel", "act", "ctrl", "mocap_pos", "mocap_quat", "qacc")
"""Fields in which an invalid number makes a world fail; bit i of the status is that of field i."""
_DERIVED_FROM = ("qpos", "qvel", "mocap_pos", "mocap_quat")
"""State from which the derived quantities at the beginning of a step were computed."""
_SET_CONST = (
    "body_subtreemass", "geom_aabb", "geom_rbound", "tendon_length0", "eq_data", "cam_pos0", "cam_poscom0", "cam_mat0", "light_pos0",
    "light_poscom0", "light_dir0", "dof_invweight0", "body_invweight0", "tendon_invweight0", "actuator_acc0",
)  # fmt: skip
"""Fields of the model that mujoco_warp.set_const computes, and that need a row per world then."""


class _Component:
    """A component of the state as an attribute: the live array ``[B, n]``; assignment writes into it."""

    def __init__(self, text: str) -> None:
        self.__doc__ = text + " Live, float32, on the device; call forward() after writing."

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, sim: WarpSimulation | None, owner: type) -> Any:
        return self if sim is None else sim._shared(self._name)

    def __set__(self, sim: WarpSimulation, value: Any) -> None:
        arrays.write(sim._component(self._name), value)


@checked
class WarpSimulation(KnownAttributes):
    """B parallel worlds of a scene on mujoco_warp, made by ``mjs.Simulation(scene, num_worlds, backend="warp", device="cuda:0")``.

    Arrays are on the device: torch tensors if torch is installed, otherwise ``wp.array``. After ``step()``, ``reset()`` and
    ``forward()``, every sensor belongs to the current state.

    Attributes:
        scene: The scene that all worlds share; ``sim.scene["name"].data`` is a sensor's measurement.
        num_worlds: Number of worlds, ``B``.
        decimation: Physics steps (substeps) per control step.
        physics_dt: Duration of a physics step, s.
        step_dt: Duration of a control step, s.
        device: Name of the device, ``"cuda:0"``.
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
        self._device = _device(device)
        self.device = str(self._device)
        """Name of the device."""
        self.scene: Scene = compiled.scene
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
        self._graphs: dict[Any, Any] = {}
        self._views: dict[str, Any] = {}
        self._moment = 1  # changes with every change of the state
        self._forces_at = 0  # the moment of the current forces
        self._behind = False  # True after step_raw(): derived quantities belong to the state before the step
        model: Any = compiled.model
        with wp.ScopedDevice(self._device):
            _check_sensor_types(model)
            try:
                self._model = mjw.put_model(model)
            except NotImplementedError as error:
                raise ValueError(f"the model is not available with backend='warp': {error}") from None
            self._model.opt.warn_overflow = 0
            physics.check_options(self._model)
            self._limits = limits.sizes(model, nconmax, njmax)
            self._data = mjw.make_data(model, nworld=num_worlds, nconmax=self._limits.nconmax, njmax=self._limits.njmax)
            self._allocate(model)
            self._make_sensors()
        self._complete = True
        for sensor in self._sensors.values():
            if isinstance(sensor, user.UserSensor):
                sensor.initialize()
        self.reset()

    def _allocate(self, model: Any) -> None:
        B, d = self.num_worlds, self._data
        zeros = lambda dtype: wp.zeros(B, dtype=dtype)  # noqa: E731
        self._ctrl = wp.zeros_like(d.ctrl)  # for the next step; d.ctrl has those of the last one
        self._rows = {name: rows_view(getattr(d, name)) for name in (*_STATE, *_MEMORY, "ctrl", "qacc")}
        self._next_ctrl = rows_view(self._ctrl)
        self._known = {name: wp.clone(self._rows[name]) for name in _DERIVED_FROM}
        self._start = _start_states(model, self._rows)
        self._start_row = zeros(wp.int32)
        self._every_world = wp.full(B, True, dtype=wp.bool)
        self._status = zeros(wp.int32)
        self._failed = zeros(wp.bool)
        self._time = zeros(wp.float64)
        self._worlds = Worlds(
            self._compiled, self._model, d, B, self._device, self.decimation, self.physics_dt,
            wp.array([self._seed], dtype=wp.uint64), wp.array(np.arange(B), dtype=wp.uint32), zeros(wp.int64), zeros(wp.int64),
            zeros(wp.int64), zeros(wp.bool),
        )  # fmt: skip

    # ---------------------------------------------------------------------------------------------------------- sensors

    def _make_sensors(self) -> None:
        reader = _Reader(self)
        self._sensors: dict[str, WarpSensor] = self._worlds.sensors
        self._used: list[WarpSensor] = []  # computed with every step, inputs first
        self._moments: dict[str, int] = {}
        for name in list(self.scene.sensors):
            self._make_sensor(name, reader)
        for made in self._sensors.values():
            if made.every_step:
                self._use(made)
        self._substepped = [made for made in self._sensors.values() if made.wants_substep]
        self._substep_stage = max((made.needs for made in self._substepped), default=Stage.NONE)

    def _make_sensor(self, name: str, reader: _Reader) -> None:
        if name in self._sensors:
            return
        sensor: Any = self.scene.sensors[name]
        if isinstance(sensor, Sensor):
            self._sensors[name] = user.UserSensor(self._worlds, sensor, self, reader)
            return
        if sensor.kind == "contact_field" and not contact.has_field(self._worlds, name):
            del self.scene._sensors[name]
            return
        if sensor.kind == "effect":
            self._make_sensor(sensor.cfg.sensor, reader)
        make = REGISTRY.get(sensor.kind)
        if make is None:
            raise unsupported(name, f"a sensor of kind {sensor.kind}")
        sensor._bind(self._compiled._core)  # so that its values in the compiled world can be read
        made = self._sensors[name] = make(self._worlds, sensor)
        sensor._core = reader
        shared = {field: arrays.share(array) for field, array in made.fields.items()}
        sensor._fields = MappingProxyType(shared)
        sensor._data = shared[""] if "" in shared else data.make_data(data.DATA_OF_KIND.get(sensor.kind, data.SensorData), shared)

    def _use(self, sensor: WarpSensor) -> None:
        """Computes this sensor with every step from now on."""
        for source in sensor.inputs:
            self._use(source)
        if sensor not in self._used and not sensor.on_host:
            self._used.append(sensor)
            self._graphs.clear()

    def _refresh(self, sensor: WarpSensor, again: bool = False) -> None:
        """Computes the sensor for the current state if it is not up to date, or ``again``."""
        self._check_open()
        if self._moments.get(sensor.name) != self._moment or again:
            self._compute(sensor)
        if (check := getattr(sensor, "check", None)) is not None:
            check()

    def _compute(self, sensor: WarpSensor) -> None:
        for source in sensor.inputs:
            self._refresh(source)
        with wp.ScopedDevice(self._device):
            if sensor.needs == Stage.ACC and self._forces_at != self._moment:
                physics.compute_forces(self._model, self._data)
                self._forces_at = self._moment
            sensor.update()
        self._moments[sensor.name] = self._moment
        self._use(sensor)

    def add(self, sensor: Any) -> Any:
        """Sensors are parts of the scene with this backend."""
        raise NotImplementedError("Simulation.add() is not available with backend='warp': put the sensor into SceneCfg.sensors")

    def refresh(self, sensors: Sequence[Any]) -> None:
        """Computes several sensors (as returned by ``scene["name"]``)."""
        for sensor in sensors:
            self._refresh(self._sensors[sensor.name])

    def _host_rows(self, sensors: Sequence[Any]) -> host_rows.HostRows:
        """The rows of these sensors for a recorder."""
        return host_rows.HostRows(
            sensors, [self._sensors[sensor.name].fields for sensor in sensors], self.num_worlds, self._device
        )

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
            self._moment += 1
            self._run("step", self._control_step)
            if self._substep_stage == Stage.ACC or any(s.needs == Stage.ACC for s in self._used):
                self._forces_at = self._moment
            self._moments.update((sensor.name, self._moment) for sensor in self._used)
            self._report()
            failures += self._failures
            for sensor in self._sensors.values():
                if sensor.on_host:
                    sensor.substep()
        self._failures = failures

    def step_raw(self, substeps: int = 1) -> None:
        """Steps all worlds as mujoco_warp does: derived quantities stay one substep behind the state, as in MuJoCo and mjlab."""
        self._check_open()
        for _ in range(substeps):
            self._run("step_raw behind" if self._behind else "step_raw", self._raw_step)
            self._behind = True
        self._moment += 1
        self._forces_at = self._moment
        self._report()

    def _raw_step(self) -> None:
        clocks = self._worlds
        self._status.zero_()
        self._data.overflow.zero_()
        wp.copy(self._data.ctrl, self._ctrl)
        if self._behind:
            physics.compute_velocities(self._model, self._data)
        physics.compute_forces(self._model, self._data)
        physics.integrate(self._model, self._data)
        wp.launch(
            kernels.advance_clocks, self.num_worlds, [self.physics_dt, clocks.substep, clocks.tick, clocks.first, self._data.time]
        )
        self._restore_failed(begin=True)
        for sensor in self._sensors.values():
            if not sensor.on_host:
                sensor.reset(self._failed)

    def update_sensors(self, dt: float = 0.0) -> None:
        """Updates the sensors' per-substep state (air time, history) once, after ``step_raw(1)``. ``dt`` is in s, the timestep or
        0."""
        if dt not in (0.0, self.physics_dt):
            raise ValueError(
                f"update_sensors(): dt is {dt} s, and the timestep is {self.physics_dt} s; others are not available with backend='warp'"
            )
        with wp.ScopedDevice(self._device):
            for sensor in [*self._substepped, *(sensor for sensor in self._sensors.values() if sensor.on_host)]:
                sensor.substep()

    def reset_sensors(self, world_ids: Any = None) -> None:
        """Resets the sensors' episode state in these worlds without resetting the physics."""
        mask = self._mask(world_ids)
        self._moment += 1
        if self._behind:
            self._forces_at = self._moment
        with wp.ScopedDevice(self._device):
            for sensor in self._sensors.values():
                sensor.reset(mask)

    def _run(self, name: str, function: Callable[[], None]) -> None:
        """Calls the function, on CUDA devices as a graph from the second call on."""
        with wp.ScopedDevice(self._device):
            if not self._device.is_cuda:
                function()
            elif name not in self._graphs:
                function()  # compiles the kernels and allocates
                self._graphs[name] = None
            else:
                if self._graphs[name] is None:
                    with wp.ScopedCapture() as capture:
                        function()
                    self._graphs[name] = capture.graph
                wp.capture_launch(self._graphs[name])

    def _control_step(self) -> None:
        B, m, d = self.num_worlds, self._model, self._data
        self._status.zero_()
        d.overflow.zero_()
        for name in _DERIVED_FROM:
            self._launch_rows(kernels.flag_changed, name, [self._rows[name], self._known[name], self._status])
        wp.copy(d.ctrl, self._ctrl)
        clocks = self._worlds
        has_forces = False
        for substep in range(self.decimation):
            if not has_forces:
                physics.compute_forces(m, d)
            physics.integrate(m, d)
            wp.launch(kernels.advance_clocks, B, [self.physics_dt, clocks.substep, clocks.tick, clocks.first, d.time])
            self._restore_failed(begin=substep == self.decimation - 1)
            physics.compute_velocities(m, d)
            has_forces = self._substep_stage == Stage.ACC
            if has_forces:
                physics.compute_forces(m, d)
            for sensor in self._substepped:
                sensor.substep()
        self._remember()
        for sensor in self._sensors.values():
            if not sensor.on_host:
                sensor.reset(self._failed)
        self._update_used(has_forces)

    def _update_used(self, has_forces: bool) -> None:
        if not has_forces and any(sensor.needs == Stage.ACC for sensor in self._used):
            physics.compute_forces(self._model, self._data)
        for sensor in self._used:
            if not (sensor.wants_substep and sensor.substep_fills_rows):
                sensor.update()

    def _launch_rows(self, kernel: Any, name: str, inputs: list[Any]) -> None:
        wp.launch(kernel, (self.num_worlds, self._rows[name].shape[1]), inputs)

    def _restore_failed(self, begin: bool) -> None:
        """Gives worlds with invalid numbers the state of their last reset. ``begin``: their next episode begins now."""
        for bit, name in enumerate(_FINITE):
            self._launch_rows(kernels.flag_invalid, name, [self._rows[name], 1 << bit, self._status])
        wp.launch(kernels.failed_worlds, self.num_worlds, [self._status, self._failed])
        self._restore(self._failed)
        if begin:
            self._begin_episode(self._failed)

    def _restore(self, mask: wp.array) -> None:
        for name, source in self._start.items():
            self._launch_rows(kernels.copy_rows, name, [mask, self._start_row, source, self._rows[name]])
        self._launch_rows(kernels.copy_rows, "ctrl", [mask, self._start_row, self._start["ctrl"], self._next_ctrl])
        self._launch_rows(kernels.copy_qpos0, "qpos", [mask, self._start_row, rows_view(self._model.qpos0), self._rows["qpos"]])

    def _begin_episode(self, mask: wp.array) -> None:
        clocks = self._worlds
        wp.launch(kernels.begin_episode, self.num_worlds, [mask, clocks.substep, clocks.episode, clocks.first, self._data.time])

    def _remember(self) -> None:
        for name, known in self._known.items():
            wp.copy(known, self._rows[name])

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
            wp.launch(
                kernels.copy_rows,
                (self.num_worlds, 1),
                [mask, self._start_row, wp.array([[row]], dtype=wp.int32), self._start_row.reshape((-1, 1))],
            )
            self._restore(mask)
            self._begin_episode(mask)
            for sensor in self._sensors.values():
                sensor.reset(mask)
            self._settle()

    def forward(self, world_ids: Any = None) -> None:
        """Updates derived quantities and sensors after the state was written."""
        self._check_open()
        mask = self._mask(world_ids)
        with wp.ScopedDevice(self._device):
            self._launch_rows(kernels.copy_rows, "ctrl", [mask, self._identity(), self._next_ctrl, self._rows["ctrl"]])
            self._settle()

    def _identity(self) -> wp.array:
        return wp.array(np.arange(self.num_worlds), dtype=wp.int32)

    def _settle(self) -> None:
        """Makes derived quantities those of the state, after resetting the worlds in which it contains invalid numbers."""
        self._moment += 1
        self._behind = False
        self._status.zero_()
        self._data.overflow.zero_()
        self._data.qacc.zero_()  # may contain invalid numbers of an earlier state
        self._restore_failed(begin=True)
        for sensor in self._sensors.values():
            if not sensor.on_host:
                sensor.reset(self._failed)
        physics.compute_velocities(self._model, self._data)
        self._remember()
        for sensor in self._used:
            if sensor.every_step:
                self._refresh(sensor)
        self._report()

    def _report(self) -> None:
        """Collects the failures of the last call and raises RuntimeError if contacts or constraints did not fit."""
        data = self._data
        counts = [data.nefc, data.nacon, data.ncollision, data.overflow]
        with wp.ScopedDevice(self._device):
            wp.launch(kernels.flag_overflow, self.num_worlds, [limits.ERRORS, data.njmax, data.naconmax, *counts, self._status])
        status = self._status.numpy()  # waits for the device
        self._failures = []
        if not status.any():
            return
        for world in np.flatnonzero(status & (kernels.OVERFLOW - 1)).tolist():
            names = [name for bit, name in enumerate(_FINITE) if status[world] & (1 << bit)]
            self._failures.append((world, f"{', '.join(names)}: NaN, infinity or a number beyond 1e10; the world was reset"))
        if self._failures:
            failed = arrays.share(self._failed)
            for sensor in self._sensors.values():
                if sensor.on_host:
                    sensor.reset(failed)
        if (status & kernels.OVERFLOW).any():
            limits.check_overflow(data, self._limits)
        stale = np.flatnonzero(status & kernels.STALE)
        if len(stale):
            raise RuntimeError(
                f"step(): the positions or velocities of world {stale[0]} were written without a forward() afterwards, "
                "and the step began with derived quantities of the old state: call sim.forward(), or write with sim.set_state(...)"
            )

    # ------------------------------------------------------------------------------------------------------------ state

    def set_state(self, world_ids: Any = None, *, forward: bool = True, **components: Any) -> None:
        """Writes components of the state, ``set_state(qpos=..., qvel=...)``, then calls forward().

        Values are on the device or not, with the shape ``[n]`` (the same for every world) or ``[worlds, n]``.
        """
        self._check_open()
        ids = None if world_ids is None else _ids(world_ids, self.num_worlds)
        rows, count = (slice(None), self.num_worlds) if ids is None else (ids, len(ids))
        for name, value in components.items():
            array = self._component(name)
            shape = tuple(value.shape) if hasattr(value, "shape") else np.shape(value)
            if shape not in ((count, *array.shape[1:]), array.shape[1:], (1, *array.shape[1:])):
                raise ValueError(f"{name}: shape {shape} is neither {(count, *array.shape[1:])} nor {array.shape[1:]}")
        for name, value in components.items():
            arrays.write(self._component(name), value, rows)
        if forward:
            self.forward(world_ids)

    qpos = _Component("Joint positions [B, nq] (m, rad).")
    qvel = _Component("Joint velocities [B, nv] (m/s, rad/s).")
    act = _Component("Actuator activations [B, na].")
    ctrl = _Component("Controls [B, nu] of the next step.")
    qfrc_applied = _Component("Applied generalized forces [B, nv].")
    xfrc_applied = _Component("Applied forces (N) and torques (N m) [B, nbody, 6], world frame.")
    mocap_pos = _Component("Mocap positions [B, nmocap, 3] (m).")
    mocap_quat = _Component("Mocap orientations [B, nmocap, 4].")
    eq_active = _Component("Which equality constraints are active [B, neq].")
    userdata = _Component("User data [B, nuserdata].")

    def _component(self, name: str) -> wp.array:
        self._check_open()
        if name == "ctrl":
            return self._ctrl
        if name not in _STATE:
            near = difflib.get_close_matches(name, [*_STATE, "ctrl"], 3)
            hint = f"did you mean {' or '.join(map(repr, near))}?" if near else f"there are {', '.join([*_STATE, 'ctrl'])}"
            raise ValueError(f"the state has no component '{name}'; {hint}")
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
        """Simulation time of each world since its reset, s, float64 ``[B]``; an exact multiple of the substep."""
        with wp.ScopedDevice(self._device):
            wp.launch(kernels.times, self.num_worlds, [self.physics_dt, self._worlds.substep, self._time])
        return arrays.share(self._time)

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
        self._compiled._check_randomizable(field)
        self._model_array(field)
        for sensor in self._sensors.values():
            if field in sensor.fixed_fields:
                raise unsupported(sensor.name, f"randomize('{field}')")
        rows = np.arange(self.num_worlds) if world_ids is None else _ids(world_ids, self.num_worlds)
        like = np.zeros((len(rows), *getattr(self.model, field).shape), np.float32)
        values = self._compiled._valid_values(field, arrays.on_host(values), like, rows)
        with wp.ScopedDevice(self._device):
            array = self._by_world(field)
            host = array.numpy()
            host[rows] = values.reshape(host[rows].shape)
            array.assign(host)
            physics.place_fixed_geoms(field, self._model, self._data)
            if field in _core.setconst_inputs():
                for name in _SET_CONST:
                    if hasattr(self._model, name):
                        self._by_world(name)
                mjw.set_const(self._model, self._data)
        self.forward(world_ids)

    def model_field(self, name: str) -> Any:
        """A field of the model with one value per world, ``[B, ...]``; see :meth:`randomize`."""
        array = self._model_array(name)
        return arrays.share(scalar_view(array if array.shape[0] == self.num_worlds else self._by_world(name)))

    def _by_world(self, field: str) -> wp.array:
        """The array of a model field, with a row for each world."""
        array = getattr(self._model, field)
        if array.shape[0] != self.num_worlds:
            rows = np.repeat(array.numpy()[:1], self.num_worlds, axis=0)
            array = wp.array(rows, dtype=array.dtype, device=self._device)
            setattr(self._model, field, array)
            self._graphs.clear()
        return array

    def _model_array(self, field: str) -> wp.array:
        by_world = _model_fields()
        if field not in by_world:
            near = difflib.get_close_matches(field, by_world, 3)
            hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
            raise ValueError(
                f"{field}: not a field of the model that can differ between worlds with backend='warp'{hint} There are {', '.join(by_world)}"
            )
        return getattr(self._model, field)

    # ---------------------------------------------------------------------------------------------------------- general

    def _mask(self, world_ids: Any) -> wp.array:
        if world_ids is None:
            return self._every_world
        mask = np.zeros(self.num_worlds, bool)
        mask[_ids(world_ids, self.num_worlds)] = True
        return wp.array(mask, dtype=wp.bool, device=self._device)

    def _key_row(self, key: int | str | None) -> int:
        """Row of the start states."""
        model = self.model
        if isinstance(key, str):
            found = _mujoco.name2id(model, _mujoco.Obj.KEY, key)
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
        return f"<simulation: {self.num_worlds} worlds of {self.scene!r} on {self.device}, {self.step_dt:g} s a step>"

    def __getattr__(self, name: str) -> Any:
        if name[0] != "_" and hasattr(type(self._compiled), name):
            raise NotImplementedError(f"Simulation.{name} is not available with backend='warp'; use backend='cpu'")
        raise AttributeError(f"{type(self).__name__} has no attribute '{name}'")


class _Reader:
    """What the Python objects of the scene's sensors call to read their arrays."""

    def __init__(self, sim: WarpSimulation) -> None:
        self._sim = sim
        self.meansize = float(sim.model.stat.meansize)

    @property
    def closed(self) -> bool:
        return self._sim.closed

    def refresh(self, handle: Any, again: bool = False) -> None:
        self._sim._refresh(self._sim._sensors[handle.name], again)

    def draw(self, *_: Any) -> Any:
        raise NotImplementedError("debug drawing is not available with backend='warp'; use backend='cpu'")


class DerivedFields:
    """Fields of mjData of all worlds at the current state, on the device: ``sim.data.xpos`` is float32 ``[B, nbody, 3]``."""

    def __init__(self, sim: WarpSimulation) -> None:
        self._sim = sim

    def __dir__(self) -> list[str]:
        data = self._sim._data
        return sorted(name for name in vars(data) if isinstance(getattr(data, name), wp.array))

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        sim = self._sim
        sim._check_open()
        if name in _STATE or name == "ctrl":
            return sim._shared(name)
        array = getattr(sim._data, name, None)
        if not isinstance(array, wp.array):
            near = difflib.get_close_matches(name, dir(self), 3)
            hint = f"; did you mean {' or '.join(map(repr, near))}?" if near else ""
            raise AttributeError(f"mujoco_warp's Data has no array '{name}'{hint}")
        if sim._forces_at != sim._moment:
            with wp.ScopedDevice(sim._device):
                physics.compute_forces(sim._model, sim._data)
            sim._forces_at = sim._moment
        return arrays.share(scalar_view(array))


def _device(name: str | None) -> Any:
    if name is None:
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    try:
        return wp.get_device(name)
    except Exception:
        known = ", ".join(str(device) for device in wp.get_devices())
        raise ValueError(f"device '{name}': there is no such device; there are {known}") from None


def _ids(world_ids: Any, count: int) -> np.ndarray:
    ids = arrays.on_host(world_ids)
    if ids.dtype == bool:
        if ids.shape != (count,):
            raise ValueError(f"world_ids: a mask of shape {ids.shape} for {count} worlds")
        return np.flatnonzero(ids)
    if ids.size and not np.issubdtype(ids.dtype, np.integer):
        raise TypeError(f"world_ids must be integers or a mask, not {world_ids!r}")
    for world in ids.reshape(-1).tolist():
        if not 0 <= world < count:
            raise ValueError(f"world id {world}: must be in [0, {count})")
    return ids.reshape(-1).astype(np.int64)


def _start_states(model: Any, rows: dict[str, wp.array]) -> dict[str, wp.array]:
    """The state components after a reset, ``[1 + nkey, n]``: row 0 is the model's own pose, row 1 + k keyframe k."""
    states: dict[str, list[np.ndarray]] = {name: [] for name in (*_STATE, "ctrl")}
    start = mujoco.MjData(model)
    for key in range(-1, model.nkey):
        mujoco.mj_resetDataKeyframe(model, start, key) if key >= 0 else mujoco.mj_resetData(model, start)
        for name, values in states.items():
            values.append(np.array(getattr(start, name)).reshape(-1))
    result = {name: wp.array(np.stack(values), dtype=rows[name].dtype, ndim=2) for name, values in states.items()}
    result |= {name: wp.array(rows[name].numpy()[:1], dtype=rows[name].dtype, ndim=2) for name in _MEMORY}
    return result


def _check_sensor_types(model: Any) -> None:
    """Raises ValueError with all sensors whose types mujoco_warp lacks."""
    known = {int(kind) for kind in types.SensorType}
    missing = [
        f"'{model.sensor(i).name}' ({mujoco.mjtSensor(kind).name.removeprefix('mjSENS_').lower()})"
        for i, kind in enumerate(model.sensor_type)
        if int(kind) not in known
    ]
    if missing:
        raise ValueError(f"sensors whose types are not available with backend='warp': {', '.join(missing)}; use backend='cpu'")


def _model_fields() -> list[str]:
    """Floating-point fields of mujoco_warp's model that can have a row per world."""
    hints = typing.get_type_hints(mjw.Model, include_extras=True)
    names = []
    for name, hint in hints.items():
        shape, dtype = getattr(hint, "shape", ()), getattr(hint, "dtype", None)
        scalar = getattr(dtype, "_wp_scalar_type_", dtype)
        if shape and shape[0] == "*" and scalar in (float, wp.float32) and hasattr(mujoco.MjModel, name):
            names.append(name)
    return sorted(names)
