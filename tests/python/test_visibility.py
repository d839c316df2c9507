# SPDX-License-Identifier: Apache-2.0
"""Pixels of an object that tasks report, compared with the segmentation image of the same camera, in one world and in eight, each with
sizes and cameras of its own."""

import numpy as np
import pytest
from world_model import model_of

import mjsense as mjs

GEOM, SEEN_GROUPS, MOST_POINTS = 5, 3, 10
OBSERVED = ["wrist_camera_segmentation", "exo_camera_segmentation", "object_image_points", "obj_start"]
CAMERAS = """
width = 96
height = 64
[[cameras]]
name = "wrist_camera"
mount = "mjcf"
camera = "gripper/wrist_camera"
fovy = 52
fovy_noise = 4
image_points = true
segmentation = true
[[cameras]]
name = "exo_camera"
mount = "orbit"
distance_range = [0.4, 0.7]
height_range = [0.1, 0.6]
fovy = 60
min_visible = 0.001
relaxed = true
image_points = true
segmentation = true
"""


def pixels_of(model, segmentation, root):
    """[H, W] bool: where a geom that is seen, of the body or below it, is nearest."""
    below = np.zeros(model.nbody, bool)
    below[root] = True
    for body in range(root + 1, model.nbody):
        below[body] = below[model.body_parentid[body]]
    shown = below[model.geom_bodyid] & (model.geom_group < SEEN_GROUPS)
    ids, kinds = segmentation[..., 0], segmentation[..., 1]
    return (kinds == GEOM) & shown[np.where(kinds == GEOM, ids, 0)]


def eroded(mask):
    """By the 3 x 3 cross; beyond the image there is background."""
    wide = np.pad(mask, 1)
    return mask & wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:]


def check(env, w, body):
    """Compares the object's streams of all cameras; how many points each has."""
    model, counts = model_of(env.sim, w), []
    for name in [n for n in env.rows if n.startswith("object_image_points/pickup_obj/") and n.endswith("/num_points")]:
        camera = name.split("/")[2]
        mask = pixels_of(model, env.rows[f"{camera}_segmentation"][w], body)
        inner = eroded(eroded(mask))
        chosen = inner if inner.any() else mask
        count, points = env.rows[name][w, 0], env.rows[name.replace("num_points", "points")][w]
        assert count == min(chosen.sum(), MOST_POINTS), (name, w)
        height, width = mask.shape
        pixels = np.rint(points[:count] * (width, height)).astype(int)
        assert all(chosen[y, x] for x, y in pixels), (name, w)
        assert len({tuple(p) for p in pixels}) == count and np.isnan(points[count:]).all()
        counts.append(count)
    assert len(counts) == 2
    return counts


@pytest.mark.parametrize("num_envs", [1, 8])
@pytest.mark.parametrize("task,scene", [("pick", "tableware"), ("pick", "shelf"), ("open", "kitchen")])
def test_image_points_agree_with_the_segmentation(task, scene, num_envs, tmp_path):
    (tmp_path / "cameras.toml").write_text(CAMERAS)
    env = mjs.make_vec(task, "franka", scene=scene, num_envs=num_envs, camera_system=str(tmp_path / "cameras.toml"), seed=7, policy="planner",
                       observations=OBSERVED, autoreset_mode="disabled")  # fmt: skip
    env.reset()
    # The body that an episode is about: the nearest to where it says that it begins.
    far = np.linalg.norm(env.sim.data.xpos - env.rows["obj_start"][:, None, :3], axis=2)
    bodies, counts = far.argmin(axis=1), []
    assert (far.min(axis=1) < 1e-5).all()
    for step in range(13):
        if step in (0, 6, 12):
            counts += [check(env, w, bodies[w]) for w in range(num_envs)]
        env.step(env.expert_action(), done=env.expert_done.copy())
    env.close()
    assert np.max(counts) == MOST_POINTS, "no camera shows the object well"
