# SPDX-License-Identifier: Apache-2.0
"""Rays per CPU second of mujoco-lidar (Warp on the CPU) in the scene that lidar_bench.cc saved: lidar_rays scene.mjb."""

import json
import statistics
import sys
import time

import mujoco
import numpy as np
import warp as wp
from mujoco_lidar import MjLidarWrapper

wp.config.quiet = True
model = mujoco.MjModel.from_binary_path(sys.argv[1])
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
body = int(model.site("head").bodyid[0])
lidar = MjLidarWrapper(model, "head", backend="warp", cutoff_dist=30.0, args={"device": "cpu", "bodyexclude": body})
elevation, azimuth = np.meshgrid(np.radians(np.linspace(-15, 15, 16)), np.radians(np.arange(360.0)), indexing="ij")
azimuth, elevation = azimuth.ravel().astype(np.float32), elevation.ravel().astype(np.float32)
seconds = []
poses = [data.qpos.copy(), data.qpos.copy()]  # used alternately; the joint positions differ
poses[1][7:] += np.random.default_rng(2).uniform(-0.2, 0.2, model.nq - 7)
for i in range(30):
    data.qpos[:] = poses[i % 2]
    mujoco.mj_forward(model, data)
    start = time.process_time()
    distances = lidar.trace_rays(data, azimuth, elevation)
    if i >= 10:
        seconds.append(time.process_time() - start)
hits = int((np.asarray(distances) < 30).sum())
print(json.dumps({"rays_per_second": azimuth.size / statistics.median(seconds), "hits": hits}))
