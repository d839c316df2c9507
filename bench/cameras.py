# SPDX-License-Identifier: Apache-2.0
"""Images per CPU second of mjsense and of MuJoCo's classic renderer (EGL, in software).

Everything that a view varies is changed before every image (camera_scenes.VIEWS): moving cameras and randomised worlds come
first, fixed cameras are separate cases. The classic renderer has shadow maps of 4096 (MuJoCo's default), of 1024, or none, and no
multisampling (its fastest setting). Both sides use one thread, and CPU time is measured, so that other work on the machine has
little influence. Measured is rendering, including the update of the ray scene of mjsense and of MuJoCo's mjvScene, but not
physics or mj_forward. Arguments are views and sizes to measure (panda_wrist, 640x480); the default is all.
"""

from __future__ import annotations

import os
import sys

import camera_scenes
from camera_rate import Ours, Shot
from camera_scenes import VIEWS
from fetch import Unavailable, run_peer, wheel
from harness import Row, report

SIZES = ((84, 84), (640, 480))
WORLDS = 8
MAPS = {"4096": "classic, shadow maps 4096", "1024": "classic, shadow maps 1024"}


def main() -> None:
    os.environ.setdefault("LP_NUM_THREADS", "0")  # llvmpipe draws in the calling thread
    wheel("PyOpenGL")
    views = [v for v in VIEWS if v in sys.argv] or list(VIEWS)
    sizes = [s for s in SIZES if f"{s[0]}x{s[1]}" in sys.argv] or list(SIZES)
    rows = []
    for name in views:
        view = VIEWS[name]
        print(f"{name}: {camera_scenes.describe(camera_scenes.compiled(view.scene))}", file=sys.stderr)
        shots = [shot for size in sizes for shot in (Shot(size), Shot(size, shadows=False), Shot(size, ("depth",), False))]
        ours = Ours(view, shots, WORLDS, threads=1)
        for index, size in enumerate(sizes):
            case = f"{view.label}, {size[0]}x{size[1]}"
            shadows, plain, depth = (ours.rate(3 * index + kind) for kind in range(3))
            peer = run_peer(None, "classic_cameras", name, *map(str, size))
            unit = "images/CPU s"
            rows += [Row(f"{case}, rgb with shadows", shadows, unit, peer[k], label) for k, label in MAPS.items()]
            rows.append(Row(f"{case}, rgb without shadows", plain, unit, peer["plain"], "classic without shadows"))
            rows.append(Row(f"{case}, depth", depth, unit, peer["depth"], "classic without shadows"))
            for row in rows[-4:]:
                print(f"{row.case}: {row.ours:.1f} against {row.peer:.2f} ({row.peer_name})", file=sys.stderr)
    report("Cameras", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        sys.exit(f"cameras: {error}")
