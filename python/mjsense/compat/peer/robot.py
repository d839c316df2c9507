# SPDX-License-Identifier: Apache-2.0
"""A robot in one world: its move groups, their joints, controls and frames."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.compat.peer.matrices import matrix_of, matrix_of_pose
from mjsense.compat.peer.worlds import PeerWorlds
from mjsense.core import mujoco_names
from mjsense.sim.simulation import Simulation

if TYPE_CHECKING:
    import mujoco


class MoveGroup:
    """Joints of a robot that move together, with their actuators and tool frame."""

    def __init__(self, view: RobotView, group: dict[str, Any]) -> None:
        self._view = view
        self.name: str = group["name"]
        self.kind: str = group["kind"]
        """Kind: base, arm or gripper."""
        self._joint_ids, self._joint_posadr, self._joint_veladr = group["joints"], group["qpos"], group["dofs"]
        self._actuator_ids = group["actuators"]
        self._leaf_site: int = group["leaf_site"]
        self.root_body_id: int = group["root_body"]
        self._pads, self._max_opening = group["pad_sites"], group["max_opening"]

    @property
    def mj_model(self) -> mujoco.MjModel:
        return self._view.mj_model

    @property
    def mj_data(self) -> mujoco.MjData:
        return self._view.mj_data

    @property
    def n_joints(self) -> int:
        return len(self._joint_ids)

    @property
    def n_actuators(self) -> int:
        return len(self._actuator_ids)

    @property
    def pos_dim(self) -> int:
        return len(self._joint_posadr)

    @property
    def vel_dim(self) -> int:
        return len(self._joint_veladr)

    @property
    def joint_pos(self) -> np.ndarray:
        """rad or m ``[n]``."""
        return self.mj_data.qpos[self._joint_posadr]

    @property
    def joint_vel(self) -> np.ndarray:
        """rad/s or m/s ``[n]``."""
        return self.mj_data.qvel[self._joint_veladr]

    @property
    def joint_pos_limits(self) -> np.ndarray:
        """``[n, 2]``, infinite for joints without limits."""
        ranges = np.tile([-np.inf, np.inf], (self.pos_dim, 1))
        for joint in self._joint_ids:
            if self.mj_model.jnt_limited[joint] and self.mj_model.jnt_type[joint] >= mujoco_names.Joint.SLIDE:
                ranges[self._joint_posadr.index(self.mj_model.jnt_qposadr[joint])] = self.mj_model.jnt_range[joint]
        return ranges

    @property
    def ctrl(self) -> np.ndarray:
        """``[n_actuators]``."""
        return self.mj_data.ctrl[self._actuator_ids]

    @property
    def ctrl_limits(self) -> np.ndarray:
        """``[n_actuators, 2]``."""
        return self.mj_model.actuator_ctrlrange[self._actuator_ids].copy()

    @property
    def leaf_frame_to_world(self) -> np.ndarray:
        """4x4 of the tool frame."""
        if self._leaf_site < 0:
            return self._view.base.pose
        return matrix_of(self.mj_data.site_xpos[self._leaf_site], self.mj_data.site_xmat[self._leaf_site])

    @property
    def root_frame_to_world(self) -> np.ndarray:
        """4x4 of the root body."""
        return matrix_of(self.mj_data.xpos[self.root_body_id], self.mj_data.xmat[self.root_body_id])

    @property
    def leaf_frame_to_robot(self) -> np.ndarray:
        """4x4 of the tool frame in the robot's base frame."""
        return np.linalg.inv(self._view.base.pose) @ self.leaf_frame_to_world

    @property
    def root_frame_to_robot(self) -> np.ndarray:
        """4x4 of the root body in the robot's base frame."""
        return np.linalg.inv(self._view.base.pose) @ self.root_frame_to_world

    @property
    def leaf_frame_to_root(self) -> np.ndarray:
        """4x4 of the tool frame in the root body's."""
        return np.linalg.inv(self.root_frame_to_world) @ self.leaf_frame_to_world

    def get_jacobian(self) -> np.ndarray:
        """``[6, nv]`` of the tool frame: linear, then angular, world axes."""
        jacobian = np.zeros((6, self.mj_model.nv))
        if self._leaf_site >= 0:
            _core.jac_site(self.mj_model._address, self.mj_data._address, jacobian, self._leaf_site)
        return jacobian


class Gripper(MoveGroup):
    """A gripper."""

    @property
    def inter_finger_dist(self) -> float:
        """Distance between the pads, m."""
        left, right = (self.mj_data.site_xpos[site] for site in self._pads)
        return float(np.linalg.norm(left - right))

    @property
    def inter_finger_dist_range(self) -> tuple[float, float]:
        """m."""
        return 0.0, self._max_opening

    @property
    def is_open(self) -> bool:
        """Whether the gripper is more than half open."""
        return self.inter_finger_dist > 0.5 * self._max_opening


class Base(MoveGroup):
    """The robot's base."""

    @property
    def pose(self) -> np.ndarray:
        """4x4, world, at floor level."""
        body = self._view.base_body
        return matrix_of(self.mj_data.xpos[body], self.mj_data.xmat[body])

    leaf_frame_to_world = root_frame_to_world = pose  # pyright: ignore[reportIncompatibleMethodOverride]  # a property as well

    @property
    def is_mobile(self) -> bool:
        return self.n_actuators > 0


class RobotView:
    """A robot's move groups in one world."""

    def __init__(self, env: PeerWorlds, view: _core.TaskView, world: int) -> None:
        self._env, self._world = env, world
        self.name: str = view.robot_name
        self.base_body: int = view.base_body
        kinds = {"base": Base, "gripper": Gripper}
        self._groups = {group["name"]: kinds.get(group["kind"], MoveGroup)(self, group) for group in view.groups()}
        found = [group for group in self._groups.values() if isinstance(group, Base)]
        nothing = {
            "name": "base",
            "kind": "base",
            "joints": [],
            "qpos": [],
            "dofs": [],
            "actuators": [],
            "leaf_site": -1,
            "root_body": self.base_body,
            "pad_sites": [-1, -1],
            "max_opening": 0.0,
        }
        self.base: Base = found[0] if found else Base(self, nothing)

    @property
    def mj_model(self) -> mujoco.MjModel:
        return self._env.mj_models[self._world]

    @property
    def mj_data(self) -> mujoco.MjData:
        return self._env.mj_datas[self._world]

    @property
    def n_grippers(self) -> int:
        return len(self.get_gripper_movegroup_ids())

    def move_group_ids(self) -> list[str]:
        return list(self._groups)

    def get_gripper_movegroup_ids(self) -> list[str]:
        return [name for name, group in self._groups.items() if isinstance(group, Gripper)]

    def get_move_group(self, mg_id: str) -> MoveGroup:
        return self._groups[mg_id]

    def get_gripper(self, gripper_group_id: str) -> Gripper:
        group = self._groups[gripper_group_id]
        if not isinstance(group, Gripper):
            raise ValueError(
                f"move group '{gripper_group_id}' is not a gripper; grippers: {', '.join(self.get_gripper_movegroup_ids())}"
            )
        return group

    def _each(self, what: str, ids: list[str] | None) -> dict[str, np.ndarray]:
        return {name: getattr(self._groups[name], what) for name in (self.move_group_ids() if ids is None else ids)}

    def get_qpos_dict(self, move_group_ids: list[str] | None = None) -> dict[str, np.ndarray]:
        """Joint positions by group."""
        return self._each("joint_pos", move_group_ids)

    def get_qvel_dict(self, move_group_ids: list[str] | None = None) -> dict[str, np.ndarray]:
        """Joint velocities by group."""
        return self._each("joint_vel", move_group_ids)

    def get_ctrl_dict(self, move_group_ids: list[str] | None = None) -> dict[str, np.ndarray]:
        """Controls by group."""
        return self._each("ctrl", move_group_ids)

    def get_jacobian(self, move_group_id: str, input_move_group_ids: list[str]) -> np.ndarray:
        """``[6, n]`` of a group's tool frame by the joints of these groups."""
        columns = [column for name in input_move_group_ids for column in self._groups[name]._joint_veladr]
        return self._groups[move_group_id].get_jacobian()[:, columns]


class PeerRobot:
    """A robot in one world."""

    def __init__(self, env: PeerWorlds, view: _core.TaskView, world: int) -> None:
        self._task, self._world = view, world
        self.robot_view = RobotView(env, view, world)
        """Move groups and their frames."""
        self.kinematics = self
        """Has fk()."""

    @property
    def name(self) -> str:
        return self.robot_view.name

    def last_unnoised_cmd_joint_pos(self) -> dict[str, np.ndarray]:
        """Targets of the controlled groups, without noise; before the first action, the controllers' initial targets."""
        return self._task.targets(self._world)

    def fk(
        self, move_group_qpos: dict[str, np.ndarray], base_pose: np.ndarray, rel_to_base: bool = False
    ) -> dict[str, np.ndarray]:
        """4x4 of every group's tool frame with its joints there: in the base frame, or in the world with the base at
        base_pose."""
        poses = {
            name: matrix_of_pose(pose) for name, pose in self._task.fk({k: list(v) for k, v in move_group_qpos.items()}).items()
        }
        return poses if rel_to_base else {name: np.asarray(base_pose) @ pose for name, pose in poses.items()}


class RobotWorlds(PeerWorlds):
    """Worlds with the robot of each."""

    def __init__(self, sim: Simulation, view: _core.TaskView | None) -> None:
        super().__init__(sim, view)
        self._robots: tuple[PeerRobot, ...] = ()

    @property
    def robots(self) -> Sequence[PeerRobot]:
        """The robot of each world."""
        if self._view is None:
            raise AttributeError("robots")
        if not self._robots:
            self._robots = tuple(PeerRobot(self, self._view, world) for world in range(self.n_batch))
        return self._robots

    @property
    def current_robot(self) -> PeerRobot:
        """The robot of the world whose sensor is being computed."""
        return self.robots[self._world]
