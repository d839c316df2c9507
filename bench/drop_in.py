# SPDX-License-Identifier: Apache-2.0
"""CPU time of images of existing environments: their own renderer (software OpenGL) and mjsense.

    python bench/drop_in.py [--sizes 84 256] [--json FILE] [ENVIRONMENT ...]

Needs the packages of the environments (those of tests/python/test_adapters.py), PyOpenGL and EGL; environments that cannot be made are skipped.
Both renderers draw the same states, after one step each, through the environment's own function.
"""

from __future__ import annotations

import argparse
import gc
import json
import os
import statistics
import time
import warnings
from typing import TYPE_CHECKING, Any

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")  # llvmpipe's; CPU time counts all threads in any case

import gymnasium
import mujoco
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    Made = tuple[Any, Callable[[], object], Callable[[], np.ndarray]]  # environment, its step, its image

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
    "Meta-World/reach-v3",
    "Meta-World/drawer-open-v3",
    "gym_aloha/AlohaTransferCube-v0",
    "dm_control/cheetah/run",
    "dm_control/humanoid/stand",
    "robosuite/Lift/agentview",
    "robosuite/Lift/robot0_eye_in_hand",
    "robosuite/PickPlace/agentview",
    "robosuite/PickPlace/robot0_eye_in_hand",
)


def gymnasium_env(name: str, size: int, use: bool) -> Made:
    arguments = {"id": name, "render_mode": "rgb_array", "width": size, "height": size, "disable_env_checker": True}
    if name.startswith("Meta-World/"):
        import metaworld  # noqa: F401

        arguments |= {"id": "Meta-World/MT1", "env_name": name.split("/")[1], "camera_name": "corner2", "seed": 0}
    env = gymnasium.make(**arguments)
    if use:
        from mjsense.compat import gymnasium as adapter

        adapter.use(env)
    env.reset(seed=0)
    env.action_space.seed(0)
    return env, lambda: env.step(env.action_space.sample()), lambda: np.asarray(env.render())


def aloha_env(name: str, size: int, use: bool) -> Made:
    import gym_aloha  # noqa: F401

    sizes = {"observation_width": 8, "observation_height": 8, "visualization_width": size, "visualization_height": size}
    env = gymnasium.make(name, disable_env_checker=True, **sizes)
    if use:
        from mjsense.compat import dm_control as adapter

        adapter.use(env.unwrapped._env)  # pyright: ignore[reportAttributeAccessIssue]  # gym-aloha's
    env.reset(seed=0)
    env.action_space.seed(0)
    return env, lambda: env.step(env.action_space.sample()), lambda: np.asarray(env.render())


def dm_control_env(name: str, size: int, use: bool) -> Made:
    from dm_control import suite

    env = suite.load(*name.split("/")[1:], task_kwargs={"random": 0})
    if use:
        from mjsense.compat import dm_control as adapter

        adapter.use(env)
    env.reset()
    rng, shape = np.random.default_rng(0), env.action_spec().shape
    return env, lambda: env.step(rng.uniform(-1, 1, shape)), lambda: env.physics.render(size, size, camera_id=0)


def robosuite_env(name: str, size: int, use: bool) -> Made:
    import robosuite
    from robosuite.environments import base
    from robosuite.utils.binding_utils import MjRenderContextOffscreen

    base.MjRenderContextOffscreen = MjRenderContextOffscreen
    if use:
        from mjsense.compat import robosuite as adapter

        adapter.use()
    _, task, camera = name.split("/")
    env = robosuite.make(task, robots="Panda", has_renderer=False, has_offscreen_renderer=True, use_camera_obs=False, seed=0)
    env.reset()
    rng = np.random.default_rng(0)
    return (
        env,
        lambda: env.step(rng.uniform(-1, 1, env.action_dim)),
        lambda: env.sim.render(width=size, height=size, camera_name=camera),
    )


MAKE = {"gym_aloha": aloha_env, "dm_control": dm_control_env, "robosuite": robosuite_env}


def images(name: str, size: int, use: bool, count: int) -> tuple[np.ndarray, float, float]:
    """The images of `count` steps, the median CPU time of one in ms, and that of the first image with the renderer's construction."""
    env, step, render = MAKE.get(name.split("/")[0], gymnasium_env)(name, size, use)
    start = time.process_time()
    rows, times = [render()], []
    first = time.process_time() - start
    for _ in range(count):
        step()
        start = time.process_time()
        rows.append(render())
        times.append(time.process_time() - start)
    env.close()
    del env, step, render
    gc.collect()  # frees OpenGL's contexts here, not in a later measurement
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
    print(f"{'environment':38s} {'size':>5s} {'OpenGL':>9s} {'mjsense':>9s} {'ratio':>6s} {'first':>8s} {'PSNR':>6s}")
    rows = []
    for name in arguments.environments:
        for size in arguments.sizes:
            try:
                theirs, slow, _ = images(name, size, False, arguments.count)
                ours, fast, first = images(name, size, True, arguments.count)
            except Exception as error:
                print(f"{name:38s} {size:5d} {type(error).__name__}: {str(error)[:90]}")
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
            print(f"{name:38s} {size:5d} {slow:6.2f} ms {fast:6.2f} ms {slow / fast:6.1f} {first:5.1f} ms {row['psnr']:6.1f}")
    for size in arguments.sizes:
        ratios = [row["opengl_ms"] / row["mjsense_ms"] for row in rows if row["size"] == size]
        if ratios:
            print(f"median ratio at {size}: {statistics.median(ratios):.1f}, lowest {min(ratios):.1f}")
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
