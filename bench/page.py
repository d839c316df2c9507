# SPDX-License-Identifier: Apache-2.0
"""Writes the tables of docs/performance_notes.md from the last runs, and those of README.md and docs/performance.md from these
tables: `python bench/page.py`. No figure in them is edited by hand.

Each benchmark stores its rows in .cache/bench/results. Between `<!-- bench NAME -->` and `<!-- end -->` a page has the table of
that benchmark, with the machine and its load. If the benchmark was not run, its table is not changed. If it was run in parts, the
parts are combined into one table.
"""

from __future__ import annotations

import json
import sys

import figures
from camera_scenes import VIEWS
from harness import RESULTS, ROOT, table


def runs(name: str) -> list[dict]:
    """The stored runs of a benchmark: one complete run, or its parts in the order of VIEWS."""
    labels = [view.label for view in VIEWS.values()]
    found = [json.loads(p.read_text()) for p in RESULTS.glob("*.json") if p.stem.split("-")[0] == name]

    def order(run: dict) -> int:
        return next((i for i, label in enumerate(labels) if run["rows"][0]["case"].startswith(label + ",")), len(labels))

    return sorted(found, key=order)


def under(found: list[dict]) -> str:
    loads = dict.fromkeys(run["load"] for run in found)
    return f"*{found[0]['machine']}; {'; '.join(loads)}.*"


def block(name: str, before: str) -> str:
    found = runs(name)
    if not found:
        print(f"page: no results of {name}; its table is not changed", file=sys.stderr)
        return before.strip()
    return f"{table([row for run in found for row in run['rows']])}\n\n{under(found)}"


def main() -> None:
    path = ROOT / "docs" / "performance_notes.md"
    path.write_text(figures.rewritten(path.read_text(), block))
    notes = path.read_text()
    for path in (ROOT / "docs" / "performance.md", ROOT / "README.md"):
        path.write_text(figures.rewritten(path.read_text(), lambda name, _: figures.table(name, notes)))


if __name__ == "__main__":
    main()
