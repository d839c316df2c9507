# SPDX-License-Identifier: Apache-2.0
"""The default cameras show the objects of a task at the start of an episode. MJSENSE_EPISODES=200 tests 200 starts of each pair."""

import importlib.util
import os
import sys
from pathlib import Path

import pytest

EPISODES = int(os.environ.get("MJSENSE_EPISODES", "8"))
LEAST = 0.95

spec = importlib.util.spec_from_file_location("camera_views", Path(__file__).parents[2] / "tools" / "camera_views.py")
assert spec and spec.loader
camera_views = importlib.util.module_from_spec(spec)
sys.modules[spec.name] = camera_views  # dataclasses look their module up
spec.loader.exec_module(camera_views)


@pytest.mark.parametrize(("task", "robot"), camera_views.PAIRS)
def test_one_view_shows_every_object(task: str, robot: str) -> None:
    found = camera_views.count(task, robot, episodes=EPISODES)
    assert found.starts > 0 and found.all_seen >= int(LEAST * found.starts), found
