# SPDX-License-Identifier: Apache-2.0
"""The worlds, the robot and the task as sensors written for MolmoSpaces see them: ``get_observation(env, task, batch_index)``.

Everything here shows; nothing can be written through it.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from mjsense import _core

if TYPE_CHECKING:
    from mjsense.simulation import Simulation


def _matrix(pose: np.ndarray) -> np.ndarray:
    """4x4 of position and quaternion (wxyz)."""
    rotation = np.empty(9)
    mujoco.mju_quat2Mat(rotation, pose[3:])
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = rotation.reshape(3, 3), pose[:3]
    return out


def _frame(pos: np.ndarray, mat: np.ndarray) -> np.ndarray:
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = mat.reshape(3, 3), pos
    return out


class PeerEnv:
    """The worlds of a simulation. Whatever is not here is the simulation's: ``env.qpos[batch_index]``, ``env.scene["imu"]``."""

    def __init__(self, sim: Simulation, view: _core.TaskView | None = None) -> None:
        self.sim = sim
        """The simulation."""
        self._view = view
        self._task: PeerTask | None = None
        self._world = 0
        self._datas: list[mujoco.MjData] = []
        self._copies: Any = None
        self.camera_manager = SimpleNamespace(registry=Cameras(self))
        """``camera_manager.registry[name]``: cameras by the names of the sensors that show them."""
        self._robots: tuple[PeerRobot, ...] = ()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__") or name in ("sim", "_view"):
            raise AttributeError(name)
        if name in ("robots", "current_robot"):
            raise AttributeError(f"env.{name}: this simulation knows no robot; those of recordings and make_vec do")
        return getattr(self.sim, name)

    @property
    def task(self) -> PeerTask | None:
        """What is played; None where nothing is."""
        if self._task is None and self._view is not None:
            self._task = PeerTask(self, self._view)
        return self._task

    @property
    def n_batch(self) -> int:
        """Worlds."""
        return self.sim.num_worlds

    @property
    def current_batch_index(self) -> int:
        """The world whose sensor is asked."""
        return self._world

    @current_batch_index.setter
    def current_batch_index(self, world: int) -> None:
        if not 0 <= world < self.n_batch:
            raise ValueError(f"Batch index {world} out of range [0, {self.n_batch - 1}]")
        self._world = world

    @property
    def mj_model(self) -> mujoco.MjModel:
        """The model of all worlds; what was randomized by world is not in it."""
        return self.sim.model

    current_model = mj_model

    @property
    def mj_datas(self) -> Sequence[mujoco.MjData]:
        """A mujoco.MjData of each world as it is now, derived quantities and contacts included: copies, which nobody reads back."""
        if self._copies is None:
            self._datas = [mujoco.MjData(self.mj_model) for _ in range(self.n_batch)]
            self._copies = self.sim._core.data_copies(self._datas)
        self._make_current()
        return self._datas

    @property
    def current_data(self) -> mujoco.MjData:
        """That of the world whose sensor is asked."""
        return self.mj_datas[self._world]

    def _make_current(self) -> None:
        if self._copies is not None:
            self.sim._core.refresh(self._copies)

    @contextmanager
    def _asked(self) -> Iterator[PeerEnv]:
        """While sensors are asked: MjData objects that they keep show the present state, and one may ask another."""
        self._make_current()
        before = self._world
        try:
            yield self
        finally:
            self._world = before

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
        """That of the world whose sensor is asked."""
        return self.robots[self._world]

    def _image(self, camera_name: str, field: str) -> np.ndarray:
        sensors = self.sim.scene.sensors
        if camera_name not in self.camera_manager.registry:
            raise KeyError(f"Camera '{camera_name}' not found in registry.")
        fields = sensors[camera_name].fields
        if field not in fields:
            raise KeyError(f"camera '{camera_name}' has no {field}, only {', '.join(fields)}")
        return fields[field][self._world].copy()

    def render_rgb_frame(self, camera_name: str) -> np.ndarray:
        """uint8 ``[H, W, 3]``, row 0 the top."""
        return self._image(camera_name, "rgb")

    def render_depth_frame(self, camera_name: str) -> np.ndarray:
        """float32 ``[H, W]``, m along the optical axis, of a camera that records depth."""
        depth = self._image(camera_name, "depth")
        return depth.reshape(depth.shape[:2])

    def render_segmentation_frame(self, camera_name: str) -> np.ndarray:
        """int32 ``[H, W, 2]``: id and type of the object, -1 the background."""
        return self._image(camera_name, "segmentation")

    def get_segmentation_mask_of_object(self, object_name: str, camera_name: str, batch_index: int = 0) -> np.ndarray | None:
        """bool ``[H, W]``: where the visible geoms of the body and those below it are; None if there is no such body."""
        model = self.mj_model
        root = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, object_name)
        if root < 0:
            return None
        before, self.current_batch_index = self._world, batch_index
        try:
            picture = self.render_segmentation_frame(camera_name)
        finally:
            self._world = before
        below = np.zeros(model.nbody, bool)
        for body in range(root, model.nbody):  # parents come first
            below[body] = body == root or (body > root and below[model.body_parentid[body]])
        geoms = np.flatnonzero(below[model.geom_bodyid] & (model.geom_group < 3))
        return (picture[..., 1] == int(mujoco.mjtObj.mjOBJ_GEOM)) & np.isin(picture[..., 0], geoms)


class Cameras:
    """Cameras by the name of the sensor that shows them."""

    def __init__(self, env: PeerEnv) -> None:
        self._env = env

    def _names(self) -> dict[str, str]:
        """MuJoCo's name of each."""
        if self._env._view is not None:
            return {camera["name"]: camera["mjcf_camera"] for camera in self._env._view.cameras()}
        sensors = self._env.sim.scene.sensors
        return {name: s.cfg.camera_name or name for name, s in sensors.items() if s.kind == "camera" and s.cfg is not None}

    def __contains__(self, name: object) -> bool:
        return name in self._names()

    def __iter__(self) -> Iterator[str]:
        return iter(self._names())

    def __len__(self) -> int:
        return len(self._names())

    def __getitem__(self, name: str) -> PeerCamera:
        names = self._names()
        if name not in names:
            raise KeyError(f"Camera '{name}' not found in registry: there are {', '.join(names) or 'none'}")
        return PeerCamera(self._env, name, self._env.mj_model.camera(names[name]).id)

    def keys(self) -> list[str]:
        return list(self)


class PeerCamera:
    """A camera in the world whose sensor is asked, as it is now."""

    def __init__(self, env: PeerEnv, name: str, camera: int) -> None:
        self._env, self.name, self._id = env, name, camera

    @property
    def _axes(self) -> np.ndarray:
        return self._env.current_data.cam_xmat[self._id].reshape(3, 3)

    @property
    def pos(self) -> np.ndarray:
        """m, world ``[3]``."""
        return self._env.current_data.cam_xpos[self._id].copy()

    @property
    def forward(self) -> np.ndarray:
        """Unit vector, world ``[3]``."""
        return -self._axes[:, 2]

    @property
    def up(self) -> np.ndarray:
        """Unit vector, world ``[3]``."""
        return self._axes[:, 1].copy()

    @property
    def fov(self) -> float:
        """Vertical, degrees."""
        return float(self._env.mj_model.cam_fovy[self._id])

    def get_pose(self) -> np.ndarray:
        """4x4, columns right, down, forward, position: camera to world."""
        axes = self._axes
        return _frame(self.pos, np.stack([axes[:, 0], -axes[:, 1], -axes[:, 2]], axis=1))


class MoveGroup:
    """Joints of a robot that move together, with their actuators and tool frame."""

    def __init__(self, view: RobotView, group: dict[str, Any]) -> None:
        self._view = view
        self.name: str = group["name"]
        self.kind: str = group["kind"]
        """base, arm or gripper."""
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
        """``[n, 2]``, infinite where there are none."""
        ranges = np.tile([-np.inf, np.inf], (self.pos_dim, 1))
        for joint in self._joint_ids:
            if self.mj_model.jnt_limited[joint] and self.mj_model.jnt_type[joint] >= mujoco.mjtJoint.mjJNT_SLIDE:
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
        return _frame(self.mj_data.site_xpos[self._leaf_site], self.mj_data.site_xmat[self._leaf_site])

    @property
    def root_frame_to_world(self) -> np.ndarray:
        """4x4 of the root body."""
        return _frame(self.mj_data.xpos[self.root_body_id], self.mj_data.xmat[self.root_body_id])

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
            mujoco.mj_jacSite(self.mj_model, self.mj_data, jacobian[:3], jacobian[3:], self._leaf_site)
        return jacobian


class Gripper(MoveGroup):
    """A gripper."""

    @property
    def inter_finger_dist(self) -> float:
        """m, between the pads."""
        left, right = (self.mj_data.site_xpos[site] for site in self._pads)
        return float(np.linalg.norm(left - right))

    @property
    def inter_finger_dist_range(self) -> tuple[float, float]:
        """m."""
        return 0.0, self._max_opening

    @property
    def is_open(self) -> bool:
        """More than half."""
        return self.inter_finger_dist > 0.5 * self._max_opening


class Base(MoveGroup):
    """What carries the robot."""

    @property
    def pose(self) -> np.ndarray:
        """4x4, world; it stands on the floor."""
        body = self._view.base_body
        return _frame(self.mj_data.xpos[body], self.mj_data.xmat[body])

    leaf_frame_to_world = root_frame_to_world = pose  # pyright: ignore[reportIncompatibleMethodOverride]  # a property too

    @property
    def is_mobile(self) -> bool:
        return self.n_actuators > 0


class RobotView:
    """A robot's move groups in one world."""

    def __init__(self, env: PeerEnv, view: _core.TaskView, world: int) -> None:
        self._env, self._world = env, world
        self.name: str = view.robot_name
        self.base_body: int = view.base_body
        kinds = {"base": Base, "gripper": Gripper}
        self._groups = {group["name"]: kinds.get(group["kind"], MoveGroup)(self, group) for group in view.groups()}
        found = [group for group in self._groups.values() if isinstance(group, Base)]
        nothing = {"name": "base", "kind": "base", "joints": [], "qpos": [], "dofs": [], "actuators": [], "leaf_site": -1,
                   "root_body": self.base_body, "pad_sites": [-1, -1], "max_opening": 0.0}  # fmt: skip
        self.base: Base = found[0] if found else Base(self, nothing)

    @property
    def mj_model(self) -> mujoco.MjModel:
        return self._env.mj_model

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
            raise ValueError(f"move group '{gripper_group_id}' is no gripper; {', '.join(self.get_gripper_movegroup_ids())} are")
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

    def __init__(self, env: PeerEnv, view: _core.TaskView, world: int) -> None:
        self._task, self._world = view, world
        self.robot_view = RobotView(env, view, world)
        """Move groups and their frames."""
        self.kinematics = self
        """Has fk()."""

    @property
    def name(self) -> str:
        return self.robot_view.name

    def last_unnoised_cmd_joint_pos(self) -> dict[str, np.ndarray]:
        """Targets of the controlled groups, without noise; before the first action what the controllers hold."""
        return self._task.targets(self._world)

    def fk(self, move_group_qpos: dict[str, np.ndarray], base_pose: np.ndarray, rel_to_base: bool = False) -> dict[str, np.ndarray]:
        """4x4 of every group's tool frame with its joints there: in the base frame, or in the world with the base at base_pose."""
        poses = {name: _matrix(pose) for name, pose in self._task.fk({k: list(v) for k, v in move_group_qpos.items()}).items()}
        return poses if rel_to_base else {name: np.asarray(base_pose) @ pose for name, pose in poses.items()}


class PeerPolicy:
    """A planner that drives the robot, in the world whose sensor is asked."""

    def __init__(self, env: PeerEnv, view: _core.TaskView) -> None:
        self._env = env
        self._view: Any = view

    def get_all_phases(self) -> dict[str, int]:
        """Numbers of the phases."""
        return self._view.phases

    def get_phase(self) -> str:
        """Name of the present one."""
        number = self._view.plan(self._env.current_batch_index)[0]
        return next((name for name, n in self._view.phases.items() if n == number), "unknown")

    @property
    def retry_count(self) -> int:
        return self._view.plan(self._env.current_batch_index)[1]

    @property
    def target_poses(self) -> dict[str, np.ndarray]:
        """4x4 where the gripper is to close, world: "grasp"."""
        pose = self._view.plan(self._env.current_batch_index)[2]
        return {"grasp": _matrix(pose) if np.any(pose[3:]) else np.eye(4)}


# Classes of MolmoSpaces that its sensors ask a policy for.
_PLANNERS = (
    ("molmo_spaces.policy.base_policy", "PlannerPolicy"),
    (
        "molmo_spaces.policy.solvers.object_manipulation.base_object_manipulation_planner_policy",
        "BaseObjectManipulationPlannerPolicy",
    ),
)


class _Infos(Sequence):
    """What the task says of each world, read when it is asked for."""

    def __init__(self, view: _core.TaskView, worlds: int) -> None:
        self._view: Any = view
        self._worlds = worlds

    def __len__(self) -> int:
        return self._worlds

    def __getitem__(self, world: Any) -> Any:
        if isinstance(world, slice):
            return [self[w] for w in range(*world.indices(self._worlds))]
        if not -self._worlds <= world < self._worlds:
            raise IndexError(world)
        return json.loads(self._view.info(int(world) % self._worlds))


class PeerTask:
    """What is played. What MolmoSpaces knows of its one world is here that of the world whose sensor is asked.

    Of a :class:`mjsense.Task` of yours everything else is there, too; as it judges after the sensors, ``get_info()`` and
    ``judge_success()`` are then of the observation before.
    """

    def __init__(self, env: PeerEnv, view: _core.TaskView) -> None:
        self.env = self._env = env
        self._view: Any = view
        self.config = PeerConfig(self)
        """Of the experiment, as far as sensors read it."""
        self._policy: PeerPolicy | None = None

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or self._view.own is None:
            raise AttributeError(f"the task has no '{name}'")
        return getattr(self._view.own, name)

    @property
    def _world(self) -> int:
        return self._env.current_batch_index

    @property
    def last_action(self) -> dict[str, Any] | None:
        """As the policy gave it, by move group, and ``success`` if it judged; None before the first."""
        return self._view.last_action(self._world)

    @property
    def _registered_policy(self) -> PeerPolicy | None:
        if not self._view.has_policy or self._view.plan(0) is None:
            return None
        for module, name in _PLANNERS:
            if module in sys.modules and not issubclass(PeerPolicy, getattr(sys.modules[module], name)):
                getattr(sys.modules[module], name).register(PeerPolicy)
        self._policy = self._policy or PeerPolicy(self._env, self._view)
        return self._policy

    def get_info(self) -> Sequence[dict[str, Any]]:
        """What the task says about the state, by world: errors, success, step."""
        return _Infos(self._view, self._env.n_batch)

    def get_task_objects(self, batch_index: int = 0) -> dict[str, str]:
        """Bodies by role: the grippers, then what the task is about."""
        view, model = self._env.robots[batch_index].robot_view, self._env.mj_model
        objects = {name: model.body(view.get_move_group(name).root_body_id).name for name in view.get_gripper_movegroup_ids()}
        return objects | dict(self._view.objects(batch_index))

    def get_task_description(self) -> str:
        """Pick up the mug"""
        return self._view.description(self._world)

    @property
    def episode_step_count(self) -> int:
        """Control steps of the episode."""
        return self._view.step(self._world)

    def num_steps_taken(self) -> int:
        """The same."""
        return self.episode_step_count

    def judge_success(self) -> bool:
        """At this moment."""
        return self._view.evaluate(self._world)[1]

    def get_reward(self) -> np.ndarray:
        """``[1]``."""
        return np.array([self._view.evaluate(self._world)[0]])

    def is_terminal(self) -> bool:
        """The episode is over by the policy's word or by success; a time-out is not."""
        return self._view.evaluate(self._world)[2]

    def is_timed_out(self) -> bool:
        """The horizon is reached."""
        return self._view.evaluate(self._world)[3]

    def is_done(self) -> bool:
        """One of the two."""
        return self.is_terminal() or self.is_timed_out()


class PeerConfig:
    """Of a task: its type and times, its objects (``task_config``), its cameras (``camera_config``)."""

    def __init__(self, task: PeerTask) -> None:
        view = task._view
        self.task_type: str = view.type
        self.task_horizon: int = view.horizon
        self.policy_dt_ms: int = view.policy_dt_ms
        self.ctrl_dt_ms = self.sim_dt_ms = view.sim_dt_ms
        self.robot_config = SimpleNamespace(name=view.robot_name)
        self.task_config = PeerTaskConfig(task)
        cameras = view.cameras()
        specs = [SimpleNamespace(name=c["name"], record_depth=c["depth"], skip_erosion=False, is_warped=False) for c in cameras]
        size = (cameras[0]["width"], cameras[0]["height"]) if cameras else (0, 0)
        self.camera_config = SimpleNamespace(cameras=specs, img_resolution=size)


class PeerTaskConfig:
    """The objects of the episode: ``pickup_obj_name``, ``pickup_obj_start_pose``, ``pickup_obj_goal_pose`` and so for every role."""

    use_sensors = True
    action_dtype = "float32"

    def __init__(self, task: PeerTask) -> None:
        self._task = task
        self.task_type: str = task._view.type
        self.added_objects: dict[str, str] = {}

    @property
    def referral_expressions(self) -> dict[str, list[tuple[str, float]]]:
        """What the objects may be called, with weights."""
        return self._task._view.referrals(self._task._world)

    def __getattr__(self, name: str) -> Any:
        if not name.startswith("_"):
            view, world = self._task._view, self._task._world
            roles = dict(view.objects(world))
            for role, body in roles.items():
                if name == f"{role}_name":
                    return body
                if name == f"{role}_start_pose":
                    return view.start_pose(world, role).tolist()
                if name == f"{role}_goal_pose":
                    goal = view.goal_pose(world, role)
                    return None if goal is None else goal.tolist()
        raise AttributeError(f"the task's configuration has no '{name}'")
