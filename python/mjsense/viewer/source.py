# SPDX-License-Identifier: Apache-2.0
"""Live worlds as the viewer reads them: a simulation, or a task that is played in one."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from mjsense.core import mujoco_names
from mjsense.core.representations import is_image
from mjsense.sensors.drawing import DebugShapes
from mjsense.sensors.sensor import Sensor
from mjsense.sim.simulation import Simulation
from mjsense.viewer.camera import View, first_view
from mjsense.viewer.curves import MAX_CURVES, StreamInfo
from mjsense.viewer.poses import PoseStream

_CONTACTS, _PLAN = "contacts", "plan"
_PLAN_COLOURS = ((0.1, 0.5, 0.9, 1), (0.95, 0.6, 0.1, 1), (0.2, 0.7, 0.3, 1), (0.7, 0.3, 0.8, 1))  # of successive parts
_CONTACT_COLOUR = (0.9, 0.3, 0.1, 1.0)


class Control(NamedTuple):
    """A number that the user sets with a slider."""

    name: str
    low: float
    high: float


class LiveSource:
    """A simulation. ``Viewer`` calls all methods from one thread."""

    def __init__(self, sim: Simulation, title: str = "") -> None:
        self.sim = sim
        self.title = title or "mjsense"
        self.num_worlds = sim.num_worlds
        self.period = sim.step_dt
        """Time between two steps, s."""
        self.policy: bool | None = None
        """Whether the policy acts; None: there is no policy."""

    # ---------------------------------------------------------------------------------------------------------- stepping

    def step(self) -> None:
        """Advances all worlds by one control step."""
        self.sim.step()

    def reset(self, seed: int) -> None:
        """Starts a new episode in all worlds."""
        model = self.sim.model
        keys = [model.key(i).name for i in range(model.nkey)]
        key = "init_state" if "init_state" in keys else 0 if keys else None
        self.sim.reset(seed=seed, key=key)

    def time(self, world: int) -> float:
        """Simulation time of a world, s."""
        return float(self.sim.time[world])

    def instruction(self, world: int) -> str:
        """What is to be done in the world's episode; empty: nothing in particular."""
        return ""

    def notes(self, world: int) -> list[str]:
        """MuJoCo's warnings in a world, and how often they were raised."""
        return [f"{name}: {counts[world]}" for name, counts in self.sim.warning_counts.items() if counts[world]]

    # ----------------------------------------------------------------------------------------------------------- reading

    @property
    def version(self) -> int:
        """Differs from an earlier value if the models of worlds may have changed since."""
        return self.sim._core.model_version()

    def model(self, world: int) -> Any:
        """The model with the values of one world."""
        return self.sim.model_of(world)

    def field(self, name: str, world: int) -> np.ndarray:
        """A field of MjData in a world."""
        return getattr(self.sim.data, name)[world]

    def streams(self) -> dict[str, StreamInfo]:
        """Streams that can be drawn as curves, by name."""
        own = {
            name: (sensor.unit, rows)
            for name, (sensor, rows) in self._user_rows().items()
            if rows.ndim < 4 and rows.dtype.kind in "fiub"
        }
        found = {name: StreamInfo(unit, rows[0].size) for name, (unit, rows) in {**own, **self._sensor_rows()}.items()}
        for name, unit in (("qpos", "m, rad"), ("qvel", "m/s, rad/s"), ("ctrl", "")):
            found.setdefault(name, StreamInfo(unit, getattr(self.sim, name).shape[1]))
        return {name: info for name, info in found.items() if 0 < info.width <= MAX_CURVES}

    def value(self, name: str, world: int) -> np.ndarray:
        """Current values of a stream, float64 [width]."""
        rows = self._row(name)
        return np.asarray(getattr(self.sim, name) if rows is None else rows, np.float64)[world].reshape(-1)

    def pictures(self) -> list[str]:
        """Names of images, those of user-defined sensors first."""
        found = [name for name, (_, rows) in self._user_rows().items() if is_image(rows.shape[1:], rows.dtype)]
        for name, sensor in self.sim.scene.sensors.items():
            if getattr(sensor, "kind", "") == "camera":
                found += [f"{name}/{field}" for field, spec in sensor.specs.items() if is_image(spec.shape, spec.dtype)]
        return found

    def picture(self, name: str, world: int) -> np.ndarray:
        """An image [H, W, C]. Only images that are shown are read, and with them computed."""
        own = self._user_row(name)
        if own is not None:
            return own[world]
        sensor, _, field = name.rpartition("/")
        return self.sim.scene[sensor].fields[field][world]

    def image_points(self, name: str, world: int) -> np.ndarray | None:
        """Points on an image, as fractions [N, 2]; None: it never has any."""
        return None

    def _user_rows(self) -> dict[str, tuple[Sensor, np.ndarray]]:
        """Rows of the sensors that are written in Python, as they were last computed."""
        return {
            f"{sensor.uuid}/{spec['name']}".removesuffix("/"): (sensor, rows)
            for sensor in self.sim._python
            if sensor._mjs_rows
            for spec, rows in zip(sensor._mjs_row_specs(), sensor._mjs_rows)
        }

    def _user_row(self, name: str) -> np.ndarray | None:
        found = self._user_rows().get(name)
        if found is None:
            return None
        sensor, rows = found
        sensor.rows  # computes them
        return rows

    def _row(self, name: str) -> np.ndarray | None:
        own = self._user_row(name)
        if own is not None:
            return own
        sensors = self.sim.scene.sensors
        if name in sensors:
            data = sensors[name].data
            return data if isinstance(data, np.ndarray) else None
        sensor, _, field = name.rpartition("/")
        return sensors[sensor].fields[field] if sensor in sensors else None

    def _sensor_rows(self) -> dict[str, tuple[str, np.ndarray]]:
        """Numeric fields of the scene's sensors: name -> (unit, rows). Reads no images."""
        found = {}
        for name, sensor in self.sim.scene.sensors.items():
            specs = getattr(sensor, "specs", None)
            if specs is None or getattr(sensor, "kind", "") == "camera":
                continue
            for field, spec in specs.items():
                if np.dtype(spec.dtype).kind in "fiub":
                    found[f"{name}/{field}" if field else name] = spec.unit, np.empty((1, *spec.shape), spec.dtype)
        return found

    # ----------------------------------------------------------------------------------------------------------- drawing

    def shape_names(self) -> list[str]:
        """Names of everything that can be drawn: sensors with shapes, streams of poses, and contacts."""
        found = [sensor.uuid for sensor in self.sim._python if type(sensor).debug_vis is not Sensor.debug_vis]
        for name, sensor in self.sim.scene.sensors.items():
            if isinstance(sensor, Sensor):
                continue
            try:
                self.sim.debug_shapes(0, [name])
            except (ValueError, TypeError, RuntimeError):
                continue  # this sensor never has anything to draw
            found.append(name)
        return [*found, *self._pose_rows(), *([_PLAN] if self.policy is not None else []), _CONTACTS]

    def shapes(self, world: int, names: list[str]) -> DebugShapes:
        """The shapes of one world."""
        poses = self._pose_rows()
        sensors = [name for name in names if name not in poses and name not in (_CONTACTS, _PLAN)]
        shapes = self.sim.debug_shapes(world, sensors) if sensors else DebugShapes(world, float(self.sim.model.stat.meansize))
        if poses:
            model, data = self.sim.model, self.sim.data
            for name in (name for name in names if name in poses):
                frame, rows = poses[name]
                PoseStream(name, frame).draw(shapes, rows[world], model, data.xpos[world], data.xmat[world])
        if _PLAN in names:
            for k, points in enumerate(self._planned(world)):
                for start, end in pairwise(points):
                    shapes.add_line(start, end, _PLAN_COLOURS[k % len(_PLAN_COLOURS)], 3.0)
        if _CONTACTS in names:
            for contact in self._contacts(world):
                shapes.add_sphere(contact[:3], 0.05 * shapes.meansize, _CONTACT_COLOUR)
                shapes.add_arrow(
                    contact[:3], contact[:3] + 0.5 * shapes.meansize * contact[3:], _CONTACT_COLOUR, 0.02 * shapes.meansize
                )
        return shapes

    def _pose_rows(self) -> dict[str, tuple[str, np.ndarray]]:
        return {}

    def _planned(self, world: int) -> list[np.ndarray]:
        """Positions of the tool along each part of the policy's plan."""
        return []

    def _contacts(self, world: int) -> np.ndarray:
        """Point and normal of each contact, float64 [n, 6]."""
        contacts = self.sim.env.mj_datas[world].contact
        return np.concatenate([np.asarray(contacts.pos).reshape(-1, 3), np.asarray(contacts.frame).reshape(-1, 9)[:, :3]], 1)

    # ----------------------------------------------------------------------------------------------------------- control

    def controls(self) -> list[Control]:
        """Controls of the actuators."""
        model = self.sim.model
        found = []
        for i in range(model.nu):
            low, high = model.actuator_ctrlrange[i] if model.actuator_ctrllimited[i] else (-1.0, 1.0)
            found.append(Control(model.actuator(i).name or f"actuator {i}", float(low), float(high)))
        return found

    def control(self, world: int) -> np.ndarray:
        """Current values of the controls."""
        return self.sim.ctrl[world]

    def set_control(self, world: int, index: int, value: float) -> None:
        self.sim.ctrl[world, index] = value

    def joints(self) -> list[Control]:
        """Hinges and slides, whose positions can be set."""
        model = self.sim.model
        found = []
        for joint in self._joint_ids():
            hinge = int(model.jnt_type[joint]) == mujoco_names.Joint.HINGE
            low, high = model.jnt_range[joint] if model.jnt_limited[joint] else ((-np.pi, np.pi) if hinge else (-1.0, 1.0))
            found.append(Control(model.joint(joint).name or f"joint {joint}", float(low), float(high)))
        return found

    def joint_positions(self, world: int) -> np.ndarray:
        return self.sim.qpos[world, self.sim.model.jnt_qposadr[self._joint_ids()]]

    def set_joint(self, world: int, index: int, value: float) -> None:
        """Moves a joint without physics."""
        qpos = self.sim.qpos[world].copy()
        qpos[self.sim.model.jnt_qposadr[self._joint_ids()[index]]] = value
        self.sim.set_state([world], qpos=qpos)

    def _joint_ids(self) -> np.ndarray:
        return np.flatnonzero(np.isin(self.sim.model.jnt_type, (mujoco_names.Joint.HINGE, mujoco_names.Joint.SLIDE)))

    def camera(self, world: int) -> View:
        """The first view."""
        return first_view(self.sim.model, self.sim.data.xpos[world], self.sim.data.xmat[world])
