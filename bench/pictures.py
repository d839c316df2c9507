# SPDX-License-Identifier: Apache-2.0
"""Writes images of mjsense, of MuJoCo's classic renderer, and their difference (times 3) side by side, and prints how much they
differ.

    .venv/bin/python bench/pictures.py FOLDER [scene ...]        scenes: gallery soft pick kitchen go1 panda

It needs the build of ./dev bench. Depth and ids are compared where both images have a surface; depth only on opaque surfaces,
because MuJoCo's depth ignores transparent ones.
"""

from __future__ import annotations

import pathlib
import sys

import opengl  # noqa: F401  before mujoco

# isort: split
import camera_scenes
import harness  # noqa: F401  adds the measured build to sys.path
import mujoco
import numpy as np
from fetch import Unavailable
from images import ssim, write_png

import mjsense as mjs

SCENES = {
    "gallery": ("front", "top", "low"),
    "soft": ("view",),
    "pick": ("view",),
    "kitchen": ("view",),
    "go1": ("view", "head"),
    "panda": ("view",),
}
STEPS = {"soft": 200}  # lets the scene settle first
WIDTH, HEIGHT = 300, 225


def classic(model: mujoco.MjModel, data: mujoco.MjData, camera: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
    model.vis.quality.offsamples = 0
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    option.flags[mujoco.mjtVisFlag.mjVIS_TENDON] = 0
    images = []
    for kind in ("rgb", "depth", "segmentation"):
        renderer = mujoco.Renderer(model, HEIGHT, WIDTH)
        if kind == "depth":
            renderer.enable_depth_rendering()
        if kind == "segmentation":
            renderer.enable_segmentation_rendering()
        renderer.update_scene(data, camera, scene_option=option)
        images.append(renderer.render().copy())
        renderer.close()
    return images[0], images[1], images[2]


def compare(name: str, camera: str, folder: pathlib.Path) -> None:
    cfg = mjs.CameraSensorCfg(
        name="cam",
        camera_name=f"w/{camera}",
        width=WIDTH,
        height=HEIGHT,
        use_shadows=True,
        data_types=("rgb", "depth", "segmentation"),
        enabled_geom_groups=camera_scenes.SHOWN_GROUPS,
    )
    scene = mjs.Scene(mjs.SceneCfg(entities={"w": mjs.EntityCfg(model=getattr(camera_scenes, name)())}, sensors=(cfg,)))
    sim = mjs.Simulation(scene, num_worlds=1)
    if name in STEPS:
        sim.step(STEPS[name])
    image = scene["cam"].data
    rgb, depth, ids = image.rgb[0], image.depth[0, ..., 0], image.segmentation[0]
    data = mujoco.MjData(sim.model)
    data.qpos[:] = sim.qpos[0]
    data.mocap_pos[:], data.mocap_quat[:] = sim.mocap_pos[0], sim.mocap_quat[0]
    mujoco.mj_forward(sim.model, data)
    peer_rgb, peer_depth, peer_ids = classic(sim.model, data, f"w/{camera}")

    material = sim.model.geom_matid
    alpha = np.where(material >= 0, sim.model.mat_rgba[material, 3], sim.model.geom_rgba[:, 3])
    is_geom = ids[..., 1] == mujoco.mjtObj.mjOBJ_GEOM
    opaque = np.where(is_geom, alpha[np.where(is_geom, ids[..., 0], 0)] > 0.99, ids[..., 1] >= 0)
    far = sim.model.vis.map.zfar * sim.model.stat.extent
    both = opaque & (peer_depth < 0.65 * far)
    error = np.abs(depth - peer_depth)[both]
    mse = ((rgb.astype(float) - peer_rgb) ** 2).mean()
    print(
        f"| {name} {camera} | {np.median(error) * 1e3:.1e} mm | {100 * (error > 0.01).mean():.3f} % "
        f"| {100 * (ids == peer_ids).all(axis=-1).mean():.2f} % | {ssim(rgb, peer_rgb):.3f} | "
        f"{10 * np.log10(255**2 / mse):.1f} dB |"
    )
    difference = np.clip(3 * np.abs(rgb.astype(int) - peer_rgb), 0, 255).astype(np.uint8)
    write_png(folder / f"{name}_{camera}.png", np.concatenate([rgb, peer_rgb, difference], axis=1))


def main() -> int:
    if len(sys.argv) < 2:
        print(__doc__, file=sys.stderr)
        return 2
    folder = pathlib.Path(sys.argv[1])
    print("| scene | depth, median | off by > 1 cm | same object | SSIM | PSNR |\n| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, cameras in SCENES.items():
        if len(sys.argv) == 2 or name in sys.argv[2:]:
            for camera in cameras:
                compare(name, camera, folder)
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Unavailable as error:
        sys.exit(f"pictures: {error}")
