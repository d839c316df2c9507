# SPDX-License-Identifier: Apache-2.0
"""``Entity.data``: the state of an entity in all worlds, and how it is written."""

from __future__ import annotations

from typing import Any

import numpy as np

from mjsense.compat.mjlab._data import Data
from mjsense.compat.mjlab._targets import NAMES, Targets
from mjsense.compat.mjlab._tensors import ids, tensor
from mjsense.core import mujoco_names
from mjsense.core.counted import counted

_FREE, _BALL = 0, 1  # mjJNT_FREE, mjJNT_BALL


def _like(values: Any, target: Any) -> Any:
    """``values`` as the kind of array that ``target`` is, with its dtype."""
    given: Any = values.detach() if hasattr(values, "detach") else np.asarray(values)
    if isinstance(target, np.ndarray):
        return np.asarray(given.cpu() if hasattr(given, "cpu") else given, target.dtype)
    return (tensor(given) if isinstance(given, np.ndarray) else given).to(target.device, target.dtype)


def _stack(parts: list[Any]) -> Any:
    if isinstance(parts[0], np.ndarray):
        return np.stack(parts, -1)
    import torch  # pyright: ignore[reportMissingImports]

    return torch.stack(parts, -1)


def _join(*parts: Any) -> Any:
    return _stack([part[..., i] for part in parts for i in range(part.shape[-1])])


def _cross(a: Any, b: Any) -> Any:
    (ax, ay, az), (bx, by, bz) = ([v[..., i] for i in range(3)] for v in (a, b))
    return _stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _rotated(quat: Any, vector: Any, sign: int = 1) -> Any:
    """``vector`` rotated by unit quaternions wxyz, or by their inverse with ``sign=-1``."""
    axis = sign * quat[..., 1:]
    twice = 2 * _cross(axis, vector)
    return vector + quat[..., :1] * twice + _cross(axis, twice)


class EntityData:
    """Poses are m and wxyz, velocities m/s and rad/s, in the world's frame (``_w``) or the root's (``_b``); float64 ``[B, ...]``.

    They are computed from the fields of mjData when they are read, so a written state shows after ``sim.forward()``.
    """

    def __init__(self, entity: Any, simulation: Any) -> None:
        targets, entity, model = entity, entity.native, simulation.model
        named = [mujoco_names.name2id(model, mujoco_names.Obj.BODY, f"{entity.name}/{name}") for name in entity.body_names]
        self._name, self._data = entity.name, Data(simulation)
        self._bodies = np.array(sorted(body for body in named if body >= 0), int)
        self._trees = np.array(model.body_rootid)[self._bodies]
        joints = [j for j in range(model.njnt) if model.jnt_bodyid[j] in set(named)]
        free = [j for j in joints if model.jnt_type[j] == _FREE]
        self._free = (int(model.jnt_qposadr[free[0]]), int(model.jnt_dofadr[free[0]])) if free else None
        others = [j for j in joints if j not in free]
        widths = {"qpos": [4 if model.jnt_type[j] == _BALL else 1 for j in others]}
        widths["qvel"] = [3 if width == 4 else 1 for width in widths["qpos"]]
        firsts = {"qpos": model.jnt_qposadr[others], "qvel": model.jnt_dofadr[others]}
        self._qpos, self._qvel = (
            np.array([adr + i for adr, width in zip(firsts[field], widths[field]) for i in range(width)], int)
            for field in ("qpos", "qvel")
        )
        actuators = (mujoco_names.name2id(model, mujoco_names.Obj.ACTUATOR, f"{entity.name}/{a}") for a in entity.actuator_names)
        self._ctrl = np.array([*actuators], int)
        root = self._bodies[0] if len(self._bodies) else 0
        self._mocap = int(model.body_mocapid[root]) if self._free is None else -1
        self._targets = Targets(targets, model, simulation.num_worlds)
        self._ipos = np.array(model.body_ipos[self._bodies[0]]) if len(self._bodies) else None

    def _field(self, name: str) -> Any:
        return getattr(self._data, name)

    # What the writers of Entity do.

    @staticmethod
    def _rows(env_ids: Any) -> Any:
        """A slice or the indices of these worlds."""
        rows = ids(env_ids)
        if rows is None or isinstance(rows, slice):
            return slice(None) if rows is None else rows
        rows = np.atleast_1d(np.asarray(rows))
        return np.flatnonzero(rows) if rows.dtype == bool else rows

    def _write(self, field: str, columns: np.ndarray, values: Any, env_ids: Any) -> None:
        target, rows = self._field(field), self._rows(env_ids)
        place = (rows if isinstance(rows, slice) else rows[:, None], columns)
        if values.shape[-1] not in (1, len(columns)):
            raise ValueError(
                f"entity '{self._name}': {counted(values.shape[-1], 'number')} of {field} for each world, and it has "
                f"{len(columns)}"
            )
        target[place] = _like(values, target)

    def _root(self) -> tuple[int, int]:
        if self._free is None:
            raise ValueError(f"entity '{self._name}' has a fixed base: its root cannot be written")
        return self._free

    def write_root_pose(self, pose: Any, env_ids: Any = None) -> None:
        first = self._root()[0]
        self._write("qpos", np.arange(first, first + 7), pose, env_ids)

    def write_root_velocity(self, velocity: Any, env_ids: Any = None, *, of_mass: bool = False, in_body: bool = False) -> None:
        """Linear velocity of the root's origin or centre of mass, and angular velocity; in the frame of the world or the root."""
        first, dof = self._root()
        rows = ids(env_ids)
        quat = self._field("qpos")[slice(None) if rows is None else rows][:, first + 3 : first + 7]
        velocity = _like(velocity, quat)
        linear, angular = velocity[:, :3], velocity[:, 3:]
        if in_body:
            linear = _rotated(quat, linear)
        else:
            if of_mass:
                linear = linear - _cross(angular, _rotated(quat, 0 * linear + _like(self._ipos, quat)))
            angular = _rotated(quat, angular, -1)  # a free joint has it in the body's frame
        self._write("qvel", np.arange(dof, dof + 6), _join(linear, angular), env_ids)

    def write_joints(self, field: str, values: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        columns = {"qpos": self._qpos, "qvel": self._qvel, "ctrl": self._ctrl}[field]
        chosen = ids(joint_ids)
        self._write(field, columns if chosen is None else np.atleast_1d(columns[np.asarray(chosen)]), values, env_ids)

    def write_wrench(self, force: Any, torque: Any, env_ids: Any = None, body_ids: Any = None) -> None:
        """``[N, bodies, 3]``, N and N m in the world's frame, at the centres of mass; None leaves the present one."""
        bodies = self._bodies if body_ids is None else np.atleast_1d(self._bodies[ids(body_ids)])
        for values, first in ((force, 0), (torque, 3)):
            if values is None:
                continue
            if len(values.shape) < 2 or tuple(values.shape[-2:]) not in ((len(bodies), 3), (1, 3)):
                raise ValueError(
                    f"entity '{self._name}': a wrench of the shape {tuple(values.shape)} is for {counted(len(bodies), 'body')}: "
                    f"[worlds, {len(bodies)}, 3]"
                )
            target = self._field("xfrc_applied")
            rows = self._rows(env_ids)
            target[rows if isinstance(rows, slice) else rows[:, None], bodies, first : first + 3] = _like(values, target)

    def write_mocap_pose(self, pose: Any, env_ids: Any = None) -> None:
        if self._mocap < 0:
            raise ValueError(f"entity '{self._name}' has no mocap body as its root: its mocap pose cannot be written")
        if pose.shape[-1] != 7:
            raise ValueError(f"entity '{self._name}': {counted(pose.shape[-1], 'number')} of a mocap pose, not 7")
        for field, place in (("mocap_pos", slice(0, 3)), ("mocap_quat", slice(3, 7))):
            target = self._field(field)
            target[self._rows(env_ids), self._mocap] = _like(pose[:, place], target)

    def write_targets(self) -> None:
        self._targets.write(self._field("ctrl"), _like)

    def clear_targets(self, env_ids: Any = None) -> None:
        self._targets.clear(env_ids)

    def set_target(self, name: str, values: Any, element_ids: Any = None, env_ids: Any = None) -> None:
        target, rows = self._targets[name], self._rows(env_ids)
        columns = np.arange(target.shape[1])
        chosen = ids(element_ids)
        columns = columns if chosen is None else np.atleast_1d(columns[chosen])
        if len(values.shape) and values.shape[-1] not in (1, len(columns)):
            raise ValueError(
                f"entity '{self._name}': {counted(values.shape[-1], 'number')} of {name} for {len(columns)} elements"
            )
        target[rows if isinstance(rows, slice) else rows[:, None], columns] = _like(values, target)

    # What tasks read.

    @property
    def body_link_pose_w(self) -> Any:
        return _join(self._field("xpos")[:, self._bodies], self._field("xquat")[:, self._bodies])

    @property
    def body_link_vel_w(self) -> Any:
        spatial = self._field("cvel")[:, self._bodies]
        offset = self._field("subtree_com")[:, self._trees] - self._field("xpos")[:, self._bodies]  # MuJoCo's cvel is about it
        angular = spatial[..., :3]
        return _join(spatial[..., 3:] - _cross(angular, offset), angular)

    @property
    def root_link_pose_w(self) -> Any:
        return self.body_link_pose_w[:, 0]

    @property
    def root_link_vel_w(self) -> Any:
        return self.body_link_vel_w[:, 0]

    @property
    def projected_gravity_b(self) -> Any:
        """Unit vector down, in the root's frame."""
        quat = self.root_link_quat_w
        return _rotated(quat, _stack([0 * quat[:, 0], 0 * quat[:, 0], 0 * quat[:, 0] - 1]), -1)

    @property
    def joint_pos(self) -> Any:
        return self._field("qpos")[:, self._qpos]

    @property
    def joint_vel(self) -> Any:
        return self._field("qvel")[:, self._qvel]

    @property
    def joint_acc(self) -> Any:
        return self._field("qacc")[:, self._qvel]

    @property
    def root_link_lin_vel_b(self) -> Any:
        return _rotated(self.root_link_quat_w, self.root_link_lin_vel_w, -1)

    @property
    def root_link_ang_vel_b(self) -> Any:
        return _rotated(self.root_link_quat_w, self.root_link_ang_vel_w, -1)

    def __getattr__(self, name: str) -> Any:
        if name in NAMES:
            return self._targets[name]
        parts = {
            "pos": ("pose", slice(0, 3)),
            "quat": ("pose", slice(3, 7)),
            "lin_vel": ("vel", slice(0, 3)),
            "ang_vel": ("vel", slice(3, 6)),
        }
        for of in ("root_link", "body_link"):
            for part, (whole, place) in parts.items():
                if name == f"{of}_{part}_w":
                    return getattr(self, f"{of}_{whole}_w")[..., place]
        raise AttributeError(
            f"Entity.data of mjsense.compat.mjlab has no '{name}'; it has the poses and velocities of root_link and body_link "
            "(_w, and _b of the root), projected_gravity_b, joint_pos, joint_vel and joint_acc"
        )


__all__ = ["EntityData"]
