# SPDX-License-Identifier: Apache-2.0
"""mjlab's own environments with mjsense.compat.mjlab.use() against mjlab's own execution on the CPU.

python mjlab_use.py [TASK ...]

Both have the same seeds and actions. Observations and rewards are compared after each step.
"""

import sys

import numpy as np
import torch
import warp as wp

wp.config.log_level = 40
import mjlab.tasks  # noqa: F401
from mjlab.envs import ManagerBasedRlEnv
from mjlab.tasks.registry import load_env_cfg

import mjsense.compat.mjlab
from mjsense.compat import mujoco_warp

STEPS, WORLDS = 10, 4
BOUNDS = {
    "Mjlab-Cartpole-Balance": (1e-4, 1e-5),
    "Mjlab-Cartpole-Swingup": (1e-4, 1e-5),
    "Mjlab-Velocity-Flat-Unitree-Go1": (2e-2, 1e-4),
    "Mjlab-Lift-Cube-Yam-Rgb": (1e-4, 1e-5),
    "Mjlab-Lift-Cube-Yam-Depth": (1e-4, 1e-5),
}
"""Task -> largest difference of an observation and of a reward."""
LEVEL = 1 / 255 + 1e-6
"""Largest difference of an image of colours or depths."""


def run(task):
    """Observations and rewards of the steps."""
    cfg = load_env_cfg(task)
    cfg.scene.num_envs, cfg.seed = WORLDS, 1
    env = ManagerBasedRlEnv(cfg=cfg, device="cpu")
    found = [env.reset(seed=1)[0]]
    actions = np.random.default_rng(0).normal(0, 0.3, (STEPS, WORLDS, env.action_manager.total_action_dim))
    for step, action in enumerate(actions):
        torch.manual_seed(step)
        np.random.seed(step)
        observations, reward, *_ = env.step(torch.tensor(action, dtype=torch.float32))
        found.append({**observations, "reward": reward})
    return [{name: np.array(value) for name, value in each.items()} for each in found], env


for task in sys.argv[1:] or BOUNDS:
    theirs, _ = run(task)
    mjsense.compat.mjlab.use()
    ours, env = run(task)
    assert mujoco_warp._worlds[id(env.sim.wp_data)].model is env.sim.wp_model
    mujoco_warp.stop()
    for step, (before, after) in enumerate(zip(theirs, ours, strict=True)):
        for name, value in before.items():
            error, bound = np.abs(after[name] - value).max(), BOUNDS.get(task, (1, 1))[name == "reward"]
            if name == "camera":
                bound = LEVEL
                assert mujoco_warp._draws(env.sim.wp_model, env.sim.wp_data, env.sim._sensor_context.render_context)
            if step in (0, 1, STEPS):
                print(f"{task}, step {step}: {name} differ by {error:.1e}")
            assert error <= bound, (task, step, name, error)
