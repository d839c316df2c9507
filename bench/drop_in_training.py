# SPDX-License-Identifier: Apache-2.0
"""Steps per second of a training script with pixels, with Gymnasium's renderer or mjsense.

    python bench/drop_in_training.py [--mjsense] [--steps 4096] [--environment HalfCheetah-v5]

Stable-Baselines3's PPO with a convolutional network learns from images of 84 x 84 pixels of 8 environments in subprocesses.
--mjsense changes one line, the one with `use`. Needs stable-baselines3, and without --mjsense OpenGL.
"""

from __future__ import annotations

import argparse
import functools
import os
import time
from pathlib import Path
from typing import Any

import gymnasium
import torch
from gymnasium.wrappers import AddRenderObservation
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import SubprocVecEnv


def make(name: str, mjsense: bool) -> Any:
    env = gymnasium.make(name, render_mode="rgb_array", width=84, height=84)
    if mjsense:
        from mjsense.compat.gymnasium import use

        env = use(env)
    return AddRenderObservation(env, render_only=True)


def cpu_seconds(envs: SubprocVecEnv) -> float:
    """CPU time of this process and of the environments' processes until now."""
    ticks = 0
    for pid in (os.getpid(), *(process.pid for process in envs.processes)):
        ticks += sum(int(x) for x in Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[11:13])
    return ticks / os.sysconf("SC_CLK_TCK")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mjsense", action="store_true")
    parser.add_argument("--steps", type=int, default=4096)
    parser.add_argument("--environment", default="HalfCheetah-v5")
    arguments = parser.parse_args()
    os.environ.setdefault("MUJOCO_GL", "disable" if arguments.mjsense else "egl")
    os.environ.setdefault("LP_NUM_THREADS", "1")
    torch.set_num_threads(1)
    envs = SubprocVecEnv([functools.partial(make, arguments.environment, arguments.mjsense)] * 8, start_method="spawn")
    learner = PPO("CnnPolicy", envs, n_steps=64, batch_size=128, n_epochs=1, device="cpu")
    start, before = time.perf_counter(), cpu_seconds(envs)
    learner.learn(arguments.steps)
    seconds, used = time.perf_counter() - start, cpu_seconds(envs) - before
    envs.close()
    steps = learner.num_timesteps
    print(f"{steps} steps in {seconds:.1f} s: {steps / seconds:.0f} steps/s; {1e3 * used / steps:.1f} ms of CPU time a step")


if __name__ == "__main__":
    main()
