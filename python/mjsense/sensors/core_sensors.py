# SPDX-License-Identifier: Apache-2.0
"""Classes of the core suite's sensors, for use in a SensorSuite, a Simulation or a recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from mjsense import _core
from mjsense.core import mujoco_names
from mjsense.core.arguments import checked
from mjsense.core.errors import UnknownNameError
from mjsense.sensors.native_sensor import NativeSensor
from mjsense.sensors.nested_streams import nest
from mjsense.sensors.sensor import Sensor


class CoreSensor(NativeSensor):
    """Base class of sensors that are computed in C++ and created when they are added to a simulation."""

    def __init__(self, uuid: str, kind: str) -> None:
        if not uuid:
            raise ValueError(f"{type(self).__name__} has no uuid")
        self._handle: Any = None
        self._core: Any = None
        self._data: Any = None
        self._fields: Mapping[str, Any] = {}
        self.name: str = uuid
        self.kind: str = kind
        self.cfg: Any = None

    def _make(self, sim: Any) -> _core.SensorHandle:
        """Creates the C++ sensor for this simulation; the caller adds it."""
        self._handle, self._core, self._fields = self._build(sim), sim._core, {}
        return self._handle

    def _build(self, sim: Any) -> _core.SensorHandle:
        raise NotImplementedError

    def _bind(self, core: _core.Simulation) -> None:
        self._core = core
        self._fields = MappingProxyType(self._handle.arrays())
        self._data = _nested(self._fields)

    def _row(self, world: int) -> Any:
        return _nested(super()._row(world))

    @property
    def data(self) -> Any:
        """The current values: an array ``[B, ...]``, or a dict by field, nested by the paths of the fields."""
        if self._core is None:
            raise RuntimeError(f"sensor '{self.name}' has no data yet: it belongs to no simulation")
        if not self._fields:
            self._bind(self._core)
        return super().data

    @property
    def specs(self) -> dict[str, _core.SensorSpec]:
        """Spec of each field: dtype, shape, unit, frame. The name of a single field is ''."""
        if self._handle is None:
            raise RuntimeError(f"sensor '{self.name}' has no fields yet: it belongs to no simulation")
        return super().specs


def _nested(fields: Any) -> Any:
    if not isinstance(fields, Mapping):
        return fields
    return fields[""] if "" in fields else nest({name: tuple(name.split("/")) for name in fields}, dict(fields))


def _sim_groups(sim: Any, context: str, groups: Mapping[str, Sequence[str]] | None) -> list[tuple[str, list[int], list[int]]]:
    """Addresses of the joints of each group. Default groups: those of the robot, or all joints as one group."""
    model = sim.model
    if groups is None and sim._view is not None:
        return [(g["name"], g["qpos"], g["dofs"]) for g in sim._view.groups()]
    if groups is None:
        return [("joints", list(range(model.nq)), list(range(model.nv)))]
    out = []
    for name, joints in groups.items():
        qpos: list[int] = []
        dofs: list[int] = []
        for joint in joints:
            i = mujoco_names.known_id(model, mujoco_names.Obj.JOINT, joint, f"{context}: group '{name}'")
            positions, velocities = mujoco_names.rows_of_joint(model, i)
            qpos += range(positions.start, positions.stop)
            dofs += range(velocities.start, velocities.stop)
        out.append((name, qpos, dofs))
    return out


@checked
class JointPositionSensor(CoreSensor):
    """Joint positions, one field per group: float32 ``[B, n]``, rad or m."""

    _velocity = False

    def __init__(self, groups: Mapping[str, Sequence[str]] | None = None, uuid: str = "qpos") -> None:
        """
        Args:
            groups: Full names of the joints by group; by default the robot's move groups or, without a robot, all joints as one
                group.
            uuid: Name in suites and files.
        """
        super().__init__(uuid, "joint_state")
        self._groups = None if groups is None else {name: list(joints) for name, joints in groups.items()}
        self._complete = True

    def _build(self, sim: Any) -> _core.SensorHandle:
        return _core.make_joint_state(self.name, self._velocity, _sim_groups(sim, f"sensor '{self.name}'", self._groups))


@checked
class JointVelocitySensor(JointPositionSensor):
    """Joint velocities, one field per group: float32 ``[B, n]``, rad/s or m/s."""

    _velocity = True

    def __init__(self, groups: Mapping[str, Sequence[str]] | None = None, uuid: str = "qvel") -> None:
        """
        Args:
            groups: Full names of the joints by group; by default the robot's move groups or, without a robot, all joints as one
                group.
            uuid: Name in suites and files.
        """
        super().__init__(groups, uuid)


@checked
class PoseSensor(CoreSensor):
    """Pose of a body or site in the world or in another frame, float32 ``[B, 7]``: position (m), quaternion (wxyz)."""

    def __init__(
        self,
        uuid: str,
        *,
        body: str | None = None,
        site: str | None = None,
        reference_body: str | None = None,
        reference_site: str | None = None,
        description: str = "",
    ) -> None:
        """
        Args:
            uuid: Name in suites and files.
            body, site: Full name of the measured body or site, such as ``robot/tool``; give one of the two.
            reference_body, reference_site: Reference frame; by default the world.
            description: One sentence.
        """
        super().__init__(uuid, "pose")
        if (body is None) == (site is None) or (reference_body is not None and reference_site is not None):
            raise ValueError(f"sensor '{uuid}': needs a body or a site, and at most one reference")
        self._frames = [
            ("body", b) if b is not None else ("site", s) if s is not None else ("", "")
            for b, s in ((body, site), (reference_body, reference_site))
        ]
        self._description = description
        self._complete = True

    def _build(self, sim: Any) -> _core.SensorHandle:
        return _core.make_pose(self.name, self._frames[0], self._frames[1], self._description)


@checked
class TcpPoseSensor(CoreSensor):
    """Pose of a gripper's tool frame in the robot's base frame, which is on the floor: float32 ``[B, 7]``, m and wxyz. Requires a
    robot."""

    def __init__(self, gripper: str | None = None, uuid: str = "tcp_pose") -> None:
        """
        Args:
            gripper: Move group of the gripper; by default the first one.
            uuid: Name in suites and files.
        """
        super().__init__(uuid, "pose")
        self._gripper = gripper
        self._complete = True

    def _build(self, sim: Any) -> _core.SensorHandle:
        grippers = {g["name"]: g for g in _robot(sim, self).groups() if g["kind"] == "gripper"}
        name = self._gripper or next(iter(grippers), "")
        if name not in grippers:
            raise UnknownNameError(_core.unknown_name(f"sensor '{self.name}'", "gripper", name, list(grippers)))
        site, body = sim.model.site(grippers[name]["leaf_site"]).name, sim.model.body(sim._view.base_body).name
        return _core.make_pose(self.name, ("site", site), ("body", body), "Pose of the tool in the robot's base frame.")


@checked
class RobotBasePoseSensor(CoreSensor):
    """Pose of the robot's base in the world: float32 ``[B, 7]``, m and wxyz. Requires a robot."""

    def __init__(self, uuid: str = "robot_base_pose") -> None:
        """
        Args:
            uuid: Name in suites and files.
        """
        super().__init__(uuid, "pose")
        self._complete = True

    def _build(self, sim: Any) -> _core.SensorHandle:
        body = sim.model.body(_robot(sim, self).base_body).name
        return _core.make_pose(self.name, ("body", body), ("", ""), "Pose of the robot's base, on the floor.")


@checked
class EnvStatesSensor(CoreSensor):
    """The state needed to restore the scene: every free body outside the robot, and the robot's joints.

    Fields ``actors/<body>`` float32 ``[B, 13]`` (m, wxyz, m/s, rad/s: MuJoCo's qpos and qvel of the free joint);
    ``articulations/<name>`` float64 ``[B, nq + nv]`` of the robot and of every body with inner joints; and, on request,
    MolmoSpaces' ``articulations/<articulation>`` float32 ``[B, length]`` (qpos of all groups, then their qvel, then zeros). In an
    environment ``present/<body>`` bool ``[B]`` of each object that can be absent from an episode; the row of an absent object is
    zeros.
    """

    def __init__(
        self,
        groups: Mapping[str, Sequence[str]] | None = None,
        articulation: str = "",
        length: int = 0,
        robot_body: str = "",
        robot: str = "robot",
        uuid: str = "env_states",
    ) -> None:
        """
        Args:
            groups: Full names of the robot's joints by group; by default its move groups or, without a robot, none.
            articulation: Name of MolmoSpaces' field; "": none.
            length: Length of its row; 0: the size of the groups.
            robot_body: Free bodies at or below this body are not actors; by default the robot's base.
            robot: Name of the robot's field; "": no fields of bodies with inner joints.
            uuid: Name in suites and files.
        """
        super().__init__(uuid, "env_states")
        self._groups = None if groups is None else {name: list(joints) for name, joints in groups.items()}
        self._rest = articulation, length, robot_body, robot
        self._complete = True

    def _build(self, sim: Any) -> _core.SensorHandle:
        articulation, length, body, robot = self._rest
        groups = self._groups if self._groups is not None or sim._view is not None else {}
        if not body and sim._view is not None and sim._view.base_body > 0:
            body = sim.model.body(sim._view.base_body).name
        addresses = _sim_groups(sim, f"sensor '{self.name}'", groups)
        return _core.make_env_states(self.name, articulation, addresses, length, body, robot, sim._view)


@checked
class CameraParameterSensor(CoreSensor):
    """Pose and projection of a camera: fields ``cam2world_gl`` float64 ``[B, 4, 4]`` (axes right, down, forward),
    ``extrinsic_cv`` ``[B, 3, 4]``, ``intrinsic_cv`` ``[B, 3, 3]`` (pixels)."""

    def __init__(self, camera: str, width: int = 640, height: int = 480, uuid: str | None = None) -> None:
        """
        Args:
            camera: Full name of the camera in the model, such as ``robot/wrist``; in recordings also the name of its stream.
            width, height: Size of the image, pixels.
            uuid: Name in suites and files; by default ``sensor_param_<camera>``.
        """
        super().__init__(uuid or f"sensor_param_{camera}", "camera_parameters")
        self._camera, self._size = camera, (width, height)
        self._complete = True

    def _build(self, sim: Any) -> _core.SensorHandle:
        streams = {} if sim._view is None else {c["name"]: c["mjcf_camera"] for c in sim._view.cameras()}
        camera = streams.get(self._camera, self._camera)
        mujoco_names.known_id(sim.model, mujoco_names.Obj.CAMERA, camera, f"sensor '{self.name}'")
        return _core.make_camera_parameters(self.name, camera, *self._size)


@checked
class CameraImageSensor(CoreSensor):
    """One field of a camera of the scene as a sensor of the suite, without a copy: rgb uint8 ``[B, H, W, 3]``, depth float32
    ``[B, H, W]``."""

    def __init__(self, camera: str, field: str = "rgb", uuid: str | None = None) -> None:
        """
        Args:
            camera: Name of the scene's camera sensor.
            field: One of its ``data_types``.
            uuid: Name in suites and files; by default the camera's name, followed by ``_<field>`` except for rgb.
        """
        super().__init__(uuid or (camera if field == "rgb" else f"{camera}_{field}"), "shared")
        self._camera, self._field = camera, field
        self._complete = True

    def _build(self, sim: Any) -> _core.SensorHandle:
        return _core.make_shared_field(self.name, _camera(sim, self, self._camera)._handle, self._field)


@checked
class ImagePointsSensor(CoreSensor):
    """Up to ten pixels that show each object in each camera: fields ``<object>/<camera>/points`` float32 ``[B, 10, 2]``
    (fractions of the image size; unused entries are NaN) and ``num_points`` int32 ``[B, 1]``."""

    def __init__(
        self, objects: Mapping[str, str], cameras: Sequence[str], thin: Sequence[str] = (), uuid: str = "object_image_points"
    ) -> None:
        """
        Args:
            objects: Full names of bodies by object key.
            cameras: Names of the scene's camera sensors; they must have a segmentation.
            thin: Keys of objects whose points may be at the edge of their visible area.
            uuid: Name in suites and files.
        """
        super().__init__(uuid, "image_points")
        self._objects, self._cameras, self._thin = dict(objects), list(cameras), set(thin)
        self._complete = True

    def _build(self, sim: Any) -> _core.SensorHandle:
        cameras = [(name, _camera(sim, self, name)._handle, False) for name in self._cameras]
        return _core.make_image_points(self.name, [(k, b, k not in self._thin) for k, b in self._objects.items()], cameras)


@checked
class GraspStateSensor(CoreSensor):
    """Whether grippers touch and hold an object: fields ``<gripper>/held`` and ``<gripper>/touching``, bool ``[B]``. An object is
    held if it touches nothing else."""

    def __init__(self, object: str, grippers: Mapping[str, str] | None = None, uuid: str | None = None) -> None:
        """
        Args:
            object: Full name of its body.
            grippers: Full names of root bodies by gripper; by default the robot's grippers.
            uuid: Name in suites and files; by default ``grasp_state_<object>``.
        """
        super().__init__(uuid or f"grasp_state_{object}", "grasp_state")
        self._object, self._grippers = object, grippers
        self._complete = True

    def _build(self, sim: Any) -> _core.SensorHandle:
        grippers = self._grippers
        if grippers is None:
            found = [g for g in _robot(sim, self).groups() if g["kind"] == "gripper"]
            grippers = {g["name"]: sim.model.body(g["root_body"]).name for g in found}
        return _core.make_grasp_state(self.name, self._object, list(grippers.items()))


def _robot(sim: Any, sensor: CoreSensor) -> _core.TaskView:
    if sim._view is None:
        raise ValueError(
            f"sensor '{sensor.name}' needs a robot, which simulations of recordings and make_vec have: name it yourself"
        )
    return sim._view


def _camera(sim: Any, sensor: CoreSensor, name: str) -> NativeSensor:
    cameras = {key: s for key, s in sim.scene.sensors.items() if getattr(s, "kind", "") == "camera"} if sim.scene.sensors else {}
    if name not in cameras:
        raise UnknownNameError(_core.unknown_name(f"sensor '{sensor.name}'", "camera sensor", name, list(cameras)))
    return cameras[name]


class FunctionSensor(Sensor):
    """A function as a sensor: ``function(env, world)`` returns the value of one world."""

    _mjs_stateless = True

    def __init__(
        self,
        uuid: str,
        function: Callable[[Any, int], Any],
        observation_space: Any = None,
        *,
        is_dict: bool = False,
        str_max_len: int = 2000,
        unit: str = "",
        frame: str = "",
    ) -> None:
        """
        Args:
            uuid: Name in suites and files.
            function: Stateless function of :attr:`mjsense.Simulation.env` and the world's id.
            observation_space: Space of one world's value.
            is_dict: True if the value is a dict, which is stored as JSON text of at most ``str_max_len`` bytes.
            str_max_len, unit, frame: See :class:`Sensor`.
        """
        super().__init__(uuid, observation_space)
        self._function = function
        self.is_dict, self.str_max_len, self.unit, self.frame = is_dict, str_max_len, unit, frame

    def get_observation(self, env: Any, task: Any = None, batch_index: int = 0, *args: Any, **kwargs: Any) -> Any:
        return self._function(env, batch_index)
