# SPDX-License-Identifier: Apache-2.0
"""CPU time of an episode step of `pick` with the two default cameras at 640x368: python bench/soft_shadows.py [SCENE ...]

Prints milliseconds per step and world for physics and planner alone, and for images with 1 (sharp), 4, 8 and 15 shadow samples.
"""

import sys
import time
from contextlib import closing

import mjsense as mjs

WORLDS, STEPS, SEED = 2, 25, 5


def milliseconds(scene: str, **options) -> float:
    with closing(mjs.make_vec("pick", "franka", scene=scene, num_envs=WORLDS, seed=SEED, policy="planner", **options)) as env:
        env.reset()
        start = time.process_time()
        for _ in range(STEPS):
            env.step(env.expert_action())
        return 1e3 * (time.process_time() - start) / (STEPS * WORLDS)


def main() -> None:
    print("| scene | no images | sharp | 4 samples | 8 samples | 15 samples |\n| --- | ---: | ---: | ---: | ---: | ---: |")
    for scene in sys.argv[1:] or ["varied_table", "clutter"]:
        times = [milliseconds(scene, cameras=[])] + [milliseconds(scene, shadow_samples=n) for n in (1, 4, 8, 15)]
        print(f"| `{scene}` | " + " | ".join(f"{t:.1f}" for t in times) + " |", flush=True)


if __name__ == "__main__":
    main()
