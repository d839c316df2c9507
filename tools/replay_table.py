# SPDX-License-Identifier: Apache-2.0
"""Replays recordings of every task with every robot that has a planner for it, and writes the table of docs/replay.md.

    python tools/replay_table.py [--episodes 2] [--only TASK[/ROBOT]]

Each pair is recorded in the task's own scene with small images and depth. Results are stored in .cache/replay, so that a part can
be repeated alone.
"""

from __future__ import annotations

import argparse
import itertools
import json
import tempfile
from pathlib import Path
from typing import Any

from task_table import CASES

import mjsense as mjs

ROOT = Path(__file__).resolve().parents[1]
PAGE, RESULTS = ROOT / "docs" / "replay.md", ROOT / ".cache" / "replay"
BEGIN, END = "<!-- replay table -->", "<!-- end -->"
PAIRS = [(task, robot) for task, robot, scene in CASES if not scene]


def check(task: str, robot: str, episodes: int) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as out:
        mjs.record(
            task,
            robot,
            out=out,
            episodes=episodes,
            max_attempts=episodes,
            keep_failures=True,
            num_worlds=2,
            width=32,
            height=24,
            depth=True,
        )
        report = mjs.check_replay(out, states=True)
    checks = [episode.sensors for episode in report.episodes if episode.sensors]
    equal = {name for check in checks for name in check.equal}
    different = {found.field for check in checks for found in check.deviations}
    return {
        "task": task,
        "robot": robot,
        "episodes": len(report.episodes),
        "steps": sum(episode.steps for episode in report.episodes),
        "stepwise": sum(episode.stepwise is None for episode in report.episodes),
        "open_loop": sum(episode.open_loop is None for episode in report.episodes),
        "streams": len(equal | different),
        "equal": len(equal - different),
        "different": sorted(different),
        "deviations": [str(found) for episode in report.episodes for found in episode.deviations.values()],
    }


def row(results: list[dict[str, Any]]) -> str:
    """The row of a task: sums over its robots."""
    robots = ", ".join(r["robot"] for r in results)
    episodes, steps, stepwise, open_loop, equal, streams = (
        sum(r[key] for r in results) for key in ("episodes", "steps", "stepwise", "open_loop", "equal", "streams")
    )
    counts = f"{episodes} | {steps} | {stepwise} of {episodes} | {open_loop} of {episodes} | {equal} of {streams}"
    return f"| `{results[0]['task']}` | {robots} | {counts} |"


def table(results: list[dict[str, Any]]) -> str:
    head = [
        "| task | robots | episodes | steps | stepwise | open loop | streams |",
        "| --- | --- | ---: | ---: | ---: | ---: | ---: |",
    ]
    return "\n".join([*head, *(row(list(group)) for _, group in itertools.groupby(results, lambda r: r["task"]))])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=2)
    parser.add_argument("--only", default="", help="TASK or TASK/ROBOT")
    arguments = parser.parse_args()
    RESULTS.mkdir(parents=True, exist_ok=True)
    results = []
    for task, robot in PAIRS:
        kept = RESULTS / f"{task}-{robot}.json"
        if arguments.only in ("", task, f"{task}/{robot}"):
            kept.write_text(json.dumps(check(task, robot, arguments.episodes)))
        if kept.exists():
            results.append(json.loads(kept.read_text()))
            print(row(results[-1:]), *results[-1]["deviations"][:5], sep="\n  ", flush=True)
    before, rest = PAGE.read_text().split(BEGIN, 1)
    PAGE.write_text(f"{before}{BEGIN}\n{table(results)}\n{END}{rest.split(END, 1)[1]}")


if __name__ == "__main__":
    main()
