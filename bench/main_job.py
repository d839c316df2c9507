# SPDX-License-Identifier: Apache-2.0
"""The main use case end to end: recording picks of a Franka by the planner with two cameras.

Measures steps and frames per second of the whole job, and how its time is divided. `encoders` and `files` are CPU seconds spent
in parallel to the loop, in other processes and threads, which compete with it for the CPUs. `all CPUs together` is the CPU time
of the whole job per step, encoders included; unlike the rates it hardly depends on other load of the machine. The arm's real
meshes come from gymnasium-robotics.
"""

import json
import os
import statistics
import subprocess
import sys
import tempfile

from fetch import Unavailable, wheel
from harness import MJSENSE, Row, report

RUNS = 3
MESHES = "gymnasium_robotics/envs/assets/kitchen_franka/franka_assets/meshes/visual"
CASES = {
    "state alone, 16 episodes in 4 worlds": ["--episodes", "16", "--cameras", "none"],
    "2 cameras 640x368, 4 episodes in 4 worlds": ["--episodes", "4"],
    "2 cameras 640x368, the arm's real meshes, 4 episodes in 4 worlds": ["--episodes", "4", "--meshes", "real"],
    "2 cameras 640x368 with depth, 4 episodes in 4 worlds": ["--episodes", "4", "--depth"],
    "2 cameras 320x192, 8 episodes in 4 worlds": ["--episodes", "8", "--size", "320x192"],
}


def run(options: list[str]) -> dict:
    with tempfile.TemporaryDirectory() as folder:
        command = [
            *MJSENSE,
            "record",
            "pick",
            "--robot",
            "franka",
            "--worlds",
            "4",
            "--out",
            folder,
            "--json",
            "-q",
            "--no-sheet",
            *([] if "--meshes" in options else ["--meshes", "shapes"]),
            *options,
        ]
        before = os.times()
        summary = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        after = os.times()
        cpu = after.children_user + after.children_system - before.children_user - before.children_system
        return {**summary, "cpu_s": cpu}


def main() -> None:
    os.environ["MJSENSE_FRANKA_MESHES"] = str(wheel("gymnasium-robotics") / MESHES)
    rows = []
    for case, options in CASES.items():
        results = [run(options) for _ in range(RUNS)]
        median = statistics.median
        rows.append(Row(case, median(r["steps"] / r["seconds"] for r in results), "steps/s"))
        if results[0]["frames"]:
            rows.append(Row(case, median(r["frames"] / r["seconds"] for r in results), "frames/s"))
        rows.append(Row(case, median(1000 * r["cpu_s"] / r["steps"] for r in results), "ms a step, all CPUs together"))
        for room in results[0]["time"]:
            share = median(100 * r["time"][room] / r["seconds"] for r in results)
            rows.append(Row(f"- {room}", share, "% of the time"))
        rows.append(Row("- in parallel: encoders", median(r["encode_cpu_s"] for r in results), "CPU s"))
        rows.append(Row("- in parallel: files", median(r["write_s"] for r in results), "s"))
    report("Main job", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        sys.exit(f"main_job: {error}")
