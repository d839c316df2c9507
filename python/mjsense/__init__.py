# SPDX-License-Identifier: Apache-2.0
"""Batched sensors for MuJoCo, from the simulator to the policy to the disk.

    import mjsense as mjs

    scene = mjs.Scene(mjs.SceneCfg(
        entities={"robot": mjs.EntityCfg(model="embedded:robots/quadruped.xml")},  # or the path of your MJCF
        terrain=mjs.TerrainCfg(),
        sensors=(mjs.CameraSensorCfg(name="front", camera_name="robot/front", data_types=("rgb", "depth")),)))
    sim = mjs.Simulation(scene, num_worlds=8, decimation=4)
    sim.step()
    scene["front"].data.rgb      # uint8 [8, 120, 160, 3]
    scene["front"]               # shows what its fields are: shape, unit, frame

Where to look (``help(mjs.Simulation)`` and so on):

    what all worlds share        Scene, SceneCfg, EntityCfg, TerrainCfg
    many worlds                  Simulation: step, reset, qpos, ctrl, randomize, draw
    a program of your own        attach: sensors over your data; Renderer
    sensors of a scene           BuiltinSensorCfg, ContactSensorCfg, RayCastSensorCfg, TerrainHeightSensorCfg, LidarSensorCfg,
                                 CameraSensorCfg, ImuSensorCfg; wrapped by noise, delay, dropout: effects
    user-defined sensors         Sensor; sets of sensors: SensorSuite
    episodes of tasks            make (gymnasium.Env), make_vec (gymnasium.vector.VectorEnv)
    making recordings            record: tasks by a policy; play: by hand, in the browser; RecordEpisodes: of any
                                 environment; Recorder: your own loop; mjsense.cluster: on many machines
    reading recordings           Dataset: rows, frames, windows, statistics; replay, check_replay; render: other cameras
    editing recordings           delete_episodes, split_dataset, merge_datasets
    files of other programs      export_lerobot, export_lerobot21, export_mcap, export_rerun, export_rlds, export_robomimic,
                                 export_zarr; import_lerobot, import_robomimic
    in the browser               view: live worlds, tasks, recordings
    plots of streams             plot
    names that these accept      task_names(), robot_names(), policy_names(); user-defined: Task, Policy, Robot
    robot learning               mjsense.tasks: the names above that are about tasks, robots and policies
    trainers                     mjsense.tasks.rl.sb3, mjsense.tasks.rl.rsl
    configurations of mjlab      mjsense.compat.mjlab

``python -m mjsense --help`` is the program.
"""

import typing as _typing

from mjsense.commands import start

start.answer_early()  # if this process is the program

from mjsense.core import libmujoco

libmujoco.load()  # loads the extension, too: before it, the libmujoco that it uses

from mjsense import _core

_core.leave_no_log_file()

from mjsense._core import SensorSpec, embedded_models, robot_names
from mjsense._core import __version__ as __version__  # pyright: ignore[reportAttributeAccessIssue]  # stubs leave it out
from mjsense.core import installed_files, later_rooms, old_names
from mjsense.core.errors import UnknownNameError
from mjsense.core.errors import did_you_mean as _did_you_mean
from mjsense.dataset import (
    Dataset,
    Deviation,
    Episode,
    EpisodeCheck,
    EpisodeQuality,
    RenderProgress,
    RenderSummary,
    ReplayReport,
    SensorCheck,
    Stream,
    Video,
    check_replay,
    render,
    replay,
)
from mjsense.dataset.edit import delete_episodes, merge_datasets, split_dataset
from mjsense.dataset.import_lerobot import import_lerobot
from mjsense.dataset.import_robomimic import import_robomimic
from mjsense.exporting import (
    export_lerobot,
    export_lerobot21,
    export_mcap,
    export_rerun,
    export_rlds,
    export_robomimic,
    export_zarr,
)
from mjsense.recording.record_episodes import RecordEpisodes, RecordVectorEpisodes
from mjsense.recording.recorder import Recorder
from mjsense.rendering.renderer import Renderer
from mjsense.scene.scene import Entity, Scene
from mjsense.sensors import configs, effects, observations
from mjsense.sensors.configs import *  # noqa: F403
from mjsense.sensors.contact import ContactSensor
from mjsense.sensors.core_sensors import (
    CameraImageSensor,
    CameraParameterSensor,
    EnvStatesSensor,
    FunctionSensor,
    GraspStateSensor,
    ImagePointsSensor,
    JointPositionSensor,
    JointVelocitySensor,
    PoseSensor,
    RobotBasePoseSensor,
    TcpPoseSensor,
)
from mjsense.sensors.data import CameraData, ContactData, ImuData, RayCastData, SensorData
from mjsense.sensors.drawing import DebugShapes
from mjsense.sensors.imu import ImuSensor
from mjsense.sensors.native_sensor import BuiltinSensor, NativeSensor
from mjsense.sensors.pipeline import ObservationPipeline
from mjsense.sensors.raycast import CameraSensor, LidarSensor, RayCastSensor, TerrainHeightSensor
from mjsense.sensors.sensor import Sensor
from mjsense.sensors.suite import SensorSuite
from mjsense.sensors.user_code import SensorError
from mjsense.sim.attached import Attached, attach
from mjsense.sim.simulation import Simulation
from mjsense.tasks import gymnasium_registry
from mjsense.tasks.env import TaskEnv, make
from mjsense.tasks.policy import Policy, policy_names, register_policy
from mjsense.tasks.record_job import RecordProgress, RecordSummary
from mjsense.tasks.recording import record
from mjsense.tasks.robot import MoveGroup, Robot, RobotCamera
from mjsense.tasks.task import Task, WorldState, register_task, task_names
from mjsense.tasks.teleoperation import Teleoperation, play
from mjsense.tasks.vector import TaskVectorEnv, make_vec
from mjsense.viewer import view
from mjsense.viewer.plots import plot
from mjsense.viewer.viewer import Viewer

later_rooms.provide({
    "env": "mjsense.compat.peer.env:PeerEnv",
    "foreign_sensor": "mjsense.compat.peer.per_world:foreign_sensor",
    "record_on_ray": "mjsense.cluster.recording:record_from_options",
    "sensor_adapters": "mjsense.compat.sensor_adapters:ADAPTERS",
    "task_names": "mjsense.tasks.task:task_names",
    "task_source": "mjsense.tasks.viewer_source:task_source",
    "warp_environment": "mjsense.warp.start:environment",
    "warp_simulation": "mjsense.warp.start:simulation",
})

installed_files.name_package_folders()

gymnasium_registry.register_all()

old_names.register()

if not _typing.TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        raise AttributeError(f"module 'mjsense' has no attribute '{name}'{_did_you_mean(name, __all__)}")

# fmt: off
__all__ = [
    *configs.__all__,
    "Attached", "BuiltinSensor", "CameraData", "CameraImageSensor", "CameraParameterSensor", "CameraSensor", "ContactData",
    "ContactSensor", "Dataset", "DebugShapes", "Deviation", "Entity", "EnvStatesSensor", "Episode",
    "EpisodeCheck", "EpisodeQuality", "FunctionSensor", "GraspStateSensor", "ImagePointsSensor", "ImuData", "ImuSensor",
    "JointPositionSensor", "JointVelocitySensor", "LidarSensor", "MoveGroup", "NativeSensor", "ObservationPipeline", "Policy",
    "PoseSensor", "RayCastData", "RayCastSensor", "RecordEpisodes", "RecordProgress", "RecordSummary", "RecordVectorEpisodes",
    "Recorder", "RenderProgress", "RenderSummary", "Renderer", "ReplayReport", "Robot", "RobotBasePoseSensor", "RobotCamera",
    "Scene", "Sensor", "SensorCheck", "SensorData", "SensorError", "SensorSpec", "SensorSuite", "Simulation", "Stream", "Task",
    "TaskEnv", "TaskVectorEnv", "TcpPoseSensor", "Teleoperation", "TerrainHeightSensor", "UnknownNameError", "Video", "Viewer",
    "WorldState", "attach", "check_replay", "delete_episodes", "effects", "embedded_models", "export_lerobot", "export_lerobot21", "export_mcap",
    "export_rerun", "export_rlds", "export_robomimic", "export_zarr", "import_lerobot", "import_robomimic", "make", "make_vec",
    "merge_datasets", "observations",
    "play", "plot", "policy_names", "record", "register_policy", "register_task", "render", "replay", "robot_names", "split_dataset", "task_names",
    "view",
    "__version__",
]
