# SPDX-License-Identifier: Apache-2.0
"""Rays per CPU second of mujoco_warp on the CPU, the engine of mjlab's ray sensors, in a scene that mjsense_bench saved:
warp_rays scene.mjb lidar|height.
"""

import json
import statistics
import sys
import time

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp


def lidar(model, data):
    """16 x 360 rays from the site "head", one world."""
    elevation, azimuth = np.meshgrid(np.radians(np.linspace(-15, 15, 16)), np.radians(np.arange(360.0)), indexing="ij")
    local = np.stack([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)], -1).reshape(
        -1, 3
    )
    site = data.site("head")
    directions = local @ site.xmat.reshape(3, 3).T
    return (
        np.broadcast_to(site.xpos, directions.shape)[None],
        directions[None],
        int(model.site("head").bodyid[0]),
        [data.qpos.copy()],
    )


def height(model, data):
    """187 vertical rays downwards around the trunk, 64 worlds."""
    rng = np.random.default_rng(1)
    x, y = np.meshgrid(np.linspace(-0.8, 0.8, 17), np.linspace(-0.5, 0.5, 11))
    offsets = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    points, states = [], []
    for _ in range(64):
        qpos = data.qpos.copy()
        qpos[:2] = rng.uniform(-3, 3, 2)
        qpos[2] = 1
        states.append(qpos)
        points.append(qpos[:3] + offsets)
    directions = np.broadcast_to([0.0, 0.0, -1.0], (64, 187, 3))
    return np.stack(points), directions, 1, states


def main() -> None:
    wp.config.quiet = True
    model = mujoco.MjModel.from_binary_path(sys.argv[1])
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    points, directions, exclude, states = {"lidar": lidar, "height": height}[sys.argv[2]](model, data)
    worlds, n = points.shape[:2]
    groups = [0, 1, 2] if sys.argv[2] == "height" else [0, 1, 2, 3, 4, 5]
    with wp.ScopedDevice("cpu"):
        m, d = mjw.put_model(model), mjw.put_data(model, data, nworld=worlds)
        rng = np.random.default_rng(2)
        poses = [np.stack(states), np.stack(states)]  # used alternately; the joint positions differ
        poses[1][:, 7:] += rng.uniform(-0.2, 0.2, poses[1][:, 7:].shape)
        mjw.kinematics(m, d)
        context = mjw.create_render_context(model, nworld=worlds, cam_res=(4, 4), enabled_geom_groups=groups)
        pnt, vec = (wp.array(np.ascontiguousarray(a, np.float32), dtype=wp.vec3f) for a in (points, directions))
        out = wp.zeros((worlds, n), dtype=float), wp.zeros((worlds, n), dtype=int), wp.zeros((worlds, n), dtype=wp.vec3f)
        body = wp.array(np.full(n, exclude, np.int32))
        mask = mjw._src.types.vec6f(*(-1 if g in groups else 0 for g in range(6)))
        seconds = []
        for i in range(30):
            d.qpos.assign(poses[i % 2].astype(np.float32))
            mjw.kinematics(m, d)
            wp.synchronize()
            start = time.process_time()
            mjw.refit_bvh(m, d, context)
            mjw.rays(m, d, pnt, vec, mask, True, body, *out, context)
            wp.synchronize()
            if i >= 10:
                seconds.append(time.process_time() - start)
    hits = int((out[0].numpy() >= 0).sum())
    print(json.dumps({"rays_per_second": worlds * n / statistics.median(seconds), "hits": hits}))


main()
