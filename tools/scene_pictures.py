# SPDX-License-Identifier: Apache-2.0
"""Pictures of the scenes for the documentation: python tools/scene_pictures.py [SCENE ...], into docs/pictures.

Views of scenes of installed packages may be added; where a package is missing its scene is left out.
"""

from __future__ import annotations

import struct
import sys
import tempfile
import zlib
from pathlib import Path

import numpy as np

import mjsense as mjs

PICTURES = Path(__file__).parents[1] / "docs/pictures"
WIDTH, HEIGHT = 480, 320
# Scene: task, where the camera stands, what it looks at.
VIEWS = {
    "kitchen": ("open", (-2.0, -1.2, 1.7), (0.3, 0.0, 0.95)),
    "kitchen:1": ("close", (-1.9, 0.9, 1.6), (0.3, 0.0, 0.95)),
    "shelf": ("pick", (-1.1, -1.1, 1.6), (0.6, 0.0, 0.85)),
    "clutter": ("pick", (-0.5, -1.1, 1.4), (0.7, 0.0, 0.6)),
}


def png(pixels: np.ndarray) -> bytes:
    height, width, _ = pixels.shape
    rows = b"".join(b"\0" + row.tobytes() for row in pixels)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")


def picture(scene: str) -> np.ndarray:
    """Two episodes beside each other, [H, 2 W, 3]."""
    task, pos, target = VIEWS[scene]
    with tempfile.TemporaryDirectory() as folder:
        cameras = Path(folder, "cameras.toml")
        cameras.write_text(
            f'width = {WIDTH}\nheight = {HEIGHT}\n[[cameras]]\nname = "view_camera"\nmount = "fixed"\n'
            f"pos = {list(pos)}\ntarget = {list(target)}\nfovy = 62\n"
        )
        env = mjs.make_vec(task, "franka", scene=scene, num_envs=2, camera_system=str(cameras), observations=["view_camera"],
                           samples=4, seed=3, policy="planner")  # fmt: skip
        env.reset()
        for _ in range(45):
            observation = env.step(env.expert_action())[0]
        env.close()
    return np.concatenate(list(observation["view_camera"]), axis=1)


def main() -> None:
    for scene in sys.argv[1:] or VIEWS:
        try:
            pixels = picture(scene)
        except ValueError as error:
            print(f"{scene}: left out: {error}")
            continue
        path = PICTURES / f"scene_{scene.replace('/', '_').replace(':', '_')}.png"
        path.write_bytes(png(np.ascontiguousarray(pixels)))
        print(f"{path}: {path.stat().st_size} B")


if __name__ == "__main__":
    main()
