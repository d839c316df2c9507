# SPDX-License-Identifier: Apache-2.0
"""Cameras at the start of episodes: targets are wide enough to be recognised, the gripper is visible, and images are not clipped."""

import json

import numpy as np
import pytest

import mjsense as mjs

GEOM = 5  # mjOBJ_GEOM


@pytest.mark.parametrize("system", ["", "close_up"])
@pytest.mark.parametrize("task", ["pick", "pick_and_place", "pick_and_place_next_to", "pick_and_place_color", "packing"])
def test_targets_are_forty_pixels_wide(task, system):
    env = mjs.make_vec(
        task, "franka", num_envs=4, policy=None, camera_system=system, segmentation=True, cameras=["exo_camera_1"]
    )
    rgb = env.rows["exo_camera_1"]
    labels = next(rows for name, rows in env.rows.items() if "segmentation" in name)
    model = env.sim.model
    hand = [g for g in range(model.ngeom) if model.body(int(model.geom_bodyid[g])).name.startswith("robot_0/gripper")]
    widths, clipped, seen = [], [], []
    for start in range(8):
        env.reset(seed=3) if start == 0 else env.reset()
        for world in range(4):
            target = model.body(json.loads(env._rollout.obs_scene(world))["objects"]["pickup_obj"]["body"]).id
            geoms = [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] == target]
            pixels = labels[world].reshape(368, 640, 2)
            seen.append((np.isin(pixels[..., 0], hand) & (pixels[..., 1] == GEOM)).sum() > 100)
            columns = np.flatnonzero((np.isin(pixels[..., 0], geoms) & (pixels[..., 1] == GEOM)).any(0))
            assert len(columns), "the target is not in the image"
            widths.append(columns[-1] - columns[0] + 1)
            clipped.append((rgb[world] == 255).any(-1).mean())
    env.close()
    assert np.median(widths) >= 40 and min(widths) >= 15
    assert np.mean(clipped) < 0.005
    assert np.mean(seen) >= (0 if system else 0.8)


@pytest.mark.parametrize(
    ("task", "robot", "scene"),
    [
        *(("pick", "franka", scene) for scene in ("table", "assorted", "clutter", "kitchen", "shelf")),
        ("nav_to_obj", "rby1", "floor"),
        ("door_opening", "rby1", "room_with_door"),
    ],
)
def test_scenes_are_not_clipped(task, robot, scene):
    """Fewer than 0.5 % of the pixels of each camera are white in all channels (mean of 16 starts)."""
    env = mjs.make_vec(task, robot, num_envs=4, policy=None, scene=scene, width=160, height=92)
    images = {name: rows for name, rows in env.rows.items() if rows.dtype == np.uint8 and rows.ndim == 4}
    white = dict.fromkeys(images, 0.0)
    for start in range(4):
        env.reset(seed=3) if start == 0 else env.reset()
        for name, rows in images.items():
            white[name] += (rows == 255).all(-1).mean() / 4
    env.close()
    assert white and max(white.values()) < 0.005, white
