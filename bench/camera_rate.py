# SPDX-License-Identifier: Apache-2.0
"""Measures the images per second of mjsense in a view of camera_scenes.py. All camera benchmarks compare this rate with their
peer."""

from __future__ import annotations

import dataclasses
import os
import statistics
import time
from collections.abc import Sequence
from typing import Any, Literal

import camera_scenes
import harness  # noqa: F401  adds the measured build to sys.path
import numpy as np
from camera_scenes import View

import mjsense as mjs

CPUS = len(os.sched_getaffinity(0))
RUNS = 5


@dataclasses.dataclass(frozen=True)
class Shot:
    size: tuple[int, int]
    kinds: tuple[Any, ...] = ("rgb",)
    shadows: bool = True
    shading: Literal["classic", "pbr"] = "classic"
    ambient_occlusion: bool = True
    environment: str = "model"


class Ours:
    """Cameras of one view in `worlds` worlds. `frame` changes everything that the view varies, then measures only the rendering
    of one shot."""

    def __init__(self, view: View, shots: Sequence[Shot], worlds: int, threads: int = CPUS) -> None:
        cameras = [
            mjs.CameraSensorCfg(
                name=f"cam{i}",
                camera_name=f"w/{view.camera}",
                width=shot.size[0],
                height=shot.size[1],
                data_types=shot.kinds,
                use_shadows=shot.shadows,
                shading=shot.shading,
                ambient_occlusion=shot.ambient_occlusion,
                environment=shot.environment,
            )
            for i, shot in enumerate(shots)
        ]
        entity = mjs.EntityCfg(model=camera_scenes.spec_of(view.scene))
        self.view = view
        self.scene = mjs.Scene(mjs.SceneCfg(entities={"w": entity}, sensors=cameras))
        self.sim = mjs.Simulation(self.scene, num_worlds=worlds, threads=threads)
        self.cameras = [self.scene[camera.name] for camera in cameras]
        self.qpos = self.sim.model.qpos0.copy()
        self.frames = 0

    def frame(self, shot: int = 0) -> tuple[float, float]:
        """CPU seconds of all threads and wall seconds for one image of each world."""
        self.sim.qpos[:] = camera_scenes.poses(self.qpos, self.sim.num_worlds, self.frames)
        for name, values in camera_scenes.model_fields(self.sim.model, self.view, self.sim.num_worlds, self.frames, "w/").items():
            self.sim.randomize(name, values)
        self.frames += 1
        self.sim.forward()
        cpu, wall = time.process_time(), time.perf_counter()
        self.sim.refresh([self.cameras[shot]])
        return time.process_time() - cpu, time.perf_counter() - wall

    def rate(self, shot: int = 0) -> float:
        """Images per CPU second."""
        self.frame(shot)
        return self.sim.num_worlds / statistics.median(self.frame(shot)[0] for _ in range(RUNS))


def of_scene(name: str) -> View:
    """The view of the main camera of a scene (CAMERAS); only the state changes."""
    return View(name, name, camera_scenes.CAMERAS[name])


@dataclasses.dataclass
class Result:
    rate: float  # images per CPU second
    first: dict[str, np.ndarray]  # the images of world 0 in frame 0


def measure(view: View, size: tuple[int, int], kinds: tuple[str, ...], worlds: int, shadows: bool = True) -> Result:
    ours = Ours(view, [Shot(size, kinds, shadows)], worlds)
    ours.frame()
    first = {kind: getattr(ours.cameras[0].data, kind)[0].copy() for kind in kinds}
    return Result(ours.rate(), first)
