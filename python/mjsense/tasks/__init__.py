# SPDX-License-Identifier: Apache-2.0
"""Robot learning: tasks, robots and policies, environments of them, and recordings of their episodes."""

from mjsense._core import robot_names
from mjsense.sensors.configs import (
    SceneFileCfg,
    SceneHeadlightCfg,
    SceneMoodCfg,
    SceneObjectCfg,
    SceneRegionCfg,
    SceneRobotCfg,
    SceneSkyCfg,
    SceneVaryCfg,
)
from mjsense.tasks.env import TaskEnv
from mjsense.tasks.making import make, make_vec
from mjsense.tasks.policy import Policy, policy_names, register_policy
from mjsense.tasks.record_job import RecordProgress, RecordSummary
from mjsense.tasks.recording import record
from mjsense.tasks.robot import MoveGroup, Robot, RobotCamera
from mjsense.tasks.task import Task, WorldState, register_task, task_names
from mjsense.tasks.teleoperation import Teleoperation, play
from mjsense.tasks.vector import TaskVectorEnv

__all__ = [
    "MoveGroup",
    "Policy",
    "RecordProgress",
    "RecordSummary",
    "Robot",
    "RobotCamera",
    "Task",
    "TaskEnv",
    "TaskVectorEnv",
    "Teleoperation",
    "WorldState",
    "SceneFileCfg",
    "SceneHeadlightCfg",
    "SceneMoodCfg",
    "SceneObjectCfg",
    "SceneRegionCfg",
    "SceneRobotCfg",
    "SceneSkyCfg",
    "SceneVaryCfg",
    "make",
    "make_vec",
    "play",
    "policy_names",
    "record",
    "register_policy",
    "register_task",
    "robot_names",
    "task_names",
]
