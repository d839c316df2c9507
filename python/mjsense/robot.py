# SPDX-License-Identifier: Apache-2.0
"""Robots: what their files say, and their kinematics."""

from __future__ import annotations

import importlib
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mjsense import _core
from mjsense._arguments import KnownAttributes, checked
from mjsense.configs import EntityCfg
from mjsense.errors import UnknownNameError


@dataclass(frozen=True)
class MoveGroup:
    """Joints of a robot that are commanded together."""

    name: str
    kind: str
    """base, torso, arm, gripper or head."""
    joints: tuple[str, ...]
    actuators: tuple[str, ...]
    controller: str
    """What a command means: ``joint_position`` and so on."""
    num_qpos: int
    """Numbers of its position: 1 a hinge or slide, 7 a free joint."""
    num_qvel: int
    num_commands: int
    """Numbers of a command; 0: it takes none."""
    command_unit: str
    command_low: np.ndarray
    """float64 ``[num_commands]``."""
    command_high: np.ndarray
    low: np.ndarray
    """Ranges of its hinges and slides: float64 ``[joints]`` rad or m."""
    high: np.ndarray
    init: np.ndarray
    """Start positions: float64 ``[num_qpos]``, empty where the robot's file gives none."""
    leaf_site: str
    """Site of its tool frame; ``""``: the robot's base frame."""


@dataclass(frozen=True)
class RobotCamera:
    """A camera of a robot that an episode records."""

    name: str
    """Of its stream."""
    camera: str
    """Of the model."""
    depth: bool


@checked
class Robot(KnownAttributes):
    """A robot: one of ours by its name (:func:`mjsense.robot_names`), or any by the path of its ``robot.toml``.

    ``record`` and ``make_vec`` take the same name or path, or this object. ``sensors`` are observed and recorded in every episode with
    it; a subclass may override :meth:`create_robot_sensors` instead. Names of its elements are without the prefix ``robot_0/`` that they
    have in a task's scene. Poses are x, y, z (m) and a quaternion wxyz, in the robot's base frame.
    """

    def __init__(self, name_or_path: str | Path, sensors: Iterable[Any] = ()) -> None:
        """
        Args:
            name_or_path: one of ours, or the path of a ``robot.toml``.
            sensors: that are written in Python, or of the core suite; those of the file are added.
        """
        self._given = os.fspath(name_or_path)
        self._core: Any = _core.Robot(self._given)
        self.sensors: list[Any] = list(sensors)
        """Sensors of this robot besides those of its file."""
        self.name: str = self._core.name
        """What messages and recordings call it."""
        self.description: str = self._core.description
        """A sentence."""
        self.file: str = self._core.file
        """Its ``robot.toml``; ``embedded:...`` for one of ours."""
        self.base: str = self._core.base
        """The body that is its base frame."""
        arrays = {"command_low", "command_high", "low", "high", "init"}

        def value_of(key: str, value: Any) -> Any:
            return np.array(value, np.float64) if key in arrays else tuple(value) if isinstance(value, list) else value

        self.groups: dict[str, MoveGroup] = {
            info["name"]: MoveGroup(**{key: value_of(key, value) for key, value in info.items()}) for info in self._core.groups
        }
        """Its move groups, in the order of actions and observations."""
        self.cameras: tuple[RobotCamera, ...] = tuple(RobotCamera(*camera) for camera in self._core.cameras)
        """What an episode records."""
        self.image_size: tuple[int, int] = self._core.image_size
        """Width and height of their pictures, pixels."""
        self.policy_dt, self.ctrl_dt, self.sim_dt = (0.001 * ms for ms in self._core.periods_ms)
        """s: of a policy's action, of the controllers, of the physics."""

    def __repr__(self) -> str:
        groups = ", ".join(f"{g.name} {g.num_commands}" for g in self.groups.values())
        return f"<robot '{self.name}': {groups}>"

    def create_robot_sensors(self) -> list[Any]:
        """The robot's sensors that are made in Python: those of its file, then ``sensors``."""
        return [*_sensors_of_file(self._given), *self.sensors]

    @property
    def joints(self) -> tuple[str, ...]:
        """Of all move groups, in order."""
        return tuple(joint for group in self.groups.values() for joint in group.joints)

    @property
    def actuators(self) -> tuple[str, ...]:
        """Of all move groups, in order."""
        return tuple(actuator for group in self.groups.values() for actuator in group.actuators)

    @property
    def xml(self) -> str:
        """The whole robot as one MJCF, its parts attached."""
        return self._core.xml

    def entity(self, **fields) -> EntityCfg:
        """The robot as an entity of a scene; ``fields`` are further ones of :class:`mjsense.EntityCfg`, such as ``pos``."""
        return EntityCfg(model=self.xml, **fields)

    def fk(self, group: str, **qpos: Sequence[float]) -> np.ndarray:
        """Pose of the group's tool frame where the named groups have these positions, the others those of the start.

        Returns:
            float64 ``[7]``. UnknownNameError for a group that there is not, ValueError for a wrong number of positions.
        """
        return np.array(self._core.fk(group, self._values(qpos)))

    def ik(
        self, group: str, pose: Sequence[float], max_iterations: int = 1000, **qpos: Sequence[float]
    ) -> np.ndarray | None:
        """Positions of the group's joints that bring its tool frame to ``pose`` ``[7]``; the other groups stand still.

        The search begins at ``qpos``, by default the start, and begins again elsewhere after 100 iterations: ``max_iterations=100``
        stays near, for a path.

        Returns:
            float64 ``[num_qpos]``, None if the pose is not reached.
        """
        target = np.array(pose, np.float64)
        if target.shape != (7,) or not np.isfinite(target).all() or not target[3:].any():
            raise ValueError(f"robot '{self.name}': pose is {target}: must be x, y, z and w, x, y, z")
        found = self._core.ik(group, target.tolist(), self._values(qpos), max_iterations)
        return np.array(found) if found else None

    def _values(self, qpos: Mapping[str, Sequence[float]]) -> list[list[float]]:
        for name in qpos:
            if name not in self.groups:
                raise UnknownNameError(f"robot '{self.name}': no move group named '{name}'; there are {', '.join(self.groups)}")
        values = []
        for group in self.groups.values():
            given = np.array(qpos.get(group.name, group.init), np.float64).ravel()
            if not given.size and group.name not in qpos:
                given = np.zeros(group.num_qpos)
            if given.size != group.num_qpos:
                raise ValueError(
                    f"robot '{self.name}': {given.size} positions for move group '{group.name}', which has {group.num_qpos}"
                )
            values.append(given.tolist())
        return values


def robot_of(robot: Any, place: str = "robot") -> tuple[str, list[Any]]:
    """(name or path for C++, the robot's sensors that are made in Python); "" for None."""
    if robot is None:
        return "", []
    if isinstance(robot, Robot):
        return robot._given, list(robot.create_robot_sensors())
    if not isinstance(robot, (str, Path)):
        raise TypeError(f"{place} is {robot!r}: must be the name of a robot, the path of its .toml, a mjsense.Robot, or None")
    name = str(robot)
    return name, _sensors_of_file(name) if name.endswith(".toml") else []


def _sensors_of_file(name_or_path: str) -> list[Any]:
    """Makes the sensors that a robot.toml names by ``class = "module:Class"``."""
    sensors = []
    for name, reference, args in _core.robot_python_sensors(name_or_path):
        place = f"{name_or_path}: sensor '{name}': class '{reference}'"
        module, attribute = reference.split(":")
        try:
            made: Any = getattr(importlib.import_module(module), attribute)
        except (ImportError, AttributeError) as error:
            raise ValueError(f"{place} is not found: {error}") from error
        try:
            sensor = made(**json.loads(args))
        except TypeError as error:
            raise TypeError(f"{place} cannot be made: {error}") from error
        sensor.uuid = name
        sensors.append(sensor)
    return sensors
