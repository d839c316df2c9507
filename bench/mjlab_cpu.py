# SPDX-License-Identifier: Apache-2.0
"""Environment steps of mjlab on the CPU per CPU second, with its own kernels and with mjsense.compat.mujoco_warp, and what they
consist of.

    build/mjlab/bin/python bench/mjlab_cpu.py [TASK ...] [--envs 64 1024] [--steps 20] [--threads 1]

One process has both environments. After `--warm` steps with mjsense's physics, which bring both into the same states, each takes
the same random actions. CPU time is that of all threads. Physics: step, forward, reset and set_const; sensing: rays and cameras;
the rest: managers, contact sensors, rewards, observations. The last column is the time on the clock of the physics of one
environment step. The environment build/mjlab is that of tests/python/test_adapters.py;
PYTHONPATH names the folder of the build, build/release/python.
"""

from __future__ import annotations

import argparse
import time
from typing import Any

TASKS = (
    "Mjlab-Cartpole-Swingup",
    "Mjlab-Velocity-Flat-Unitree-Go1",
    "Mjlab-Velocity-Rough-Unitree-Go1",
    "Mjlab-Velocity-Flat-Unitree-G1",
)
PARTS = {"physics": ("step", "forward", "reset", "recompute_constants"), "sensing": ("sense",)}


class Environment:
    """An environment whose calls of the simulation are timed."""

    def __init__(self, task: str, envs: int) -> None:
        from mjlab.envs import ManagerBasedRlEnv
        from mjlab.tasks.registry import load_env_cfg

        cfg = load_env_cfg(task)
        cfg.scene.num_envs, cfg.seed = envs, 1
        self.spent = dict.fromkeys((*PARTS, "all"), 0.0)
        self.clock = dict(self.spent)
        self.env: Any = ManagerBasedRlEnv(cfg=cfg, device="cpu")
        self.env.reset(seed=1)
        for part, names in PARTS.items():
            for name in names:
                setattr(self.env.sim, name, self.timed(part, getattr(self.env.sim, name)))

    def timed(self, part: str, call: Any) -> Any:
        def run(*args: Any, **kwargs: Any) -> Any:
            start, begun = time.process_time(), time.perf_counter()
            result = call(*args, **kwargs)
            self.spent[part] += time.process_time() - start
            self.clock[part] += time.perf_counter() - begun
            return result

        return run

    def step(self, action: Any) -> None:
        self.timed("all", self.env.step)(action)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tasks", nargs="*", default=TASKS)
    parser.add_argument("--envs", nargs="*", type=int, default=[64, 1024])
    parser.add_argument("--steps", type=int, default=20, help="steps with mjsense; a tenth of it with mjlab's own kernels")
    parser.add_argument("--warm", type=int, default=25)
    parser.add_argument("--threads", type=int, default=1)
    options = parser.parse_args()

    import torch
    import warp as wp

    torch.set_num_threads(options.threads)
    wp.config.log_level = 40
    import mjlab.tasks  # noqa: F401

    from mjsense.compat import mujoco_warp

    print(
        "| task | environments | mjlab | mjsense | ratio | of these: physics | sensing | rest | physics, ms |\n"
        + "| --- "
        + "| ---: " * 8
        + "|"
    )
    for task in options.tasks:
        for envs in options.envs:
            with mujoco_warp.used(options.threads):
                theirs, ours = Environment(task, envs), Environment(task, envs)
                actions = torch.randn(options.warm + options.steps, envs, ours.env.action_manager.total_action_dim) * 0.3
                for action in actions[: options.warm]:
                    theirs.step(action)
                    ours.step(action)
            rates = []
            for one, steps in ((theirs, max(1, options.steps // 10)), (ours, options.steps)):
                one.spent, one.clock = dict.fromkeys(one.spent, 0.0), dict.fromkeys(one.spent, 0.0)
                with mujoco_warp.used(options.threads) if one is ours else torch.no_grad():
                    for action in actions[options.warm :][:steps]:
                        one.step(action)
                rates.append(envs * steps / one.spent["all"])
            shares = [ours.spent[part] / ours.spent["all"] for part in PARTS]
            cells = [task, envs, *(f"{rate:,.0f}" for rate in rates), f"{rates[1] / rates[0]:.0f}"]
            cells += [f"{share:.0%}" for share in (*shares, 1 - sum(shares))]
            cells.append(f"{1e3 * ours.clock['physics'] / options.steps:.0f}")
            print("|", " | ".join(map(str, cells)), "|", flush=True)


if __name__ == "__main__":
    main()
