# SPDX-License-Identifier: Apache-2.0
"""Memory of a simulation: of a mesh of a million triangles in a first and in a second simulation, and of each additional world.

Each figure is the resident memory of a separate process after one step and one frame of every sensor. Figures of geometry exclude
MuJoCo's mjModel, of which every simulation has a copy. The memory of a world is that of 128 additional worlds divided by 128; it
is compared with the memory of the same number of mjData.
"""

from __future__ import annotations

import gc
import os
import subprocess
import sys

import camera_scenes
import mujoco
import numpy as np
from harness import Row, report

import mjsense as mjs

SIZE = 84
WORLDS = (16, 144)
SCENES = {"go1": "Go1 on a height field, head camera, height scan, feet", "panda": "Panda at its table, wrist camera"}


def resident() -> float:
    """Resident memory of this process in MB."""
    gc.collect()
    with open("/proc/self/statm") as f:
        return int(f.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def scene_of(name: str, camera: str, *more: object) -> mjs.Scene:
    shot = mjs.CameraSensorCfg(name="camera", camera_name=f"w/{camera}", width=SIZE, height=SIZE, data_types=("rgb", "depth"))
    return mjs.Scene(mjs.SceneCfg(entities={"w": mjs.EntityCfg(model=camera_scenes.spec_of(name))}, sensors=(shot, *more)))


def run(sim: mjs.Simulation) -> mjs.Simulation:
    sim.step()
    sim.refresh(list(sim.scene.sensors.values()))
    return sim


def of_geometry(triangles: str) -> list[float]:
    """[MB that the first simulation adds, MB that the second adds, MB of mjModel]. Each simulation has a separate scene; the
    first two figures exclude mjModel."""
    held, added = [], []
    for _ in range(2):
        scene = scene_of(f"boulder:{triangles}", "view")
        before = resident()
        sim = run(mjs.Simulation(scene, num_worlds=1))
        added.append(resident() - before - sim.model.nbuffer / 1e6)
        held.append((scene, sim))
    return [*added, sim.model.nbuffer / 1e6]


def of_worlds(name: str, worlds: str) -> list[float]:
    """MB of a simulation with this number of worlds."""
    if name == "go1":
        scan = mjs.RayCastSensorCfg(
            name="scan", frame=mjs.ObjRef("body", "w/trunk"), pattern=mjs.GridPatternCfg(size=(1.6, 1.0), resolution=0.1)
        )
        feet = mjs.ContactMatch(mode="geom", pattern=r".*_foot_collision", entity="w")
        contact = mjs.ContactSensorCfg(name="feet", primary=feet, fields=("found", "force"), track_air_time=True)
        scene = scene_of("go1", "head", scan, contact)
    else:
        scene = scene_of("panda", "robot0_eye_in_hand")
    before = resident()
    sim = run(mjs.Simulation(scene, num_worlds=int(worlds)))
    return [resident() - before, sim.num_worlds]


def of_mujoco(name: str, worlds: str) -> list[float]:
    """MB of this number of mjData."""
    model = camera_scenes.compiled(name)
    before = resident()
    data = [mujoco.MjData(model) for _ in range(int(worlds))]
    for d in data:
        mujoco.mj_step(model, d)
    return [resident() - before, len(data)]


def measured(what: str, *arguments: str) -> list[float]:
    """The result of `of_<what>` in a new process."""
    done = subprocess.run([sys.executable, __file__, "--child", what, *arguments], check=True, stdout=subprocess.PIPE, text=True)
    return [float(x) for x in done.stdout.split()]


def a_world(what: str, name: str) -> float:
    few, many = (measured(what, name, str(n)) for n in WORLDS)
    return (many[0] - few[0]) / (many[1] - few[1])


def main() -> None:
    rows = []
    first, second, model = np.median([measured("geometry", "1000000") for _ in range(3)], axis=0)
    rows.append(Row("1,000,000 triangles, seen and met by rays", first, "MB"))
    rows.append(Row("- added by a second simulation of an equal model", second, "MB"))
    rows.append(Row("- MuJoCo's model of either", model, "MB"))
    for name, label in SCENES.items():
        rows.append(
            Row(
                f"one more world: {label}",
                a_world("worlds", name),
                "MB",
                a_world("mujoco", name),
                "mjData alone",
                higher_is_better=False,
            )
        )
    report("Memory", rows)


if __name__ == "__main__":
    if "--child" in sys.argv:
        kind, *values = sys.argv[sys.argv.index("--child") + 1 :]
        print(*globals()[f"of_{kind}"](*values))
    else:
        main()
