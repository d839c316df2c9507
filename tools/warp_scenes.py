# SPDX-License-Identifier: Apache-2.0
"""The scenes in which tools/gpu_check.py compares the backends."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import mjsense as mjs
from mjsense.sensors import effects

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
        <geom name="arm" type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".4"/><site name="hand" pos=".3 0 0"
        size=".04"/></body>
    </body>
  </worldbody>
  <tendon><fixed name="difference"><joint joint="left" coef="1"/><joint joint="right" coef="-1"/></fixed></tendon>
  <actuator><motor name="left" joint="left"/><motor name="right" joint="right"/><motor name="arm" joint="arm"
  gear="3"/></actuator>
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
            "feet",
            feet,
            ground,
            EVERY_FIELD,
            num_slots=2,
            track_air_time=True,
            history_length=3,
            track_events=True,
            latch=True,
            friction_split=True,
            other_ids=True,
        ),
        mjs.ContactSensorCfg(
            "net", feet, ground, ("found", "force", "torque", "pos"), reduce="netforce", latch=True, other_ids=True
        ),
        mjs.ContactSensorCfg("deepest", feet, ground, ("found", "dist", "pos"), reduce="mindist", global_frame=False),
        mjs.ContactSensorCfg("legs", mjs.ContactMatch("subtree", ".*_hip", "robot"), None, EVERY_FIELD, global_frame=True),
        mjs.RayCastSensorCfg("scan", base, mjs.GridPatternCfg(size=(1.0, 0.6), resolution=0.1), ray_alignment="yaw"),
        mjs.TerrainHeightSensorCfg("height", base, mjs.GridPatternCfg(size=(0.2, 0.2), resolution=0.1)),
        mjs.LidarSensorCfg("lidar", base, scan=mjs.SpinningScanCfg(channels=4, samples=24), range_noise_std=0.01, dropout=0.05),
        mjs.ImuSensorCfg("imu", base, "mpu6050", orientation=True),
        mjs.EffectSensorCfg(
            "noisy",
            "imu",
            effects=(effects.EpisodeBias(effects.Gaussian(0.05)), effects.Noise(effects.Gaussian(0.1)), effects.Delay(0.02)),
        ),
    )


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
        entities=things,
        terrain=mjs.TerrainCfg(),
        sensors=(
            mjs.ContactSensorCfg("contacts", every, None, EVERY_FIELD, num_slots=6, other_ids=True),
            mjs.ContactSensorCfg("pairs", every, every, ("found",), secondary_policy="each"),
            mjs.ContactSensorCfg(
                "any", mjs.ContactMatch("subtree", "trunk", "robot"), None, ("found", "dist"), reduce="none", num_slots=8
            ),
            mjs.CameraSensorCfg("eye", camera_name="robot/eye", width=32, height=24, data_types=("rgb", "depth", "segmentation")),
        ),
    )


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
    """The scene of a task with its robot; the worlds start where its first episodes do, and the model where the first does,
    because all objects of a task are in one place in its own model."""

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
