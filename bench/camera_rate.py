"""Our images a second in a scene of camera_scenes.py: what all camera benchmarks compare with their peer."""

from __future__ import annotations

import dataclasses
import os
import statistics
import time

import camera_scenes
import harness  # noqa: F401  finds mjsense
import numpy as np

import mjsense as mjs

CPUS = len(os.sched_getaffinity(0))
RUNS = 5


class Ours:
    """One camera in `worlds` worlds; every call of `frame` moves everything (camera_scenes.poses), then times the images alone."""

    def __init__(self, name: str, size: tuple[int, int], kinds: tuple[str, ...], worlds: int, threads: int = CPUS) -> None:
        width, height = size
        camera = mjs.CameraSensorCfg(
            name="cam", camera_name=f"w/{camera_scenes.CAMERAS[name]}", width=width, height=height, data_types=kinds, use_shadows=True
        )
        entity = mjs.EntityCfg(model=getattr(camera_scenes, name)())
        self.scene = mjs.Scene(mjs.SceneCfg(entities={"w": entity}, sensors=(camera,)))
        self.sim = mjs.Simulation(self.scene, num_worlds=worlds, threads=threads)
        self.qpos = self.sim.model.qpos0.copy()
        self.frames = 0

    def frame(self) -> tuple[float, float]:
        """CPU seconds of all threads, and wall seconds."""
        self.sim.qpos[:] = camera_scenes.poses(self.qpos, self.sim.num_worlds, self.frames)
        self.frames += 1
        self.sim.forward()
        cpu, wall = time.process_time(), time.perf_counter()
        self.sim.refresh([self.scene["cam"]])
        return time.process_time() - cpu, time.perf_counter() - wall


@dataclasses.dataclass
class Result:
    rate: float  # images a CPU second
    first: dict[str, np.ndarray]  # the images of world 0 in frame 0


def measure(name: str, size: tuple[int, int], kinds: tuple[str, ...], worlds: int) -> Result:
    ours = Ours(name, size, kinds, worlds)
    ours.frame()
    first = {kind: getattr(ours.scene["cam"].data, kind)[0].copy() for kind in kinds}
    return Result(worlds / statistics.median(ours.frame()[0] for _ in range(RUNS)), first)
