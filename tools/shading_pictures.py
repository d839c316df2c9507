# SPDX-License-Identifier: Apache-2.0
"""Writes docs/pictures/shading.jpg, scenes with classic shading above the same with physically based shading:
python tools/shading_pictures.py. Needs ffmpeg.
"""

from __future__ import annotations

import mujoco
import numpy as np
from scene_pictures import HEIGHT, PICTURES, VIEWS, WIDTH, picture, write_jpeg

import mjsense as mjs

SCENES = ("task_open", "scene_varied_table")
MATERIALS = 5  # along each side of the grid of balls: roughness along the rows, metallic between them


def bumps() -> np.ndarray:
    """A normal map of round bumps, uint8 [64, 64, 3]."""
    x, y = (np.meshgrid(*2 * [np.arange(64)]) - np.full((2, 1, 1), 31.5)) / 24
    inside = x**2 + y**2 < 1
    normal = np.stack([np.where(inside, x, 0), np.where(inside, -y, 0)], -1) * 0.8
    z = np.sqrt(1 - (normal**2).sum(-1, keepdims=True))
    return np.round(255 * (0.5 + 0.5 * np.concatenate([normal, z], -1))).astype(np.uint8)


def balls() -> mujoco.MjModel:
    """Balls of several materials on a floor with bumps."""
    spec = mujoco.MjSpec()
    spec.add_texture(
        name="bumps",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        width=64,
        height=64,
        nchannel=3,
        data=bumps().ravel().tolist(),
    )
    floor = spec.add_material(name="floor", rgba=(0.5, 0.45, 0.4, 1), roughness=0.5, texrepeat=(4, 4), texuniform=True)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_NORMAL] = "bumps"
    world = spec.worldbody
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(4, 4, 0.1), material="floor")
    world.add_light(pos=(-2, -2, 4), dir=(0.5, 0.5, -1), castshadow=True)
    for row in range(MATERIALS):
        for column in range(MATERIALS):
            name, share = f"{row} {column}", 1 / (MATERIALS - 1)
            spec.add_material(name=name, rgba=(0.85, 0.55, 0.3, 1), metallic=row * share, roughness=column * share)
            world.add_geom(size=(0.18, 0, 0), pos=(0.45 * (column - 2), 0.45 * (row - 2), 0.18), material=name)
    world.add_camera(name="view", pos=(0, -2.2, 1.7), xyaxes=(1, 0, 0, 0, 0.63, 0.78), fovy=50)
    spec.visual.quality.offsamples = 16
    return spec.compile()


def picture_of_balls(shading: str) -> np.ndarray:
    model = balls()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mjs.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.shading = shading
        renderer.update_scene(data, "view")
        return renderer.render()


def main() -> None:
    rows = []
    for shading in ("classic", "pbr"):
        columns = [picture(VIEWS[name], 1, shadow_samples=8, shading=shading) for name in SCENES]
        rows.append(np.concatenate([*columns, picture_of_balls(shading)], axis=1))
    path = PICTURES / "shading.jpg"
    write_jpeg(path, np.concatenate(rows))
    print(f"{path}: {path.stat().st_size} B", flush=True)


if __name__ == "__main__":
    main()
