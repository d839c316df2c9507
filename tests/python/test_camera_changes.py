# SPDX-License-Identifier: Apache-2.0
"""A fixed camera renders only the parts of an image that may have changed. Its images equal those of a simulation without earlier images."""

import numpy as np
import pytest

import mjsense as mjs

SCENE = """
<mujoco>
  <asset><texture name="checks" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .7 .6" width="64" height="64"/>
    <material name="floor" texture="checks" texrepeat="4 4" reflectance="{reflectance}"/>
    <mesh name="rock" vertex="0 0 0  .3 0 0  0 .3 0  0 0 .3  .25 .25 .1"/></asset>
  <worldbody>
    <light name="sun" pos="1 -1 3" dir="-.3 .3 -1"/><light name="bulb" pos="-1 0 1.5" cutoff="120"/>
    <camera name="eye" pos="0 -2.5 1.5" xyaxes="1 0 0 0 .5 .85"/>
    <geom name="floor" type="plane" size="3 3 .1" material="floor"/>
    <geom name="wall" type="box" size="2 .05 1" pos="0 1.5 1"/>
    <body name="ball" pos="-.5 0 .8"><freejoint/><geom size=".15" rgba="1 0 0 1"/></body>
    <body name="box" pos=".5 .3 .6"><freejoint/><geom type="box" size=".1 .2 .1" rgba="0 1 0 .5"/></body>
    <body name="stone" pos="0 .5 1"><freejoint/><geom type="mesh" mesh="rock"/></body>
    <body name="arm" pos="1 .5 .5"><joint name="hinge" type="hinge" axis="0 1 0"/><geom type="capsule" size=".05 .3"/></body>
  </worldbody>
</mujoco>
"""
KINDS = ("rgb", "depth", "segmentation", "normals")


def make(worlds, threads, reflectance, **camera):
    cfg = mjs.CameraSensorCfg(name="view", camera_name="eye", data_types=KINDS, use_shadows=True, **camera)
    scene = mjs.Scene(mjs.SceneCfg(base=SCENE.format(reflectance=reflectance), sensors=(cfg,)))
    return scene, mjs.Simulation(scene, num_worlds=worlds, threads=threads)


def images(scene):
    return {kind: getattr(scene["view"].data, kind).copy() for kind in KINDS}


@pytest.mark.parametrize(
    ("worlds", "threads", "reflectance", "camera"),
    [
        (1, 2, 0, {"width": 140, "height": 100}),
        (6, 1, 0, {"width": 60, "height": 50}),
        (6, 2, 0.2, {"width": 60, "height": 50}),
        (2, 2, 0, {"width": 60, "height": 50, "samples": 4}),
    ],
)
def test_images_equal_those_of_a_new_simulation(worlds, threads, reflectance, camera):
    scene, sim = make(worlds, threads, reflectance, **camera)
    rng = np.random.default_rng(0)
    fields = {}

    def randomize(name, world_ids, spread):
        value = np.broadcast_to(fields.get(name, getattr(sim.model, name)), (worlds, *getattr(sim.model, name).shape)).copy()
        value[world_ids] += rng.uniform(-spread, spread, value[world_ids].shape)
        fields[name] = value
        sim.randomize(name, value)

    different = 0
    last = None
    for step in range(24):
        if step % 8 == 3:
            randomize("geom_rgba", [0], 0.1)
        elif step % 8 == 5:
            randomize("light_pos", [worlds - 1], 0.2)
        elif step % 8 == 7:
            randomize("cam_pos", [0], 0.05)
        elif step == 12:
            sim.reset([0])
        elif step == 14:
            sim.qpos[0, 0] = np.nan
            sim.forward()
        elif step == 15:
            sim.reset([0])
        else:
            sim.step()
        found = images(scene)
        other_scene, other = make(worlds, threads, reflectance, **camera)
        for name, value in fields.items():
            other.randomize(name, value)
        other.qpos[:] = sim.qpos
        other.forward()
        for kind, image in images(other_scene).items():
            np.testing.assert_array_equal(found[kind], image, err_msg=f"{kind} in step {step}")
        different += last is not None and (found["rgb"] != last).any()
        last = found["rgb"]
    assert different > 12
