# SPDX-License-Identifier: Apache-2.0
"""Images of existing environments drawn by mjsense compared with those of their own renderers.

    python bench/drop_in_quality.py [--size 256] [--pictures FOLDER] [--json FILE] [ENVIRONMENT ...]

Needs what bench/drop_in.py needs; LIBERO needs an environment of its own, because it needs another robosuite. The colours are
those of the environment's own function after two steps; depth and segmentation are those of mujoco.Renderer and mjsense.Renderer
with the same model, data and camera. Each environment is drawn in a process of its own. The last line but one lists the medians,
the last one the environments below the bounds. --pictures writes both images and their difference.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import drop_in
import mujoco
import numpy as np
from images import ssim, write_sheet

# While numba compiles robosuite's functions, once after an installation, the images of software OpenGL (Mesa 22.3) are wrong.
os.environ.setdefault("NUMBA_DISABLE_JIT", "1")

GYMNASIUM = """Ant-v5 HalfCheetah-v5 Hopper-v5 Humanoid-v5 HumanoidStandup-v5 InvertedDoublePendulum-v5 InvertedPendulum-v5
    Pusher-v5
    Reacher-v5 Swimmer-v5 Walker2d-v5 AdroitHandDoor-v1 AdroitHandHammer-v1 AdroitHandPen-v1 AdroitHandRelocate-v1
    AntMaze_UMaze-v5
    FetchPickAndPlace-v4 FetchPush-v4 FetchReach-v4 FetchSlide-v4 FrankaKitchen-v1 HandManipulateBlock-v1 HandManipulateEgg-v1
    HandManipulatePen-v1 HandReach-v3 PointMaze_UMaze-v3"""
META_WORLD = "button-press-topdown-v3 door-open-v3 drawer-open-v3 hammer-v3 peg-insert-side-v3 push-v3 reach-v3 window-open-v3"
DM_CONTROL = """acrobot/swingup ball_in_cup/catch cartpole/swingup cheetah/run dog/stand finger/spin fish/swim hopper/hop
    humanoid/stand
    manipulator/bring_ball quadruped/walk reacher/easy swimmer/swimmer6 walker/walk"""
ROBOSUITE = """Door/agentview Lift/agentview Lift/robot0_eye_in_hand NutAssembly/agentview PickPlace/agentview
    PickPlace/robot0_eye_in_hand
    Stack/agentview ToolHang/agentview Wipe/agentview"""
LIBERO = "libero_spatial/0/agentview libero_object/0/agentview libero_goal/0/agentview libero_10/0/robot0_eye_in_hand"
ENVIRONMENTS = [
    *GYMNASIUM.split(),
    *(f"Meta-World/{name}" for name in META_WORLD.split()),
    *(f"dm_control/{name}" for name in DM_CONTROL.split()),
    "gym_aloha/AlohaTransferCube-v0",
    "gym_aloha/AlohaInsertion-v0",
    *(f"robosuite/{name}" for name in ROBOSUITE.split()),
    *(f"libero/{name}" for name in LIBERO.split()),
]

BOUNDS = {"psnr": 36.0, "ssim": 0.985, "depth_mm": 1.0, "segmentation": 99.5}


def parts(name: str, env: Any) -> tuple[Any, Any, Any]:
    """The environment's mujoco.MjModel and MjData, and the camera of its image."""
    kind = name.split("/")[0]
    if kind in ("robosuite", "libero"):
        return env.sim.model._model, env.sim.data._data, name.split("/")[-1]
    if kind == "dm_control":
        return env.physics.model.ptr, env.physics.data.ptr, 0
    if kind == "gym_aloha":
        physics = env.unwrapped._env.physics
        return physics.model.ptr, physics.data.ptr, "top"
    from mjsense.compat.gymnasium import renderer_of

    renderer = renderer_of(env)
    assert renderer.viewer is not None
    return renderer.model, renderer.data, renderer.viewer.cam


def measured(name: str, size: int, pictures: Path | None) -> dict[str, Any]:
    import mjsense

    drop_in.prepare()
    rgb, found = [], None
    for use in (False, True):
        env, step, render = drop_in.make(name, (size, size), use)
        for _ in range(2):
            step()
        render()  # the first image of some packages has infinite planes at another place
        rgb.append(render())
        found = parts(name, env)
    assert found is not None
    model, data, camera = found
    depth, segmentation = [], []
    model.vis.global_.offwidth, model.vis.global_.offheight = max(size, 640), max(size, 480)
    for make in (mujoco.Renderer, mjsense.Renderer):
        renderer = make(model, size, size)
        renderer.update_scene(data, camera)
        renderer.enable_depth_rendering()
        depth.append(renderer.render())
        renderer.disable_depth_rendering()
        renderer.enable_segmentation_rendering()
        segmentation.append(renderer.render())
    if pictures:
        difference = np.clip(8 * np.abs(rgb[0].astype(int) - rgb[1]), 0, 255).astype(np.uint8)
        write_sheet(pictures / f"{name.replace('/', '_')}.png", *rgb, difference)
    near = depth[0] < 0.5 * model.vis.map.zfar * model.stat.extent
    return {
        "environment": name,
        "psnr": drop_in.psnr(*rgb),
        "ssim": ssim(*rgb),
        "depth_mm": float(1e3 * np.median(np.abs(depth[0] - depth[1])[near])) if near.any() else 0.0,
        "segmentation": float(100 * (segmentation[0] == segmentation[1]).all(-1).mean()),
    }


def row_of(row: dict[str, Any]) -> str:
    name = row["environment"]
    return f"{name:38s} {row['psnr']:8.1f} dB {row['ssim']:8.4f} {row['depth_mm']:9.4f} mm {row['segmentation']:8.2f} %"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("environments", nargs="*", default=ENVIRONMENTS)
    parser.add_argument("--size", type=int, default=256)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--pictures", type=Path)
    parser.add_argument("--one", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        with contextlib.redirect_stdout(io.StringIO()):
            row = measured(arguments.environments[0], arguments.size, arguments.pictures)
        print(json.dumps(row), flush=True)
        os._exit(0)  # without the packages' own clean-up of EGL
    rows = []
    more = ["--pictures", str(arguments.pictures)] if arguments.pictures else []
    for name in arguments.environments:
        command = [sys.executable, "-W", "ignore", __file__, "--one", "--size", str(arguments.size), *more, name]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            print(f"{name:38s} {(done.stderr.strip().splitlines() or ['no message'])[-1][:90]}", flush=True)
            continue
        rows.append(json.loads(done.stdout.strip().splitlines()[-1]))
        print(row_of(rows[-1]), flush=True)
    if rows:
        median = {key: float(np.median([row[key] for row in rows])) for key in BOUNDS}
        print(row_of({"environment": f"median of {len(rows)}", **median}))
        low = [
            row["environment"]
            for row in rows
            if row["psnr"] < BOUNDS["psnr"]
            or row["ssim"] < BOUNDS["ssim"]
            or row["depth_mm"] > BOUNDS["depth_mm"]
            or row["segmentation"] < BOUNDS["segmentation"]
        ]
        print("outliers:", *low)
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
