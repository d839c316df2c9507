# SPDX-License-Identifier: Apache-2.0
"""Time of current sensor values: a control step of a Simulation compared with mj_step of MuJoCo's own batch, whose derived values
are one substep old.

Both start from the same states, get the same controls, new ones at every step, and go through bitwise equal states. CPU time of
one thread is measured in turns, so that other programs have little influence. A separate row gives the time of the sensors alone:
the same sensors, evaluated again at an unchanged state.
"""

import copy
import dataclasses
import statistics
import sys
import time
from collections.abc import Callable, Sequence

import camera_scenes
import mujoco
import mujoco.batch
import numpy as np
from contact import FEET, robot
from fetch import Unavailable, wheel
from harness import Row, report

import mjsense as mjs

WORLDS = 64
ZOO = "mjlab/asset_zoo/robots"


def with_motors(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Adds motors to the model: mjlab adds its actuators only when it creates a task."""
    for joint in spec.joints:
        if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
            spec.add_actuator(name=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT, target=joint.name)
    return spec


def go1() -> mjs.SceneCfg:
    """mjlab's Go1, which stands on joint springs."""
    spec = with_motors(robot(wheel("mjlab") / ZOO / "unitree_go1/xmls/go1.xml", native=False))
    return mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model=spec, pos=(0.0, 0.0, 0.3))}, terrain=mjs.TerrainCfg())


def g1() -> mjs.SceneCfg:
    """mjlab's G1, a humanoid that has fallen and lies on the floor."""
    spec = with_motors(mujoco.MjSpec.from_file(str(wheel("mjlab") / ZOO / "unitree_g1/xmls/g1.xml")))
    return mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model=spec, pos=(0.0, 0.0, 0.8))}, terrain=mjs.TerrainCfg())


def panda() -> mjs.SceneCfg:
    """robosuite's Panda at a table."""
    return mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model=camera_scenes.panda())})


def poses_and_velocities(body: str) -> list:
    obj = mjs.ObjRef(type="body", name=body, entity="robot")
    kinds = ("framepos", "framequat", "framelinvel", "frameangvel")
    return [mjs.BuiltinSensorCfg(name=kind, sensor_type=kind, obj=obj) for kind in kinds]


def rays(body: str) -> list:
    """A sensor with two rays: measures the physics that ray sensors require, not the rays themselves."""
    frame = mjs.ObjRef(type="body", name=body, entity="robot")
    return [mjs.RayCastSensorCfg(name="scan", frame=frame, pattern=mjs.GridPatternCfg(size=(0.1, 0.0), resolution=0.1))]


def camera(body: str) -> list:
    """A camera of 4 x 4 pixels: measures the physics that cameras require, not the images themselves."""
    return [
        mjs.CameraSensorCfg(
            name="eye", parent_body=f"robot/{body}", pos=(0.0, 0.0, 0.0), width=4, height=4, data_types=("depth",)
        )
    ]


def forces(pattern: str) -> list:
    primary = mjs.ContactMatch(mode="geom", pattern=pattern, entity="robot")
    return [mjs.ContactSensorCfg(name="touch", primary=primary, fields=("found", "force"))]


class Ours:
    def __init__(self, scene: mjs.SceneCfg, sensors: Sequence, decimation: int) -> None:
        self.scene = mjs.Scene(dataclasses.replace(scene, sensors=tuple(sensors)))
        self.sim = mjs.Simulation(self.scene, num_worlds=WORLDS, decimation=decimation, threads=1)
        self.read = [self.scene[s.name if s.name in self.scene.sensors else f"robot/{s.name}"] for s in sensors]
        self.state, self.ctrl = self.sim.state, self.sim.ctrl

    def step(self) -> None:
        self.sim.step()
        for sensor in self.read:
            sensor.data

    def again(self) -> None:
        self.sim.invalidate()
        self.sim.refresh(self.read)


class Plain:
    """MuJoCo's batch with bvactive 0, as in mjsense: visited bounding volumes are not marked. It has one mjData per thread (its
    default) or one per world (`persistent`)."""

    def __init__(self, ours: Ours, persistent: bool) -> None:
        model = copy.copy(ours.sim.model)
        model.vis.global_.bvactive = 0
        self.batch = mujoco.batch.Batch(model, WORLDS, nthread=1, persistent=persistent)
        self.state, self.ctrl = self.batch.state, self.batch.bind("ctrl")
        self.decimation = ours.sim.decimation

    def step(self) -> None:
        self.batch.step(nstep=self.decimation)


def us(body: Callable[[], None], controls: np.ndarray, ctrl: np.ndarray, per: int) -> float:
    """CPU microseconds per world and substep."""
    spent = 0.0
    for row in controls:
        ctrl[:] = row
        start = time.process_time_ns()
        body()
        spent += time.process_time_ns() - start
    return spent / 1e3 / len(controls) / WORLDS / per


def compare(name: str, scene: mjs.SceneCfg, body: str, touching: str, rounds: int, steps: int) -> list[Row]:
    rows = []
    what = {
        "nothing read": [],
        "poses and velocities": poses_and_velocities(body),
        "rays": rays(body),
        "camera": camera(body),
        "contact forces": forces(touching),
    }
    for decimation in (1, 4):
        ours = {case: Ours(scene, sensors, decimation) for case, sensors in what.items()}
        peers = {
            "mj_batch": Plain(ours["nothing read"], persistent=False),
            "mj_batch, persistent": Plain(ours["nothing read"], persistent=True),
        }
        plain = peers["mj_batch"]
        rng = np.random.default_rng(0)
        sides = {**peers, **ours}
        settle = 0.02 * rng.standard_normal((300 // decimation, WORLDS, plain.ctrl.shape[1]))
        for side in sides.values():  # until the robots are at rest
            us(side.step, settle, side.ctrl, decimation)
        spent: dict[str, list[float]] = {case: [] for case in sides}
        again: dict[str, list[float]] = {case: [] for case in what}
        for _ in range(rounds + 3):
            controls = 0.02 * rng.standard_normal((steps, WORLDS, plain.ctrl.shape[1]))
            for case, side in sides.items():  # each turn is long enough that its worlds are in the cache
                spent[case].append(us(side.step, controls, side.ctrl, decimation))
            for case in what:
                if ours[case].read:
                    again[case].append(us(ours[case].again, controls[-1:], ours[case].ctrl, decimation))
            for case in what:
                assert np.array_equal(ours[case].state, plain.state), f"{name}, {case}: the states differ from those of mj_step"
        for case in what:
            label = f"{name}, {case}, decimation {decimation}"
            goal = {"nothing read": 1 / 1.03, "contact forces": None}.get(case, 1 / (1.05 if decimation == 1 else 1.03))
            own = statistics.median(again[case][3:]) if again[case] else 0.0
            for peer in peers:
                wanted = goal if peer == "mj_batch" else None
                rows.append(
                    Row(
                        label,
                        statistics.median(spent[case][3:]) - own,
                        "us per world and substep",
                        statistics.median(spent[peer][3:]),
                        peer,
                        higher_is_better=False,
                        goal=wanted,
                    )
                )
            if own:
                rows.append(Row("- the sensors themselves", own, "us per world and substep"))
    return rows


def main() -> None:
    quick = "--quick" in sys.argv
    rounds, steps = (6, 10) if quick else (15, 20)
    robots = [r for r in ("go1", "g1", "panda") if r in sys.argv] or ["go1", "g1", "panda"]
    rows = []
    if "go1" in robots:
        rows += compare("Go1", go1(), "trunk", "|".join(FEET), rounds, steps)
    if "g1" in robots:
        rows += compare("G1", g1(), "torso_link", ".*_foot.*_collision", rounds, steps)
    if "panda" in robots:
        rows += compare("Panda", panda(), "robot0_right_hand", ".*finger.*", rounds, steps)
    report(f"Physics of {WORLDS} worlds with current sensors, compared with plain steps", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        sys.exit(f"physics: {error}")
