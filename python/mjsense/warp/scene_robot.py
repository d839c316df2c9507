# SPDX-License-Identifier: Apache-2.0
"""The robot of a scene: move groups of actuators, their commands, and its observations (``robots/scene_robot.h`` in C++)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np

from mjsense.core import mujoco_names
from mjsense.core.errors import UnknownNameError
from mjsense.sensors.sensor import Sensor
from mjsense.tasks.task import WorldState
from mjsense.warp.arrays import torch

_HINGE_OR_SLIDE = (2, 3)


@dataclass
class Group:
    """A move group: its actuators, their ranges, and the hinges and slides that it drives."""

    name: str
    actuators: list[int]
    joints: list[int]
    low: list[float]
    high: list[float]


class SceneRobot:
    """The actuators of an entity, or of the whole model if ``entity`` is "", by move group.

    Args:
        groups: Name and patterns for the local names of the actuators; without any, one group ``joints`` has all.
        context: Beginning of error messages.
    """

    def __init__(self, model: Any, entity: str, groups: Sequence[tuple[str, Sequence[str]]], context: str) -> None:
        prefix = f"{entity}/" if entity else ""
        kinds = mujoco_names.Obj
        bodies = _named(model, kinds.BODY, model.nbody, prefix)
        if entity and not bodies:
            known = sorted({name.split("/")[0] for name in _named(model, kinds.BODY, model.nbody, "") if "/" in name})
            raise UnknownNameError(f"{context}: no robot entity '{entity}'; there are {', '.join(known)}")
        self.base_body = next(iter(bodies.values())) if entity else 0
        self._base_name = prefix + next(iter(bodies)) if entity else "world"
        actuators = _named(model, kinds.ACTUATOR, model.nu, prefix)
        if groups:
            chosen = [(name, _match(patterns, actuators, f"{context}, move group '{name}'")) for name, patterns in groups]
        else:
            chosen = [("joints", list(actuators.values()))] if actuators else []
        joints = _named(model, kinds.JOINT, model.njnt, prefix).values()
        every = [joint for joint in joints if model.jnt_type[joint] in _HINGE_OR_SLIDE]
        self.groups = [_group(model, name, ids, _driven(model, ids) if groups else every) for name, ids in chosen]
        owners: dict[int, str] = {}
        for group in self.groups:
            for actuator in group.actuators:
                if actuator in owners:
                    name = mujoco_names.id2name(model, kinds.ACTUATOR, actuator)
                    raise ValueError(
                        f"{context}: actuator '{name}' belongs to the move groups '{owners[actuator]}' and '{group.name}'"
                    )
                owners[actuator] = group.name
        self._actuators = [actuator for group in self.groups for actuator in group.actuators]
        self._low, self._high = ([value for group in self.groups for value in getattr(group, side)] for side in ("low", "high"))
        self._limits: Any = None

    @property
    def layout(self) -> list[tuple[str, list[float], list[float]]]:
        """Name and range of the commands of each move group."""
        return [(group.name, group.low, group.high) for group in self.groups]

    def command(self, ctrl: Any, actions: Any) -> None:
        """Writes the commands ``[B, n]`` into the controls ``[B, nu]``, clipped to their ranges."""
        if self._limits is None:
            self._limits = [torch().tensor(side, dtype=ctrl.dtype, device=ctrl.device) for side in (self._low, self._high)]
        ctrl[:, self._actuators] = torch().clamp(actions.to(ctrl.dtype), *self._limits)

    def place(self, world: WorldState, pose: Sequence[float]) -> None:
        """Moves the base, a free or mocap body, to this position and quaternion."""
        world.place(self._base_name, pose[:3], pose[3:])

    def sensors(self, model: Any) -> list[Sensor]:
        """The robot's observations: ``qpos`` and ``qvel`` by move group, and ``robot_base_pose``."""
        moving = [group for group in self.groups if group.joints]
        addresses = {"qpos": model.jnt_qposadr, "qvel": model.jnt_dofadr}
        made: list[Sensor] = [
            _JointState(name, {group.name: adr[group.joints].tolist() for group in moving})
            for name, adr in addresses.items()
            if moving
        ]
        return [*made, _BasePose(self.base_body)]


class _JointState(Sensor):
    """Positions or velocities of the joints of each move group, rad or m, or that per s."""

    def __init__(self, uuid: str, addresses: dict[str, list[int]]) -> None:
        super().__init__()
        self.uuid, self._addresses = uuid, addresses
        self.unit = "rad or m" if uuid == "qpos" else "rad/s or m/s"
        spaces: dict[str, Any] = {
            name: gymnasium.spaces.Box(-np.inf, np.inf, (len(at),), np.float32) for name, at in addresses.items()
        }
        self.observation_space = gymnasium.spaces.Dict(spaces)

    def compute(self, sim: Any) -> Any:
        values = getattr(sim, self.uuid)
        return {name: values[:, at] for name, at in self._addresses.items()}


class _BasePose(Sensor):
    """Pose of the robot's base: position and quaternion."""

    uuid = "robot_base_pose"
    unit, frame = "m, wxyz", "world"
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (7,), np.float32)

    def __init__(self, body: int) -> None:
        super().__init__()
        self._body = body

    def compute(self, sim: Any) -> Any:
        return torch().cat([sim.data.xpos[:, self._body], sim.data.xquat[:, self._body]], 1)


def _named(model: Any, kind: Any, count: int, prefix: str) -> dict[str, int]:
    """Local name -> id of the elements whose names begin with the prefix."""
    names = [mujoco_names.id2name(model, kind, i) or "" for i in range(count)]
    return {name[len(prefix) :]: i for i, name in enumerate(names) if name.startswith(prefix)}


def _match(patterns: Sequence[str], names: dict[str, int], context: str) -> list[int]:
    found = []
    for pattern in patterns:
        matched = [i for name, i in names.items() if re.fullmatch(pattern, name)]
        if not matched:
            raise ValueError(f"{context}: '{pattern}' matches no actuator; there are {', '.join(names)}")
        found += matched
    return sorted(found)


def _driven(model: Any, actuators: Sequence[int]) -> list[int]:
    """The hinges and slides that these actuators move, themselves or by a tendon."""
    joints = set()
    for actuator in actuators:
        target, kind = model.actuator_trnid[actuator, 0], model.actuator_trntype[actuator]
        if kind in (0, 1):  # a joint, or in the parent's frame
            joints.add(int(target))
        elif kind == 3:  # a tendon
            wraps = range(model.tendon_adr[target], model.tendon_adr[target] + model.tendon_num[target])
            joints |= {int(model.wrap_objid[wrap]) for wrap in wraps if model.wrap_type[wrap] == 1}
    return sorted(joint for joint in joints if model.jnt_type[joint] in _HINGE_OR_SLIDE)


def _group(model: Any, name: str, actuators: list[int], joints: list[int]) -> Group:
    limited = model.actuator_ctrllimited[actuators].astype(bool)
    low, high = (
        np.where(limited, model.actuator_ctrlrange[actuators, side], bound) for side, bound in ((0, -np.inf), (1, np.inf))
    )
    return Group(name, actuators, joints, low.tolist(), high.tolist())
