# SPDX-License-Identifier: Apache-2.0
"""Physically based images per CPU second compared with mujoco-warp-pbr on Warp's CPU device, and with Filament, the renderer of
MuJoCo 4, through Vulkan (Mesa's lavapipe, without a GPU).

64 worlds at 84 x 84, and one image at 640 x 480, in views of camera_scenes.VIEWS; rgb with shadows. mujoco-warp-pbr has the light
of the same surroundings, Filament its own, and renders one world at a time. Neither has ambient occlusion here: rows say whether
mjsense's images have it. No side draws samples within pixels; mjsense draws mirrors and the peers do not. Physics and
kinematics are not measured. --pictures=FOLDER writes the images of all. Other arguments are views to measure. mujoco-warp-pbr and
Filament need a Python 3.12, Filament a Vulkan driver (mesa-vulkan-drivers); the first run compiles kernels for each scene,
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
                images, picture = (pathlib.Path(scratch) / name for name in ("images.npz", "picture.npz"))
                size, light = (str(width), str(height)), str(surroundings)
                peers = {
                    "mujoco-warp-pbr": run_peer("warp_pbr", "warp_cameras", name, *size, str(worlds), light, str(images)),
                    "Filament": run_peer("filament", "filament_cameras", view.scene, view.camera, *size, "rgb", str(picture)),
                }
                for rate, occlusion in zip(rates, ("with", "without")):
                    case = f"{view.label}, {width}x{height}, {occlusion} ambient occlusion"
                    for peer, found in peers.items():
                        rows.append(Row(case, rate, "images/CPU s", found["images_per_second"], peer))
                        print(f"{case}: {rate:.1f} against {rows[-1].peer:.2f} of {peer}", file=sys.stderr)
                if folder:
                    first = Ours(view, shots, worlds=1, threads=1)
                    first.frame()
                    shown = [first.cameras[0].data.rgb[0], np.load(images)["rgb"], np.load(picture)["image"]]
                    write_sheet(folder / f"{name}_{height}_pbr.png", *shown)
    report("Physically based images", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        print(f"cameras_pbr skipped: {error}", file=sys.stderr)
