# SPDX-License-Identifier: Apache-2.0
"""Simulations: B worlds of one scene that are stepped together, with sensors that are always up to date."""

from __future__ import annotations

import inspect
from abc import ABCMeta
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal, overload

import numpy as np
from numpy.typing import NDArray

from mjsense import _core
from mjsense.core import mujoco_names, representations
from mjsense.core.arguments import KnownAttributes, Seed, checked
from mjsense.core.arrays import ids_of_worlds
from mjsense.core.counted import counted
from mjsense.core.errors import UnknownNameError, did_you_mean
from mjsense.core.later_rooms import provided
from mjsense.scene.physics_options import Options
from mjsense.scene.scene import Scene
from mjsense.scene.written_values import numbers, write_component
from mjsense.sensors.drawing import DebugShapes
from mjsense.sensors.given_sensor import as_sensor
from mjsense.sensors.native_sensor import NativeSensor
from mjsense.sensors.sensor import Sensor
from mjsense.sim.derived_fields import DerivedFields
from mjsense.sim.world_models import WorldModels

if TYPE_CHECKING:
    import mujoco


class _State:
    """A component of the state as an attribute of a simulation: the live array ``[B, n]``; assignment writes into it."""

    def __init__(self, text: str) -> None:
        self.__doc__ = text + " Live, float64; call forward() after writing."

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    @overload
    def __get__(self, sim: None, owner: type) -> _State: ...
    @overload
    def __get__(self, sim: Simulation, owner: type) -> NDArray[np.float64]: ...
    def __get__(self, sim: Simulation | None, owner: type) -> _State | NDArray[np.float64]:
        return self if sim is None else sim._component(self._name)

    def __set__(self, sim: Simulation, value: Any) -> None:
        write_component(self._name, sim._component(self._name), value)


@checked
class Simulation(KnownAttributes, metaclass=ABCMeta):  # WarpSimulation is registered as a virtual subclass
    """B parallel worlds of a scene.

    After ``step()``, ``reset()`` and ``forward()``, every derived quantity and every sensor belongs to the current state. Worlds
    are independent, and results are equal bit for bit for any number of threads.

    Attributes:
        scene: The scene that all worlds share; ``sim.scene["name"].data`` is a sensor's measurement.
        num_worlds: Number of worlds, ``B``.
        decimation: Physics steps (substeps) per control step.
        physics_dt: Duration of a physics step, s.
        step_dt: Duration of a control step, s.
    """

    _stepped_elsewhere = False

    def __new__(cls, *args: Any, backend: str = "cpu", **options: Any) -> Simulation:
        return provided("warp_simulation")(*args, **options) if backend == "warp" else super().__new__(cls)

    def __init__(
        self,
        scene: Scene,
        num_worlds: int | None = None,
        decimation: int = 1,
        threads: int = 0,
        seed: Seed = 0,
        *,
        backend: Literal["cpu", "warp"] = "cpu",
        device: str | None = None,
        nconmax: int | None = None,
        njmax: int | None = None,
    ) -> None:
        """
        Args:
            scene: The scene. Its sensors belong to this simulation from now on, so that a second simulation needs its own scene.
            num_worlds: Number of worlds, ``B``; by default the scene's ``num_envs``.
            decimation: Physics steps (substeps) per control step.
            threads: Number of threads; 0: one per CPU that is available to this process.
            seed: Seed of the random numbers (noise, delays).
            backend: ``"cpu"``, or ``"warp"``: the physics of mujoco_warp and sensors on its device. The result is then a
                :class:`mjsense.warp.simulation.WarpSimulation`, which ``isinstance`` regards as a ``Simulation``. Attributes that
                it does not have raise NotImplementedError.
            device: With warp: ``"cpu"``, ``"cuda:0"`` ...; by default the first CUDA device, or the CPU without one.
            nconmax: With warp: contacts for which each world has memory, on average over the worlds.
            njmax: With warp: constraint rows for which each world has memory.
        """
        if backend != "cpu":
            raise ValueError(f"Simulation(): backend must be 'cpu' or 'warp', not '{backend}'")
        for name, value in {"device": device, "nconmax": nconmax, "njmax": njmax}.items():
            if value is not None:
                raise ValueError(f"Simulation(): {name} is for backend='warp'")
        if scene._simulation is not None:
            raise RuntimeError("this scene belongs to a simulation already: make another with Scene(scene.cfg)")
        num_worlds = scene.cfg.num_envs if num_worlds is None else num_worlds
        self._core = _core.Simulation(scene._core, num_worlds, decimation, threads, seed)
        scene._simulation = self._core
        self._adopt(scene)

    @classmethod
    def _of(cls, core: Any, prepared: Scene | None = None, view: Any = None) -> Simulation:
        """Wraps a C++ simulation that is stepped elsewhere.

        Args:
            prepared: The Python scene that it was created from, if any.
            view: View of the task that is played in it.
        """
        self = cls.__new__(cls)
        self._core = core
        self._stepped_elsewhere = True
        scene = Scene._of(core.scene(), prepared)
        scene._simulation = core
        self._adopt(scene, view)
        return self

    def _adopt(self, scene: Scene, view: Any = None) -> None:
        self._begin(scene, view)
        for sensor in scene.sensors.values():
            if isinstance(sensor, Sensor):
                self._core.own_sensor(sensor._mjs_handle)
                self._own(sensor, sensor._mjs_handle)
            else:
                sensor._bind(self._core)
        self._complete = True

    @classmethod
    def _compiled(cls, scene: Scene, decimation: int, seed: int) -> Simulation:
        """One world that checks the scene and has its ids; the scene's sensors do not read it."""
        self = cls.__new__(cls)
        self._core = _core.Simulation(scene._core, 1, decimation, 1, seed)
        self._begin(scene)
        return self

    def _begin(self, scene: Scene, view: Any = None) -> None:
        self.scene = scene
        self._view = view
        self._env: Any = None
        self.num_worlds: int = self._core.num_worlds
        """Number of worlds, ``B``."""
        self.decimation: int = self._core.decimation
        """Physics steps (substeps) per control step."""
        self.physics_dt: float = self._core.physics_dt
        """Duration of a physics step, s."""
        self.step_dt: float = self._core.step_dt
        """Duration of a control step, s."""
        self._views: dict[str, np.ndarray] = {}
        self._python: list[Sensor] = []
        self._derived: dict[str, tuple[Any, np.ndarray]] = {}
        self._models = WorldModels(self._core)

    def __repr__(self) -> str:
        if self._core.closed:
            return "<simulation, closed>"
        return f"<simulation: {counted(self.num_worlds, 'world')} of {self.scene!r}, {self.step_dt:g} s a step>"

    def _repr_html_(self) -> str:
        """HTML for notebooks: the worlds, user-defined sensors, and the scene, folded."""
        if self._core.closed:
            return representations.block(repr(self), "")
        facts = [
            ("worlds", self.num_worlds),
            ("control step", f"{self.step_dt:g} s, {self.decimation} substeps"),
            ("time of world 0", f"{self.time[0]:g} s"),
            ("entities", ", ".join(self.scene.entities)),
            ("seed", self.seed),
        ]
        facts += [
            (f"{name} (MuJoCo's warning)", f"{counts.sum()} times, in {counted(int(np.count_nonzero(counts)), 'world')}")
            for name, counts in self.warning_counts.items()
        ]
        own = "".join(sensor._repr_html_() for sensor in self._python)
        return representations.block(
            "simulation", representations.grid(("", ""), facts) + own, {"scene and its sensors": self.scene._repr_html_()}
        )

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *exception: Any) -> None:
        self.close()

    @property
    def closed(self) -> bool:
        """True after close()."""
        return self._core.closed

    def close(self) -> None:
        """Frees the worlds once no array of them is referenced any more. Every later call raises RuntimeError."""
        self._views.clear()
        self._models.clear()
        self._core.close()

    # --------------------------------------------------------------------------------------------------------- physics

    def step(self, control_steps: int = 1) -> None:
        """Advances every world by control steps of ``decimation`` substeps each."""
        if control_steps <= 1:  # The core reports 0 as an error.
            self._core.step(control_steps)
            return
        # One at a time, so that Ctrl-C is handled between two steps.
        for _ in range(control_steps):
            self._core.step(1)

    def reset(self, world_ids: Sequence[int] | None = None, *, seed: Seed | None = None, key: int | str | None = None) -> None:
        """Starts a new episode.

        Args:
            world_ids: Worlds to reset; by default all.
            seed: If given, the random numbers of all worlds restart from this seed.
            key: Keyframe (name or index) to start from; by default the model's own pose. ``"init_state"`` combines the first
                keyframes of the entities; keyframes of a scene's base keep their own names and indices.
        """
        if isinstance(key, str):
            found = mujoco_names.name2id(self.model, mujoco_names.Obj.KEY, key)
            if found < 0:
                names = [self.model.key(i).name for i in range(self.model.nkey)]
                raise ValueError(f"no keyframe '{key}'; there are {names}")
            key = found
        elif key is not None and key < -1:
            raise ValueError(f"keyframe {key}: the model has {self.model.nkey} keyframes (-1: the model's defaults)")
        self._core.reset(self._ids(world_ids), -1 if key is None else key, seed)

    def forward(self, world_ids: Sequence[int] | None = None) -> None:
        """Updates derived quantities and sensors after the state was written."""
        self._core.forward(self._ids(world_ids))

    def set_state(self, world_ids: Sequence[int] | None = None, *, forward: bool = True, **components: Any) -> None:
        """Writes components of the state, ``set_state(qpos=..., qvel=...)``, then calls forward().

        The components are those of the attributes qpos, qvel, act, ctrl ... Values have the shape ``[n]`` (the same for every
        world) or ``[worlds, n]``; ``time`` (s) is a number or has the shape ``[worlds]``. Sensors' update periods, histories and
        delays count the steps since the reset, whatever ``time`` is. With ``forward=False``, derived quantities are computed when
        they are read.
        """
        rows = self._rows(world_ids)
        checked = []
        for name, value in components.items():
            view = self._component(name)
            value = numbers(name, value)
            target = view[rows]
            if value.shape not in (target.shape, target.shape[1:], (1, *target.shape[1:])):
                raise ValueError(f"{name}: shape {value.shape} is neither {target.shape} nor {target.shape[1:]}")
            checked.append((view, value))
        for view, value in checked:
            view[rows] = value
        if forward:
            self.forward(world_ids)
        else:
            self._core.invalidate(self._ids(world_ids))

    @property
    def state(self) -> NDArray[np.float64]:
        """The complete integration state (mjSTATE_INTEGRATION), float64 ``[B, nstate]``. The array is live; copy it to keep
        it."""
        if "state" not in self._views or self._core.closed:
            self._views["state"] = self._core.state()
        return self._views["state"].view()

    qpos = _State("Joint positions [B, nq] (m, rad).")
    qvel = _State("Joint velocities [B, nv] (m/s, rad/s).")
    act = _State("Actuator activations [B, na].")
    ctrl = _State("Controls [B, nu].")
    qfrc_applied = _State("Applied generalized forces [B, nv].")
    xfrc_applied = _State("Applied forces (N) and torques (N m) [B, nbody, 6], world frame.")
    mocap_pos = _State("Mocap positions [B, nmocap, 3] (m).")
    mocap_quat = _State("Mocap orientations [B, nmocap, 4].")
    eq_active = _State("Which equality constraints are active [B, neq].")
    userdata = _State("User data [B, nuserdata].")

    @property
    def env(self) -> Any:
        """The worlds in the interface of sensors written for MolmoSpaces: the first argument of ``get_observation(env, task,
        batch_index)``."""
        if self._env is None:
            self._env = provided("env")(self, self._view)
        return self._env

    @property
    def data(self) -> DerivedFields:
        """Fields of mjData at the current state, ``[B, ...]``: ``sim.data.xpos``."""
        return DerivedFields(self)

    @property
    def time(self) -> NDArray[np.float64]:
        """Simulation time of each world, s, ``[B]``, a copy. It is 0 after a reset, or the keyframe's time, and
        ``set_state(time=...)`` changes it. Unless it began elsewhere than at 0, it is an exact multiple of the substep."""
        counted, summed = np.array(self._core.times()), self._component("time")
        # MuJoCo adds the timestep in each step, and each sum is rounded. A larger difference was written.
        rounding = np.finfo(float).eps * counted * (counted / self.physics_dt)
        return np.where(np.abs(summed - counted) <= rounding, counted, summed)

    @property
    def failures(self) -> list[tuple[int, str]]:
        """``(world, reason)`` of the worlds that failed in the last call, with MuJoCo's message. Only these worlds were reset.
        After :meth:`step_raw`, only worlds in which MuJoCo raised an error: worlds that diverge there are reset by MuJoCo
        without a report."""
        return self._core.failures()

    @property
    def warning_counts(self) -> dict[str, np.ndarray]:
        """Number of warnings that MuJoCo has raised since construction, int ``[B]`` by the warning's name,
        ``"mjWARN_CONTACTFULL"``.

        Warnings that were never raised are absent. MuJoCo also prints the first warning of each name, with its world.
        """
        counts = {name: np.array(row) for name, row in zip(mujoco_names.WARNINGS, self._core.warning_counts())}
        return {name: row for name, row in counts.items() if row.any()}

    @property
    def model(self) -> mujoco.MjModel:
        """A read-only copy of the simulated model, for look-ups and MuJoCo's functions. It does not contain values that differ
        between
        worlds: see :meth:`model_of`; and :attr:`options` and :meth:`randomize` for changes. ``copy.copy(sim.model)`` can be
        changed."""
        return self._models.shared

    @property
    def options(self) -> Options:
        """Gravity, wind, flags and the other physics options of the running simulation:
        ``sim.options.gravity = (0, 0, -1.62)``."""
        return Options(self)

    def _set_timestep(self, seconds: float) -> None:
        """See :attr:`Options.timestep`."""
        if self._stepped_elsewhere:
            raise ValueError(
                "timestep: it cannot change in environments and recordings, whose control periods are multiples of "
                "it; set sim_dt_ms"
            )
        self._core.set_timestep(seconds)
        self.physics_dt, self.step_dt = self._core.physics_dt, self._core.step_dt
        self._models.timestep_changed()

    def model_of(self, world: int) -> mujoco.MjModel:
        """A copy of the model with the values of one world: those set by :meth:`randomize`, and the sizes, furniture, lights and
        colours of its episode.

        Each world has one copy, created at its first use, with the full memory of a model. It follows :meth:`randomize`; changes
        by a new episode or by writing to :meth:`model_field` are copied by the next call. Changing the copy does not affect the
        simulation.
        """
        (world,) = self._rows([world]).tolist()
        return self._models.of(world)

    @property
    def threads(self) -> int:
        """Number of threads that step the worlds and trace rays."""
        return self._core.threads

    @property
    def seed(self) -> int:
        """Seed of the random numbers (noise, delays); set another one with ``reset(seed=...)``."""
        return self._core.seed

    def randomize(self, field: str, values: Any, world_ids: Sequence[int] | None = None) -> None:
        """Sets a field of the model per world: ``randomize("geom_friction", values)``, or an option,
        ``randomize("opt.gravity", values)``.

        Values have the shape ``[worlds, ...]`` or broadcast to it. Quantities that MuJoCo derives from the field, rays and images
        follow. Raises ValueError for fields that cannot differ between worlds (meshes, height fields, texture pixels), for a
        wrong shape, for values that are not finite, and for those that MuJoCo cannot use.
        """
        worlds = np.arange(self.num_worlds)
        if self._models.randomize(field, values, worlds[self._rows(world_ids)]):
            self.forward(world_ids)

    def model_field(self, name: str) -> np.ndarray:
        """A field of the model with one value per world, ``[B, ...]``, live; see :meth:`randomize`."""
        return self._models.field(name).view()

    def _ids(self, world_ids: Any) -> list[int] | None:
        """Ids of worlds, of ids or a mask; None: all. Raises ValueError for ids out of range."""
        return None if world_ids is None else ids_of_worlds(world_ids, self.num_worlds).tolist()

    def _rows(self, world_ids: Any) -> Any:
        """Index of these worlds in arrays ``[B, ...]``."""
        return slice(None) if world_ids is None else ids_of_worlds(world_ids, self.num_worlds)

    def _component(self, name: str) -> NDArray[np.float64]:
        view = self._views.get(name)
        if view is None or self._core.closed:
            view = self._core.component(name)
            view = self._views[name] = view[:, 0] if name == "time" else view
        return view.view()

    # --------------------------------------------------------------------------------------------------------- sensors

    def add(self, sensor: Any) -> Any:
        """Adds a sensor that is not part of the scene, for use in suites, and returns it.

        The sensor is a user-defined one, one of the core suite (such as :class:`mjsense.sensors.PoseSensor`), or an object of
        another library with a ``uuid`` and ``get_observation(env, task, batch_index)``; the latter is wrapped, and the wrapper is
        returned.
        """
        sensor = as_sensor(sensor)
        if isinstance(sensor, NativeSensor):
            if sensor._core is not None:
                raise RuntimeError(f"sensor '{sensor.uuid}' belongs to a simulation already")
            make = getattr(sensor, "_make", None)
            if make is None:
                raise TypeError(f"sensor '{sensor.uuid}' belongs to a scene")
            self._core.add_native(make(self))
            sensor._bind(self._core)
            return sensor
        if sensor._mjs_core is not None:
            raise RuntimeError(f"sensor '{sensor.uuid}' belongs to a simulation already")
        if sensor.uuid in self.scene.sensors or any(sensor.uuid == own.uuid for own in self._python):
            raise ValueError(f"sensor '{sensor.uuid}': there is one of that name already")
        sensor._mjs_probe(self)
        self._own(sensor, self._core.add_sensor(sensor))
        return sensor

    def _own(self, sensor: Sensor, handle: Any) -> None:
        self._python.append(sensor)
        sensor._mjs_bind(self, handle)

    def refresh(self, sensors: Sequence[Any]) -> None:
        """Computes several sensors (as returned by ``scene["name"]``) in one pass over the worlds. Reading their ``.data``
        afterwards is free."""
        for sensor in sensors:
            if not isinstance(sensor, (NativeSensor, Sensor)):
                raise TypeError(f"not a sensor: {sensor!r}")
        self._core.refresh_all([s._mjs_handle if isinstance(s, Sensor) else s._handle for s in sensors])

    def invalidate(self, world_ids: Sequence[int] | None = None) -> None:
        """Call after the state was changed outside of this class: sensors are recomputed at their next read."""
        self._core.invalidate(self._ids(world_ids))

    # --------------------------------------------------------------------------------------------------------- drawing

    def draw(self, scene: mujoco.MjvScene, world: int = 0, sensors: Any = None, *, labels: bool = False) -> int:
        """Adds shapes that visualise sensor measurements to a MuJoCo scene (``renderer.scene``, ``viewer.user_scn``).

        Args:
            world: Id of the world to draw.
            sensors: A sensor, its name, or a sequence of these. None: sensors configured with ``debug_vis=True``, and
                user-defined sensors with a ``debug_vis`` method.
            labels: Also label each shape.

        Returns:
            Number of shapes that did not fit into the scene; 0: all are drawn.
        """
        return self.debug_shapes(world, sensors).draw(scene, labels)

    def debug_shapes(self, world: int = 0, sensors: Any = None) -> DebugShapes:
        """The shapes that :meth:`draw` adds, as NumPy arrays for other viewers."""
        self._rows([world])
        shapes = DebugShapes(world, self._core.meansize)
        if sensors is None:
            shapes._extend(*self._core.draw(world, []))
            own = [sensor for sensor in self._python if type(sensor).debug_vis is not Sensor.debug_vis]
        else:
            if isinstance(sensors, (str, NativeSensor, Sensor)):
                sensors = [sensors]
            if not hasattr(sensors, "__iter__"):
                raise TypeError(f"sensors must be a sensor, its name, or a sequence of these, not {sensors!r:.100}")
            chosen = [self._sensor(sensor) for sensor in sensors]
            native = [sensor._handle for sensor in chosen if isinstance(sensor, NativeSensor)]
            if native:
                shapes._extend(*self._core.draw(world, native))
            own = [sensor for sensor in chosen if isinstance(sensor, Sensor)]
        for sensor in own:
            sensor._mjs_draw(shapes)
        return shapes

    def _sensor(self, sensor: Any) -> Any:
        """A sensor of this simulation, given by itself or its name."""
        if isinstance(sensor, (NativeSensor, Sensor)):
            return sensor
        if not isinstance(sensor, str):
            raise TypeError(f"neither a sensor nor the name of one: {sensor!r}")
        known = {**self.scene.sensors, **{own.uuid: own for own in self._python}}
        if sensor not in known:
            raise UnknownNameError(f"no sensor named '{sensor}'{did_you_mean(sensor, known, 'there are')}")
        return known[sensor]

    # ------------------------------------------------------------------------------------------------ mjlab's call order

    def step_raw(self, substeps: int = 1) -> None:
        """Steps all worlds with mj_step: derived quantities stay one substep behind the state, as in MuJoCo and mjlab."""
        self._core.step_raw(substeps)

    def update_sensors(self, dt: float = 0.0) -> None:
        """Updates the sensors' per-substep state (air time, history) once, after ``step_raw(1)``. ``dt`` is in s; 0: the
        timestep."""
        if not 0 <= dt < np.inf:
            raise ValueError(f"update_sensors(): dt must be at least 0 s and finite, not {dt}")
        self._core.update_sensors(dt)

    def reset_sensors(self, world_ids: Sequence[int] | None = None) -> None:
        """Resets the sensors' episode state in these worlds without resetting the physics."""
        self._core.reset_sensors(self._ids(world_ids))


# Otherwise help() would show the arguments of __new__.
Simulation.__signature__ = inspect.Signature([*inspect.signature(Simulation.__init__).parameters.values()][1:])  # pyright: ignore[reportAttributeAccessIssue]
