# SPDX-License-Identifier: Apache-2.0
"""The outer cameras of franka: targets are wide enough to be recognised, and images are not clipped."""

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
    widths, clipped = [], []
    for start in range(8):
        env.reset(seed=3) if start == 0 else env.reset()
        for world in range(4):
            target = model.body(json.loads(env._rollout.obs_scene(world))["objects"]["pickup_obj"]["body"]).id
            geoms = [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] == target]
            pixels = labels[world].reshape(368, 640, 2)
            columns = np.flatnonzero((np.isin(pixels[..., 0], geoms) & (pixels[..., 1] == GEOM)).any(0))
            assert len(columns), "the target is not in the image"
            widths.append(columns[-1] - columns[0] + 1)
            clipped.append((rgb[world] == 255).any(-1).mean())
    env.close()
    assert np.median(widths) >= 40 and min(widths) >= 15
    assert np.mean(clipped) < 0.005
