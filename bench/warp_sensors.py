# SPDX-License-Identifier: Apache-2.0
"""Times sensors on mujoco_warp's worlds, compared with those of mjlab in the same configuration if it is installed.

    python bench/warp_sensors.py [--device cuda:0] [--worlds 64]

Both programs have the same worlds in the same states, and take turns. A time is that of one update of the sensor for all worlds:
CPU time of the process, or, on a CUDA device, time until the device has finished, without a graph. mjlab 1.6 asks for mujoco_warp
3.11; it works with 4.0 (pip install --no-deps).
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import warp as wp

import mjsense as mjs
from mjsense.warp.arrays import on_host

ROUNDS = 7
SIZE = 32  # pixels of the camera's sides


def robot() -> mujoco.MjSpec:
    legs = "".join(
        f'<body pos="{x} {y} 0"><joint name="hip{i}" axis="0 1 0"/><geom type="capsule" size=".02" fromto="0 0 0 0 '
        '0 -.25" group="3"/>'
        f'<geom name="foot{i}" size=".03" pos="0 0 -.28" group="3"/></body>'
        for i, (x, y) in enumerate([(0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1)])
    )
    return mujoco.MjSpec.from_string(
        f'<mujoco><worldbody><body name="trunk" pos="0 0 .35"><freejoint/><geom type="box" size=".25 .1 .05" group="3"/>{legs}'
        '<site name="imu"/></body></worldbody></mujoco>'
    )


def add_boxes(body: mujoco.MjsBody, count: int) -> None:
    """Adds flat boxes at random places."""
    rng = np.random.default_rng(1)
    for _ in range(count):
        pos, size = (*rng.uniform(-5, 5, 2), 0.0), rng.uniform(0.05, 0.4, 3) * (1, 1, 0.2)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=pos, size=size, contype=0, conaffinity=0)


def ground(boxes: int) -> Callable[[mujoco.MjSpec], None]:
    """Adds a plane and flat boxes to the world."""

    def add(spec: mujoco.MjSpec) -> None:
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(0, 0, 1))
        add_boxes(spec.worldbody, boxes)

    return add


def furniture() -> mujoco.MjSpec:
    """An entity with a fixed base and 200 flat boxes."""
    spec = mujoco.MjSpec()
    add_boxes(spec.worldbody.add_body(name="boxes"), 200)
    return spec


def ours(
    specs: dict[str, Any], add_ground: Any, worlds: int, device: str
) -> tuple[dict[str, Callable[[], None]], Callable[[Any], None], Any]:
    trunk = mjs.ObjRef(type="body", name="trunk", entity="robot")
    sensors = (
        mjs.RayCastSensorCfg(
            "height scan",
            frame=trunk,
            pattern=mjs.GridPatternCfg(size=(1.6, 1.0), resolution=0.1),
            ray_alignment="yaw",
            include_geom_groups=(0,),
        ),
        mjs.CameraSensorCfg(
            "depth image",
            parent_body="robot/trunk",
            pos=(0.3, 0, 0),
            quat=(0.65, 0.27, -0.27, -0.65),
            fovy=60,
            width=SIZE,
            height=SIZE,
            data_types=("depth",),
        ),
    )
    entities = {name: mjs.EntityCfg(model=spec()) for name, spec in specs.items()}
    cfg = mjs.SceneCfg(entities=entities, sensors=sensors, spec_fn=add_ground)
    sim: Any = mjs.Simulation(mjs.Scene(cfg), worlds, backend="warp", device=device)
    calls = {cfg.name: sim._sensors.by_name[cfg.name].update for cfg in sensors}
    return calls, lambda qpos: sim.set_state(qpos=qpos), lambda name: sim.scene[name].fields


def mjlab(
    specs: dict[str, Any], add_ground: Any, worlds: int, device: str
) -> tuple[dict[str, Callable[[], None]], Callable[[Any], None], Any]:
    import torch
    from mjlab.entity import EntityCfg
    from mjlab.scene import Scene, SceneCfg
    from mjlab.sensor import CameraSensorCfg, GridPatternCfg, ObjRef, RayCastSensorCfg
    from mjlab.sim import Simulation, SimulationCfg

    torch.set_num_threads(1)  # threads that wait for each other take long with arrays of this size
    trunk = ObjRef(type="body", name="trunk", entity="robot")
    configs = {
        "height scan": RayCastSensorCfg(
            name="scan",
            frame=trunk,
            pattern=GridPatternCfg(size=(1.6, 1.0), resolution=0.1),
            ray_alignment="yaw",
            include_geom_groups=(0,),
        ),
        "depth image": CameraSensorCfg(
            name="image",
            parent_body="robot/trunk",
            pos=(0.3, 0, 0),
            quat=(0.65, 0.27, -0.27, -0.65),
            fovy=60,
            width=SIZE,
            height=SIZE,
            data_types=("depth",),
        ),
    }
    calls, writers, readers = {}, [], {}
    for name, cfg in configs.items():
        entities = {name: EntityCfg(spec_fn=spec) for name, spec in specs.items()}
        scene = Scene(SceneCfg(num_envs=worlds, entities=entities, sensors=(cfg,), spec_fn=add_ground), device=device)
        sim = Simulation(num_envs=worlds, cfg=SimulationCfg(), model=scene.compile(), device=device)
        scene.initialize(sim.mj_model, sim.model, sim.data)
        sim.set_sensor_context(scene.sensor_context)

        def write(qpos: Any, sim: Any = sim) -> None:
            sim.data.qpos[:] = torch.as_tensor(qpos, device=device)
            sim.forward()

        def call(sim: Any = sim, sensor: Any = scene[cfg.name]) -> None:
            sim.sense()
            sensor.data  # computes the row

        calls[name], readers[name] = call, scene[cfg.name]
        writers.append(write)

    def write_all(qpos: Any) -> None:
        for write in writers:
            write(qpos)

    return calls, write_all, lambda name: vars(readers[name].data)


def measure(call: Callable[[], None], device: str) -> float:
    wp.synchronize_device(device)
    clock = time.process_time if device == "cpu" else time.perf_counter
    begin = clock()
    for _ in range(5):
        call()
    wp.synchronize_device(device)
    return (clock() - begin) / 5 * 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--worlds", type=int, default=64)
    options = parser.parse_args()
    programs = {"mjsense": ours}
    try:
        import mjlab as _
    except ImportError as error:
        print(f"without mjlab: {error}", file=sys.stderr)
    else:
        programs["mjlab"] = mjlab
    rng = np.random.default_rng(0)
    fixed = {"robot": robot, "boxes": furniture}
    for title, specs, boxes in (
        ("plane", {"robot": robot}, 0),
        ("200 boxes of the world", {"robot": robot}, 200),
        ("200 boxes of an entity", fixed, 0),
    ):
        made = {name: make(specs, ground(boxes), options.worlds, options.device) for name, make in programs.items()}
        qpos = np.tile([0, 0, 0.35, 1, 0, 0, 0, 0, 0, 0, 0], (options.worlds, 1)).astype(np.float32)
        qpos[:, :2] += rng.uniform(-3, 3, (options.worlds, 2))
        for _, write, _ in made.values():
            write(qpos)
        for sensor in made["mjsense"][0]:
            times: dict[str, list[float]] = {name: [] for name in made}
            for _ in range(ROUNDS):
                for name, (calls, _, _) in made.items():
                    times[name].append(measure(calls[sensor], options.device))
            row = ", ".join(f"{name} {statistics.median(values):.2f} ms" for name, values in times.items())
            if "mjlab" in made:
                mine, other = (made[name][2](sensor) for name in ("mjsense", "mjlab"))
                field = "distances" if "distances" in mine else "depth"
                row += f", largest difference {np.abs(on_host(mine[field]) - on_host(other[field])).max():.1e} m"
            print(f"{title}, {sensor}, {options.worlds} worlds on {options.device}: {row}", flush=True)


if __name__ == "__main__":
    main()
