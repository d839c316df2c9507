# SPDX-License-Identifier: Apache-2.0
"""CPU time of images of existing environments: their own renderer (software OpenGL) and mjsense.

    python bench/drop_in.py [--sizes 84 256 640x480] [--json FILE] [--pictures FOLDER] [ENVIRONMENT ...]

Needs the packages of the environments (those of tests/python/test_adapters.py), PyOpenGL and EGL; environments that cannot be
made are skipped. Both renderers draw the same states, after one step each with a random action, through the environment's own
function, in turns of 50 steps each. Times are medians of the images that differ from the one before; ratios are medians of the
turns' ratios. The columns "step" are the CPU times of a step and its image. --pictures writes the last image of each environment
and size, the package's own at the left, mjsense's at the right.
"""

from __future__ import annotations

import argparse
import gc
import itertools
import json
import logging
import os
import statistics
import time
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")  # llvmpipe's; CPU time counts all threads in any case

import gymnasium
import mujoco
import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable

    Size = tuple[int, int]  # width, height
    Made = tuple[Any, Callable[[], object], Callable[[], np.ndarray]]  # environment, its step, its image

ENVIRONMENTS = tuple(
    """
    HalfCheetah-v5 Ant-v5 Humanoid-v5 Walker2d-v5 Pusher-v5 FetchPickAndPlace-v4 FrankaKitchen-v1 HandManipulateBlock-v1
    AdroitHandDoor-v1 AdroitHandRelocate-v1 Meta-World/reach-v3 Meta-World/drawer-open-v3 gym_aloha/AlohaTransferCube-v0
    dm_control/cheetah/run dm_control/humanoid/stand robosuite/Lift/agentview robosuite/Lift/robot0_eye_in_hand
    robosuite/PickPlace/agentview robosuite/PickPlace/robot0_eye_in_hand
    """.split()
)


def random_step(env: Any) -> None:
    *_, terminated, truncated, _ = env.step(env.action_space.sample())
    if terminated or truncated:
        env.reset()


def gymnasium_env(name: str, size: Size, use: bool) -> Made:
    arguments = {"id": name, "render_mode": "rgb_array", "width": size[0], "height": size[1], "disable_env_checker": True}
    if name.startswith("Meta-World/"):
        import metaworld  # noqa: F401

        arguments |= {"id": "Meta-World/MT1", "env_name": name.split("/")[1], "camera_name": "corner2", "seed": 0}
    env = gymnasium.make(**arguments)
    if use:
        from mjsense.compat import gymnasium as adapter

        adapter.use(env)
    env.reset(seed=0)
    env.action_space.seed(0)
    return env, lambda: random_step(env), lambda: np.asarray(env.render())


def aloha_env(name: str, size: Size, use: bool) -> Made:
    import gym_aloha  # noqa: F401

    sizes = {"observation_width": 8, "observation_height": 8, "visualization_width": size[0], "visualization_height": size[1]}
    env = gymnasium.make(name, disable_env_checker=True, **sizes)
    if use:
        from mjsense.compat import dm_control as adapter

        adapter.use(env.unwrapped._env)  # pyright: ignore[reportAttributeAccessIssue]  # gym-aloha's
    env.reset(seed=0)
    env.action_space.seed(0)
    return env, lambda: random_step(env), lambda: np.asarray(env.render())


def dm_control_env(name: str, size: Size, use: bool) -> Made:
    from dm_control import suite

    env = suite.load(*name.split("/")[1:], task_kwargs={"random": 0})
    if use:
        from mjsense.compat import dm_control as adapter

        adapter.use(env)
    env.reset()
    rng, shape = np.random.default_rng(0), env.action_spec().shape
    return env, lambda: env.step(rng.uniform(-1, 1, shape)), lambda: env.physics.render(size[1], size[0], camera_id=0)


def robosuite_env(name: str, size: Size, use: bool) -> Made:
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
        lambda: np.array(env.sim.render(width=size[0], height=size[1], camera_name=camera)[::-1]),
    )


def libero_env(name: str, size: Size, use: bool) -> Made:
    from libero.libero import get_libero_path
    from libero.libero.envs import OffScreenRenderEnv
    from robosuite.environments import base
    from robosuite.utils.binding_utils import MjRenderContextOffscreen

    base.MjRenderContextOffscreen = MjRenderContextOffscreen
    if use:
        from mjsense.compat import robosuite as adapter

        adapter.use()
    _, suite, task, camera = name.split("/")
    files = sorted((Path(get_libero_path("bddl_files")) / suite).glob("*.bddl"))
    env = OffScreenRenderEnv(bddl_file_name=str(files[int(task)]), camera_heights=8, camera_widths=8)
    env.seed(0)
    np.random.seed(0)
    env.reset()
    rng = np.random.default_rng(0)
    return (
        env,
        lambda: env.step(rng.uniform(-1, 1, 7)),
        lambda: np.array(env.sim.render(width=size[0], height=size[1], camera_name=camera)[::-1]),
    )


MAKE = {"gym_aloha": aloha_env, "dm_control": dm_control_env, "robosuite": robosuite_env, "libero": libero_env}


def prepare() -> None:
    """Registers environments and stops the packages' messages."""
    warnings.filterwarnings("ignore")
    logging.disable(logging.CRITICAL)
    try:
        import gymnasium_robotics

        gymnasium.register_envs(gymnasium_robotics)
    except Exception as error:
        print(f"gymnasium-robotics: {error}")


def make(name: str, size: Size, use: bool) -> Made:
    """The environment after a reset, with mjsense if `use`; it gives the same states in both cases."""
    return MAKE.get(name.split("/")[0], gymnasium_env)(name, size, use)


TURN = 50
"""Steps of one renderer before it is the other's turn."""


class Run:
    """Images of an environment, and their CPU times in ms."""

    def __init__(self, name: str, size: Size, use: bool) -> None:
        self._env, self._step, self._render = make(name, size, use)
        start = time.process_time()
        self.images = [self._render()]
        self.first = 1e3 * (time.process_time() - start)  # with the renderer's construction
        self.image_times: list[float] = []
        self.step_times: list[float] = []  # of steps with their images

    def run(self, count: int) -> None:
        for _ in range(count):
            begin = time.process_time()
            self._step()
            start = time.process_time()
            self.images.append(self._render())
            end = time.process_time()
            self.image_times.append(1e3 * (end - start))
            self.step_times.append(1e3 * (end - begin))

    def close(self) -> None:
        """Frees OpenGL's contexts here, not in a later measurement."""
        self._env.close()
        del self._env, self._step, self._render
        gc.collect()


class Compared(NamedTuple):
    """A time of both renderers, ms, and their ratio."""

    opengl: float
    mjsense: float
    ratio: float


def compare(theirs: list[float], ours: list[float], used: list[bool]) -> Compared:
    """Medians of the used times, and the median of the turns' ratios, which changes less with the speed of the machine."""
    turns = [
        tuple(list(itertools.compress(times[i : i + TURN], used[i : i + TURN])) for times in (theirs, ours))
        for i in range(0, len(used), TURN)
    ]
    ratio = statistics.median(statistics.median(a) / statistics.median(b) for a, b in turns if a)
    opengl, mjsense = (statistics.median(itertools.compress(times, used)) for times in (theirs, ours))
    return Compared(opengl, mjsense, ratio)


def measure(name: str, size: Size, count: int) -> tuple[Run, Run]:
    """The package's own renderer and mjsense, which draw `count` steps in turns."""
    runs = Run(name, size, False), Run(name, size, True)
    for i in range(0, count, TURN):
        for run in runs:
            run.run(min(TURN, count - i))
    for run in runs:
        run.close()
    return runs


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    error = np.mean((a.astype(float) - b) ** 2)
    return float(10 * np.log10(255**2 / max(error, 1e-3)))


def save_picture(path: Path, theirs: np.ndarray, ours: np.ndarray) -> None:
    """Both images side by side."""
    from PIL import Image

    gap = np.full((len(ours), 4, 3), 255, np.uint8)
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(np.concatenate([theirs, gap, ours], axis=1)).save(path, quality=85)


def size_of(text: str) -> Size:
    width, _, height = text.partition("x")
    return int(width), int(height or width)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("environments", nargs="*", default=ENVIRONMENTS)
    parser.add_argument("--sizes", nargs="+", type=size_of, default=[(84, 84), (256, 256), (640, 480)])
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--json")
    parser.add_argument("--pictures", type=Path)
    arguments = parser.parse_args()
    prepare()
    print(f"MuJoCo {mujoco.__version__}")
    columns = ("OpenGL", "mjsense", "ratio", "step", "mjsense", "ratio", "first", "PSNR")
    print(f"{'environment':38s} {'size':>8s} " + " ".join(f"{name:>9s}" for name in columns))
    rows = []
    for name in arguments.environments:
        for size in arguments.sizes:
            label = f"{size[0]}x{size[1]}"
            try:
                theirs, ours = measure(name, size, arguments.count)
                moved = [not np.array_equal(*pair) for pair in itertools.pairwise(theirs.images)]
                if sum(moved) < 5:
                    raise ValueError(f"only {sum(moved)} of {len(moved)} images differ from the one before")
            except Exception as error:
                print(f"{name:38s} {label:>8s} {type(error).__name__}: {str(error)[:90]}", flush=True)
                continue
            if arguments.pictures:
                save_picture(arguments.pictures / f"{name.replace('/', '_')}_{label}.jpg", theirs.images[-1], ours.images[-1])
            image = compare(theirs.image_times, ours.image_times, moved)
            step = compare(theirs.step_times, ours.step_times, moved)
            row = {
                "environment": name,
                "size": label,
                "opengl_ms": image.opengl,
                "mjsense_ms": image.mjsense,
                "ratio": image.ratio,
                "opengl_step_ms": step.opengl,
                "mjsense_step_ms": step.mjsense,
                "step_ratio": step.ratio,
                "first_ms": ours.first,
                "psnr": psnr(np.array(theirs.images[1:]), np.array(ours.images[1:])),
            }
            rows.append(row)
            print(f"{name:38s} {label:>8s} " + " ".join(f"{x:9.2f}" for x in list(row.values())[2:]), flush=True)
    for size in sorted({row["size"] for row in rows}):
        ratios = [row["ratio"] for row in rows if row["size"] == size]
        print(f"median ratio at {size}: {statistics.median(ratios):.1f}, lowest {min(ratios):.1f}")
    if arguments.json:
        with open(arguments.json, "w") as file:
            json.dump(rows, file, indent=1)


if __name__ == "__main__":
    main()
