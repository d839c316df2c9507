# SPDX-License-Identifier: Apache-2.0
"""What the table of docs/tasks.md says, on a few seeds."""

import importlib.util
from pathlib import Path

import pytest

from mjsense import _core

TOOL = Path(__file__).parents[2] / "tools" / "task_table.py"
PLAYED = ("pick/floating_rum", "pick/franka/tableware", "pick_and_place/franka", "pick_and_place/floating_rum", "pick_and_place_next_to/franka", "pick_and_place_color/franka",
          "packing/franka", "close/i2rt_yam", "nav_to_obj/mobile_franka")  # fmt: skip


@pytest.fixture(scope="module")
def table():
    spec = importlib.util.spec_from_file_location("task_table", TOOL)
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_task_of_ours_has_a_row(table):
    assert {task for task, _, _ in table.CASES} == set(_core.task_names())


@pytest.mark.parametrize("case", PLAYED)
def test_planners_succeed(table, case):
    task, robot, scene = (*case.split("/"), "")[:3]
    found = table.play(task, robot, scene, 4)
    assert found["episodes"] == 4 and found["success"] >= 0.75, found
