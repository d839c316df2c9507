# SPDX-License-Identifier: Apache-2.0
"""Tasks in gymnasium's registry: ``gymnasium.make("mjsense/Pick-Franka-v0")`` after ``import mjsense``."""

from __future__ import annotations

import re

import gymnasium

from mjsense import _core
from mjsense.core.env_ids import env_id


def register(task: str, robot: str | None = None) -> None:
    """Registers a task, unless gymnasium does not allow its name or it is already registered. Its options are those of
    :func:`mjsense.make` and :func:`mjsense.make_vec`."""
    if not re.fullmatch(r"[\w.-]+", task) or env_id(task, robot) in gymnasium.registry:
        return
    kwargs = {"task": task} if robot is None else {"task": task, "robot": robot}
    gymnasium.register(
        env_id(task, robot),
        entry_point="mjsense.tasks.making:make",
        vector_entry_point="mjsense.tasks.making:make_vec",
        kwargs=kwargs,
        order_enforce=False,
    )


def register_all() -> None:
    """Registers every task with its default robot and with every robot. Incompatible pairs raise an error when an environment is
    made."""
    for task in _core.task_names():
        for robot in (None, *_core.robot_names()):
            register(task, robot)
