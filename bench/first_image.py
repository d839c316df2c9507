# SPDX-License-Identifier: Apache-2.0
"""CPU time until the first image of a model: `mujoco.Renderer` (software OpenGL) and `mjsense.Renderer`.

    python bench/first_image.py [--size 84x84] [--count 7] [ENVIRONMENT ...]

Needs robosuite or the packages of other environments of bench/drop_in.py, PyOpenGL and EGL. Each measurement has a process of its
own, which loads the model and imports both packages before the time begins; the two renderers take turns. "construct" is
`Renderer(model)`, "image" the first `update_scene` and `render`, "next" the same once more. CPU times of all threads in ms,
medians. The last column has a hash of the image, by which builds can be compared.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ.setdefault("MUJOCO_GL", "egl")
os.environ.setdefault("LP_NUM_THREADS", "1")

import mujoco
import numpy as np

ENVIRONMENTS = ("robosuite/Lift/agentview", "robosuite/Lift/frontview", "robosuite/PickPlace/agentview")


def save_model(name: str, folder: Path) -> tuple[Path, str | int]:
    """Writes the environment's model and state after a reset; returns the model's file and the camera."""
    import drop_in

    drop_in.prepare()
    env, _, _ = drop_in.make(name, (8, 8), False)
    if name.startswith("robosuite/"):
        model, data, camera = env.sim.model._model, env.sim.data._data, name.split("/")[2]
    else:
        model, data, camera = env.unwrapped.model, env.unwrapped.data, -1
    path = folder / "model.mjb"
    mujoco.mj_saveModel(model, str(path), None)
    state = np.empty(mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    np.save(path.with_suffix(".npy"), state)
    return path, camera


def measure(kind: str, path: Path, camera: str | int, size: tuple[int, int]) -> dict[str, Any]:
    """The CPU times of one renderer in this process, in ms."""
    import mjsense

    make = mjsense.Renderer if kind == "mjsense" else mujoco.Renderer
    model = mujoco.MjModel.from_binary_path(str(path))
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, np.load(path.with_suffix(".npy")), mujoco.mjtState.mjSTATE_INTEGRATION)
    mujoco.mj_forward(model, data)
    times = [time.process_time()]
    renderer = make(model, size[1], size[0])
    times.append(time.process_time())
    images = []
    for _ in range(2):
        renderer.update_scene(data, camera)
        images.append(renderer.render())
        times.append(time.process_time())
    assert np.array_equal(*images)
    construct, image, next_image = 1e3 * np.diff(times)
    return {
        "construct": construct,
        "image": image,
        "next": next_image,
        "hash": hashlib.sha256(images[0].tobytes()).hexdigest()[:12],
    }


def in_new_process(*arguments: object) -> dict[str, Any]:
    command = [sys.executable, __file__, "--measure", *map(str, arguments)]
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("environments", nargs="*", default=ENVIRONMENTS)
    parser.add_argument("--size", default="84x84")
    parser.add_argument("--count", type=int, default=7)
    parser.add_argument("--measure", nargs=3, metavar=("RENDERER", "MODEL", "CAMERA"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    width, height = map(int, arguments.size.split("x"))
    if arguments.measure:
        kind, path, camera = arguments.measure
        print(json.dumps(measure(kind, Path(path), int(camera) if camera == "-1" else camera, (width, height))))
        return
    print(f"MuJoCo {mujoco.__version__}, {arguments.size}")
    print(f"{'environment':32s} {'renderer':9s} {'construct':>9s} {'image':>8s} {'together':>8s} {'next':>8s}  image's hash")
    for name in arguments.environments:
        with tempfile.TemporaryDirectory() as folder:
            path, camera = save_model(name, Path(folder))
            rows: dict[str, list[dict[str, Any]]] = {"mujoco": [], "mjsense": []}
            for _ in range(arguments.count):
                for kind, found in rows.items():
                    found.append(in_new_process(kind, path, camera, "--size", arguments.size))
        for kind, found in rows.items():
            median = {key: statistics.median(row[key] for row in found) for key in ("construct", "image", "next")}
            together = statistics.median(row["construct"] + row["image"] for row in found)
            print(
                f"{name:32s} {kind:9s} {median['construct']:9.1f} {median['image']:8.1f} {together:8.1f} "
                f"{median['next']:8.2f}  {found[0]['hash']}",
                flush=True,
            )


if __name__ == "__main__":
    main()
