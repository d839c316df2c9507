# SPDX-License-Identifier: Apache-2.0
"""Success of the planner with each object of the catalogue, and a picture of all objects.

    python bench/objects.py --attempts 4 --pattern "rgb_.*"
    python bench/objects.py --attempts 0 --sheet objects.png

Every object lies alone on the varied table with a bowl and a plate. Excluded objects and those whose package is not installed are
left out.
"""

from __future__ import annotations

import argparse
import json
import re
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

import mjsense as mjs
from mjsense import _core
from mjsense.core.png import png_of
from mjsense.tasks.assets import name_package_folders

SCENE = """
name = "one_object"
extends = "robosuite/objects"
catalogue = ["{name}", "blue_bowl", "white_plate"]
"""
SIZE, COLUMNS = 96, 16  # pixels and objects of a row of the picture


def objects(pattern: str) -> list[dict[str, Any]]:
    """Objects that tasks pick up and whose names match."""
    name_package_folders()
    listed = json.loads(_core.objects_json())
    used = [one for one in listed if one["installed"] and not one["receptacle"] and not one["excluded"]]
    return [one for one in used if re.fullmatch(pattern, one["name"])]


def attempts(scene: Path, out: Path, number: int, robot: str) -> tuple[int, Counter[str]]:
    """Number of successes, and the reasons of the failures."""
    summary = mjs.record(
        "pick",
        robot=robot,
        scene=str(scene),
        out=out,
        num_attempts=number,
        num_worlds=number,
        cameras=[],
        replay=False,
        progress=False,
    )
    return summary.succeeded, Counter(summary.failures)


def picture(scene: Path, name: str) -> np.ndarray:
    """The object from above at an angle, as it lies at the start of an episode: uint8 [SIZE, SIZE, 3]."""
    import mujoco

    env = mjs.make_vec("pick", scene=str(scene), cameras=[], policy=None, observations=["qpos"])
    env.reset(seed=1)
    model, data = env.sim.model_of(0), env.sim.env.mj_datas[0]
    mujoco.mj_forward(model, data)
    body = model.body(f"{name}/{name}").id
    geoms = np.flatnonzero(model.body_rootid[model.geom_bodyid] == body)
    camera = mujoco.MjvCamera()
    camera.lookat = data.xpos[body]
    camera.distance = 3.2 * max(np.linalg.norm(data.geom_xpos[g] - data.xpos[body]) + model.geom_rbound[g] for g in geoms)
    camera.azimuth, camera.elevation = 120, -35
    model.vis.headlight.ambient, model.vis.headlight.diffuse = 0.3, 0.6  # not only the lamps of the episode
    renderer = mjs.Renderer(model, SIZE, SIZE)
    renderer.update_scene(data, camera)
    image = renderer.render()
    renderer.close()
    env.close()
    return image


def sheet(images: list[np.ndarray]) -> np.ndarray:
    """The images in rows of COLUMNS."""
    empty = [np.full((SIZE, SIZE, 3), 255, np.uint8)] * (-len(images) % COLUMNS)
    rows = [np.concatenate((images + empty)[n : n + COLUMNS], 1) for n in range(0, len(images), COLUMNS)]
    return np.concatenate(rows)


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Success of the planner with each object of the catalogue, and a picture of them."
    )
    parser.add_argument("--pattern", default=".*", help="Regular expression of the objects' names.")
    parser.add_argument("--attempts", type=int, default=4, help="Attempts per object; 0: none.")
    parser.add_argument("--robot", default="franka")
    parser.add_argument("--sheet", type=Path, help="PNG file for a picture of all objects, in the order of mjsense objects.")
    options = parser.parse_args()
    images = []
    totals: dict[str, list[int]] = {}
    for one in objects(options.pattern):
        name = one["name"]
        with tempfile.TemporaryDirectory() as folder:
            scene = Path(folder, "scene.toml")
            scene.write_text(SCENE.format(name=name))
            if options.sheet:
                images.append(picture(scene, name))
            if options.attempts:
                good, failures = attempts(scene, Path(folder, "data"), options.attempts, options.robot)
                print(f"{name}: {good} of {options.attempts}", *(f"; {n} x {why}" for why, n in failures.items()), flush=True)
                total = totals.setdefault(one["source"], [0, 0, 0])
                for i, count in enumerate((1, good, options.attempts)):
                    total[i] += count
    for source, (number, good, tried) in totals.items():
        print(f"{number} objects of {source}: {good} of {tried}")
    if options.sheet:
        options.sheet.write_bytes(png_of(sheet(images)))


if __name__ == "__main__":
    main()
