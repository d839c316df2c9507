# SPDX-License-Identifier: Apache-2.0
"""Writes docs/pictures/path.jpg: a state of a recording with classic, pbr and path shading. python tools/path_pictures.py
[SAMPLES]

SAMPLES: paths per pixel, 256 by default. Needs ffmpeg.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import mujoco
import numpy as np
from scene_pictures import PICTURES, VIEWS, write_jpeg

import mjsense as mjs

WIDTH, HEIGHT = 320, 240
VIEW = VIEWS["scene_kitchen"]


def camera() -> mujoco.MjvCamera:
    out = mujoco.MjvCamera()
    assert VIEW.pos is not None
    offset = np.subtract(VIEW.target, VIEW.pos)
    out.lookat[:] = VIEW.target
    out.distance = np.linalg.norm(offset)
    out.azimuth = np.degrees(np.arctan2(offset[1], offset[0]))
    out.elevation = np.degrees(np.arcsin(offset[2] / out.distance))
    return out


def images(model: mujoco.MjModel, data: mujoco.MjData, samples: int) -> np.ndarray:
    """The three kinds side by side, [H, 3 W, 3]."""
    found = []
    model.vis.global_.fovy = 55
    model.vis.quality.offsamples = 8
    with mjs.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.point_lights = True
        renderer.samples_per_pixel = samples
        renderer.update_scene(data, camera())
        for shading in ("classic", "pbr", "path"):
            renderer.shading = shading
            found.append(renderer.render().copy())
    return np.concatenate(found, axis=1)


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder, "data")
        mjs.record(
            VIEW.task,
            VIEW.robot,
            scene=VIEW.scene,
            out=out,
            episodes=1,
            num_worlds=1,
            horizon=VIEW.steps,
            keep_failures=True,
            seed=VIEW.seed,
        )
        episode = mjs.Dataset(out).episodes[0]
        model = episode.model()
        data = mujoco.MjData(model)
        episode.set_state(model, data, -1)
        pixels = images(model, data, int(sys.argv[1]) if len(sys.argv) > 1 else 256)
    path = PICTURES / "path.jpg"
    write_jpeg(path, pixels)
    print(f"{path}: {path.stat().st_size} B")


if __name__ == "__main__":
    main()
