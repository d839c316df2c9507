"""Images a second of CPU time beside mujoco_warp's cameras on the CPU, the renderer of mjlab's CameraSensor.

64 worlds, 84 x 84, rgb and depth together. Ours has shadows; the peer once without, its default, and once with. Poses change before
every image; physics and kinematics are not timed. A row says on how many pixels the depths are the same, so that both are known
to draw the same scene; --pictures=FOLDER writes what both drew. The first run compiles the peer's kernels, about a minute.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import tempfile

import camera_scenes
import numpy as np
from camera_rate import measure
from fetch import Unavailable, run_peer
from harness import Row, report
from images import same_depth, write_sheet

WIDTH, HEIGHT, WORLDS = 84, 84, 64
GOAL = 8


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=pathlib.Path, metavar="FOLDER")
    folder = parser.parse_known_args()[0].pictures
    rows = []
    for name in camera_scenes.CAMERAS:
        size = camera_scenes.describe(camera_scenes.compiled(name))
        ours = measure(name, (WIDTH, HEIGHT), ("rgb", "depth"), WORLDS)
        for shadows, goal in (("plain", GOAL), ("shadows", None)):
            with tempfile.NamedTemporaryFile(suffix=".npz") as file:
                peer = run_peer("warp", "warp_cameras", name, str(WIDTH), str(HEIGHT), str(WORLDS), shadows, file.name)
                first = dict(np.load(file.name))
            case = f"{name}: {size}" if shadows == "plain" else "- the peer with shadows too"
            rows.append(Row(case, ours.rate, "images/CPU s", peer["images_per_second"], "mujoco_warp", goal=goal))
            print(f"{case}: {ours.rate:.0f} against {rows[-1].peer:.0f}", file=sys.stderr)
        rows.append(Row("- the same depth within 1 cm", same_depth(ours.first["depth"][..., 0], first["depth"]), "% of pixels"))
        if folder:
            write_sheet(folder / f"{name}_warp.png", ours.first["rgb"], first["rgb"])
    report(f"Cameras, {WORLDS} worlds, {WIDTH} x {HEIGHT}, rgb and depth", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        print(f"cameras_warp left out: {error}", file=sys.stderr)
