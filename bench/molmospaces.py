# SPDX-License-Identifier: Apache-2.0
"""Images of molmo-spaces' own renderer (software OpenGL) and of the same class with mjsense: likeness and CPU time.

    python bench/molmospaces.py [--size 640x480] [--count 20] [MODEL.xml ...]

Needs the environment build/molmospaces of tests/python/test_adapters.py, and EGL. By default 20 models of gymnasium,
gymnasium-robotics and dm_control. Both renderers draw the same states with the same camera, in turns; each time is the CPU time
of ``update`` and ``render``, the median of all states. Columns: PSNR of rgb in dB, median error of depth in mm where it is below
half the far plane, share of pixels that show the same object, and milliseconds of molmo-spaces and mjsense with their ratio for
each kind of image. nan: molmo-spaces cannot draw the segmentation of the model.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from importlib.util import find_spec
from pathlib import Path
from typing import Any

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")  # llvmpipe's; CPU time counts all threads in any case

import mujoco
import numpy as np
from molmo_spaces.renderer.opengl_rendering import MjOpenGLRenderer  # pyright: ignore[reportMissingImports]

import mjsense.compat.molmospaces

MODELS = {
    "gymnasium": [
        f"envs/mujoco/assets/{name}.xml" for name in ("ant", "half_cheetah", "hopper", "humanoid", "pusher", "walker2d")
    ],
    "gymnasium_robotics": [
        f"envs/assets/{name}.xml"
        for name in (
            *("adroit_hand/adroit_door", "adroit_hand/adroit_hammer", "adroit_hand/adroit_relocate"),
            *(
                "fetch/pick_and_place",
                "fetch/slide",
                "hand/manipulate_block",
                "hand/reach",
                "kitchen_franka/kitchen_assets/kitchen_env_model",
            ),
        )
    ],
    "dm_control": [f"suite/{name}.xml" for name in ("ball_in_cup", "cheetah", "dog", "humanoid_CMU", "manipulator", "quadruped")],
}
"""By package: files of models."""
KINDS = ("rgb", "depth", "segmentation")


def model_files() -> list[Path]:
    found = []
    for package, files in MODELS.items():
        spec = find_spec(package)
        if spec is None or spec.origin is None:
            print(f"{package} is not installed")
            continue
        found += [Path(spec.origin).parent / file for file in files]
    return found


def camera_of(model: mujoco.MjModel) -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    mujoco.mjv_defaultFreeCamera(model, camera)
    return camera


def image_of(renderer: Any, kind: str, data: mujoco.MjData, camera: mujoco.MjvCamera) -> tuple[np.ndarray, float]:
    """The image, and the CPU time of it in ms."""
    for each in KINDS[1:]:
        getattr(renderer, f"{'enable' if each == kind else 'disable'}_{each}_rendering")()
    start = time.process_time()
    renderer.update(data, camera)
    image = renderer.render()
    return image, 1e3 * (time.process_time() - start)


def likeness(kind: str, model: mujoco.MjModel, theirs: np.ndarray, ours: np.ndarray) -> float:
    if kind == "rgb":
        return float(10 * np.log10(255**2 / max(1e-3, np.mean((theirs.astype(float) - ours) ** 2))))
    if kind == "depth":
        near = theirs < 0.5 * model.vis.map.zfar * model.stat.extent
        return 1e3 * float(np.median(np.abs(theirs - ours)[near])) if near.any() else 0.0
    return 100 * float((theirs[..., :2] == ours[..., :2]).all(-1).mean())


def measure(path: Path, width: int, height: int, count: int) -> tuple[list[float], list[tuple[float, float]]]:
    """Likeness and times of each kind."""
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    camera = camera_of(model)
    theirs = MjOpenGLRenderer(model=model, width=width, height=height)
    with mjsense.compat.molmospaces.used():
        ours = MjOpenGLRenderer(model=model, width=width, height=height)
    quality: dict[str, list[float]] = {kind: [] for kind in KINDS}
    times: dict[str, list[tuple[float, float]]] = {kind: [] for kind in KINDS}
    for step in range(count + 1):
        mujoco.mj_step(model, data, 5)
        mujoco.mj_forward(model, data)
        for kind in KINDS:
            try:
                a, theirs_ms = image_of(theirs, kind, data, camera)
            except IndexError:  # molmo-spaces looks up the bodies of all objects, such as tendons, by their ids among the geoms
                theirs.scene.flags[:] = ours.scene.flags
                a = theirs_ms = None
            b, ours_ms = image_of(ours, kind, data, camera)
            if step and a is not None and theirs_ms is not None:  # the first scene has no camera before it, and prepares meshes
                quality[kind].append(likeness(kind, model, a, b))
                times[kind].append((theirs_ms, ours_ms))
    theirs.close()
    ours.close()

    def median(values: list[float]) -> float:
        return statistics.median(values) if values else float("nan")

    pairs = [(median([a for a, _ in times[kind]]), median([b for _, b in times[kind]])) for kind in KINDS]
    return [median(quality[kind]) for kind in KINDS], pairs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("models", nargs="*", type=Path)
    parser.add_argument("--size", default="640x480")
    parser.add_argument("--count", type=int, default=20)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    print(f"MuJoCo {mujoco.__version__}, {width} x {height}, {arguments.count} states")
    print(
        f"{'model':24s} {'PSNR':>6s} {'depth':>7s} {'segm.':>6s} "
        + " ".join(f"{kind:>12s} {'ours':>6s} {'ratio':>6s}" for kind in KINDS)
    )
    ratios: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for path in arguments.models or model_files():
        (psnr, depth, same), times = measure(path, width, height, arguments.count)
        columns = " ".join(f"{theirs:12.2f} {ours:6.2f} {theirs / ours:6.1f}" for theirs, ours in times)
        print(f"{path.stem[:24]:24s} {psnr:6.1f} {depth:7.3f} {same:6.2f} {columns}", flush=True)
        for kind, (theirs, ours) in zip(KINDS, times, strict=True):
            if theirs == theirs:
                ratios[kind].append(theirs / ours)
    for kind, each in ratios.items():
        print(f"{kind}: median ratio {statistics.median(each):.1f}, lowest {min(each):.1f}", flush=True)
    os._exit(0)  # without PyOpenGL's clean-up, which fails after that of EGL


if __name__ == "__main__":
    main()
