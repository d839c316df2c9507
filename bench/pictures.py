"""Side-by-side sheets: ours, MuJoCo's classic renderer, and their difference (times 3); and how far apart they are.

    python bench/pictures.py FOLDER [scene ...]        scenes: gallery pick kitchen go1 panda

Depth and ids are compared where both see something; depth only where it is opaque, for MuJoCo's depth looks through glass.
"""

from __future__ import annotations

import os

os.environ.setdefault("MUJOCO_GL", "egl")

import pathlib
import struct
import sys
import zlib

import camera_scenes
import mujoco
import numpy as np

SCENES = {
    "gallery": ("front", "top", "low"),
    "pick": ("view",),
    "kitchen": ("view",),
    "go1": ("view", "head"),
    "panda": ("view",),
}
WIDTH, HEIGHT = 300, 225
SHOWN_GROUPS = (0, 1, 2)


def write_png(path: pathlib.Path, image: np.ndarray) -> None:
    height, width, _ = image.shape
    raw = b"".join(b"\0" + row.tobytes() for row in image)

    def chunk(kind: bytes, body: bytes) -> bytes:
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")
    )


def ssim(a: np.ndarray, b: np.ndarray) -> float:
    """Structural similarity of luminance: Wang et al. 2004, Gaussian window of 11 pixels, sigma 1.5."""
    kernel = np.exp(-0.5 * ((np.arange(11) - 5) / 1.5) ** 2)
    kernel /= kernel.sum()

    def blur(x: np.ndarray) -> np.ndarray:
        for axis in (0, 1):
            x = np.apply_along_axis(lambda row: np.convolve(row, kernel, "valid"), axis, x)
        return x

    a, b = (x.astype(float) @ (0.299, 0.587, 0.114) for x in (a, b))
    mean_a, mean_b = blur(a), blur(b)
    var_a, var_b = blur(a * a) - mean_a**2, blur(b * b) - mean_b**2
    cov = blur(a * b) - mean_a * mean_b
    c1, c2 = (0.01 * 255) ** 2, (0.03 * 255) ** 2
    return float(
        (((2 * mean_a * mean_b + c1) * (2 * cov + c2)) / ((mean_a**2 + mean_b**2 + c1) * (var_a + var_b + c2))).mean()
    )


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
    return images[0], images[1], images[2][..., 0]


def compare(name: str, camera: str, folder: pathlib.Path) -> None:
    import mjsense as mjs

    cfg = mjs.CameraSensorCfg(
        name="cam", camera_name=f"w/{camera}", width=WIDTH, height=HEIGHT, use_shadows=True,
        data_types=("rgb", "depth", "segmentation"), enabled_geom_groups=SHOWN_GROUPS,
    )
    scene = mjs.Scene(
        mjs.SceneCfg(entities={"w": mjs.EntityCfg(model=getattr(camera_scenes, name)())}, sensors=(cfg,))
    )
    sim = mjs.Simulation(scene, num_worlds=1)
    image = scene["cam"].data
    rgb, depth, ids = image.rgb[0], image.depth[0, ..., 0], image.segmentation[0, ..., 0]
    data = mujoco.MjData(sim.model)
    data.qpos[:] = sim.qpos[0]
    data.mocap_pos[:], data.mocap_quat[:] = sim.mocap_pos[0], sim.mocap_quat[0]
    mujoco.mj_forward(sim.model, data)
    peer_rgb, peer_depth, peer_ids = classic(sim.model, data, f"w/{camera}")

    material = sim.model.geom_matid
    alpha = np.where(material >= 0, sim.model.mat_rgba[material, 3], sim.model.geom_rgba[:, 3])
    far = sim.model.vis.map.zfar * sim.model.stat.extent
    both = (ids >= 0) & (peer_depth < 0.65 * far) & (alpha[ids] > 0.99)
    error = np.abs(depth - peer_depth)[both]
    mse = ((rgb.astype(float) - peer_rgb) ** 2).mean()
    print(
        f"| {name} {camera} | {np.median(error) * 1e3:.1e} mm | {100 * (error > 0.01).mean():.3f} % "
        f"| {100 * (ids == peer_ids).mean():.2f} % | {ssim(rgb, peer_rgb):.3f} | {10 * np.log10(255**2 / mse):.1f} dB |"
    )
    difference = np.clip(3 * np.abs(rgb.astype(int) - peer_rgb), 0, 255).astype(np.uint8)
    write_png(folder / f"{name}_{camera}.png", np.concatenate([rgb, peer_rgb, difference], axis=1))


def main() -> int:
    if len(sys.argv) < 2:
        print(__doc__, file=sys.stderr)
        return 2
    camera_scenes.need_opengl()
    folder = pathlib.Path(sys.argv[1])
    folder.mkdir(parents=True, exist_ok=True)
    print("| scene | depth, median | off by > 1 cm | same geom | SSIM | PSNR |\n| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, cameras in SCENES.items():
        if len(sys.argv) == 2 or name in sys.argv[2:]:
            for camera in cameras:
                compare(name, camera, folder)
    return 0


if __name__ == "__main__":
    sys.exit(main())
