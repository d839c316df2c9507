# SPDX-License-Identifier: Apache-2.0
"""mjsense.compat.mujoco_warp against mujoco_warp's own kernels on the CPU: every field, rays, models by world, and errors.

python mujoco_warp_use.py PAGE

PAGE is docs/mujoco_warp.md, whose example runs, and whose list of fields that stay as they are must be complete.
"""

import copy
import re
import sys
import threading
from pathlib import Path

import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp
from mujoco_warp import step as step_of_a_module

wp.config.log_level = 40
wp.set_device("cpu")
WORLDS = 8
MODEL = mujoco.MjModel.from_xml_string("""
<mujoco>
  <option timestep=".004" integrator="implicitfast" tolerance="1e-6"><flag energy="enable"/></option>
  <worldbody>
    <light pos="0 0 3"/><camera pos="0 -2 1"/>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <geom type="box" size=".3 .3 .05" pos="1 0 .05" group="3"/>
    <body name="hand" mocap="true" pos="0 1 1"><geom size=".05" contype="0" conaffinity="0"/></body>
    <body name="box" pos="0 0 .25"><freejoint/><geom type="box" size=".1 .1 .1"/><site name="middle"/>
      <body pos=".1 0 .1"><joint name="first" axis="0 1 0" damping=".1" range="-1 1"/><geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
        <body name="tip" pos=".3 0 0"><joint name="second" axis="0 1 0" armature=".01" frictionloss=".05"/>
          <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03"/><site name="tip" pos=".3 0 0"/></body></body>
    </body>
    <body name="ball" pos="1 0 .3"><freejoint/><geom size=".08"/></body>
  </worldbody>
  <tendon><fixed name="fixed"><joint joint="first" coef="1"/><joint joint="second" coef="-1"/></fixed>
    <spatial name="spatial"><site site="middle"/><site site="tip"/></spatial></tendon>
  <actuator><position name="servo" joint="first" kp="20"/><motor joint="second"/>
    <general tendon="fixed" gainprm="3" dyntype="filter" dynprm=".05"/></actuator>
  <equality><connect body1="ball" body2="hand" anchor="0 0 .2" active="false"/></equality>
  <sensor><accelerometer site="tip"/><gyro site="middle"/><framepos objtype="body" objname="tip"/><touch site="middle"/>
    <jointpos joint="first"/><actuatorfrc actuator="servo"/><subtreecom body="box"/><tendonpos tendon="spatial"/>
    <contact geom1="floor" num="2" data="found force"/></sensor>
</mujoco>""")
BOUNDS = {"default": 2e-5, "efc.state": 2, "efc.id": 9, "contact.geomcollisionid": 9}
"""Largest difference of a field, of its largest number. The others are numbered in another way."""


def start(nconmax=40, njmax=150, source=MODEL):
    rng = np.random.default_rng(0)
    data = mujoco.MjData(MODEL)
    mujoco.mj_forward(MODEL, data)
    model, worlds = mjw.put_model(source), mjw.put_data(MODEL, data, nworld=WORLDS, nconmax=nconmax, njmax=njmax)
    worlds.qpos.numpy()[:, 2] += rng.uniform(-0.2, 0.1, WORLDS)
    worlds.qpos.numpy()[:, 7:9] = rng.uniform(-0.5, 0.5, (WORLDS, 2))
    worlds.qvel.numpy()[:] = rng.normal(0, 0.3, (WORLDS, MODEL.nv))
    worlds.ctrl.numpy()[:] = rng.uniform(-1, 1, (WORLDS, MODEL.nu))
    worlds.xfrc_applied.numpy()[:, 2, :3] = rng.normal(0, 1, (WORLDS, 3))
    return model, worlds


def value(data, name):
    """The numbers of a field: of constraints and contacts those that there are, contacts in the order of worlds, geoms and places."""
    part = {"efc": data.efc, "contact": data.contact}.get(name.partition(".")[0], data)
    array = getattr(part, name.rpartition(".")[2]).numpy().astype(float)
    if part is data.efc:
        return np.concatenate([row[:count] for row, count in zip(array, data.nefc.numpy(), strict=True)])
    if part is data.contact:
        count = data.nacon.numpy()[0]
        keys = [*data.contact.pos.numpy()[:count].round(4).T, *data.contact.geom.numpy()[:count].T, data.contact.worldid.numpy()[:count]]
        return array[:count][np.lexsort(keys)] if array.size else array
    return array


def compare(theirs, ours, names, bounds, label):
    assert theirs.nacon.numpy()[0] == ours.nacon.numpy()[0] > 0
    worst = ("", 0.0)
    for name in names:
        a, b = value(theirs, name), value(ours, name)
        if a.size:
            error = np.abs(a - b).max() / max(1e-3, np.abs(a).max())
            assert error <= bounds.get(name, bounds["default"]), (label, name, error)
            worst = max(worst, (name, error), key=lambda one: one[1] if one[0] not in BOUNDS else 0)
    print(f"{label}: {len(names)} fields; largest difference {worst[1]:.1e} of the largest number, of {worst[0]}")


def raises(kind, text, call):
    try:
        call()
    except kind as error:
        assert re.search(text, str(error)), error
    else:
        raise AssertionError(f"no error: {text}")


own = start()
mjw.step(*own)
before = [mjw.step]  # a list: names of modules are replaced, too
import mjsense.compat.mujoco_warp as compat
from mjsense.compat import _warp_graphs as graphs

with compat.used():
    assert step_of_a_module is mjw.step is not before[0]
    ours = start()
    mjw.step(*ours)
    worlds = compat.worlds_of(*ours)
    names = [name for name in worlds.shown if name != "nacon"]
    compare(own[1], ours[1], names, BOUNDS, "one step")
    page = Path(sys.argv[1]).read_text()
    listed = re.search(r"^## Fields that stay as they are\n(.*?)^## ", page, re.MULTILINE | re.DOTALL)[1]
    left = {name for name in re.findall(r"`([\w.]+)`", listed) if name in names or name in worlds.left}
    assert left == {*worlds.left}, sorted(left ^ {*worlds.left})
assert mjw.step is before[0]

# Both cast the same rays and step; then forward(), a reset, and a model that was randomised.
rng = np.random.default_rng(1)
origins = wp.array(rng.uniform(-1, 1, (WORLDS, 50, 3)) + (0, 0, 2), dtype=wp.vec3)
directions = wp.array(rng.normal(0, 1, (WORLDS, 50, 3)) - (0, 0, 2), dtype=wp.vec3)
exclude = wp.array([-1] * 30 + [2] * 20, dtype=int)
groups = wp.types.vector(length=6, dtype=float)
hits = []
for model, data in (own, ours):
    use = data is ours[1]
    if use:
        compat.use()
    found = []
    for wanted, static in ((groups(*[-1] * 6), True), (groups(-1, 0, 0, 0, 0, 0), True), (groups(*[-1] * 6), False)):
        distance, geom = wp.zeros((WORLDS, 50), dtype=float), wp.zeros((WORLDS, 50), dtype=int)
        normal = wp.zeros((WORLDS, 50), dtype=wp.vec3)
        mjw.rays(model, data, origins, directions, wanted, static, exclude, distance, geom, normal)
        found.append((geom.numpy(), distance.numpy(), normal.numpy()))
    hits.append(found)
    for _ in range(5):
        mjw.step(model, data)
    for name, factor in (("body_mass", 1.2), ("geom_friction", 0.5), ("dof_damping", 2.0)):
        array = getattr(model, name)
        rows = np.repeat(array.numpy(), WORLDS, axis=0)
        rows[::2] *= factor
        setattr(model, name, wp.array(rows, dtype=array.dtype))
    mjw.set_const(model, data)
    model.opt.gravity.numpy()[0, 0] = 1
    model.opt.iterations = 50
    mask = wp.array([world == 3 for world in range(WORLDS)], dtype=bool)
    mjw.reset_data(model, data, reset=mask)
    data.eq_active.numpy()[5] = True
    data.mocap_pos.numpy()[5, 0, 2] = 0.6
    data.qpos.numpy()[3, 2] = 0.4
    for _ in range(30):
        mjw.step(model, data)
    mjw.forward(model, data)
for (geom, distance, normal), (our_geom, our_distance, our_normal) in zip(*hits, strict=True):
    same = geom == our_geom
    assert same.all()
    np.testing.assert_allclose(our_distance[same], distance[same], atol=5e-6)
    np.testing.assert_allclose(our_normal[same & (geom >= 0)], normal[same & (geom >= 0)], atol=1e-4)
    assert len({*geom.ravel().tolist()}) > 2
for name in ("qpos", "qvel", "time", "xpos", "geom_xpos", "qfrc_actuator", "energy", "act", "act_dot"):
    a, b = (value(data, name).reshape(WORLDS, -1) for data in (own[1], ours[1]))
    errors = np.sort(np.abs(a - b).max(1) / np.abs(a).max())  # worlds whose contacts begin a step later differ more
    print(f"36 steps: {name} differs by {np.median(errors):.1e} (median of the worlds), {errors[-1]:.1e} (largest)")
    assert np.median(errors) < 1e-5, name
    assert errors[-1] < 0.1, name
assert not ours[1].overflow.numpy().any()

# Errors.
for room in (0, 1):
    few = start(nconmax=room)
    few[1].qpos.numpy()[:, 2] = 0.09
    text = rf"worlds have \d+ contacts, and the data has room for {8 * room}: make it with nconmax=\d+"
    raises(ValueError, text, lambda few=few: mjw.step(*few))
small = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>")
raises(ValueError, "this Data belongs to another model: its qpos has the shape", lambda: mjw.step(mjw.put_model(small), ours[1]))
raises(ValueError, r"call use\(\) before mujoco_warp.put_model", lambda: mjw.step(own[0], own[1]))
raises(ValueError, r"call use\(\) before", lambda: mjw.step(copy.copy(ours[0]), ours[1]))
ours[0].geom_bodyid.numpy()[1] = 77
raises(ValueError, "geom_bodyid", lambda: mjw.step(*ours))
again = start()
mjw.step(*again)
raises(ValueError, "reset must be", lambda: mjw.reset_data(*again, reset=wp.array([1.0] * WORLDS, dtype=float)))
linked = again[1].xpos
again[1].xpos = wp.zeros((WORLDS, 2 * MODEL.nbody), dtype=wp.vec3)[:, ::2]
raises(ValueError, "xpos is not contiguous", lambda: mjw.step(*again))
again[1].xpos = linked
for part, name, array, text in (
    (again[1], "qpos", wp.zeros((WORLDS, MODEL.nq + 1), dtype=float), r"qpos of the data has the shape \(8, 17\), expected \(8, 16\)"),
    (again[1], "qpos", wp.zeros((WORLDS // 2, MODEL.nq * 2), dtype=float), r"qpos of the data has the shape \(4, 32\), expected"),
    (again[1], "qvel", wp.zeros((WORLDS, MODEL.nv), dtype=wp.float64), "qvel of the data has elements of float64, expected float32"),
    (again[1], "sensordata", wp.zeros((WORLDS, 1), dtype=float), r"sensordata of the data has the shape \(8, 1\), expected"),
    (again[1].contact, "dist", wp.zeros(3, dtype=float), r"contact\.dist of the data has the shape \(3,\), expected \(320,\)"),
    (again[0], "body_mass", wp.zeros((1, 3), dtype=float), r"body_mass of the model has the shape \(1, 3\), expected \('\*', 6\)"),
    (again[0], "body_mass", wp.zeros((0, 6), dtype=float), r"body_mass of the model has the shape \(0, 6\)"),
):
    kept = getattr(part, name)
    setattr(part, name, array)
    raises(ValueError, text, lambda: mjw.step(*again))
    raises(ValueError, text, lambda: mjw.step(*again))  # and no later step uses it
    setattr(part, name, kept)
    mjw.step(*again)

# Geometry that a program changes in place is found within as many steps as it has parts of 64 KB.
points = " ".join(f"{x} {y} {z}" for x in (-1, 1) for y in (-1, 1) for z in (-1, 1))
heights = "".join(f'<hfield name="h{i}" nrow="150" ncol="150" size="1 1 1 1"/>' for i in range(2))
shaped = mujoco.MjModel.from_xml_string(f"""<mujoco><asset><mesh name="cube" vertex="{points}"/>{heights}</asset><worldbody>
    <geom type="hfield" hfield="h0"/><geom type="hfield" hfield="h1"/><body pos="0 0 9"><freejoint/><geom type="mesh" mesh="cube"/></body>
    </worldbody></mujoco>""")
for name in ("mesh_vert", "hfield_data"):
    shapes = mjw.put_model(shaped), mjw.put_data(shaped, mujoco.MjData(shaped), nworld=2)
    for _ in range(12):
        mjw.step(*shapes)
    getattr(shapes[0], name).numpy().ravel()[-1] += 0.5
    raises(ValueError, f"{name} cannot be changed after put_model", lambda shapes=shapes: [mjw.step(*shapes) for _ in range(12)])
shapes = None
version = compat.importlib.metadata.version
compat.importlib.metadata.version = lambda name: "3.10.2"
raises(ImportError, r"is tested with mujoco-warp 3\.11 to 4\.0, and 3\.10\.2 is installed", compat.use)
compat.importlib.metadata.version = version

# The worlds use what is changed between put_model() and the first step, in place, and with new arrays for each world.
changed = copy.copy(MODEL)
changed.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_GRAVITY)
changed.opt.impratio, changed.opt.iterations = 4, 3
early, known = start(), start(source=changed)
pairs = [early, start(), known]
for number, (model, data) in enumerate(pairs[:2]):
    if number:
        mjw.forward(model, data)
    model.opt.disableflags, model.opt.iterations = changed.opt.disableflags, 3
    if number:
        model.opt.impratio_invsqrt = wp.array([0.5] * WORLDS, dtype=float)
    else:
        model.opt.impratio_invsqrt.fill_(0.5)
mjw.forward(*known)
for model, data in pairs:
    for _ in range(30):
        mjw.step(model, data)
for _, data in pairs[:2]:
    np.testing.assert_allclose(data.qpos.numpy(), known[1].qpos.numpy(), atol=1e-5)

# The same rays in all worlds, from poses that the program has computed; and a reset by integers.
mjw.step(*again)
assert "nacon" in compat.worlds_of(*again).shown  # after the error, everything was linked anew
again[1].qpos.numpy()[:, :3] = (0, 0, 3)
again[1].qpos.numpy()[:, 3:7] = (1, 0, 0, 0)
again[1].qpos.numpy()[4, 2] = 4
mjw.kinematics(*again)
down = [wp.array([[point]], dtype=wp.vec3) for point in ((0, 0, 5), (0, 0, -1))]
distance, geom, normal = wp.zeros((WORLDS, 1), dtype=float), wp.zeros((WORLDS, 1), dtype=int), wp.zeros((WORLDS, 1), dtype=wp.vec3)
mjw.rays(*again, *down, groups(*[-1] * 6), True, wp.array([-1], dtype=int), distance, geom, normal)
np.testing.assert_allclose(distance.numpy()[:, 0], [1.9] * 4 + [0.9] + [1.9] * 3, atol=1e-5)
before_reset = again[1].qpos.numpy().copy()
mjw.reset_data(*again, reset=wp.array([2, 0, 0, 1, 0, 0, 0, 0], dtype=int))
assert (again[1].qpos.numpy() != before_reset).any(1).tolist() == [True, False, False, True] + [False] * 4

# A program's functions for the model are called, so that mujoco_warp's own kernels step it.
called = start()
called[0].callback.control = lambda model, data: data.ctrl.fill_(0.5)
mjw.step(*called)
assert (called[1].ctrl.numpy() == 0.5).all()
called[0].callback.control, called[0].opt.run_collision_detection = None, False
mjw.step(*called)
assert id(called[1]) not in compat._worlds

if not mujoco.__version__.startswith("4."):
    soft = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><flexcomp name="cloth" type="grid" count="3 3 1" spacing=".1 .1 .1" dim="2"
        mass="1"/></worldbody></mujoco>""")
    pair = mjw.put_model(soft), mjw.put_data(soft, mujoco.MjData(soft))
    raises(ValueError, r"^mujoco_warp on the CPU: the model has flexes, which cannot be simulated from MuJoCo 3", lambda pair=pair: mjw.step(*pair))
    pair = None

# A graph steps when it is launched, not while it is captured, in the order of its other kernels; and errors are raised then.
graphed, direct = start(), start()
at_first = graphed[1].qpos.numpy().copy()
with wp.ScopedCapture() as capture:
    for _ in range(2):
        mjw.step(*graphed)
        wp.copy(graphed[1].ctrl, graphed[1].qpos.flatten()[: graphed[1].ctrl.size].reshape(graphed[1].ctrl.shape))
np.testing.assert_array_equal(graphed[1].qpos.numpy(), at_first)
for _ in range(3):
    wp.capture_launch(capture.graph)
for _ in range(6):
    mjw.step(*direct)
    direct[1].ctrl.numpy()[:] = direct[1].qpos.numpy().ravel()[: direct[1].ctrl.size].reshape(direct[1].ctrl.shape)
np.testing.assert_array_equal(graphed[1].qpos.numpy(), direct[1].qpos.numpy())
few = start(nconmax=0)
few[1].qpos.numpy()[:, 2] = 0.09
with wp.ScopedCapture() as failing:
    mjw.step(*few)
raises(ValueError, r"make it with nconmax=\d+", lambda: wp.capture_launch(failing.graph))
wp.capture_launch(capture.graph)  # works after the error of another one
assert len(graphs._in_graphs) == 3
capture = failing = graphed = None

# Two simulations in two threads.
pairs, alone = [start(), start()], start()
runs = [threading.Thread(target=lambda pair=pair: [mjw.step(*pair) for _ in range(50)]) for pair in pairs]
for run in runs:
    run.start()
for run in runs:
    run.join()
for _ in range(50):
    mjw.step(*alone)
for _, data in pairs:
    np.testing.assert_array_equal(data.qpos.numpy(), alone[1].qpos.numpy())

(code,) = re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)[:1]
program = {}
exec(code, program)
assert np.isfinite(program["data"].qpos.numpy()).all()
kept = len(compat._worlds), len(compat._models)
program = few = called = pairs = alone = None
import gc

gc.collect()
assert (len(compat._worlds), len(compat._models)) < kept and not graphs._in_graphs
