# SPDX-License-Identifier: Apache-2.0
"""mujoco_warp's set_const, set_const_0 and set_const_fixed with mjsense.compat.mujoco_warp.use() against its own kernels.

python mujoco_warp_constants.py
"""

import sys
import time
import warnings

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

wp.config.log_level = 40
wp.set_device("cpu")
warnings.simplefilter("ignore", DeprecationWarning)
import mjsense.compat.mujoco_warp as compat
from mjsense.compat import _warp_constants as constants

WORLDS = 4
MODEL = mujoco.MjModel.from_xml_string("""
<mujoco>
  <worldbody>
    <light pos="0 0 3" dir="0 .2 -1"/><camera pos="0 -2 1" xyaxes="1 0 0 0 1 1"/>
    <geom type="plane" size="5 5 .1"/>
    <body name="box" pos="0 0 .25"><freejoint/><geom type="box" size=".1 .1 .1"/><site name="middle"/>
      <camera name="eye" pos=".1 0 .2"/>
      <body pos=".1 0 .1"><joint name="first" axis="0 1 0" damping=".1"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
        <body name="tip" pos=".3 0 0"><joint name="second" axis="0 1 0" armature=".01"/><light pos="0 0 .1"/>
          <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/><site name="tip" pos=".3 0 0"/></body></body>
    </body>
    <body name="ball" pos="1 0 .3"><joint type="ball"/><geom size=".08" pos=".1 0 0"/></body>
  </worldbody>
  <tendon><fixed name="fixed"><joint joint="first" coef="1"/><joint joint="second" coef="-1"/></fixed>
    <spatial name="spatial" springlength=".2"><site site="middle"/><site site="tip"/></spatial></tendon>
  <actuator><position name="servo" joint="first" kp="20"/><motor joint="second"/><general tendon="fixed" gainprm="3"/></actuator>
</mujoco>""")
INPUTS = ("body_mass", "body_inertia", "body_ipos", "dof_armature", "qpos0", "body_pos")
FIELDS = (*constants._FIXED, *(name for name in (*constants._KINEMATICS, *constants._INERTIA) if name != "eq_data"))
POSITIONS = ("xpos", "xquat", "xipos", "geom_xpos", "site_xmat", "cam_xpos", "light_xpos", "subtree_com", "cdof", "cinert", "ten_length")
if hasattr(mjw, "SetConstGroup"):  # version 4.0 does not restore these
    POSITIONS = tuple(name for name in POSITIONS if not name.startswith(("cam", "light")))
POSITIONS += ("actuator_length", "crb", "M", "qpos", "qvel", "time")


def start(by_world=True):
    model, data = mjw.put_model(MODEL), mjw.put_data(MODEL, mujoco.MjData(MODEL), nworld=WORLDS, nconmax=40, njmax=150)
    for name in (*INPUTS, *FIELDS) if by_world else ():
        array = getattr(model, name)
        setattr(model, name, wp.array(np.repeat(array.numpy(), WORLDS, axis=0), dtype=array.dtype))
    mjw.step(model, data)
    return model, data


def randomize(model, seed, masses=True):
    rng = np.random.default_rng(seed)
    for name in INPUTS[0 if masses else 1 :]:
        values = getattr(model, name).numpy()
        if name in ("qpos0", "body_ipos"):
            values[:, -2:] += rng.uniform(-0.05, 0.05, values[:, -2:].shape)
        else:
            values *= rng.uniform(0.8, 1.2, values.shape)
    quat = model.qpos0.numpy()[:, -4:]
    quat /= np.linalg.norm(quat, axis=1)[:, None]


def compare(label, theirs, ours):
    for number, names in enumerate((FIELDS, POSITIONS)):
        for name in names:
            a, b = getattr(theirs[number], name).numpy(), getattr(ours[number], name).numpy()
            error = np.abs(a - b).max() / max(1e-3, np.abs(a).max())
            assert error < 2e-5, (label, name, error)
    print(f"{label}: {len(FIELDS)} fields of the model and {len(POSITIONS)} of the data equal mujoco_warp's")


def never(*args, **kwargs):
    raise AssertionError("mujoco_warp's own function is called")


own_functions = dict(compat._OWN)
for by_world in (True, False):
    own = start(by_world)
    compat.use()
    ours = start(by_world)
    compat.stop()
    for seed, name in enumerate(("set_const", "set_const_fixed", "set_const_0", "set_const", "set_const")):
        for model, _ in (own, ours):
            randomize(model, seed, name != "set_const_0")  # masses need set_const_fixed, too
        if seed == 4:  # what the program writes into a result is replaced
            for model, _ in (own, ours):
                model.dof_invweight0.fill_(7.0)
                model.body_subtreemass.fill_(7.0)
        getattr(mjw, name)(*own)
        compat.use()
        compat._OWN.update(dict.fromkeys(compat._CONSTANTS, never))
        getattr(mjw, name)(*ours)
        compat._OWN.update(own_functions)
        if name == "set_const_fixed":  # it leaves the others for the next call
            assert not np.allclose(ours[0].dof_invweight0.numpy(), start()[0].dof_invweight0.numpy(), rtol=1e-3)
            compat.stop()
            for model, data in (own, ours):
                mjw.kinematics(model, data)
            continue
        compat.stop()
        compare(f"{name}, {'a row for each world' if by_world else 'one row'}", own, ours)
    for _ in range(3):
        mjw.step(*own)
    compat.use()
    for _ in range(3):
        mjw.step(*ours)
    compat.stop()
    for name in ("qpos", "qvel"):
        np.testing.assert_allclose(getattr(own[1], name).numpy(), getattr(ours[1], name).numpy(), atol=2e-5)

# A model with something that cannot be derived by mjsense is left to mujoco_warp: a damping ratio, before 4.0.
if not hasattr(mjw, "SetConstGroup"):
    compat.use()
    model, data = start()
    model.actuator_biasprm.numpy()[0, 0, 1:3] = -20, 0.5
    mjw.set_const_0(model, data)
    assert model.actuator_biasprm.numpy()[0, 0, 2] < 0
    compat.stop()

spent = {}
for use in (False, True):
    if use:
        compat.use()
    model, data = start()
    mjw.set_const(model, data)
    randomize(model, 0)
    begun = time.process_time()
    mjw.set_const(model, data)
    spent[use] = time.process_time() - begun
compat.stop()
print(f"set_const of {WORLDS} worlds: {1e3 * spent[False]:.1f} ms of CPU time, with mjsense {1e3 * spent[True]:.1f} ms")
sys.exit(0)
