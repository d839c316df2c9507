# SPDX-License-Identifier: Apache-2.0
"""Views of mjModel and mjData show what mujoco's own objects show."""

import copy
import ctypes
import gc
import pickle

import mujoco
import numpy as np
import pytest

import mjsense as mjs
from mjsense import _core
from mjsense.core import libmujoco, mujoco_names, mujoco_views

XML = """
<mujoco>
  <option timestep="0.004" wind="1 2 3"/>
  <visual><global offwidth="321"/><rgba haze="0.1 0.2 0.3 0.4"/></visual>
  <asset>
    <texture name="checks" type="2d" builtin="checker" width="4" height="4"/>
    <material name="paint" texture="checks"/>
    <mesh name="wedge" vertex="0 0 0  1 0 0  0 1 0  0 0 1"/>
    <hfield name="hills" nrow="3" ncol="2" size="1 1 1 1" elevation="0 1 2 3 4 5"/>
  </asset>
  <worldbody>
    <light name="sun" pos="0 0 3"/>
    <camera name="eye" pos="0 0 2"/>
    <geom name="floor" type="plane" size="2 2 1"/>
    <body name="box" pos="0 0 0.1"><freejoint name="free"/><geom name="cube" type="box" size=".1 .1 .1" material="paint"/></body>
    <body name="arm" pos="1 0 1">
      <joint name="ball" type="ball"/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/>
      <body name="hand" pos=".3 0 0">
        <joint name="hinge" axis="0 1 0"/><geom size=".05"/><site name="tip"/><geom type="mesh" mesh="wedge" contype="0" conaffinity="0"/>
      </body>
    </body>
  </worldbody>
  <tendon><fixed name="string"><joint joint="hinge" coef="2"/></fixed></tendon>
  <equality><connect name="held" body1="hand" body2="world" anchor="0 0 0" active="false"/></equality>
  <actuator><position name="servo" joint="hinge" kp="2"/><general name="slow" joint="hinge" dyntype="filter" dynprm="0.1"/></actuator>
  <sensor><framepos name="where" objtype="site" objname="tip"/><jointpos name="angle" joint="hinge"/></sensor>
  <keyframe><key name="start" ctrl="0.5 0.1"/></keyframe>
  <custom><numeric name="three" data="1 2 3"/><text name="word" data="hello"/></custom>
</mujoco>
"""
KINDS = ("actuator", "body", "cam", "camera", "eq", "geom", "hfield", "jnt", "joint", "key", "light", "mat", "mesh", "numeric", "sensor",
         "site", "tendon", "tex")  # fmt: skip


@pytest.fixture(scope="module")
def model():
    return mujoco.MjModel.from_xml_string(XML)


@pytest.fixture(scope="module")
def data(model):
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    for _ in range(50):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    return data


@pytest.fixture(scope="module")
def model_view(model):
    return mujoco_views.MjModelView(_core.OwnedModel.copy(model._address))


@pytest.fixture(scope="module")
def data_view(model_view, data):
    # One libmujoco serves both here, so its functions can be called with addresses.
    lib = ctypes.CDLL(libmujoco._environment()[1])
    view = mujoco_views.MjDataView(model_view)
    lib.mj_copyData(*(ctypes.c_void_p(address) for address in (view._address, model_view._address, data._address)))
    return view


def fields(real):
    """Names of attributes that are neither methods nor structs."""
    return [name for name in dir(type(real)) if not name.startswith("_") and not callable(getattr(real, name))]


def check(real, view, where=""):
    for name in fields(real):
        if name in ("signature", "model") or where + name in ("vis.rgba.bv", "vis.rgba.bvactive"):  # mujoco shows the last two with no elements
            continue
        expected, found = getattr(real, name), getattr(view, name)
        if isinstance(expected, np.ndarray):
            assert found.shape == expected.shape, where + name
            assert found.dtype == expected.dtype, where + name
            np.testing.assert_array_equal(found, expected, err_msg=where + name)
        elif isinstance(expected, (int, float, bytes, str)):
            assert found == expected and (isinstance(found, type(expected)) or "[" in where), where + name
        elif hasattr(expected, "__len__"):
            assert len(found) == len(expected), where + name
            for i in range(min(len(expected), 3)):
                check(expected[i], found[i], f"{where}{name}[{i}].")
        else:
            check(expected, found, f"{where}{name}.")


def test_every_attribute_of_a_model(model, model_view):
    check(model, model_view)
    assert len(fields(model)) > 500


def test_every_attribute_of_data(data, data_view):
    assert data.ncon > 0 and data.nefc > 0
    check(data, data_view)
    assert data_view.model is data_view._model


@pytest.mark.parametrize("kind", KINDS)
def test_elements_by_name_and_id(model, data, model_view, data_view, kind):
    for real, view in ((model, model_view), (data, data_view)):
        if not hasattr(real, kind):
            assert not hasattr(view, kind)
            continue
        index = 0
        while True:
            try:
                expected = getattr(real, kind)(index)
            except IndexError:
                break
            found = getattr(view, kind)(index)
            if expected.name:
                assert getattr(view, kind)(expected.name).id == expected.id == found.id
            for name in dir(expected):
                if name.startswith(("_", "J_")) or name in ("moment", "plastic"):  # sparse rows, and plasticity: views have the whole array only
                    continue
                np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=f"{kind} {index} {name}")
            index += 1
        assert index > 0


def test_unknown_elements(model_view, model):
    for ask in (lambda m: m.geom("cub"), lambda m: m.geom(99), lambda m: m.body("")):
        with pytest.raises((KeyError, IndexError)) as expected:
            ask(model)
        with pytest.raises(expected.type, match="Invalid"):
            ask(model_view)


def test_arrays_are_the_memory_and_keep_it(model):
    view = mujoco_views.MjModelView(_core.OwnedModel.copy(model._address))
    view.geom("cube").size = [0.3, 0.2, 0.1]
    view.opt.timestep = 0.5
    assert view.geom_size[1].tolist() == [0.3, 0.2, 0.1] and view.opt.timestep == 0.5
    twin = copy.deepcopy(view)
    twin.geom_size[1] = 9
    size = view.geom_size
    del view
    gc.collect()
    assert size[1].tolist() == [0.3, 0.2, 0.1]


def test_what_a_view_cannot_do(model_view, data_view, monkeypatch):
    monkeypatch.setattr(libmujoco, "why_not_shared", "the installed mujoco is 3.8.1")
    with pytest.raises(TypeError, match=r"the installed mujoco is 3\.8\.1; pip install 'mujoco>=4\.0,<4\.1'"):
        mujoco.mj_forward(model_view, data_view)
    with pytest.raises(AttributeError, match=r"MjModelView has no attribute 'bind'.* the installed mujoco is 3\.8\.1; pip install"):
        model_view.bind
    with pytest.raises(AttributeError, match="no attribute 'geom_siz'"):
        model_view.geom_siz = 1
    with pytest.raises(TypeError, match="cannot be pickled"):
        pickle.dumps(model_view)


def test_enumerations_are_mujocos():
    for ours, theirs, prefix in ((mujoco_names.Obj, mujoco.mjtObj, "mjOBJ_"), (mujoco_names.Geom, mujoco.mjtGeom, "mjGEOM_"),
                                 (mujoco_names.Joint, mujoco.mjtJoint, "mjJNT_")):  # fmt: skip
        for value in ours:
            assert getattr(theirs, prefix + value.name) == value
    assert [mujoco.mjtWarning(i).name for i in range(int(mujoco.mjtWarning.mjNWARNING))] == list(mujoco_names.WARNINGS)
    assert mujoco.mjMAXVAL == mujoco_names.MAXVAL
    assert {*_core.setconst_inputs()} == {*mujoco.MjModel._setconst_inputs}


def test_a_spec_of_another_series_goes_over_as_xml(monkeypatch, tmp_path):
    """Files are found where the spec has found them."""
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes/wedge.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n")
    file = tmp_path / "robot.xml"
    file.write_text("""<mujoco><compiler meshdir="meshes"/><asset><mesh file="wedge.obj"/><mesh name="kept" file="kept.obj"/></asset><worldbody>
        <body name="b"><geom type="mesh" mesh="wedge"/><geom name="k" type="mesh" mesh="kept" pos="2 0 0"/></body></worldbody></mujoco>""")
    spec = mujoco.MjSpec.from_file(str(file))
    spec.assets = {"kept.obj": b"v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\nf 1 2 3\nf 1 2 4\nf 1 3 4\nf 2 3 4\n"}
    before = spec.meshes[0].file
    shared = mjs.Scene(mjs.SceneCfg(entities={"r": mjs.EntityCfg(model=spec)})).model
    kind, _ = mujoco_names.source_of(spec)
    assert kind == "spec"
    monkeypatch.setattr(libmujoco, "shared", None)
    kind, xml = mujoco_names.source_of(spec)
    assert kind == "xml" and "wedge.obj" in xml and spec.meshes[0].file == before
    found = mjs.Scene(mjs.SceneCfg(entities={"r": mjs.EntityCfg(model=spec)})).model
    assert isinstance(found, mujoco_views.MjModelView)
    np.testing.assert_allclose(found.mesh_vert, shared.mesh_vert)
    np.testing.assert_allclose(found.body("r/b").mass, shared.body("r/b").mass)


def edit(spec):
    """What functions that edit a spec do, with mujoco's own enumerators."""
    spec.option.timestep = 0.005
    spec.stat.extent = 3
    spec.visual.global_.offwidth = 800
    spec.add_texture(name="dots", type=mujoco.mjtTexture.mjTEXTURE_2D, builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER, width=8, height=8, rgb1=[1, 0, 0])
    spec.add_material(name="shiny", shininess=0.9, textures=["", "dots"])
    spec.add_mesh(name="tetra", uservert=[0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1])
    body = spec.worldbody.add_body(name="added", pos=(0, 0, 2), gravcomp=0.5)
    body.add_freejoint(name="loose")
    body.add_geom(name="ball", type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[0.1], mass=2, material="shiny")
    body.add_geom(name="rock", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="tetra", contype=0, conaffinity=0)
    leg = body.add_body(name="leg", quat=[0.6, 0.8, 0, 0])
    leg.add_joint(name="knee", type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0], range=[-1, 1])
    leg.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.1, 0.1, 0.1))
    leg.add_site(name="foot", pos=[0, 0, -0.1])
    leg.add_camera(name="down", fovy=60)
    spec.worldbody.add_light(name="lamp", pos=[0, 0, 4], diffuse=[0.2, 0.3, 0.4])
    motor = spec.add_actuator(name="motor", target="knee", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.gainprm[0] = 7
    motor.ctrlrange = [-2, 2]
    motor.userdata = [1.0, 2.0]
    assert [*motor.userdata] == [1.0, 2.0] and motor.target == "knee"
    spec.add_sensor(name="height", type=mujoco.mjtSensor.mjSENS_FRAMEPOS, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="foot")
    spec.add_equality(name="bond", type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="added", name2="box/b", active=False)
    spec.add_exclude(bodyname1="added", bodyname2="box/b")
    spec.add_pair(geomname1="ball", geomname2="box/g", condim=4)
    spec.add_numeric(name="pi", data=[3.14], size=1)
    spec.add_text(name="note", data="hello")
    spec.add_key(name="up", qpos=[0, 0, 2, 1, 0, 0, 0, 0.5])
    for geom in spec.geoms:
        geom.friction[0] = 0.7
    found = spec.body("leg")
    found.name = "limb"
    assert found.parent.name == "added" and spec.geom("nothing") is None
    assert [g.name for g in spec.body("added").geoms] == ["ball", "rock"] and spec.bodies[0].name == "world"
    assert spec.joint("knee").type == mujoco.mjtJoint.mjJNT_HINGE and found.sites[0].name == "foot"


BOX = "<mujoco><worldbody><body name='b'><geom name='g' size='.1 .1 .1' type='box'/></body></worldbody></mujoco>"


def test_editing_a_scene_gives_the_same_model(monkeypatch):
    def scene():
        return mjs.Scene(mjs.SceneCfg(entities={"box": mjs.EntityCfg(model=BOX)}, spec_fn=edit))

    real = scene().model
    monkeypatch.setattr(libmujoco, "shared", None)
    view = scene().model
    assert isinstance(view, mujoco_views.MjModelView)
    check(real, view)
    shorter = mjs.Scene(mjs.SceneCfg(spec_fn=lambda spec: spec.delete(spec.worldbody.add_site(name="doomed")))).model
    assert shorter.nsite == 0
    assert real.nsensor == real.nu == real.nmesh == real.npair == real.nexclude == real.neq == 1


@pytest.mark.parametrize(
    ("edit", "error", "text"),
    [
        (lambda spec: spec.add_frame(), AttributeError, r"no 'add_frame' here: .*3\.8\.1; pip install 'mujoco>=4\.0,<4\.1'"),
        (lambda spec: spec.worldbody.add_geom(siz=[1, 1, 1]), AttributeError, "no 'siz' here"),
        (lambda spec: spec.worldbody.add_geom(size=[1, 1, 1, 1]), ValueError, "size: .* has more than 3 numbers"),
        (lambda spec: spec.worldbody.add_geom("shiny", size=[1, 1, 1]), ValueError, "no default class named 'shiny'"),
        (lambda spec: [spec.worldbody.add_body(name="twice") for _ in range(2)], ValueError, "repeated name 'twice'"),
    ],
)
def test_edits_that_are_errors(monkeypatch, edit, error, text):
    monkeypatch.setattr(libmujoco, "shared", None)
    monkeypatch.setattr(libmujoco, "why_not_shared", "the installed mujoco is 3.8.1")
    with pytest.raises(error, match=text):
        mjs.Scene(mjs.SceneCfg(spec_fn=edit))
