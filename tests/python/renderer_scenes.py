# SPDX-License-Identifier: Apache-2.0
"""Models for the tests of mjsense.Renderer."""

import pytest

import mjsense as mjs

mujoco = pytest.importorskip("mujoco")

BALL = """<mujoco><visual><map znear="0.01" zfar="50"/></visual><statistic extent="1" center="0 0 0"/>
<worldbody><light pos="0 0 3" castshadow="false"/>
<camera name="front" pos="0 -2.5 0" xyaxes="1 0 0 0 0 1" fovy="45"/><camera name="frontal" pos="0 -3 0" xyaxes="1 0 0 0 0 1"/>
<body name="ball" pos="0 0 0"><freejoint/><geom name="ball" size="0.5" rgba="1 0 0 1"/></body></worldbody></mujoco>"""

SHAPES = """<mujoco><visual><map znear="0.01" zfar="30"/></visual><statistic extent="2" center="0 0 .4"/>
<asset><texture name="sky" type="skybox" builtin="gradient" rgb1=".4 .6 .8" rgb2="0 0 .2" width="64" height="384"/>
<texture name="checks" type="2d" builtin="checker" rgb1=".2 .3 .4" rgb2=".8 .7 .6" width="128" height="128"/>
<texture name="cube" type="cube" builtin="checker" mark="cross" markrgb="1 1 1" rgb1=".7 .2 .2" rgb2=".2 .2 .7" width="64" height="64"/>
<material name="floor" texture="checks" texrepeat="4 4" texuniform="true" reflectance=".2"/>
<material name="box" texture="cube"/><material name="flat" texture="checks" texrepeat="2 2"/><material name="glass" rgba=".2 .8 .9 .4"/>
<mesh name="rock" vertex="0 0 0  .3 0 0  0 .3 0  0 0 .3  .25 .25 .1"/>
<hfield name="hill" nrow="3" ncol="3" size=".4 .4 .2 .05" elevation="0 1 0 2 3 1 0 1 0"/></asset>
<worldbody><light pos="1 -1 3" dir="-.3 .3 -1" diffuse=".7 .7 .7"/>
<light type="directional" dir=".5 .5 -1" pos="0 0 3" diffuse=".3 .3 .3" castshadow="false"/>
<camera name="view" pos="1.2 -1.6 1.2" xyaxes="1 .75 0 -.25 .35 .85"/><camera name="below" pos="1.6 -1.6 -.5" xyaxes="1 1 0 .2 -.2 1"/>
<camera name="flat" pos="1.2 -1.6 1.2" xyaxes="1 .75 0 -.25 .35 .85" projection="orthographic" fovy="2"/>
<camera name="sensor" pos="1.2 -1.6 1.2" xyaxes="1 .75 0 -.25 .35 .85" sensorsize=".01 .008" focal=".01 .01" principal=".001 .0005"
 resolution="640 480"/>
<geom name="floor" type="plane" size="0 0 .1" material="floor"/><geom type="plane" size=".3 .2 .1" pos="-.8 .8 .3" euler="40 0 20" material="flat"/>
<geom type="hfield" hfield="hill" pos="-.8 -.4 .02" rgba=".3 .7 .3 1"/>
<body pos="0 0 .5"><freejoint/><geom type="sphere" size=".15" material="flat"/></body>
<body name="arm" pos=".5 0 .3"><joint type="hinge" axis="0 1 0"/><geom type="capsule" size=".08 .2" rgba=".9 .4 .2 1"/>
 <site name="a" pos="0 0 .35" size=".05"/><body pos="0 0 .4"><joint type="hinge" axis="1 0 0"/><geom type="box" size=".1 .06 .08" material="box"/>
 <site name="b" type="box" size=".04 .02 .06" pos="0 0 .12" rgba="0 1 0 .5"/></body></body>
<body pos="0 .6 .3"><joint type="slide" axis="0 0 1"/><geom type="cylinder" size=".1 .2" material="flat"/><site name="c" pos="0 0 .3"/></body>
<body pos="-.4 .1 .3"><joint type="ball"/><geom type="ellipsoid" size=".1 .15 .2" rgba=".6 .2 .8 1"/></body>
<body pos=".4 -.6 .1"><freejoint/><geom type="mesh" mesh="rock" rgba=".9 .9 .3 1"/></body>
<body pos="-.2 -.6 .2"><freejoint/><geom type="box" size=".15 .15 .15" material="glass"/></body></worldbody>
<tendon><spatial width=".01" rgba="1 0 0 1"><site site="a"/><site site="b"/><site site="c"/></spatial></tendon></mujoco>"""

SOFT = """<mujoco><statistic extent="1" center="0 0 .3"/><worldbody><light pos="0 -1 2" dir="0 .5 -1"/>
<camera name="view" pos="0 -1.6 .9" xyaxes="1 0 0 0 .4 .9"/><geom type="plane" size="1 1 .1"/>
<flexcomp name="cloth" type="grid" dim="2" count="6 6 1" spacing=".08 .08 .08" pos="-.3 0 .4" radius=".01" rgba=".2 .6 .9 1" mass=".1"/>
<flexcomp name="gel" type="grid" dim="3" count="4 4 4" spacing=".07 .07 .07" pos=".3 0 .3" radius=".01" rgba=".9 .5 .2 1" mass=".1"/>
<flexcomp name="rope" type="grid" dim="1" count="8 1 1" spacing=".05 .05 .05" pos="0 -.3 .3" radius=".01" rgba=".3 .9 .3 1" mass=".1"/>
</worldbody></mujoco>"""


def load(xml, steps=0):
    if not hasattr(mujoco.MjModel, "cam_projection"):  # older versions
        xml = xml.replace('projection="orthographic"', 'orthographic="true"')
    if not hasattr(mujoco.MjModel, "light_type"):
        xml = xml.replace('type="directional"', 'directional="true"')
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    for _ in range(steps):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return model, data


def image_of(model, data, camera=-1, option=None, **kwargs):
    with mjs.Renderer(model, 60, 80, **kwargs) as renderer:
        renderer.update_scene(data, camera, option)
        return renderer.render()
