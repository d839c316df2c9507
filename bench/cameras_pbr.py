# SPDX-License-Identifier: Apache-2.0
"""Physically based images per CPU second compared with mujoco-warp-pbr on Warp's CPU device.

64 worlds at 84 x 84, and one image at 640 x 480, in views of camera_scenes.VIEWS; rgb with shadows in the light of the same
surroundings. The peer has no ambient occlusion: rows say whether mjsense's images have it. Neither side draws samples within
pixels; mjsense draws mirrors and the peer does not. Physics and kinematics are not measured. --pictures=FOLDER writes the images
of both. Other arguments are views to measure. The peer needs a Python 3.12; the first run compiles its kernels for each scene,
which takes minutes.
"""

from __future__ import annotations

import argparse
import pathlib
import sys
import tempfile

import camera_scenes
import numpy as np
from camera_rate import Ours, Shot
from fetch import Unavailable, run_peer
from harness import Row, report
from images import write_sheet

SIZES = ((84, 84, 64), (640, 480, 1))
"""Width, height, worlds."""
VIEWS = ("panda_wrist", "panda_moving", "kitchen_moving", "go1_head", "kitchen_fixed")


def write_surroundings(path: pathlib.Path) -> None:
    """A bright ceiling over a darker floor, as a Radiance picture (RGBE) of 128 x 64 pixels."""
    z = np.cos((np.arange(64) + 0.5) / 64 * np.pi)
    value = np.clip(100 * (1 + 0.6 * z), 1, 255)
    pixels = np.empty((64, 128, 4), np.uint8)
    pixels[...] = np.stack([value, value, value, np.full(64, 128)], -1)[:, None]
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 64 +X 128\n" + pixels.tobytes())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pictures", type=pathlib.Path, metavar="FOLDER")
    folder = parser.parse_known_args()[0].pictures
    rows = []
    with tempfile.TemporaryDirectory() as scratch:
        surroundings = pathlib.Path(scratch) / "surroundings.hdr"
        write_surroundings(surroundings)
        for name in [v for v in VIEWS if v in sys.argv] or VIEWS:
            view = camera_scenes.VIEWS[name]
            for width, height, worlds in SIZES:
                shots = [
                    Shot((width, height), shading="pbr", ambient_occlusion=on, environment=str(surroundings))
                    for on in (True, False)
                ]
                ours = Ours(view, shots, worlds=worlds, threads=1)
                rates = [ours.rate(0), ours.rate(1)]
                images = pathlib.Path(scratch) / "images.npz"
                peer = run_peer(
                    "warp_pbr", "warp_cameras", name, str(width), str(height), str(worlds), str(surroundings), str(images)
                )
                case = f"{view.label}, {width}x{height}"
                for rate, occlusion in zip(rates, ("with", "without")):
                    rows.append(
                        Row(
                            f"{case}, {occlusion} ambient occlusion",
                            rate,
                            "images/CPU s",
                            peer["images_per_second"],
                            "mujoco-warp-pbr",
                        )
                    )
                    print(f"{rows[-1].case}: {rate:.1f} against {rows[-1].peer:.2f}", file=sys.stderr)
                if folder:
                    first = Ours(view, shots, worlds=1, threads=1)
                    first.frame()
                    write_sheet(folder / f"{name}_{height}_pbr.png", first.cameras[0].data.rgb[0], np.load(images)["rgb"])
    report("Physically based images and mujoco-warp-pbr", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        print(f"cameras_pbr skipped: {error}", file=sys.stderr)
