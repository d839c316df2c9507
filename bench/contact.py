# SPDX-License-Identifier: Apache-2.0
"""Time of contact sensors: in one world with few and with all primaries in contact (contact_bench.cc), and as an addition to a
physics step of Unitree Go1 robots on rough terrain, compared with MuJoCo's own contact sensors.

The robot is that of mjlab's wheel on PyPI. All cases run the same physics on one thread, and CPU time is measured, so that other
programs have little influence. MuJoCo's sensors give the seven fields of the four feet at the end of a step. Those of mjsense
give in addition air time, touchdown and lift-off, the peak within the step, and a history of four substeps of every field.
--mjlab also measures mjlab's sensors on the CPU (peers/mjlab_contact.py); this is not the default, because its environment takes
5 GB.
"""

import pathlib
import statistics
import sys
import time

import mujoco
from fetch import Unavailable, run_peer, wheel
from harness import Row, google_benchmarks, report

import mjsense as mjs

FIELDS = ("found", "force", "torque", "dist", "pos", "normal", "tangent")
FEET = [f"{leg}_foot_collision" for leg in ("FR", "FL", "RR", "RL")]
DECIMATION = 4


def robot(xml: pathlib.Path, native: bool) -> mujoco.MjSpec:
    """A Go1 that stands on joint springs. If `native`, each foot has a contact sensor of MuJoCo."""
    spec = mujoco.MjSpec.from_file(str(xml))
    pose = {"thigh": 0.9, "calf": -1.8, "R_hip": 0.1, "L_hip": -0.1}
    for joint in spec.joints:
        for part, angle in pose.items():
            if part in joint.name:
                joint.stiffness[0], joint.damping[0], joint.springref = 40.0, 1.0, angle
    for foot in FEET if native else ():
        sensor = spec.add_sensor(name=f"{foot}_contact", type=mujoco.mjtSensor.mjSENS_CONTACT)
        sensor.objtype, sensor.objname = mujoco.mjtObj.mjOBJ_GEOM, foot
        sensor.intprm[0] = sum(1 << i for i in range(7))  # all seven fields
        sensor.intprm[1] = 2  # reduction: maxforce
        sensor.intprm[2] = 1
    return spec


def feet(**kwargs) -> mjs.ContactSensorCfg:
    primary = mjs.ContactMatch(mode="geom", pattern=".*_foot_collision", entity="robot")
    return mjs.ContactSensorCfg(name="feet", primary=primary, fields=FIELDS, **kwargs)


class Case:
    def __init__(self, xml: pathlib.Path, worlds: int, sensors=(), read=(), native: bool = False, rough: bool = True) -> None:
        entity = mjs.EntityCfg(model=robot(xml, native), pos=(0.0, 0.0, 0.35))
        terrain = mjs.TerrainCfg(terrain_type="generator", levels=2, types=4) if rough else mjs.TerrainCfg()
        self.scene = mjs.Scene(mjs.SceneCfg(entities={"robot": entity}, terrain=terrain, sensors=sensors))
        self.sim = mjs.Simulation(self.scene, num_worlds=worlds, decimation=DECIMATION, threads=1)
        if rough:  # places each robot on its terrain tile
            self.sim.qpos[:, :3] += self.scene.env_origins(worlds)
            self.sim.forward()
        self.read = [self.scene[key] for key in read]
        self.seconds: list[float] = []
        self.run(25)

    def run(self, steps: int) -> None:
        for _ in range(steps):
            self.sim.step()
            for sensor in self.read:
                sensor.data

    def measure(self, steps: int) -> None:
        start = time.process_time()
        self.run(steps)
        self.seconds.append((time.process_time() - start) / steps)

    def us_per_world_step(self) -> float:
        """Microseconds of one substep of one world: the minimum of all rounds, which other programs disturbed least."""
        return 1e6 * min(self.seconds) / self.sim.num_worlds / DECIMATION


def share(case: Case, physics: Case) -> float:
    """Percentage that a case adds to physics: the median over rounds, each of which ran both in succession."""
    return statistics.median(100 * (a / b - 1) for a, b in zip(case.seconds, physics.seconds))


def added_us(case: Case, physics: Case) -> float:
    """The same in microseconds per world and substep."""
    return 1e6 * statistics.median(a - b for a, b in zip(case.seconds, physics.seconds)) / case.sim.num_worlds / DECIMATION


def one_world() -> list[Row]:
    """Seven fields, with few or all primaries in contact."""
    rows = []
    m = google_benchmarks("contact/(ours|mujoco)")
    for name, other in sorted(m.items(), key=lambda item: [int(n) for n in item[0].split("/")[-2:]]):
        kind, primaries, _ = name.removeprefix("contact/").split("/")
        if kind == "mujoco_7_fields":
            case = f"one world, primaries: {primaries}, contacts: {other['contacts']:.0f}"
            for ours, memory in (("ours_7_fields", ""), ("ours_with_memory", "; ours with air time, events, peak, history of 4")):
                cost = m[name.replace(kind, ours)]
                if cost["contacts"] != other["contacts"]:
                    raise RuntimeError(f"{name}: {cost['contacts']:.0f} contacts on our side")
                rows.append(
                    Row(
                        case + memory,
                        cost["cpu"] * 1e-3,
                        "us",
                        other["cpu"] * 1e-3,
                        "MuJoCo's contact sensors",
                        higher_is_better=False,
                    )
                )
    return rows


def main() -> None:
    quick = "--quick" in sys.argv
    rounds, steps = (10, 2) if quick else (60, 2)
    rows = one_world()
    xml = wheel("mjlab") / "mjlab/asset_zoo/robots/unitree_go1/xmls/go1.xml"
    imu = [f"robot/imu_{s}" for s in ("ang_vel", "lin_vel", "lin_acc")]
    memory = {"track_air_time": True, "track_events": True, "latch": True, "history_length": DECIMATION}
    cases = {
        "physics": Case(xml, 64),
        "imu": Case(xml, 64, read=imu),
        "fields": Case(xml, 64, (feet(),), ["feet", *imu]),
        "memory": Case(xml, 64, (feet(**memory),), ["feet", *imu]),
        "mujoco": Case(xml, 64, read=[*imu, *(f"robot/{f}_contact" for f in FEET)], native=True),
    }
    for _ in range(rounds):
        for case in cases.values():
            case.measure(steps)
    rows.append(Row("64 Go1 on rough terrain: physics", cases["physics"].us_per_world_step(), "us per world and substep"))
    physics = cases["physics"]
    rows.append(
        Row(
            "IMU alone, needs one constraint solve at the new state",
            share(cases["imu"], physics),
            "% of physics",
            higher_is_better=False,
        )
    )
    peer = share(cases["mujoco"], physics)
    rows.append(
        Row(
            "IMU and feet, 7 fields, including that solve",
            share(cases["fields"], physics),
            "% of physics",
            peer,
            "MuJoCo's sensors",
            higher_is_better=False,
        )
    )
    remembered = Row(
        "the same with air time, events, peak, history", share(cases["memory"], physics), "% of physics", higher_is_better=False
    )
    rows.append(remembered)
    if "--mjlab" in sys.argv:
        other = run_peer("mjlab", "mjlab_contact")
        sensing = other["sensors"] + other["torch"]
        remembered.peer, remembered.peer_name = (
            100 * sensing / other["physics"],
            f"mjlab on the CPU, of its {other['physics']:.0f} us",
        )
        touching = (cases["memory"].scene["feet"].data.found > 0).mean(), other["feet_in_contact"]
        rows.append(
            Row(
                "- in time ({:.0%} of the feet touch, {:.0%} of mjlab's)".format(*touching),
                added_us(cases["memory"], physics),
                "us per world and substep",
                sensing,
                f"mjlab on the CPU, {other['torch']:.1f} of it in torch",
                higher_is_better=False,
            )
        )
    for worlds in (16, 256) if quick else (16, 256, 2048):
        case = Case(xml, worlds, (feet(**memory),), ["feet"], rough=False)
        for _ in range(3):
            case.measure(8)
        kilobytes = sum(a.nbytes for a in case.scene["feet"].fields.values()) / worlds / 1024
        rows.append(Row(f"{worlds} Go1 on a plane: physics and feet", case.us_per_world_step(), "us per world and substep"))
        rows.append(Row("- rows of the sensor", kilobytes, "KiB per world"))
        del case
    report("Contact sensors", rows)


if __name__ == "__main__":
    try:
        main()
    except Unavailable as error:
        sys.exit(f"contact: {error}")
