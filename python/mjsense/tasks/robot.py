# SPDX-License-Identifier: Apache-2.0
"""Robots: the contents of their files, and kinematics."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core.arguments import KnownAttributes, checked
from mjsense.core.errors import UnknownNameError
from mjsense.core.input_files import expect_no_folder
from mjsense.sensors.configs import EntityCfg
from mjsense.sensors.named_class import sensor_of_class


@dataclass(frozen=True)
class MoveGroup:
    """Joints of a robot that are commanded together."""

    name: str
    kind: str
    """``"base"``, ``"torso"``, ``"arm"``, ``"gripper"`` or ``"head"``."""
    joints: tuple[str, ...]
    actuators: tuple[str, ...]
    controller: str
    """Type of controller, which defines the meaning of a command: ``joint_position`` and so on."""
    num_qpos: int
    """Size of the group's position: 1 per hinge or slide, 7 for a free joint."""
    num_qvel: int
    num_commands: int
    """Size of a command; 0: the group takes none."""
    command_unit: str
    command_low: np.ndarray
    """Lower bounds of a command, float64 ``[num_commands]``."""
    command_high: np.ndarray
    low: np.ndarray
    """Lower limits of its hinges and slides, float64 ``[joints]``, rad or m."""
    high: np.ndarray
    init: np.ndarray
    """Initial positions, float64 ``[num_qpos]``; empty if the robot's file has none."""
    leaf_site: str
    """Site of its tool frame; ``""``: the robot's base frame."""


@dataclass(frozen=True)
class RobotCamera:
    """A camera of a robot that is recorded in episodes."""

    name: str
    """Name of its stream."""
    camera: str
    """Name of the camera in the model."""
    depth: bool


@checked
class Robot(KnownAttributes):
    """A robot: a built-in one by its name (:func:`mjsense.robot_names`), or any robot by the path of its ``robot.toml``.

    ``record`` and ``make_vec`` accept a name, a path or this object. ``sensors`` are observed and recorded in every episode with
    the robot; a subclass may override :meth:`create_robot_sensors` instead. Names of elements have no prefix here; in a task's
    scene their prefix is ``robot_0/``. Poses are x, y, z (m) and a quaternion wxyz, in the robot's base frame.
    """

    def __init__(self, name_or_path: str | Path, sensors: Iterable[Any] = ()) -> None:
        """
        Args:
            name_or_path: Name of a built-in robot, or path of a ``robot.toml``.
            sensors: Sensors written in Python or of the core suite, in addition to those of the file.
        """
        self._given = os.fspath(name_or_path)
        expect_no_folder(self._given, "robot.toml", _core.robot_names)
        self._core: Any = _core.Robot(self._given)
        self.sensors: list[Any] = list(sensors)
        """Sensors of this robot in addition to those of its file."""
        self.name: str = self._core.name
        """Name in messages and recordings."""
        self.description: str = self._core.description
        """One sentence."""
        self.file: str = self._core.file
        """Path of its ``robot.toml``; ``embedded:...`` for a built-in robot."""
        self.base: str = self._core.base
        """The body that defines the base frame."""
        arrays = {"command_low", "command_high", "low", "high", "init"}

        def value_of(key: str, value: Any) -> Any:
            return np.array(value, np.float64) if key in arrays else tuple(value) if isinstance(value, list) else value

        self.groups: dict[str, MoveGroup] = {
            info["name"]: MoveGroup(**{key: value_of(key, value) for key, value in info.items()}) for info in self._core.groups
        }
        """Move groups, in the order of actions and observations."""
        self.cameras: tuple[RobotCamera, ...] = tuple(RobotCamera(*camera) for camera in self._core.cameras)
        """Cameras that episodes record."""
        self.image_size: tuple[int, int] = self._core.image_size
        """Width and height of their images, pixels."""
        self.policy_dt, self.ctrl_dt, self.sim_dt = (0.001 * ms for ms in self._core.periods_ms)
        """Periods of policy actions, controllers and physics, s."""

    def __repr__(self) -> str:
        groups = ", ".join(f"{g.name} {g.num_commands}" for g in self.groups.values())
        return f"<robot '{self.name}': {groups}>"

    def create_robot_sensors(self) -> list[Any]:
        """Creates the robot's sensors that are written in Python: those of its file, then ``sensors``."""
        return [*_sensors_of_file(self._given), *self.sensors]

    @property
    def joints(self) -> tuple[str, ...]:
        """Joints of all move groups, in order."""
        return tuple(joint for group in self.groups.values() for joint in group.joints)

    @property
    def actuators(self) -> tuple[str, ...]:
        """Actuators of all move groups, in order."""
        return tuple(actuator for group in self.groups.values() for actuator in group.actuators)

    @property
    def xml(self) -> str:
        """MJCF of the complete robot with all parts attached."""
        return self._core.xml

    def entity(self, **fields) -> EntityCfg:
        """The robot as an entity of a scene. ``fields`` are further fields of :class:`mjsense.EntityCfg`, such as ``pos``."""
        return EntityCfg(model=self.xml, **fields)

    def fk(self, group: str, **qpos: Sequence[float]) -> np.ndarray:
        """Forward kinematics: pose of the group's tool frame at the given positions of groups; the others are at their initial
        positions.

        Returns:
            float64 ``[7]`` in the base frame. Raises UnknownNameError for an unknown group, ValueError for a wrong number of
            positions.
        """
        return np.array(self._core.fk(group, self._values(qpos)))

    def ik(self, group: str, pose: Sequence[float], max_iterations: int = 1000, **qpos: Sequence[float]) -> np.ndarray | None:
        """Inverse kinematics: positions of the group that bring its tool frame to ``pose`` ``[7]``; the other groups do not move.

        The search starts at ``qpos``, by default the initial positions, and restarts from other positions every 100 iterations.
        With ``max_iterations=100`` the result is close to ``qpos``, as needed for a path.

        Returns:
            float64 ``[num_qpos]``, or None if the pose is not reached.
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


def robot_of(robot: Any, context: str = "robot") -> tuple[str, list[Any]]:
    """Returns (name or path for C++, the robot's sensors that are written in Python); "" for None."""
    if robot is None:
        return "", []
    if isinstance(robot, Robot):
        return robot._given, list(robot.create_robot_sensors())
    if not isinstance(robot, (str, Path)):
        raise TypeError(f"{context} is {robot!r}: must be the name of a robot, the path of its .toml, a mjsense.Robot, or None")
    name = str(robot)
    expect_no_folder(name, "robot.toml", _core.robot_names)
    return name, _sensors_of_file(name) if name.endswith(".toml") else []


def _sensors_of_file(name_or_path: str) -> list[Any]:
    """Creates the sensors that a robot.toml declares as ``class = "module:Class"``."""
    sensors = []
    for name, reference, args in _core.robot_python_sensors(name_or_path):
        sensor = sensor_of_class(reference, json.loads(args), f"{name_or_path}: sensor '{name}'")
        sensor.uuid = name
        sensors.append(sensor)
    return sensors
