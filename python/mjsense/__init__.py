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
    evaluating policies          evaluate: the same episodes for every policy; wrap_policy: these policies in your own loop;
                                 mjsense.evaluation: benchmarks, comparison
    reading recordings           Dataset: rows, frames, windows, statistics; replay, check_replay; render: other cameras
    editing recordings           delete_episodes, split_dataset, merge_datasets
    files of other programs      export; import_lerobot, import_robomimic
    in the browser               view: live worlds, tasks, recordings
    plots of streams             plot
    names that these accept      task_names(), robot_names(), policy_names(); user-defined: Task, Policy, Robot
    more about sensors           mjsense.sensors: their classes, data and parts; mjsense.scene, mjsense.sim
    more about recordings        mjsense.recording, mjsense.dataset, mjsense.exporting
    robot learning               mjsense.tasks: tasks, robots, policies, environments; mjsense.viewer
    trainers                     mjsense.tasks.rl.sb3, mjsense.tasks.rl.rsl
    configurations of mjlab      mjsense.compat.mjlab

``python -m mjsense --help`` is the program.
"""

import typing

from mjsense.commands import start

start.answer_early()  # if this process is the program

from mjsense.core import libmujoco

libmujoco.load()  # loads the extension, too: before it, the libmujoco that it uses

from mjsense import _core

_core.leave_no_log_file()

from mjsense import dataset as dataset
from mjsense import evaluation as evaluation
from mjsense import exporting as exporting
from mjsense import recording as recording
from mjsense import scene as scene
from mjsense import sensors as sensors
from mjsense import sim as sim
from mjsense import tasks as tasks
from mjsense import viewer as viewer
from mjsense._core import __version__ as __version__  # pyright: ignore[reportAttributeAccessIssue]  # stubs leave it out
from mjsense._core import embedded_models, robot_names
from mjsense.core import installed_files, later_rooms, old_names
from mjsense.core.errors import UnknownNameError
from mjsense.dataset import Dataset, check_replay, render, replay
from mjsense.dataset.edit import delete_episodes, merge_datasets, split_dataset
from mjsense.dataset.import_lerobot import import_lerobot
from mjsense.dataset.import_robomimic import import_robomimic
from mjsense.evaluation.playing import evaluate
from mjsense.evaluation.timing import wrap_policy
from mjsense.exporting import export
from mjsense.recording import RecordEpisodes, Recorder
from mjsense.scene import Scene
from mjsense.sensors import (
    BuiltinSensorCfg,
    CameraIntrinsics,
    CameraSensorCfg,
    ContactMatch,
    ContactSensorCfg,
    EffectSensorCfg,
    EntityCfg,
    GridPatternCfg,
    ImuSensorCfg,
    LensDistortion,
    LidarSensorCfg,
    MujocoCfg,
    ObjRef,
    PinholeCameraPatternCfg,
    RayCastSensorCfg,
    RingPatternCfg,
    SceneCfg,
    SceneFileCfg,
    Sensor,
    SensorError,
    SensorSuite,
    SpinningScanCfg,
    SubTerrainCfg,
    TableScanCfg,
    TerrainCfg,
    TerrainHeightSensorCfg,
    UserPatternCfg,
    effects,
    observations,
)
from mjsense.sim import Renderer, Simulation, attach
from mjsense.tasks import gymnasium_registry
from mjsense.tasks.making import make, make_vec
from mjsense.tasks.policy import Policy, policy_names, register_policy
from mjsense.tasks.recording import record
from mjsense.tasks.robot import Robot
from mjsense.tasks.task import Task, register_task, task_names
from mjsense.tasks.teleoperation import play
from mjsense.viewer import plot, view

later_rooms.provide(
    {
        "env": "mjsense.compat.peer.env:PeerEnv",
        "foreign_sensor": "mjsense.compat.peer.per_world:foreign_sensor",
        "record_on_ray": "mjsense.cluster.recording:record_from_options",
        "sensor_adapters": "mjsense.compat.sensor_adapters:ADAPTERS",
        "task_names": "mjsense.tasks.task:task_names",
        "task_source": "mjsense.tasks.viewer_source:task_source",
        "warp_environment": "mjsense.warp.start:environment",
        "warp_simulation": "mjsense.warp.start:simulation",
    }
)

installed_files.name_package_folders()

gymnasium_registry.register_all()

old_names.register()

__all__ = [
    "BuiltinSensorCfg",
    "CameraIntrinsics",
    "CameraSensorCfg",
    "ContactMatch",
    "ContactSensorCfg",
    "Dataset",
    "EffectSensorCfg",
    "EntityCfg",
    "GridPatternCfg",
    "ImuSensorCfg",
    "LensDistortion",
    "LidarSensorCfg",
    "MujocoCfg",
    "ObjRef",
    "PinholeCameraPatternCfg",
    "Policy",
    "RayCastSensorCfg",
    "RecordEpisodes",
    "Recorder",
    "Renderer",
    "RingPatternCfg",
    "Robot",
    "Scene",
    "SceneCfg",
    "SceneFileCfg",
    "Sensor",
    "SensorError",
    "SensorSuite",
    "Simulation",
    "SpinningScanCfg",
    "SubTerrainCfg",
    "TableScanCfg",
    "Task",
    "TerrainCfg",
    "TerrainHeightSensorCfg",
    "UnknownNameError",
    "UserPatternCfg",
    "attach",
    "check_replay",
    "delete_episodes",
    "effects",
    "embedded_models",
    "evaluate",
    "export",
    "import_lerobot",
    "import_robomimic",
    "make",
    "make_vec",
    "merge_datasets",
    "observations",
    "play",
    "plot",
    "policy_names",
    "record",
    "register_policy",
    "register_task",
    "render",
    "replay",
    "robot_names",
    "split_dataset",
    "task_names",
    "view",
    "wrap_policy",
    "__version__",
]

if not typing.TYPE_CHECKING:  # a type checker would accept every name

    def __getattr__(name):
        return old_names.moved_name(name)
