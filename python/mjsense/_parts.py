# SPDX-License-Identifier: Apache-2.0
"""Tasks, policies and sensors of the user's, on their way into a rollout."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path
from types import NoneType
from typing import Any

from mjsense._code_checksums import checksums
from mjsense._members import member
from mjsense.configs import SceneCfg, SceneFileCfg
from mjsense.policy import Policy, policy_of
from mjsense.task import Task, task_of

Tasks = str | Task | type[Task] | Callable[[], Task]
"""A task, what makes one, or its registered name."""
Policies = str | Policy | type[Policy] | Callable[[dict[str, Any]], Any] | None
"""A policy, a function from observations to actions, or its registered name."""
Scenes = str | Path | SceneFileCfg | Callable[[], SceneCfg]
"""A scene: its name, its file, what such a file would say, or a function that makes its models."""

Parts = tuple[Task | None, Policy | None, list[Any], SceneFileCfg | None, dict[str, dict[str, str]]]


def parts_of(options: dict[str, Any], sensors: Iterable[Any]) -> Parts:
    """(task, policy, sensors, scene) written in Python, and what a recording compares of their code when it is resumed; the options
    get the names of all."""
    options["task"], task = task_of(options["task"])
    options["policy"], policy = policy_of(options["policy"])
    robot = options["robot"]
    if robot is None:
        robot = task.robot if task is not None else "auto"
        if not isinstance(robot, (str, Path, NoneType)):
            raise TypeError(f"{type(task).__name__}.robot is {robot!r}: must be the name of a robot, the path of its .toml, or None")
    options["robot"] = "" if robot is None else str(robot)
    options["scene"], scene = scene_of(options["scene"])
    for part in (task, policy):
        for sensor in part._mjs_make_sensors() if part else ():
            member(sensor)
    members = [member(sensor) for sensor in sensors]
    code: dict[str, dict[str, str]] = {}
    if "resume" in options:
        owners = {"task": task, "policy": policy, **{f"sensor '{sensor.uuid}'": sensor for sensor in members}}
        code = {place: checksums(owner, place, options["resume"]) for place, owner in owners.items() if owner is not None}
    return task, policy, members, scene, code


def scene_of(scene: Scenes) -> tuple[str, SceneFileCfg | None]:
    """(name for messages and files, the object if it is made in Python)."""
    if isinstance(scene, (str, Path)):
        return str(scene), None
    if not isinstance(scene, SceneFileCfg):
        scene = SceneFileCfg(name=getattr(scene, "__name__", type(scene).__name__).strip("<>"), models=scene)
    return scene.name, scene
