# SPDX-License-Identifier: Apache-2.0
"""mjsense.attach with any MuJoCo: measurements are those of its own functions, within the bounds of docs/attach.md. Prints the deviations.

Run by test_other_mujocos.py.
"""

import types

import mujoco
import numpy as np

import mjsense as mjs
from mjsense.sim import foreign_model

MODEL = """
<mujoco>
  <option timestep="0.004"/>
  <asset>
    <texture name="checker" type="2d" builtin="checker" rgb1="1 1 1" rgb2="0 0 0" width="16" height="16"/>
    <material name="checker" texture="checker"/>
    <mesh name="rock" vertex="0 0 0 .2 0 0 0 .2 0 0 0 .2 .1 .1 .15"/>
    <hfield name="hill" nrow="4" ncol="4" size="1 1 .2 .1"/>
  </asset>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="5 5 .1" material="checker"/>
    <geom type="hfield" hfield="hill" pos="3 3 0"/>
    <camera name="front" pos="0 -2 1" xyaxes="1 0 0 0 .5 1"/>
    <body name="box" pos="0 0 .3" gravcomp=".1"><freejoint/><geom type="box" size=".1 .1 .1" rgba="1 0 0 1"/><site name="imu"/></body>
    <body name="rock" pos="1 0 .4"><freejoint/><geom name="rock" type="mesh" mesh="rock"/></body>
    <body name="target" mocap="true" pos="1 1 1"><geom size=".05" contype="0" conaffinity="0"/></body>
    <body name="arm" pos=".5 1 .5">
      <joint name="shoulder" axis="0 1 0"/><geom name="upper" type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
      <body pos=".3 0 0">
        <joint name="wrist" type="ball"/><geom type="capsule" fromto="0 0 0 .2 0 0" size=".03"/><site name="tip" pos=".2 0 0"/>
        <body pos=".2 0 0"><joint name="slide" type="slide" axis="1 0 0" range="-.1 .1"/><geom name="ball" size=".04"/></body>
      </body>
    </body>
  </worldbody>
  <equality><weld body1="box" body2="target" active="false"/><joint joint1="shoulder" joint2="slide"/></equality>
  <contact><exclude body1="box" body2="arm"/></contact>
  <tendon>
    <fixed name="fixed"><joint joint="shoulder" coef="1"/><joint joint="slide" coef="2"/></fixed>
    <spatial name="spatial" range="0 2"><site site="imu"/><geom geom="ball"/><site site="tip"/></spatial>
  </tendon>
  <actuator>
    <motor joint="shoulder" ctrlrange="-1 1"/><position tendon="fixed" kp="1"/>
    <general joint="slide" dyntype="filter" dynprm=".1" biastype="affine" biasprm="0 -1 0"/>
  </actuator>
  <sensor>
    <framepos name="pos" objtype="site" objname="tip"/><framequat name="quat" objtype="body" objname="rock"/><jointpos name="angle" joint="shoulder"/>
    <tendonpos name="length" tendon="spatial"/><rangefinder name="range" site="tip"/><subtreecom name="com" body="arm"/>
    <gyro name="gyro" site="imu"/><velocimeter name="speed" site="tip"/><tendonvel name="rate" tendon="spatial"/>
    <distance name="distance" geom1="ball" geom2="upper" cutoff="5"/><clock name="clock"/>
    <accelerometer name="acc" site="imu"/><force name="force" site="tip"/><torque name="torque" site="tip"/><touch name="touch" site="imu"/>
    <actuatorfrc name="push" actuator="ACTUATOR"/><framelinacc name="a" objtype="body" objname="rock"/>
  </sensor>
</mujoco>""".replace('<motor joint="shoulder"', '<motor name="motor" joint="shoulder"').replace("ACTUATOR", "motor")

model = mujoco.MjModel.from_xml_string(MODEL)
datas = [mujoco.MjData(model) for _ in range(2)]
for world, data in enumerate(datas):
    data.qvel[:3], data.ctrl[:] = [0.1, 0.2 * world, 0], 0.3
sensors = (
    mjs.ImuSensorCfg(name="imu", site=mjs.ObjRef("site", "imu")),
    mjs.CameraSensorCfg(name="front", camera_name="front", width=32, height=24, data_types=("rgb", "segmentation")),
    mjs.CameraSensorCfg(name="mounted", parent_body="box", pos=(0, 0, 0.2), width=16, height=12, data_types=("depth",)),
    mjs.ContactSensorCfg(name="feet", primary=mjs.ContactMatch(mode="geom", pattern=("rock", "geom_2")), fields=("found",), track_air_time=True),
    mjs.TerrainHeightSensorCfg(name="height", frame=mjs.ObjRef("site", "tip")),
)
attached = mjs.attach(model, datas, sensors)
own = mujoco.MjData(model)
names = [model.sensor(i).name for i in range(model.nsensor)]
worst = dict.fromkeys(names, 0.0)
air, contacts = np.zeros(2), 0
for step in range(200):
    for data in datas:
        mujoco.mj_step(model, data)
    attached.update()
    for world, data in enumerate(datas):
        for field in ("qpos", "qvel", "act", "ctrl", "qacc_warmstart"):
            getattr(own, field)[:] = getattr(data, field)
        own.time = data.time
        mujoco.mj_forward(model, own)
        for name in names:
            expected, found = own.sensor(name).data, attached[name].data[world]
            worst[name] = max(worst[name], float(np.max(np.abs(found - expected)) / max(1.0, np.max(np.abs(expected)))))
        touched = any({model.geom("rock").id} & {c.geom1, c.geom2} for c in own.contact)
        contacts += touched
        air[world] = 0 if touched else air[world] + model.opt.timestep
        assert bool(attached["feet"].data.found[world, 0]) == touched
        assert abs(attached["feet"].data.current_air_time[world, 0] - air[world]) < 1e-6
assert 20 < contacts < 380
if hasattr(model, "M_rownnz"):
    for name, value in foreign_model._sparse_matrices(model).items():
        np.testing.assert_array_equal(value, getattr(model, name), name)
position = max(worst[n] for n in ("pos", "quat", "angle", "length", "range", "com", "distance", "clock"))
velocity = max(worst[n] for n in ("gyro", "speed", "rate"))
force = max(worst[n] for n in ("acc", "force", "torque", "touch", "push", "a"))
print(f"MuJoCo {mujoco.mj_versionString()}: positions {position:.1e}, velocities {velocity:.1e}, accelerations and forces {force:.1e}")
assert position < 1e-6 and velocity < 1e-6 and force < 1e-3, worst
assert attached["front"].data.rgb.std() > 10 and np.isfinite(attached["mounted"].data.depth).all()
assert np.allclose(attached["imu"].data.gyro, attached["gyro"].data)
before = attached["front"].data.rgb.copy()
model.geom_rgba[2] = [0, 1, 0, 1]
attached.reload()
assert not np.array_equal(before, attached["front"].data.rgb)
if not mujoco.mj_versionString().startswith("4.0"):
    FLEX = '<mujoco><worldbody><flexcomp name="f" type="grid" count="2 2 1" spacing=".1 .1 .1" dim="2"/></worldbody></mujoco>'
    soft = mujoco.MjModel.from_xml_string(FLEX)
    try:
        mjs.attach(soft, mujoco.MjData(soft))
    except ValueError as error:
        assert "the model has flexes" in str(error), error
    else:
        raise AssertionError("a model with flexes was attached")
    try:
        foreign_model._refuse_unknown(types.SimpleNamespace(geom_smell=np.ones(3)), attached.simulation.model, "5.0")
    except ValueError as error:
        assert "the model of MuJoCo 5.0 has geom_smell, which mjsense's MuJoCo 4.0 does not know" in str(error), error
    else:
        raise AssertionError("an unknown field was accepted")
attached.close()

CHANGED = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1" pos="0 0 -3"/><site name="high" pos="0 0 2"/>
    <body name="static" pos="0 0 1">
      <geom size=".1"/><site name="static"/>
      <body pos=".3 0 0"><joint axis="0 1 0"/><geom size=".1" contype="0" conaffinity="0"/><site name="tip" pos=".2 0 0"/></body>
    </body>
    <geom name="one" type="box" size=".1 .12 .08"/>
    <body pos=".23 .06 .3" quat=".1 2.1 .6 -.6"><joint/><geom name="two" type="box" size=".1 .12 .08"/></body>
  </worldbody>
  <tendon><spatial stiffness="10" springlength="0"><site site="high"/><site site="tip"/></spatial></tendon>
  <sensor>
    <accelerometer name="acceleration of a static body" site="static"/>
    <force name="force of a spatial tendon" site="static"/>
    <contact name="net force without a contact" geom1="floor" geom2="one" reduce="netforce" data="normal tangent"/>
    <distance name="distance of boxes" geom1="one" geom2="two" cutoff="5"/>
  </sensor>
</mujoco>"""
"""Sensors of which the table in docs/attach.md says that MuJoCo has changed them."""
EXPECTED = {
    "acceleration of a static body": ([0, 0, 9.81], [0, 0, 0]),
    "force of a spatial tendon": ([5, 0, 72.184064], [0, 0, 82.184064]),
    "net force without a contact": ([0, 0, 0, 0, 0, 0], [1, 0, 0, 0, 1, 0]),
    "distance of boxes": ([0.1557198], [0]),
}
"""Measurement -> value of mjsense and MuJoCo 4.0, and of MuJoCo 3.8 to 3.11."""
version = tuple(map(int, mujoco.mj_versionString().split(".")))
if version >= (3, 8):
    model = mujoco.MjModel.from_xml_string(CHANGED)
    data = mujoco.MjData(model)
    attached = mjs.attach(model, data)
    mujoco.mj_forward(model, data)
    for name, (ours, old) in EXPECTED.items():
        np.testing.assert_allclose(attached[name].data[0], ours, atol=1e-5, err_msg=name)
        if version < (3, 12) or version >= (4,):
            np.testing.assert_allclose(data.sensor(name).data, old if version < (4,) else ours, atol=1e-5, err_msg=name)
    attached.close()
