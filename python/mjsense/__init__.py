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
    trainers                     mjsense.rl.sb3, mjsense.rl.rsl
    configurations of mjlab      mjsense.compat.mjlab

``python -m mjsense --help`` is the program.
"""

import typing as _typing

from mjsense import _libmujoco

_libmujoco.load()  # loads the extension, too: before it, the libmujoco that it uses

from mjsense import _core

_core.leave_no_log_file()

from mjsense import _gymnasium, assets, configs, effects, observations
from mjsense._core import SensorSpec, embedded_models, robot_names
from mjsense._core import __version__ as __version__  # pyright: ignore[reportAttributeAccessIssue]  # stubs leave it out
from mjsense._recording import RecordProgress, RecordSummary
from mjsense._user_code import SensorError
from mjsense.attach import Attached, attach
from mjsense.configs import *  # noqa: F403
from mjsense.contact import ContactSensor
from mjsense.core_sensors import (
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
from mjsense.data import CameraData, ContactData, ImuData, RayCastData, SensorData
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
from mjsense.drawing import DebugShapes
from mjsense.effects import EffectSensorCfg
from mjsense.env import TaskEnv, make
from mjsense.errors import UnknownNameError
from mjsense.errors import did_you_mean as _did_you_mean
from mjsense.export import (
    export_lerobot,
    export_lerobot21,
    export_mcap,
    export_rerun,
    export_rlds,
    export_robomimic,
    export_zarr,
)
from mjsense.imu import ImuSensor
from mjsense.native_sensor import BuiltinSensor, NativeSensor
from mjsense.pipeline import ObservationPipeline
from mjsense.plot import plot
from mjsense.policy import Policy, policy_names, register_policy
from mjsense.raycast import CameraSensor, LidarSensor, RayCastSensor, TerrainHeightSensor
from mjsense.record import record
from mjsense.record_episodes import RecordEpisodes, RecordVectorEpisodes
from mjsense.recorder import Recorder
from mjsense.renderer import Renderer
from mjsense.robot import MoveGroup, Robot, RobotCamera
from mjsense.scene import Entity, Scene
from mjsense.sensor import Sensor
from mjsense.simulation import Simulation
from mjsense.suite import SensorSuite
from mjsense.task import Task, WorldState, register_task, task_names
from mjsense.teleoperation import Teleoperation, play
from mjsense.vector import TaskVectorEnv, make_vec
from mjsense.view import view
from mjsense.view.viewer import Viewer

assets.name_package_folders()

_gymnasium.register_all()

if not _typing.TYPE_CHECKING:

    def __getattr__(name: str) -> object:
        raise AttributeError(f"module 'mjsense' has no attribute '{name}'{_did_you_mean(name, __all__)}")

# fmt: off
__all__ = [
    *configs.__all__,
    "Attached", "BuiltinSensor", "CameraData", "CameraImageSensor", "CameraParameterSensor", "CameraSensor", "ContactData",
    "ContactSensor", "Dataset", "DebugShapes", "Deviation", "EffectSensorCfg", "Entity", "EnvStatesSensor", "Episode",
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
