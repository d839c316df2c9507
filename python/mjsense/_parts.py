# SPDX-License-Identifier: Apache-2.0
"""Tasks, policies and sensors of the user's, on their way into a rollout."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from mjsense._members import member
from mjsense.policy import Policy, policy_of
from mjsense.task import Task, task_of

Tasks = str | Task | type[Task] | Callable[[], Task]
"""A task, what makes one, or its registered name."""
Policies = str | Policy | type[Policy] | Callable[[dict[str, Any]], Any] | None
"""A policy, a function from observations to actions, or its registered name."""


def parts_of(options: dict[str, Any], sensors: Iterable[Any]) -> tuple[Task | None, Policy | None, list[Any]]:
    """(task, policy, sensors) written in Python; the options get the names of all."""
    options["task"], task = task_of(options["task"])
    options["policy"], policy = policy_of(options["policy"])
    robot = options["robot"]
    if robot is None:
        robot = task.robot if task is not None else "franka"
    options["robot"] = "" if robot is None else str(robot)
    for part in (task, policy):
        for sensor in part._mjs_make_sensors() if part else ():
            member(sensor)
    return task, policy, [member(sensor) for sensor in sensors]
