# SPDX-License-Identifier: Apache-2.0
"""Makes the tables of figures in README.md and docs/performance.md from those of docs/performance_notes.md.

page.py writes them; tests/python/test_docs.py checks that they are up to date.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

WARP = "mujoco_warp on the CPU"
OPENGL = "MuJoCo's OpenGL renderer in software"
SENSORS = "MuJoCo's contact sensors"

SHORT_UNITS = {"M rays per CPU second": "M rays/CPU s", "us per world and substep": "us"}


@dataclass(frozen=True)
class Figure:
    """One cell of a benchmark's table, and its label in a summary."""

    benchmark: str
    case: str  # full text of the first column
    column: str  # heading of the compared program's column
    label: str
    compared_with: str


TRAINING = Figure(
    "cameras",
    "Panda table, camera, lights, materials randomised, 640x480, rgb with shadows",
    "classic, shadow maps 1024",
    "RGB with shadows, 640x480, Panda at a table, randomised for every image",
    OPENGL,
)
BATCH = Figure(
    "cameras_warp",
    "Panda table, camera, lights, materials randomised, with shadows",
    "mujoco_warp, the same setting",
    "RGB with shadows and depth, 84x84, 64 worlds, Panda at a table, randomised for every image",
    WARP,
)
SCAN = Figure(
    "rays",
    "187 rays, 64 worlds, height field 128 x 128",
    "mujoco_warp on the CPU",
    "Height scan, 187 rays in each of 64 worlds, height field",
    WARP,
)
STEP = Figure(
    "physics",
    "Go1, poses and velocities, decimation 4",
    "mj_batch",
    "Physics of Go1 with fresh poses and velocities, time of a substep",
    "MuJoCo's batch, values one substep old",
)

TABLES = {
    "headlines": (TRAINING, BATCH, SCAN, STEP),
    "summary": (
        TRAINING,
        Figure(
            "cameras",
            "Panda table, randomised once an episode, 640x480, rgb with shadows",
            "classic, shadow maps 1024",
            "RGB with shadows, 640x480, Panda at a table, randomised once an episode",
            OPENGL,
        ),
        Figure(
            "cameras",
            "Panda's wrist camera, 640x480, rgb with shadows",
            "classic, shadow maps 1024",
            "RGB with shadows, 640x480, Panda's wrist camera",
            OPENGL,
        ),
        Figure(
            "cameras",
            "kitchen, camera moving, 640x480, rgb with shadows",
            "classic, shadow maps 1024",
            "RGB with shadows, 640x480, kitchen, moving camera",
            OPENGL,
        ),
        Figure(
            "cameras",
            "kitchen, camera moving, 640x480, rgb without shadows",
            "classic without shadows",
            "RGB without shadows, 640x480, kitchen, moving camera",
            OPENGL,
        ),
        Figure(
            "cameras",
            "Go1's head camera, 640x480, rgb with shadows",
            "classic, shadow maps 1024",
            "RGB with shadows, 640x480, Go1's head camera",
            OPENGL,
        ),
        BATCH,
        Figure(
            "cameras_filament",
            "kitchen 640x480 rgb with shadows",
            "Filament",
            "RGB with shadows, 640x480, kitchen, fixed camera",
            "Filament in software",
        ),
        SCAN,
        Figure(
            "rays",
            "lidar 16 x 360 on a humanoid in a room, 127 geoms, 393k faces",
            "mujoco-lidar on the CPU",
            "Lidar, 16 x 360 rays, a room with 393,000 triangles",
            "mujoco-lidar on the CPU",
        ),
        Figure(
            "rays",
            "lidar in 16 worlds, a step of physics (not timed) between",
            "mj_multiRay",
            "Lidar in 16 worlds",
            "mj_multiRay",
        ),
        Figure(
            "rays",
            "lidar among 10,000 boxes and one that moves",
            "ours, the boxes as one mesh",
            "Lidar among 10,000 boxes",
            "mjsense, the boxes as one mesh",
        ),
        STEP,
        Figure(
            "physics",
            "Go1, contact forces, decimation 4",
            "mj_batch",
            "Physics of Go1 with fresh contact forces, time of a substep",
            "MuJoCo's batch, values one substep old",
        ),
        Figure(
            "physics",
            "G1, contact forces, decimation 1",
            "mj_batch",
            "Physics of G1 with fresh contact forces, decimation 1, time of a substep",
            "MuJoCo's batch, values one substep old",
        ),
        Figure(
            "contact",
            "one world, primaries: 32, contacts: 32",
            SENSORS,
            "Contact sensor, 32 primaries, 32 contacts, 7 fields, time of a reading",
            SENSORS,
        ),
        Figure(
            "memory",
            "one more world: Panda at its table, wrist camera",
            "mjData alone",
            "Memory of a world, Panda at a table, wrist camera",
            "MuJoCo's mjData",
        ),
        Figure(
            "record",
            "1 x 100 steps, 2 RGB, 640x368",
            "h5py and ffmpeg in sequence",
            "Recording of two RGB cameras, 640x368, wall time",
            "h5py and ffmpeg, one after the other",
        ),
    ),
}


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def benchmark_block(notes: str, name: str) -> str:
    found = re.search(rf"<!-- bench {name} -->\n(.*?)<!-- end -->", notes, re.DOTALL)
    if not found:
        raise LookupError(f"docs/performance_notes.md: no table of benchmark '{name}'")
    return found[1]


def row_of(notes: str, figure: Figure) -> tuple[str, str, str, str]:
    """(unit, figure of mjsense, figure of the other program, ratio)."""
    lines = [cells(line) for line in benchmark_block(notes, figure.benchmark).splitlines() if line.startswith("|")]
    heading = lines[0]
    row = next((row for row in lines[2:] if row[0] == figure.case), None)
    if row is None or figure.column not in heading:
        raise LookupError(
            f"docs/performance_notes.md: the table of '{figure.benchmark}' has no row '{figure.case}' with a column "
            f"'{figure.column}'"
        )
    other = re.fullmatch(r"(\S+) \((\S+) x\)", row[heading.index(figure.column)])
    if other is None:
        raise LookupError(f"docs/performance_notes.md: the row '{figure.case}' has no figure for '{figure.column}'")
    return SHORT_UNITS.get(row[1], row[1]), row[2], other[1], other[2]


def table(name: str, notes: str) -> str:
    lines = ["| measurement | mjsense | compared with | ratio |", "| --- | --- | --- | ---: |"]
    for figure in TABLES[name]:
        unit, ours, other, ratio = row_of(notes, figure)
        lines.append(f"| {figure.label} | {ours} {unit} | {figure.compared_with}: {other} {unit} | {ratio} x |")
    return "\n".join(lines)


def rewritten(text: str, block: Callable[[str, str], str]) -> str:
    """The page `text` with each block `<!-- bench NAME -->` ... `<!-- end -->` replaced by block(NAME, its current text)."""
    return re.sub(
        r"(<!-- bench (\w+) -->\n)(.*?)(<!-- end -->)", lambda m: f"{m[1]}\n{block(m[2], m[3])}\n\n{m[4]}", text, flags=re.DOTALL
    )
