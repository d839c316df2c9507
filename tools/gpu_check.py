# SPDX-License-Identifier: Apache-2.0
"""Compares simulations with ``backend="warp"`` with those on the CPU, measures their speed, and writes the tables of docs/warp.md.

    python tools/gpu_check.py [--device cuda:0] [--worlds 64] [--steps 10] [--long 1000] [--write]

Both simulations step from the same states with the same controls. Then the states of the CPU are copied, so that they are the same again,
and every field of every sensor is compared. Forces and accelerations are compared in worlds in which mujoco_warp finds the same contacts
as MuJoCo; the others are counted. The exit code is 1 if a field differs by more than its bound.
"""

from __future__ import annotations

import argparse
import gc
import platform
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

import mjsense as mjs
from mjsense import effects

PAGE = Path(__file__).resolve().parents[1] / "docs" / "warp.md"
BEGIN, END = "<!-- table of tools/gpu_check.py -->", "<!-- end -->"
STATE = ("qpos", "qvel", "act", "mocap_pos", "mocap_quat")

ROBOT = """
<mujoco>
  <asset><texture name="grid" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .8 .7" width="64" height="64"/>
    <material name="grid" texture="grid" texrepeat="4 4"/></asset>
  <worldbody>
    <light pos="1 -1 3" dir="-.3 .3 -1"/>
    <body name="trunk" pos="0 0 .25"><freejoint name="root"/>
      <geom name="trunk" type="box" size=".2 .15 .1" mass="4" material="grid"/>
      <site name="imu" pos=".1 0 .02" euler="5 10 15"/><site name="nose" pos=".25 0 0" size=".05"/>
      <camera name="eye" pos=".1 0 .25" xyaxes="0 -1 0 .7 0 1"/>
      <body name="left_wheel" pos="0 .2 -.1"><joint name="left" axis="0 1 0"/>
        <geom name="left_wheel" type="sphere" size=".1" mass=".3"/></body>
      <body name="right_wheel" pos="0 -.2 -.1"><joint name="right" axis="0 1 0"/>
        <geom name="right_wheel" type="sphere" size=".1" mass=".3"/></body>
      <body name="arm" pos=".2 0 .1"><joint name="arm" axis="0 1 0" damping=".2" range="-40 80" limited="true"/>
        <geom name="arm" type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".4"/><site name="hand" pos=".3 0 0" size=".04"/></body>
    </body>
  </worldbody>
  <tendon><fixed name="difference"><joint joint="left" coef="1"/><joint joint="right" coef="-1"/></fixed></tendon>
  <actuator><motor name="left" joint="left"/><motor name="right" joint="right"/><motor name="arm" joint="arm" gear="3"/></actuator>
  <sensor>
    <touch name="touch" site="hand"/><accelerometer name="accelerometer" site="imu"/><velocimeter name="velocimeter" site="imu"/>
    <gyro name="gyro" site="imu"/><force name="force" site="hand"/><torque name="torque" site="hand"/>
    <magnetometer name="magnetometer" site="imu"/><rangefinder name="rangefinder" site="nose"/>
    <jointpos name="jointpos" joint="arm"/><jointvel name="jointvel" joint="arm"/>
    <jointactuatorfrc name="jointactuatorfrc" joint="arm"/><jointlimitpos name="jointlimitpos" joint="arm"/>
    <tendonpos name="tendonpos" tendon="difference"/><tendonvel name="tendonvel" tendon="difference"/>
    <actuatorpos name="actuatorpos" actuator="arm"/><actuatorvel name="actuatorvel" actuator="arm"/>
    <actuatorfrc name="actuatorfrc" actuator="arm"/>
    <framepos name="framepos" objtype="site" objname="hand" reftype="body" refname="trunk"/>
    <framequat name="framequat" objtype="site" objname="hand"/>
    <framexaxis name="framexaxis" objtype="site" objname="hand"/><frameyaxis name="frameyaxis" objtype="site" objname="hand"/>
    <framezaxis name="framezaxis" objtype="site" objname="hand"/><framelinvel name="framelinvel" objtype="site" objname="hand"/>
    <frameangvel name="frameangvel" objtype="site" objname="hand"/><framelinacc name="framelinacc" objtype="site" objname="hand"/>
    <frameangacc name="frameangacc" objtype="site" objname="hand"/><subtreecom name="subtreecom" body="trunk"/>
    <subtreelinvel name="subtreelinvel" body="trunk"/><subtreeangmom name="subtreeangmom" body="trunk"/>
    <e_potential name="e_potential"/><e_kinetic name="e_kinetic"/><clock name="clock"/>
  </sensor>
</mujoco>"""
BOX = """
<mujoco><worldbody><body name="box"><freejoint/>
  <geom name="box" type="box" size=".1 .1 .1" mass=".2" rgba=".8 .3 .2 1"/></body></worldbody></mujoco>"""
BALL = """
<mujoco><worldbody><body name="ball"><freejoint/>
  <geom name="ball" type="sphere" size=".1" mass=".2" rgba=".2 .7 .3 1"/></body></worldbody></mujoco>"""

EVERY_FIELD = ("found", "force", "torque", "dist", "pos", "normal", "tangent")


@dataclass
class SceneOfCheck:
    """A scene and the states in which its worlds begin."""

    make: Callable[[], mjs.SceneCfg]
    decimation: int = 2

    def start(self, worlds: int) -> dict[str, np.ndarray]:
        """Components of the state, ``[worlds, n]``; without them the keyframe or the model's own pose."""
        return {}


def quadruped_sensors() -> tuple[Any, ...]:
    feet, ground = mjs.ContactMatch("geom", ".*_foot", "robot"), mjs.ContactMatch("body", "terrain")
    base = mjs.ObjRef("site", "imu", "robot")
    return (
        mjs.ContactSensorCfg(
            "feet", feet, ground, EVERY_FIELD, num_slots=2, track_air_time=True, history_length=3, track_events=True, latch=True,
            friction_split=True, other_ids=True),
        mjs.ContactSensorCfg("net", feet, ground, ("found", "force", "torque", "pos"), reduce="netforce", latch=True, other_ids=True),
        mjs.ContactSensorCfg("deepest", feet, ground, ("found", "dist", "pos"), reduce="mindist", global_frame=False),
        mjs.ContactSensorCfg("legs", mjs.ContactMatch("subtree", ".*_hip", "robot"), None, EVERY_FIELD, global_frame=True),
        mjs.RayCastSensorCfg("scan", base, mjs.GridPatternCfg(size=(1.0, 0.6), resolution=0.1), ray_alignment="yaw"),
        mjs.TerrainHeightSensorCfg("height", base, mjs.GridPatternCfg(size=(0.2, 0.2), resolution=0.1)),
        mjs.LidarSensorCfg("lidar", base, scan=mjs.SpinningScanCfg(channels=4, samples=24), range_noise_std=0.01, dropout=0.05),
        mjs.ImuSensorCfg("imu", base, "mpu6050", orientation=True),
        mjs.EffectSensorCfg("noisy", "imu", effects=(effects.EpisodeBias(effects.Gaussian(0.05)), effects.Noise(effects.Gaussian(0.1)), effects.Delay(0.02))),
    )  # fmt: skip


def plane() -> mjs.SceneCfg:
    robot = mjs.EntityCfg(model="embedded:robots/quadruped.xml")
    return mjs.SceneCfg(entities={"robot": robot}, terrain=mjs.TerrainCfg(), sensors=quadruped_sensors())


def feet_only() -> mjs.SceneCfg:
    return mjs.SceneCfg(
        entities={"robot": mjs.EntityCfg(model="embedded:robots/quadruped.xml")},
        terrain=mjs.TerrainCfg(),
        sensors=quadruped_sensors()[:1],
    )


def objects() -> mjs.SceneCfg:
    """Objects that touch each other, every type of built-in sensor, and cameras."""
    robot, box, ball = (
        mjs.EntityCfg(ROBOT, pos=(0, 0, 0.2)),
        mjs.EntityCfg(BOX, pos=(0.6, 0, 0.1)),
        mjs.EntityCfg(BALL, pos=(0.62, 0.02, 0.295)),
    )
    things = {"robot": robot, "box": box, "ball": ball}
    every = mjs.ContactMatch("body", ("box/box", "ball/ball", "robot/trunk", "robot/left_wheel", "robot/arm"))
    return mjs.SceneCfg(
        entities=things, terrain=mjs.TerrainCfg(), sensors=(
            mjs.ContactSensorCfg("contacts", every, None, EVERY_FIELD, num_slots=6, other_ids=True),
            mjs.ContactSensorCfg("pairs", every, every, ("found",), secondary_policy="each"),
            mjs.ContactSensorCfg("any", mjs.ContactMatch("subtree", "trunk", "robot"), None, ("found", "dist"), reduce="none", num_slots=8),
            mjs.CameraSensorCfg(
                "eye", camera_name="robot/eye", width=32, height=24, data_types=("rgb", "depth", "segmentation")),
        ))  # fmt: skip


def on_tiles(kind: Any) -> SceneOfCheck:
    """A quadruped on terrain of one kind."""

    def make() -> mjs.SceneCfg:
        terrain = mjs.TerrainCfg("generator", {kind: mjs.SubTerrainCfg(kind)}, levels=1, tile_size=(4.0, 4.0), border=0.0)
        robot = mjs.EntityCfg(model="embedded:robots/quadruped.xml")
        return mjs.SceneCfg(entities={"robot": robot}, terrain=terrain, sensors=quadruped_sensors())

    return SceneOfCheck(make)


def walk() -> mjs.SceneCfg:
    """The quadruped of examples/walk, on several kinds of terrain."""
    tiles = {kind: mjs.SubTerrainCfg(kind) for kind in ("flat", "rough", "waves", "stairs", "stepping_stones")}
    robot = mjs.EntityCfg(model="embedded:robots/quadruped.xml", pos=(0, 0, 0.1))
    return mjs.SceneCfg(
        entities={"robot": robot},
        terrain=mjs.TerrainCfg("generator", tiles, levels=2, tile_size=(4.0, 4.0)),
        sensors=quadruped_sensors(),
    )


def stones() -> mjs.SceneCfg:
    """Convex meshes that fall onto a plane and onto each other."""
    rng = np.random.default_rng(0)
    vertices = [" ".join(f"{x:.3f}" for x in (rng.normal(size=(30, 3)) * 0.08).ravel()) for _ in range(4)]
    meshes = "".join(f'<mesh name="m{i}" vertex="{text}"/>' for i, text in enumerate(vertices))
    bodies = "".join(
        f'<body name="stone{i}" pos="{0.12 * (i % 2)} {0.1 * (i // 2 % 2)} {0.25 + 0.22 * i}"><freejoint/>'
        f'<geom name="stone{i}" type="mesh" mesh="m{i % 4}" mass=".5"/><site name="imu{i}"/></body>'
        for i in range(6)
    )
    ground = '<geom name="ground" type="plane" size="0 0 .1"/><light pos="0 0 4"/>'
    every = tuple(f"stone{i}" for i in range(6))
    return mjs.SceneCfg(
        base=f"<mujoco><asset>{meshes}</asset><worldbody>{ground}{bodies}</worldbody></mujoco>",
        sensors=sensors_of("imu0", every),
    )


def sensors_of(site: str, things: tuple[str, ...], camera: str = "") -> tuple[Any, ...]:
    """Sensors in a scene of which only some names are known."""
    place = mjs.ObjRef("site", site)
    view: dict[str, Any] = {"camera_name": camera} if camera else {"pos": (0, -2, 1), "quat": (0.85, 0.53, 0, 0)}
    return (
        # Contacts of one object have equal forces and depths up to rounding, so that their order is arbitrary: compare their sum.
        mjs.ContactSensorCfg(
            "net", mjs.ContactMatch("body", things), None, ("found", "force", "torque", "pos"), reduce="netforce"
        ),
        mjs.ContactSensorCfg(
            "pairs", mjs.ContactMatch("body", things), mjs.ContactMatch("body", things), ("found",), secondary_policy="each"
        ),
        mjs.RayCastSensorCfg("scan", place, mjs.GridPatternCfg(size=(0.6, 0.6), resolution=0.1), ray_alignment="world"),
        mjs.TerrainHeightSensorCfg("height", place, mjs.GridPatternCfg(size=(0.2, 0.2), resolution=0.1)),
        mjs.LidarSensorCfg("lidar", place, scan=mjs.SpinningScanCfg(channels=4, samples=24), range_noise_std=0.01, dropout=0.05),
        mjs.ImuSensorCfg("imu", place, "mpu6050", orientation=True),
        mjs.CameraSensorCfg("picture", width=32, height=24, data_types=("rgb", "depth", "segmentation", "normals"), **view),
    )


class OfTask(SceneOfCheck):
    """The scene of a task with its robot; the worlds start where its first episodes do, and the model where the first does, because
    all objects of a task are in one place in its own model."""

    def __init__(self, task: str, robot: str, scene: str = "") -> None:
        super().__init__(self._cfg, decimation=4)
        self._arguments: dict[str, Any] = {"task": task, "robot": robot, "scene": scene, "cameras": [], "seed": 0}
        self._folder = tempfile.TemporaryDirectory()

    def _cfg(self) -> mjs.SceneCfg:
        env: Any = mjs.make_vec(**self._arguments)
        env.reset(seed=0)
        path, scene, model, qpos = Path(self._folder.name), env.scene, env.sim.model, env.sim.qpos[0].copy()
        for name, content in scene.assets().items():
            (path / name).parent.mkdir(parents=True, exist_ok=True)
            (path / name).write_bytes(content)
        (path / "scene.xml").write_text(scene.to_xml())
        names = [model.body(i).name for i in range(model.nbody)]
        free = {names[model.jnt_bodyid[j]]: qpos[model.jnt_qposadr[j] :][:7] for j in np.flatnonzero(model.jnt_type == 0)}
        hand = [name for name in names if name.startswith("robot_0/")][-1]
        # Not a site on the surface of its base, where a ray may hit or miss that surface.
        site = [name for i in range(model.nsite) if (name := model.site(i).name).startswith("robot_0/")][-1]
        camera = next((model.camera(i).name for i in range(model.ncam) if model.cam_bodyid[i] > 0), "")
        env.close()
        things = tuple(name for name in [hand, *free] if name)[:6]

        def place(spec: Any) -> None:
            for name, pose in free.items():
                spec.body(name).pos, spec.body(name).quat = pose[:3], pose[3:]

        return mjs.SceneCfg(base=path / "scene.xml", sensors=sensors_of(site, things, camera), spec_fn=place)

    def start(self, worlds: int) -> dict[str, np.ndarray]:
        env = mjs.make_vec(num_envs=worlds, **self._arguments)
        env.reset(seed=0)
        state = {name: np.array(getattr(env.sim, name)) for name in (*STATE, "ctrl")}
        env.close()
        return state


SCENES: dict[str, SceneOfCheck] = {
    "quadruped on a plane": SceneOfCheck(plane),
    "quadruped on rough terrain": on_tiles("rough"),
    "quadruped on waves": on_tiles("waves"),
    "quadruped on a slope": on_tiles("slope"),
    "quadruped on stairs": on_tiles("stairs"),
    "quadruped on stepping stones": on_tiles("stepping_stones"),
    "quadruped on tiles of five kinds": SceneOfCheck(walk),
    "objects": SceneOfCheck(objects),
    "stones": SceneOfCheck(stones),
    "table with a Franka": OfTask("pick", "franka"),
    "table with a YAM": OfTask("pick", "i2rt_yam"),
    "table with two YAMs": OfTask("pick", "bimanual_yam"),
    "table with receptacles": OfTask("pick_and_place", "franka"),
    "varied table with a Franka hand": OfTask("pick", "franka_hand", "varied_table"),
    "varied table with a RUM gripper": OfTask("pick", "floating_rum", "varied_table"),
    "cluttered table": OfTask("pick", "franka", "clutter"),
    "bookcase": OfTask("pick", "franka", "shelf"),
    "kitchen": OfTask("open", "franka", "kitchen"),
    "kitchen with a mobile Franka": OfTask("pick", "mobile_franka", "kitchen:3"),
    "door with an RB-Y1": OfTask("door_opening", "rby1"),
}

FORCES = ("N", "N m", "m/s^2", "rad/s^2")
"""Units of quantities that depend on the constraint solver, whose tolerance is larger than the rounding of float32."""
EXACT = ("found", "found_history", "pair_found", "other_geom", "other_body", "geom_id", "body_id", "material_id", "segmentation")
"""Fields that are compared for equality although some are floats."""
DELAY_STEPS = 8
"""Number of control steps that are longer than the delay of the effect."""


@dataclass
class Field:
    """Differences of one field over all scenes, sensors of its kind, worlds and steps."""

    unit: str = ""
    exact: bool = False
    colours: bool = False
    contacts: bool = False
    pixel_normals: bool = False
    values: int = 0
    other: int = 0
    """Number of values that are not equal (integers, bools, counts), or beyond the bound."""
    largest: float = 0.0
    difference: float = 0.0
    differences: list[np.ndarray] = field(default_factory=list)

    def add(self, ours: np.ndarray, theirs: np.ndarray, rows: np.ndarray) -> None:
        """``rows``: the worlds whose contacts, hits and so on are the same on both sides."""
        self.values += ours.size
        if self.exact:
            self.other += int((ours != theirs).sum())
            return
        ours, theirs = ours[rows].astype(float), theirs[rows].astype(float)
        both = np.isfinite(ours) & np.isfinite(theirs)
        self.other += int((np.isfinite(ours) != np.isfinite(theirs)).sum())
        if both.any():
            difference = np.abs(ours - theirs)[both]
            self.largest = max(self.largest, float(np.abs(theirs[both]).max()))
            self.difference = max(self.difference, float(difference.max()))
            self.differences.append(np.sort(difference.ravel())[-max(1, difference.size // 500) :])

    @property
    def bound(self) -> float:
        """Of the difference that one value in a thousand may exceed: 2 % of the largest value for quantities that depend on forces,
        100 of 255 for colours, because textures are filtered in another way at their edges, 0.02 for normals of images, because
        a pixel at an edge may show the other face, 0.05 % for contacts, and 0.005 % for all others."""
        if self.colours:
            return 100.0
        if self.pixel_normals:
            return 0.02
        share = 2e-2 if self.unit in FORCES else 5e-4 if self.contacts else 5e-5
        return share * max(self.largest, 1.0)

    def tail(self) -> float:
        """The difference that one value in a thousand exceeds."""
        found = np.sort(np.concatenate(self.differences)) if self.differences else np.zeros(1)
        return float(found[-min(len(found), max(1, self.values // 1000))])


def on_host(values: Any) -> np.ndarray:
    return values.cpu().numpy() if hasattr(values, "cpu") else values.numpy() if hasattr(values, "device") else np.asarray(values)


def pair(scene: SceneOfCheck, worlds: int, device: str, reference: bool = True) -> tuple[Any, Any]:
    """A simulation on the CPU, if it is wanted, and one on the device."""
    cfg, decimation = scene.make(), scene.decimation
    limits = {"nconmax": 200, "njmax": 1000} if isinstance(scene, OfTask) else {"nconmax": 100, "njmax": 400}
    ours = mjs.Simulation(mjs.Scene(cfg), worlds, decimation, backend="warp", device=device, **limits)
    return mjs.Simulation(mjs.Scene(scene.make()), worlds, decimation) if reference else None, ours


def steps(reference: Any, ours: Any, count: int, start: dict[str, np.ndarray] | None = None, seed: int = 0) -> Iterator[int]:
    """Steps both from the same states under random controls."""
    rng = np.random.default_rng(seed)
    key = "init_state" if reference.model.nkey else None
    for sim in (reference, ours):
        sim.reset(key=key)
    velocity = 0.3 * rng.normal(size=reference.qvel.shape) * (not start)
    for sim in (reference, ours):
        sim.set_state(**{"qvel": velocity, **(start or {})})
    ctrl = reference.ctrl.copy()
    for step in range(count):
        if step % 5 == 0:
            push = rng.normal(size=reference.ctrl.shape) * (0.1 if start else 0.5)
        reference.ctrl[:] = ctrl + push
        ours.ctrl = reference.ctrl
        reference.step()
        ours.step()
        ours.set_state(**{name: getattr(reference, name) for name in STATE})
        yield step


def same_contacts(reference: Any, ours: Any) -> np.ndarray:
    """The worlds in which both find the same contacts, bool ``[B]``."""
    same = np.ones(reference.num_worlds, bool)
    for name, sensor in reference.scene.sensors.items():
        if sensor.kind == "contact":
            theirs, mine = sensor.fields, ours.scene[name].fields
            for key, tolerance in {
                "found": 0.0,
                "found_history": 0.0,
                "dist": 1e-5,
                "dist_history": 1e-5,
                "normal": 1e-3,
                "normal_history": 1e-3,
            }.items():
                if key in theirs:
                    difference = np.abs(on_host(mine[key]) - theirs[key]).reshape(len(same), -1)
                    same &= (difference <= tolerance).all(1)
    return same


def contact_algorithm(model: Any) -> str:
    """Names the geoms between which mujoco_warp finds contacts in another way than MuJoCo; contact sensors are then compared in the
    worlds with the same contacts."""
    if model.nhfield:
        return ", height field"
    collides = (model.geom_contype | model.geom_conaffinity) > 0
    return ", meshes and cylinders" if np.isin(model.geom_type[collides], (4, 5, 7)).any() else ""


def compare(found: dict[tuple[str, str], Field], reference: Any, ours: Any, past: list[np.ndarray]) -> None:
    """Adds the differences of all sensors at the current state. ``past``: in which worlds earlier steps had the same contacts."""
    same = same_contacts(reference, ours)
    past.append(same)
    delayed = np.all(past[-DELAY_STEPS:], axis=0)
    algorithm = contact_algorithm(reference.model)
    contacts = found["contact", f"(worlds with other contacts{algorithm})"]
    contacts.exact, contacts.values, contacts.other = True, contacts.values + len(same), contacts.other + int((~same).sum())
    forces = {reference.model.sensor(i).name for i in np.flatnonzero(reference.model.sensor_needstage == 3)}
    for name, sensor in reference.scene.sensors.items():
        if name not in ours.scene.sensors or sensor.kind == "contact_field":
            continue
        theirs, mine = sensor.fields, ours.scene[name].fields
        assert set(theirs) == set(mine), name
        rows = np.ones(len(same), bool)
        if sensor.kind in ("contact", "imu", "effect") or name in forces:
            rows = (delayed if sensor.kind == "effect" else same).copy()
        for key in theirs:
            ids = on_host(mine[key]) if key in EXACT or theirs[key].dtype.kind in "bi" else None
            if ids is not None:
                rows &= (ids == theirs[key]).reshape(len(rows), -1).all(1)
        for key, spec in sensor.specs.items():
            label = (
                sensor.cfg.sensor_type
                if sensor.kind == "builtin" and sensor.cfg
                else name.split("/")[-1]
                if sensor.kind == "builtin"
                else key
            )
            entry = found[sensor.kind, label]
            entry.colours, entry.contacts = theirs[key].dtype == np.uint8, sensor.kind == "contact"
            entry.pixel_normals = sensor.kind == "camera" and key == "normals"
            entry.unit, entry.exact = spec.unit, key in EXACT or theirs[key].dtype.kind in "bi"
            assert on_host(mine[key]).shape == theirs[key].shape and on_host(mine[key]).dtype == theirs[key].dtype, (name, key)
            compared = same if sensor.kind == "contact" and algorithm else np.ones(len(rows), bool)
            entry.add(on_host(mine[key])[compared], theirs[key][compared], rows[compared])


def run(device: str, worlds: int, count: int, scenes: dict[str, SceneOfCheck]) -> dict[tuple[str, str], Field]:
    found: dict[tuple[str, str], Field] = defaultdict(Field)
    for name, scene in scenes.items():
        began = time.perf_counter()
        reference, ours = pair(scene, worlds, device)
        past: list[np.ndarray] = []
        for _ in steps(reference, ours, count, scene.start(worlds)):
            compare(found, reference, ours, past)
        print(f"{name}: {time.perf_counter() - began:.0f} s", file=sys.stderr)
    return found


def beyond(found: dict[tuple[str, str], Field]) -> list[str]:
    """Fields that differ by more than their bound, or, if they are compared for equality, in more than 1 % of the values."""
    wrong = []
    for (kind, name), entry in found.items():
        if not name.startswith("(") and entry.other > 0.01 * entry.values:
            wrong.append(f"{kind} {name}: {entry.other} of {entry.values} are not equal")
        if not entry.exact and entry.tail() > entry.bound:
            wrong.append(f"{kind} {name}: {entry.tail():.2g} {entry.unit} in one of 1,000, the bound is {entry.bound:.2g}")
    return wrong


def table(found: dict[tuple[str, str], Field]) -> list[str]:
    lines = [
        "| sensor | field | unit | largest value | largest difference | exceeded by 1 in 1,000 | its bound | not equal |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for (kind, name), entry in sorted(found.items()):
        share = f"{entry.other:,} of {entry.values:,}" if entry.exact or entry.other else ""
        numbers = [""] * 4 if entry.exact else [f"{x:.2g}" for x in (entry.largest, entry.difference, entry.tail(), entry.bound)]
        lines.append(f"| {' | '.join([kind, name, entry.unit, *numbers, share])} |")
    return lines


def long_run(device: str, worlds: int, count: int) -> list[str]:
    """Differences of what a contact sensor remembers, over many steps without a reset."""
    found: dict[tuple[str, str], Field] = defaultdict(Field)
    reference, ours = pair(SceneOfCheck(feet_only), worlds, device)
    landings, past = 0, []
    for _ in steps(reference, ours, count):
        compare(found, reference, ours, past)
        landings += int(reference.scene["feet"].data.touchdown.sum())
    remembered = {
        key: entry for key, entry in found.items() if key[1].endswith(("_time", "_history", "touchdown", "liftoff", "_peak"))
    }
    print("\n".join(beyond(remembered)), file=sys.stderr)
    return [*table(remembered), "", f"{landings:,} touchdowns in {count:,} control steps of {worlds} worlds."]


def speed(device: str, worlds: int, count: int = 20) -> list[str]:
    """Control steps of the quadruped with all sensors, which are read after each step."""
    lines = [
        "| backend | device | worlds | control steps of a world per second |",
        "| --- | --- | --- | --- |",
    ]
    reference, ours = pair(SceneOfCheck(plane), worlds, device)
    for name, sim in {"cpu": reference, "warp": ours, "warp, with a recorder": ours}.items():
        sim.reset(key="init_state")
        sensors = [sensor for sensor in sim.scene.sensors.values() if sensor.cfg is not None]
        with tempfile.TemporaryDirectory() as folder:
            recorder = mjs.Recorder(folder, sim, sensors) if name.endswith("recorder") else None
            if recorder:
                recorder.begin_episode(0, 0)
            for step in range(count + 3):
                if step == 3:
                    began = time.perf_counter()
                sim.step()
                for sensor in sensors:
                    sensor.data
                if recorder:
                    recorder.append()  # the rows of all worlds
                if step in (2, count + 2) and sim is ours:
                    wait(device)
            rate = count * worlds / (time.perf_counter() - began)
        lines.append(f"| {name} | {device if sim is ours else f'{sim.threads} threads'} | {worlds:,} | {rate:,.0f} |")
    return lines


def wait(device: str) -> None:
    import warp as wp

    wp.synchronize_device(device)


def memory(device: str, counts: tuple[int, ...]) -> list[str]:
    """Device memory of simulations with all sensors, by number of worlds."""
    names = ("quadruped on a plane", "table with a Franka", "kitchen")
    lines = [f"| worlds | {' | '.join(names)} |", "| --- | --- | --- | --- |"]
    for worlds in counts:
        row = [f"{memory_of(SCENES[name], worlds, device) / 2**20:,.0f} MiB" for name in names]
        lines.append(f"| {worlds:,} | {' | '.join(row)} |")
    return lines


def memory_of(scene: SceneOfCheck, worlds: int, device: str) -> int:
    before = bytes_on(device)
    ours = pair(scene, worlds, device, reference=False)[1]
    for sensor in ours.scene.sensors.values():
        sensor.data  # allocates what is needed to compute it
    return bytes_on(device) - before


def bytes_on(device: str) -> int:
    """Bytes that Warp has allocated on a device."""
    import warp as wp

    gc.collect()
    if wp.get_device(device).is_cuda:
        return wp.get_mempool_used_mem_current(device)
    found = (thing for thing in gc.get_objects() if type(thing) is wp.array)
    return sum(array.capacity for array in found if array.ptr and array.deleter is not None)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", help="cpu, cuda:0 and so on; by default the first CUDA device, or the CPU without one.")
    parser.add_argument("--worlds", type=int, default=64, help="Number of worlds.")
    parser.add_argument("--steps", type=int, default=10, help="Number of control steps for each scene.")
    parser.add_argument(
        "--long", type=int, default=1000, help="Number of control steps of the comparison of air times and history; 0: none."
    )
    parser.add_argument(
        "--speed-worlds", type=int, help="Number of worlds for the speed; by default 64 on the CPU and 4096 on CUDA devices."
    )
    parser.add_argument(
        "--memory-worlds", type=int, nargs="*", default=(64, 256, 1024), help="Numbers of worlds for the table of memory."
    )
    parser.add_argument("--only", help="Name of the only scene to compare.")
    parser.add_argument("--write", action="store_true", help="Write the tables into docs/warp.md.")
    arguments = parser.parse_args()
    import mujoco
    import mujoco_warp as mjw
    import warp as wp

    wp.config.quiet = True
    device = arguments.device or ("cuda:0" if wp.is_cuda_available() else "cpu")
    scenes = {name: scene for name, scene in SCENES.items() if arguments.only in (None, name)}
    found = run(device, arguments.worlds, arguments.steps, scenes)
    name = platform.processor() or platform.machine() if device == "cpu" else wp.get_device(device).name
    versions = f"mujoco_warp {mjw.__version__}, Warp {wp.__version__}, MuJoCo {mujoco.__version__}"
    lines = [
        f"Device `{device}` ({name}), {versions}: {arguments.worlds} worlds, {arguments.steps} control steps in each of {len(scenes)} scenes.",
        "",
    ]
    lines += table(found)
    if arguments.long:
        lines += [
            "",
            "What contact sensors remember over many steps:",
            "",
            *long_run(device, min(arguments.worlds, 16), arguments.long),
        ]
    lines += ["", "Memory of the device:", "", *memory(device, arguments.memory_worlds)]
    lines += ["", "Speed:", "", *speed(device, arguments.speed_worlds or (64 if device == "cpu" else 4096))]
    print("\n".join(lines))
    if arguments.write:
        page = PAGE.read_text()
        before, after = page.split(BEGIN)[0], page.split(END)[1]
        PAGE.write_text(before + BEGIN + "\n" + "\n".join(lines) + "\n" + END + after)
    wrong = beyond(found)
    print("\n".join(wrong), file=sys.stderr)
    return bool(wrong)


if __name__ == "__main__":
    sys.exit(main())
