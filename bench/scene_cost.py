# SPDX-License-Identifier: Apache-2.0
"""What each part of the default scenes costs in recording speed: python bench/scene_cost.py [--rounds 5] [--size 640x368]

Records `pick` with Franka and two cameras, and prints for each variant of the scene the median CPU time of a step, with start of
the episode, physics, planner, images and encoding, and its ratio to the plain scene. The ratio is the median over rounds, in
which the variants take turns. A variant whose objects come from a package is skipped if the package is not installed.
"""

import argparse
import os
import resource
import statistics
import tempfile
from pathlib import Path

import mjsense as mjs

HORIZON = 40  # steps; shorter than any planned episode, so that all are equally long
TABLE = Path(__file__).resolve().parents[1] / "models/scenes/table/scene.toml"
ROOM = '[[entities]]\nname = "room"\nmodel = "embedded:scenes/table/room.xml"\n\n'
VARIANTS = {
    "grey table in an empty room, 8 objects of primitives": {"scene": "plain"},
    "furnished room (`table`)": {"scene": "table"},
    "furnished room that differs between episodes (`varied_table`, the default)": {"scene": "varied_table"},
    "12 objects of the catalogue, without meshes (`assorted`)": {"scene": "assorted"},
    "9 objects with meshes (`metaworld/objects`)": {"scene": "metaworld/objects"},
    "10 objects with meshes (`ycb/objects`)": {"scene": "ycb/objects"},
    "the default, soft shadows of 4 samples": {"scene": "varied_table", "shadow_samples": 4},
    "the default, soft shadows of 8 samples": {"scene": "varied_table", "shadow_samples": 8},
}


def plain_scene(folder: str) -> str:
    """A file of the scene `table` with a plain room instead of the generated one."""
    text = TABLE.read_text().replace('generator = "table_room"\n', "").replace("[[entities]]\n", ROOM + "[[entities]]\n", 1)
    path = Path(folder, "plain.toml")
    path.write_text(text)
    return str(path)


def cpu_seconds() -> float:
    """CPU time of this process and of its encoders that have ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def milliseconds(options: dict, width: int, height: int) -> float:
    """CPU time of a step. Two recordings of different length have the same cost of beginning, which is thus left out."""
    spent = []
    for episodes in (2, 6):
        with tempfile.TemporaryDirectory() as out:
            begun = cpu_seconds()
            mjs.record(
                "pick",
                "franka",
                out=out,
                episodes=episodes,
                num_worlds=2,
                horizon=HORIZON,
                keep_failures=True,
                width=width,
                height=height,
                seed=5,
                progress=False,
                **options,
            )
            spent.append(cpu_seconds() - begun)
    return 1e3 * (spent[1] - spent[0]) / (4 * HORIZON)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5, help="Number of rounds.")
    parser.add_argument("--size", default="640x368", help="Size of the images.")
    chosen = parser.parse_args()
    width, height = map(int, chosen.size.split("x"))
    times: dict[str, list[float]] = {name: [] for name in VARIANTS}
    with tempfile.TemporaryDirectory() as folder:
        plain = {"scene": plain_scene(folder)}
        for _ in range(chosen.rounds):
            for name, options in VARIANTS.items():
                try:
                    times[name].append(milliseconds(plain if options["scene"] == "plain" else options, width, height))
                except ValueError as error:
                    print(f"{name}: skipped: {error}")
    first = next(iter(times.values()))
    print(f"{os.cpu_count()} CPUs, load {os.getloadavg()[1]:.1f}\n\n| scene | CPU ms per step | ratio |\n| --- | ---: | ---: |")
    for name, found in times.items():
        if found:
            ratio = statistics.median(now / then for now, then in zip(found, first))
            print(f"| {name} | {statistics.median(found):.1f} | {ratio:.2f} |")


if __name__ == "__main__":
    main()
