# SPDX-License-Identifier: Apache-2.0
"""``mjlab.entity``: a model of the scene: its spec, edits of the spec, actuators and initial state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

from mjsense.compat.mjlab._entity_data import EntityData
from mjsense.compat.mjlab._names import find, value_of
from mjsense.compat.mjlab.actuator import ActuatorCfg, TransmissionType, XmlActuatorCfg
from mjsense.core.counted import counted
from mjsense.sensors import configs

_FREE = mujoco.mjtJoint.mjJNT_FREE


@dataclass
class EntityArticulationInfoCfg:
    """Actuators of the entity."""

    actuators: tuple[ActuatorCfg, ...] = ()
    soft_joint_pos_limit_factor: float = 1.0


@dataclass
class EntityCfg:
    """A model that is attached to the scene.

    ``spec_fn`` creates its spec. Then lights, cameras, textures, materials, meshes, geoms and collisions edit it in this order
    (any objects with ``edit_spec(spec)``), and the actuators are added.
    """

    @dataclass
    class InitialStateCfg:
        """The keyframe ``init_state``: m, wxyz, rad.

        The first matching expression sets a joint. ``joint_pos=None`` uses the model's keyframe.
        """

        pos: tuple[float, float, float] = (0.0, 0.0, 0.0)
        rot: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
        lin_vel: tuple[float, float, float] = (0.0, 0.0, 0.0)
        ang_vel: tuple[float, float, float] = (0.0, 0.0, 0.0)
        joint_pos: dict[str, float] | None = field(default_factory=lambda: {".*": 0.0})
        joint_vel: dict[str, float] = field(default_factory=lambda: {".*": 0.0})

    init_state: InitialStateCfg = field(default_factory=InitialStateCfg)
    spec_fn: Callable[[], mujoco.MjSpec] = field(default_factory=lambda: mujoco.MjSpec)
    articulation: EntityArticulationInfoCfg | None = None
    sort_actuators: bool = False
    lights: tuple[Any, ...] = ()
    cameras: tuple[Any, ...] = ()
    textures: tuple[Any, ...] = ()
    materials: tuple[Any, ...] = ()
    meshes: tuple[Any, ...] = ()
    geoms: tuple[Any, ...] = ()
    collisions: tuple[Any, ...] = ()

    def spec(self) -> mujoco.MjSpec:
        """A new spec of the entity, edited, with its keyframe."""
        spec = self.spec_fn()
        for edits in (self.lights, self.cameras, self.textures, self.materials, self.meshes, self.geoms, self.collisions):
            for edit in edits:
                edit.edit_spec(spec)
        _add_actuators(spec, self)
        _add_keyframe(spec, self)
        return spec

    def native(self) -> configs.EntityCfg:
        spec = self.spec()
        if any(joint.type == _FREE for joint in spec.joints):
            return configs.EntityCfg(model=spec)
        return configs.EntityCfg(model=spec, pos=self.init_state.pos, quat=self.init_state.rot)


def _joints(spec: mujoco.MjSpec) -> list[str]:
    return [joint.name for joint in spec.joints if joint.type != _FREE]


def _add_actuators(spec: mujoco.MjSpec, cfg: EntityCfg) -> None:
    names = {
        TransmissionType.JOINT: _joints(spec),
        TransmissionType.TENDON: [t.name for t in spec.tendons],
        TransmissionType.SITE: [s.name for s in spec.sites],
    }
    chosen: list[tuple[ActuatorCfg, str]] = []
    for actuator in cfg.articulation.actuators if cfg.articulation is not None else ():
        kind = TransmissionType(actuator.transmission_type)
        chosen += [(actuator, name) for name in find(actuator.target_names_expr, names[kind], kind.value)[1]]
    if cfg.sort_actuators:
        kinds = list(names)

        def place(item: tuple[ActuatorCfg, str]) -> tuple[int, int, int]:
            kind = TransmissionType(item[0].transmission_type)
            return (0, 0, 0) if isinstance(item[0], XmlActuatorCfg) else (1, kinds.index(kind), names[kind].index(item[1]))

        chosen.sort(key=place)
    for actuator, name in chosen:
        actuator.edit_spec(spec, [name])


def _add_keyframe(spec: mujoco.MjSpec, cfg: EntityCfg) -> None:
    state = cfg.init_state
    if state.joint_pos is None:
        if not spec.keys:
            raise ValueError("EntityCfg: init_state.joint_pos is None, which takes the model's keyframe, but the model has none")
        spec.keys[0].name = "init_state"
        return
    joints = _joints(spec)
    angles = [float(value_of(state.joint_pos, name, 0.0)) for name in joints]
    root = [*state.pos, *state.rot] if len(joints) < len(spec.joints) else []
    key = spec.add_key(name="init_state", qpos=[*root, *angles])
    if cfg.articulation is not None and cfg.articulation.actuators and joints:
        by_name = dict(zip(joints, angles))
        key.ctrl = np.array([by_name.get(actuator.target, 0.0) for actuator in spec.actuators])


class Entity:
    """An attached entity: the local names of its elements in model order. ``native`` is the :class:`mjsense.scene.Entity`."""

    _data: EntityData | None = None
    """Once there is a simulation."""

    def __init__(self, native: Any, cfg: Any) -> None:
        self.native = native
        self.cfg = cfg

    def __repr__(self) -> str:
        return f"<Entity of mjlab: {self.native!r}>"

    @property
    def is_fixed_base(self) -> bool:
        """Whether the entity has no free joint."""
        return self.native.fixed_base

    @property
    def body_names(self) -> tuple[str, ...]:
        return self.native.body_names

    @property
    def geom_names(self) -> tuple[str, ...]:
        return self.native.geom_names

    @property
    def site_names(self) -> tuple[str, ...]:
        return self.native.site_names

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Without the free joint."""
        names = self.native.joint_names
        return names if self.is_fixed_base else names[1:]

    @property
    def actuator_names(self) -> tuple[str, ...]:
        return self.native.actuator_names

    @property
    def tendon_names(self) -> tuple[str, ...]:
        return self.native.tendon_names

    @property
    def camera_names(self) -> tuple[str, ...]:
        return self.native.camera_names

    @property
    def num_joints(self) -> int:
        """Without the free joint."""
        return len(self.joint_names)

    def find_bodies(self, name_keys: str | Sequence[str], preserve_order: bool = False) -> tuple[list[int], list[str]]:
        """Local indices and names of the bodies that the expressions match completely; UnknownNameError without a match."""
        return find(name_keys, self.body_names, "body", preserve_order)

    def find_joints(self, name_keys: str | Sequence[str], preserve_order: bool = False) -> tuple[list[int], list[str]]:
        """Like find_bodies(), for joints."""
        return find(name_keys, self.joint_names, "joint", preserve_order)

    def find_geoms(self, name_keys: str | Sequence[str], preserve_order: bool = False) -> tuple[list[int], list[str]]:
        """Like find_bodies(), for geoms."""
        return find(name_keys, self.geom_names, "geom", preserve_order)

    def find_sites(self, name_keys: str | Sequence[str], preserve_order: bool = False) -> tuple[list[int], list[str]]:
        """Like find_bodies(), for sites."""
        return find(name_keys, self.site_names, "site", preserve_order)

    def find_actuators(self, name_keys: str | Sequence[str], preserve_order: bool = False) -> tuple[list[int], list[str]]:
        """Like find_bodies(), for actuators."""
        return find(name_keys, self.actuator_names, "actuator", preserve_order)

    def find_tendons(self, name_keys: str | Sequence[str], preserve_order: bool = False) -> tuple[list[int], list[str]]:
        """Like find_bodies(), for tendons."""
        return find(name_keys, self.tendon_names, "tendon", preserve_order)

    @property
    def data(self) -> EntityData:
        """The state in all worlds."""
        if self._data is None:
            raise RuntimeError(f"entity '{self.native.name}' has no data yet: make a Simulation of its scene")
        return self._data

    # Writers: ``env_ids`` are ids or a mask of the worlds, by default of all. Then call ``forward()``.

    def write_root_state_to_sim(self, root_state: Any, env_ids: Any = None) -> None:
        """Pose (m, wxyz), linear and angular velocity of the root in the world's frame, ``[N, 13]``."""
        if root_state.shape[-1] != 13:
            raise ValueError(f"write_root_state_to_sim: root_state has {counted(root_state.shape[-1], 'column')}, not 13")
        self.write_root_link_pose_to_sim(root_state[:, :7], env_ids)
        self.write_root_link_velocity_to_sim(root_state[:, 7:], env_ids)

    def write_root_link_pose_to_sim(self, root_pose: Any, env_ids: Any = None) -> None:
        self.data.write_root_pose(root_pose, env_ids)

    def write_root_link_velocity_to_sim(self, root_velocity: Any, env_ids: Any = None) -> None:
        """Of the root's origin, in the world's frame, ``[N, 6]``; the pose is that in ``qpos``."""
        self.data.write_root_velocity(root_velocity, env_ids)

    def write_root_link_velocity_b_to_sim(self, root_velocity_b: Any, env_ids: Any = None) -> None:
        """In the root's frame."""
        self.data.write_root_velocity(root_velocity_b, env_ids, in_body=True)

    def write_root_com_velocity_to_sim(self, root_velocity: Any, env_ids: Any = None) -> None:
        """Of the root's centre of mass, in the world's frame."""
        self.data.write_root_velocity(root_velocity, env_ids, of_mass=True)

    def write_joint_state_to_sim(self, position: Any, velocity: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        """``[N, joints]``, without the free joint."""
        self.write_joint_position_to_sim(position, joint_ids, env_ids)
        self.write_joint_velocity_to_sim(velocity, joint_ids, env_ids)

    def write_joint_position_to_sim(self, position: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self.data.write_joints("qpos", position, joint_ids, env_ids)

    def write_joint_velocity_to_sim(self, velocity: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self.data.write_joints("qvel", velocity, joint_ids, env_ids)

    def write_ctrl_to_sim(self, ctrl: Any, ctrl_ids: Any = None, env_ids: Any = None) -> None:
        self.data.write_joints("ctrl", ctrl, ctrl_ids, env_ids)

    def write_external_wrench_to_sim(self, forces: Any, torques: Any, env_ids: Any = None, body_ids: Any = None) -> None:
        """``[N, bodies, 3]``, N and N m in the world's frame, until the next call or reset; None keeps the present ones."""
        self.data.write_wrench(forces, torques, env_ids, body_ids)

    def write_mocap_pose_to_sim(self, mocap_pose: Any, env_ids: Any = None) -> None:
        """Of an entity without a free joint, ``[N, 7]``: m, wxyz."""
        self.data.write_mocap_pose(mocap_pose, env_ids)

    # Targets of actuators, which write_data_to_sim() writes to their controls.

    def set_joint_position_target(self, position: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self.data.set_target("joint_pos_target", position, joint_ids, env_ids)

    def set_joint_velocity_target(self, velocity: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self.data.set_target("joint_vel_target", velocity, joint_ids, env_ids)

    def set_joint_effort_target(self, effort: Any, joint_ids: Any = None, env_ids: Any = None) -> None:
        self.data.set_target("joint_effort_target", effort, joint_ids, env_ids)

    def set_tendon_len_target(self, length: Any, tendon_ids: Any = None, env_ids: Any = None) -> None:
        self.data.set_target("tendon_len_target", length, tendon_ids, env_ids)

    def set_tendon_vel_target(self, velocity: Any, tendon_ids: Any = None, env_ids: Any = None) -> None:
        self.data.set_target("tendon_vel_target", velocity, tendon_ids, env_ids)

    def set_tendon_effort_target(self, effort: Any, tendon_ids: Any = None, env_ids: Any = None) -> None:
        self.data.set_target("tendon_effort_target", effort, tendon_ids, env_ids)

    def set_site_effort_target(self, effort: Any, site_ids: Any = None, env_ids: Any = None) -> None:
        self.data.set_target("site_effort_target", effort, site_ids, env_ids)

    def write_data_to_sim(self) -> None:
        """Writes the targets to the controls of all actuators of the entity. Call it before a physics step."""
        self.data.write_targets()

    def reset(self, env_ids: Any = None) -> None:
        """Sets the targets to 0."""
        self.data.clear_targets(env_ids)

    clear_state = reset

    def update(self, dt: float) -> None:
        """Has no effect: MuJoCo computes the actuators."""


__all__ = ["Entity", "EntityArticulationInfoCfg", "EntityCfg"]
