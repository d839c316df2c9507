# SPDX-License-Identifier: Apache-2.0
"""Prepares user-defined tasks, policies and sensors for a rollout."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

from mjsense import _core
from mjsense.core.input_files import expect_no_folder
from mjsense.scene.scene import prepared
from mjsense.sensors.configs import SceneCfg, SceneFileCfg
from mjsense.tasks.code_checksums import checksums
from mjsense.tasks.members import member
from mjsense.tasks.policy import Policy, policy_of
from mjsense.tasks.robot import Robot, robot_of
from mjsense.tasks.task import Task, task_of

Tasks = str | Task | type[Task] | Callable[[], Task]
"""A task, its class, a function that returns one, or its registered name."""
Policies = str | Policy | type[Policy] | Callable[[dict[str, Any]], Any] | None
"""A policy, a function from observations to actions, or its registered name."""
Scenes = str | Path | SceneFileCfg | Callable[[], SceneCfg]
"""A scene: its name, its file, a configuration equal to such a file, or a function that returns its configuration."""

Robots = str | Path | Robot
"""A robot: its registered name, the path of its .toml, or an object, which may have sensors."""

Code = dict[str, dict[str, str]]
"""Owner -> checksums of its code, which are compared when a recording is resumed."""
Select = Callable[[list[tuple[str, str]]], list[str]]
Parts = tuple[Task | None, Policy | None, Any, SceneFileCfg | None, Code, list[Any], Select | None]


def parts_of(options: dict[str, Any], sensors: Iterable[Any]) -> Parts:
    """Returns the parts that are written in Python: (task, policy, sensors, scene, code, the robot's sensors, selection of the
    suite). Replaces all parts in the options by their names."""
    composed = _composed(options)
    options["task"], task = task_of(options["task"])
    options["policy"], policy = policy_of(options["policy"])
    robot = options["robot"]
    if robot is None and composed is not None:
        robot = composed.robot or "auto"
    elif robot is None:
        robot = task.robot if task is not None else "auto"
    place = f"{type(task).__name__}.robot" if options["robot"] is None else "robot"
    options["robot"], robot_sensors = robot_of(robot, place)
    options["scene"], scene = scene_of(options["scene"])
    for part in (task, policy):
        for sensor in part._mjs_make_sensors() if part else ():
            member(sensor)
    given = [member(sensor) for sensor in sensors]
    of_robot = [member(sensor) for sensor in robot_sensors]
    code: Code = {}
    if "resume" in options:
        owners = {
            "task": composed or task,
            "policy": policy,
            **{f"sensor '{sensor.uuid}'": sensor for sensor in (*given, *of_robot)},
        }
        code = {
            place: checksums(owner, place, options["resume"] or options["append"])
            for place, owner in owners.items()
            if owner is not None
        }
    if composed is None or not options.get("use_sensors", True):
        return task, policy, given, scene, code, of_robot, None
    return task, policy, Composition(composed, given), scene, code, of_robot, composed._mjs_select


class Composition:
    """The sensors that a task creates after its simulation exists, followed by those passed by the caller."""

    def __init__(self, task: Any, given: list[Any]) -> None:
        self._task, self._given = task, given
        self.made: list[Any] = []

    def __call__(self, sim: Any) -> list[Any]:
        self.made = [*self._task._mjs_compose(sim), *self._given]
        return self.made

    def __iter__(self) -> Iterator[Any]:
        return iter(self.made)


def _composed(options: dict[str, Any]) -> Any:
    """Returns the task of ``mjsense.compat.molmospaces`` if it is one; the options are then set to the underlying task and its
    policy."""
    task = options["task"]
    if not hasattr(task, "_mjs_compose"):
        return None
    task = task() if isinstance(task, type) else task
    options["task"] = task._mjs_name()
    if task._registered is not None and options["policy"] in (None, "planner"):
        options["policy"] = task._registered
    if not task._mjs_uses_sensors():
        options["use_sensors"] = False
    return task


def _scene_names() -> list[str]:
    return [scene["name"] for scene in json.loads(_core.scenes_json())]  # pyright: ignore[reportAttributeAccessIssue]  # no stub


def scene_of(scene: Scenes) -> tuple[str, SceneFileCfg | None]:
    """Returns (name for messages and files, the object if the scene is configured in Python)."""
    if isinstance(scene, (str, Path)):
        expect_no_folder(str(scene), "scene.toml", _scene_names)
        return str(scene), None
    if not isinstance(scene, SceneFileCfg):
        scene = SceneFileCfg(name=getattr(scene, "__name__", type(scene).__name__).strip("<>"), models=scene)
    if scene.models is not None:
        scene._mjs_scene = partial(prepared, scene.models, "models()")
    return scene.name, scene
