# SPDX-License-Identifier: Apache-2.0
"""CPU time of an image as scenes grow in geoms, triangles and lights (camera_scenes.GROWTH). The camera and all movable objects
move before every image; all lights cast shadows.

Images are 84 x 84; both sides use one thread. The peer is MuJoCo's classic renderer as in cameras.py, with its default shadow
maps of 4096 and with 1024. Arguments are views to measure (geoms_1000); the default is all.
"""

from __future__ import annotations

import os
import sys

from camera_rate import Ours, Shot
from camera_scenes import GROWTH
from cameras import MAPS
from fetch import Unavailable, run_peer, wheel
from harness import Row, report

SIZE = (84, 84)


def main() -> None:
    os.environ.setdefault("LP_NUM_THREADS", "0")  # llvmpipe draws in the calling thread
    wheel("PyOpenGL")
    rows = []
    for name in [v for v in GROWTH if v in sys.argv] or list(GROWTH):
        kinds = (("rgb",), True), (("rgb",), False), (("depth",), False)
        ours = Ours(GROWTH[name], [Shot(SIZE, *kind) for kind in kinds], worlds=8, threads=1)
        shadows, plain, depth = (1e6 / ours.rate(kind) for kind in range(3))
        peer = {k: 1e6 / rate for k, rate in run_peer(None, "classic_cameras", name, *map(str, SIZE)).items()}

        def cost(what: str, own: float, other: float, label: str) -> Row:
            return Row(f"{GROWTH[name].label}, {what}", own, "us per image", other, label, higher_is_better=False)

        rows += [cost("rgb with shadows", shadows, peer[k], label) for k, label in MAPS.items()]
        rows.append(cost("rgb without shadows", plain, peer["plain"], "classic without shadows"))
        rows.append(cost("depth", depth, peer["depth"], "classic without shadows"))
        for row in rows[-4:]:
            print(f"{row.case}: {row.ours:.1f} us against {row.peer:.0f} ({row.peer_name})", file=sys.stderr)
    report("What an image costs as scenes grow", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        sys.exit(f"cameras_growth: {error}")
