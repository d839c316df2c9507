# SPDX-License-Identifier: Apache-2.0
"""Images per CPU second with physically based and with classic shading.

Everything that a view varies is changed before every image. One thread, 8 worlds, shadows; the update of the ray scene is
included. Arguments are views to measure (panda_wrist); the default is VIEWS.
"""

from __future__ import annotations

import sys

import camera_scenes
from camera_rate import Ours, Shot
from fetch import Unavailable
from harness import Row, report

SIZES = ((84, 84), (640, 480))
VIEWS = ("panda_wrist", "panda_moving", "kitchen_moving", "go1_head", "panda_fixed", "kitchen_fixed")


def main() -> None:
    rows = []
    for name in [v for v in VIEWS if v in sys.argv] or VIEWS:
        view = camera_scenes.VIEWS[name]
        shots = [
            shot
            for size in SIZES
            for shot in (Shot(size), Shot(size, shading="pbr"), Shot(size, shading="pbr", ambient_occlusion=False))
        ]
        ours = Ours(view, shots, worlds=8, threads=1)
        for index, (width, height) in enumerate(SIZES):
            classic, physical, plain = (ours.rate(3 * index + kind) for kind in range(3))
            case = f"{view.label}, {width}x{height}"
            rows.append(Row(case, physical, "images/CPU s", classic, "classic"))
            rows.append(Row(f"{case}, without ambient occlusion", plain, "images/CPU s", classic, "classic"))
            for row in rows[-2:]:
                print(f"{row.case}: {row.ours:.1f} against {row.peer:.1f}", file=sys.stderr)
    report("Physically based images", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        sys.exit(f"cameras_shading: {error}")
