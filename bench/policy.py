# SPDX-License-Identifier: Apache-2.0
"""Overhead of a policy written in Python: a policy that returns a constant, in 64 worlds.

Measures the wall time of `act` alone, which calls the policy once for all worlds; the steps in between are not measured, and the
observations are computed before.
"""

import statistics
import time

from harness import Row, report

import mjsense as mjs

WORLDS, STEPS = 64, 200


def main() -> None:
    import numpy as np

    constant = np.zeros((WORLDS, 8))
    env = mjs.make_vec("pick", num_envs=WORLDS, cameras=[], policy=lambda obs: constant)
    env.reset(seed=0)
    spent = []
    for _ in range(STEPS):
        start = time.perf_counter_ns()
        env._rollout.act()
        spent.append((time.perf_counter_ns() - start) * 1e-3)
        env.step(constant)
    report("Policies", [Row("a constant from Python, 64 worlds", statistics.median(spent), "us a step", higher_is_better=False)])


if __name__ == "__main__":
    main()
