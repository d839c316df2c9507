# SPDX-License-Identifier: Apache-2.0
"""CPU time of images of existing environments: their own renderer (software OpenGL) and mjsense.

    python bench/drop_in.py [--sizes 84 256] [--json FILE] [ENVIRONMENT ...]

Needs the packages of the environments, PyOpenGL and EGL; environments that cannot be made are skipped. Both renderers draw the same states,
after one step each, through the environment's own ``render()``.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import time
import warnings

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")  # llvmpipe's; CPU time counts all threads in any case

import gymnasium
import mujoco
import numpy as np
from mjsense.compat import gymnasium as adapter

ENVIRONMENTS = (
    "HalfCheetah-v5",
    "Ant-v5",
    "Humanoid-v5",
    "Walker2d-v5",
    "Pusher-v5",
    "FetchPickAndPlace-v4",
    "FrankaKitchen-v1",
    "HandManipulateBlock-v1",
    "AdroitHandDoor-v1",
    "AdroitHandRelocate-v1",
)


def images(name: str, size: int, use: bool, count: int) -> tuple[np.ndarray, float, float]:
    """The images of `count` steps, the median CPU time of one in ms, and that of the first image with the renderer's construction."""
    env = gymnasium.make(name, render_mode="rgb_array", width=size, height=size)
    if use:
        adapter.use(env)
    env.reset(seed=0)
    env.action_space.seed(0)
    start = time.process_time()
    rows, times = [env.render()], []
    first = time.process_time() - start
    for _ in range(count):
        env.step(env.action_space.sample())
        start = time.process_time()
        rows.append(env.render())
        times.append(time.process_time() - start)
    env.close()
    return np.array(rows[1:]), 1e3 * statistics.median(times), 1e3 * first


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    error = np.mean((a.astype(float) - b) ** 2)
    return float(10 * np.log10(255**2 / max(error, 1e-3)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("environments", nargs="*", default=ENVIRONMENTS)
    parser.add_argument("--sizes", nargs="+", type=int, default=(84, 256))
    parser.add_argument("--count", type=int, default=10)
    parser.add_argument("--json")
    arguments = parser.parse_args()
    warnings.filterwarnings("ignore")
    try:
        import gymnasium_robotics

        gymnasium.register_envs(gymnasium_robotics)
    except Exception as error:
        print(f"gymnasium-robotics: {error}")
    print(f"MuJoCo {mujoco.__version__}")
    print(f"{'environment':24s} {'size':>5s} {'OpenGL':>9s} {'mjsense':>9s} {'ratio':>6s} {'first':>8s} {'PSNR':>6s}")
    rows = []
    for name in arguments.environments:
        for size in arguments.sizes:
            try:
                theirs, slow, _ = images(name, size, False, arguments.count)
                ours, fast, first = images(name, size, True, arguments.count)
            except Exception as error:
                print(f"{name:24s} {size:5d} {type(error).__name__}: {str(error)[:90]}")
                continue
            row = {
                "environment": name,
                "size": size,
                "opengl_ms": slow,
                "mjsense_ms": fast,
                "first_ms": first,
                "psnr": psnr(theirs, ours),
            }
            rows.append(row)
            print(f"{name:24s} {size:5d} {slow:6.2f} ms {fast:6.2f} ms {slow / fast:6.1f} {first:5.1f} ms {row['psnr']:6.1f}")
    for size in arguments.sizes:
        ratios = [row["opengl_ms"] / row["mjsense_ms"] for row in rows if row["size"] == size]
        if ratios:
            print(f"median ratio at {size}: {statistics.median(ratios):.1f}, lowest {min(ratios):.1f}")
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
