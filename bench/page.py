# SPDX-License-Identifier: Apache-2.0
"""Writes the tables of docs/performance.md and README.md from the last runs: `python bench/page.py`. No figure is typed by hand.

Every benchmark leaves its rows in .cache/bench/results. Between `<!-- bench NAME -->` and `<!-- end -->` a page has that benchmark's table,
with the machine and its load, or what stood there if it was not run; one that was run in parts has one table of all of them. README's `<!-- bench headlines -->` has
the ratios of HEADLINES.
"""

from __future__ import annotations

import json
import re
import sys

from camera_scenes import VIEWS
from harness import RESULTS, ROOT, table

# Benchmark, case, peers: what README says.
HEADLINES = (
    ("cameras", "Panda's wrist camera, 640x480, rgb with shadows"),
    ("cameras", "kitchen, camera moving, 640x480, rgb with shadows"),
    ("cameras", "Go1's head camera, 640x480, rgb with shadows"),
    ("cameras", "Panda table, camera, lights, materials randomised, 640x480, rgb with shadows"),
    ("cameras", "Panda table, camera, lights, materials randomised, 84x84, rgb with shadows"),
    ("cameras", "Panda table, randomised an episode, 640x480, rgb with shadows"),
    ("cameras", "kitchen, randomised an episode, 640x480, rgb with shadows"),
    ("cameras_warp", "Panda table, camera, lights, materials randomised, with shadows"),
    ("rays", "187 rays, 64 worlds, height field 128 x 128"),
    ("rays", "lidar 16 x 360 on a humanoid in a room"),
    ("contact", "one world, primaries: 32, contacts: 32"),
    ("physics", "Go1, poses and velocities, decimation 4"),
)


def runs(name: str) -> list[dict]:
    """The whole run, or its parts in the order of the views."""
    labels = [view.label for view in VIEWS.values()]
    found = [json.loads(p.read_text()) for p in RESULTS.glob("*.json") if p.stem.split("-")[0] == name]

    def order(run: dict) -> int:
        return next((i for i, label in enumerate(labels) if run["rows"][0]["case"].startswith(label + ",")), len(labels))

    return sorted(found, key=order)


def under(found: list[dict]) -> str:
    loads = dict.fromkeys(run["load"] for run in found)
    return f"*{found[0]['machine']}; {'; '.join(loads)}.*"


def block(name: str, before: str) -> str:
    if name == "headlines":
        return headlines(before)
    found = runs(name)
    if not found:
        print(f"page: no results of {name}, which stays as it is", file=sys.stderr)
        return before.strip()
    return f"{table([row for run in found for row in run['rows']])}\n\n{under(found)}"


def headlines(before: str) -> str:
    """A line of what was not run stays as it is."""
    lines = ["| | times | beside |", "| --- | ---: | --- |"]
    used, older = [], {}
    for name, case in HEADLINES:
        found = runs(name)
        rows = [r for run in found for r in run["rows"] if r["case"].startswith(case) and "air time" not in r["case"] and r["peer"]]
        if not rows:
            print(f"page: no results of {name}: {case}", file=sys.stderr)
            older[name] = None
            lines += [line for line in before.splitlines() if line.startswith(f"| {case}")]
            continue
        used += found
        times = " / ".join(f"{r['ratio']:.3g}" for r in rows)
        beside = " / ".join(r["peer_name"] for r in rows).replace("classic, shadow maps 4096 / classic, shadow maps", "MuJoCo's classic renderer, shadow maps 4096 /")
        what = rows[0]["case"] + {"cameras_warp": ", 84x84", "physics": ": a step with fresh sensors"}.get(name, "")
        lines.append(f"| {what} | {times} | {beside} |")
    if not used:
        return before.strip()
    earlier = f" (rows of {', '.join(older)} are of older runs: Performance)" if older else ""
    said = f"CPU time, both sides in one run, {used[0]['machine']}{earlier}; how busy the machine was is said under each table of Performance."
    return "\n".join([*lines, "", said])


def main() -> None:
    for path in (ROOT / "docs" / "performance.md", ROOT / "README.md"):
        text = path.read_text()
        path.write_text(
            re.sub(
                r"(<!-- bench (\w+) -->\n)(.*?)(<!-- end -->)",
                lambda m: f"{m[1]}\n{block(m[2], m[3])}\n\n{m[4]}",
                text,
                flags=re.DOTALL,
            )
        )


if __name__ == "__main__":
    main()
