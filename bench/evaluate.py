# SPDX-License-Identifier: Apache-2.0
"""Episodes per second of CPU time of one small policy (ACT, images of 64x64 pixels) in `mjsense evaluate` with 16 worlds, with
and without videos, and with one world, which is the structure of MolmoSpaces' runner, and in LeRobot's `lerobot-eval` with
lerobot_env_mjsense.

Each program runs with few and with many episodes; the difference leaves out the time in which it starts. The policy is not
trained, so that all episodes have the same length. The environment of tests/python/lerobot_environments.py is needed:

    MJSENSE_TEST_LEROBOT=1 ./dev test -k test_lerobot_evaluation
    ./dev python bench/evaluate.py [--episodes 64]
"""

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import mjsense as mjs

ROOT = Path(__file__).resolve().parents[1]
VERSION, STEPS, SEED = "0.6.1", 60, 5
FOLDER = ROOT / f"build/lerobot_{VERSION}_mjsense"
PYTHON = ROOT / f"build/lerobot_{VERSION}/bin/python"


def cpu_seconds(*words: object) -> float:
    """CPU time of a program in LeRobot's Python, with one thread for PyTorch."""
    places = (Path(mjs.__file__).parents[1], FOLDER, FOLDER / "plugin")
    variables = {"PYTHONPATH": os.pathsep.join(map(str, places)), "HF_HUB_OFFLINE": "1", "OMP_NUM_THREADS": "1"}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([PYTHON, *map(str, words)], env={**os.environ, **variables}, capture_output=True, text=True)
    if done.returncode:
        sys.exit(done.stdout[-2000:] + done.stderr[-3000:])
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--episodes", type=int, default=64, help="Additional episodes of the second run.")
    episodes = parser.parse_args().episodes
    if not (FOLDER / "installed").exists():
        sys.exit(f"{FOLDER} is missing: MJSENSE_TEST_LEROBOT=1 ./dev test -k test_lerobot_evaluation makes it")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        images = {"seed": SEED, "width": 64, "height": 64, "shadows": False}
        mjs.record("pick", out=folder / "data", episodes=2, horizon=20, keep_failures=True, progress=False, **images)
        mjs.exporting.export_lerobot(folder / "data", folder / "out")
        cpu_seconds(ROOT / "tests/python/adapters/lerobot_act.py", folder / "out", folder / "act", "act", 1)

        def ours(worlds: int, count: int, *more: str) -> float:
            options = [
                "--worlds",
                worlds,
                "--episodes",
                count,
                "--seed",
                SEED,
                "--width",
                64,
                "--height",
                64,
                "--no-shadows",
                "--quiet",
            ]
            return cpu_seconds(
                *("-m", "mjsense", "evaluate", "pick", "--policy", f"lerobot:{folder / 'act'}", "--horizon", STEPS),
                *("--threads", 1, "--out", folder / "results", "--overwrite", *options, *more),
            )

        def theirs(worlds: int, count: int) -> float:
            env = {
                "task": "pick",
                "env_seed": SEED,
                "width": 64,
                "height": 64,
                "horizon": STEPS,
                "options": "{shadows: false, threads: 1}",
            }
            return cpu_seconds(
                *("-m", "lerobot.scripts.lerobot_eval", "--env.type=mjsense", "--policy.device=cpu", "--seed=0"),
                *(f"--env.{option}={value}" for option, value in env.items()),
                *(f"--policy.path={folder / 'act'}", f"--eval.batch_size={worlds}", f"--eval.n_episodes={count}"),
                f"--output_dir={folder / 'eval'}",
            )

        cases = (
            ("mjsense evaluate, 16 worlds", lambda count: ours(16, count), 16),
            ("mjsense evaluate --no-videos, 16 worlds", lambda count: ours(16, count, "--no-videos"), 16),
            ("mjsense evaluate, one world", lambda count: ours(1, count), 2),
            ("lerobot-eval with lerobot_env_mjsense, 16 worlds", lambda count: theirs(16, count), 16),
        )
        for text, call, few in cases:
            seconds = call(few + episodes) - call(few)
            print(f"{text:50} {episodes / seconds:6.2f} episodes/CPU s", flush=True)


if __name__ == "__main__":
    main()
