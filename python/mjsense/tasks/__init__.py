# SPDX-License-Identifier: Apache-2.0
"""Robot learning: tasks, robots and policies, environments of them, and recordings of their episodes. Modules are imported when
one of their names is used."""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from mjsense._core import robot_names

if TYPE_CHECKING:
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

_NAMES = {
    "sensors.configs": (
        "SceneFileCfg",
        "SceneHeadlightCfg",
        "SceneMoodCfg",
        "SceneObjectCfg",
        "SceneRegionCfg",
        "SceneRobotCfg",
        "SceneSkyCfg",
        "SceneVaryCfg",
    ),
    "tasks.env": ("TaskEnv",),
    "tasks.making": ("make", "make_vec"),
    "tasks.policy": ("Policy", "policy_names", "register_policy"),
    "tasks.record_job": ("RecordProgress", "RecordSummary"),
    "tasks.recording": ("record",),
    "tasks.robot": ("MoveGroup", "Robot", "RobotCamera"),
    "tasks.task": ("Task", "WorldState", "register_task", "task_names"),
    "tasks.teleoperation": ("Teleoperation", "play"),
    "tasks.vector": ("TaskVectorEnv",),
}
_MODULES = {name: module for module, names in _NAMES.items() for name in names}

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


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return getattr(importlib.import_module(f"mjsense.{_MODULES[name]}"), name)
