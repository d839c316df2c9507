# SPDX-License-Identifier: Apache-2.0
"""Images per CPU second compared with Filament, MuJoCo 4's physically based renderer, through Vulkan (Mesa's lavapipe, without a
GPU).

First rgb with shadows on both sides, without Filament's reflections and multisampling; then depth. Poses change before every
image; physics and mj_forward are not measured. CPU time is measured, so the figures are meaningless on a GPU. Scenes look
different in Filament (its own lights, tone mapping): --pictures=FOLDER writes both images. One row gives the share of pixels with
equal depth.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import tempfile

import camera_scenes
import numpy as np
from camera_rate import CPUS, measure, of_scene
from fetch import Unavailable, run_peer
from harness import Row, report
from images import same_depth, write_sheet

SIZES = ((84, 84), (224, 224), (640, 480))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=pathlib.Path, metavar="FOLDER")
    folder = parser.parse_known_args()[0].pictures
    rows = []
    for name in camera_scenes.CAMERAS:
        print(f"{name}: {camera_scenes.describe(camera_scenes.compiled(name))}", file=sys.stderr)
        for width, height in SIZES:
            for kind in ("rgb", "depth"):
                with tempfile.NamedTemporaryFile(suffix=".npz") as file:
                    camera = camera_scenes.CAMERAS[name]
                    peer = run_peer("filament", "filament_cameras", name, camera, str(width), str(height), kind, file.name)
                    image = np.load(file.name)["image"]
                ours = measure(of_scene(name), (width, height), (kind,), 8 * CPUS)
                case = f"{name} {width}x{height} {kind}{' with shadows' if kind == 'rgb' else ''}"
                rows.append(Row(case, ours.rate, "images/CPU s", peer["images_per_second"], "Filament"))
                print(f"{case}: {ours.rate:.0f} against {rows[-1].peer:.1f}", file=sys.stderr)
                if kind == "rgb" and folder:
                    write_sheet(folder / f"{name}_{height}_filament.png", ours.first["rgb"], image)
        rows.append(Row("- the same depth within 1 cm", same_depth(ours.first["depth"][..., 0], image), "% of pixels"))
    report("Cameras and Filament", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        print(f"cameras_filament skipped (it needs a Vulkan driver, mesa-vulkan-drivers): {error}", file=sys.stderr)
