# SPDX-License-Identifier: Apache-2.0
"""Ids of the tasks in gymnasium's registry, which exported files name."""

from __future__ import annotations


def env_id(task: str, robot: str | None = None) -> str:
    """Id of an environment, ``mjsense/PickAndPlace-Franka-v0``; without a robot ``mjsense/PickAndPlace-v0``, which uses the
    task's default robot."""
    words = ["".join(part.capitalize() for part in name.split("_")) for name in (task, robot) if name]
    return f"mjsense/{'-'.join(words)}-v0"
