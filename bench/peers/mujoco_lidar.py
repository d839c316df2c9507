"""Rays a second of mujoco-lidar (Warp on the CPU) in the scene that lidar_bench.cc saved. Runs in an environment of its own:

    python -m venv peers && peers/bin/pip install warp-lang scipy mujoco-core==4.0.1 && peers/bin/pip install --no-deps mujoco-lidar
    peers/bin/python bench/peers/mujoco_lidar.py scene.mjb
"""

import statistics
import sys
import time

sys.path.pop(0)  # this file has the package's name

import mujoco  # noqa: E402
import numpy as np  # noqa: E402
import warp as wp  # noqa: E402
from mujoco_lidar import MjLidarWrapper  # noqa: E402

wp.config.quiet = True
model = mujoco.MjModel.from_binary_path(sys.argv[1])
data = mujoco.MjData(model)
mujoco.mj_forward(model, data)
body = int(model.site("head").bodyid[0])
lidar = MjLidarWrapper(model, "head", backend="warp", cutoff_dist=30.0, args={"device": "cpu", "bodyexclude": body})
elevation, azimuth = np.meshgrid(np.radians(np.linspace(-15, 15, 16)), np.radians(np.arange(360.0)), indexing="ij")
azimuth, elevation = azimuth.ravel().astype(np.float32), elevation.ravel().astype(np.float32)
seconds = []
for i in range(30):
    start = time.process_time()
    distances = lidar.trace_rays(data, azimuth, elevation)
    if i >= 10:
        seconds.append(time.process_time() - start)
print(f"{azimuth.size / statistics.median(seconds):.0f} rays per CPU second, {int((np.asarray(distances) < 30).sum())} hits")
