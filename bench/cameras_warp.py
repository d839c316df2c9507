# SPDX-License-Identifier: Apache-2.0
"""Images per CPU second compared with mujoco_warp's cameras on the CPU, the renderer of mjlab's CameraSensor.

64 worlds, 84 x 84, rgb and depth together, in the views of camera_scenes.VIEWS: once with shadows on both sides and once without
(the peer's default). Physics and kinematics are not measured. Rows give the share of pixels with equal depth, which shows that
both sides render the same scene; --pictures=FOLDER writes the images of both. Arguments are views to measure; the default is all.
The first run compiles the peer's kernels, which takes about a minute.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import tempfile

import numpy as np
from camera_rate import measure
from camera_scenes import VIEWS
from fetch import Unavailable, run_peer
from harness import Row, report
from images import same_depth, write_sheet

WIDTH, HEIGHT, WORLDS = 84, 84, 64


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=pathlib.Path, metavar="FOLDER")
    folder = parser.parse_known_args()[0].pictures
    rows = []
    for name in [v for v in VIEWS if v in sys.argv] or VIEWS:
        view = VIEWS[name]
        for shadows in (True, False):
            ours = measure(view, (WIDTH, HEIGHT), ("rgb", "depth"), WORLDS, shadows)
            setting = "shadows" if shadows else "plain"
            with tempfile.NamedTemporaryFile(suffix=".npz") as file:
                peer = run_peer("warp", "warp_cameras", name, str(WIDTH), str(HEIGHT), str(WORLDS), setting, file.name)
                first = dict(np.load(file.name))
            case = f"{view.label}, {'with' if shadows else 'without'} shadows"
            rows.append(Row(case, ours.rate, "images/CPU s", peer["images_per_second"], "mujoco_warp, the same setting"))
            print(f"{case}: {ours.rate:.0f} against {rows[-1].peer:.0f}", file=sys.stderr)
        same = same_depth(ours.first["depth"][..., 0], first["depth"])
        rows.append(Row("- the same depth within 1 cm", same, "% of pixels"))
        if folder:
            write_sheet(folder / f"{name}_warp.png", ours.first["rgb"], first["rgb"])
    report(f"Cameras, {WORLDS} worlds, {WIDTH} x {HEIGHT}, rgb and depth", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        print(f"cameras_warp skipped: {error}", file=sys.stderr)
