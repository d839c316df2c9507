# SPDX-License-Identifier: Apache-2.0
from pathlib import Path
from types import MappingProxyType

import mujoco
import numpy as np
import pytest
from scenes import ARM, BALL, ball_scene

import mjsense as mjs


def test_entities_and_names():
    scene = mjs.Scene(mjs.SceneCfg(entities={"arm": mjs.EntityCfg(model=ARM), "ball": mjs.EntityCfg(model=BALL)}))
    assert list(scene.entities) == ["arm", "ball"]
    assert scene["arm"].joint_names == ("shoulder", "elbow")
    assert scene["arm"].fixed_base and not scene["ball"].fixed_base
    assert list(scene.sensors) == ["ball/acc"]
    assert scene.model.nq == 2 + 7
    assert mujoco.MjModel.from_xml_string(scene.to_xml()).nq == scene.model.nq


def test_model_from_path_text_spec_and_function(tmp_path):
    path = tmp_path / "ball.xml"
    path.write_text(BALL)
    for model in (path, str(path), BALL, mujoco.MjSpec.from_string(BALL), lambda: mujoco.MjSpec.from_string(BALL)):
        scene = mjs.Scene(mjs.SceneCfg(entities={"b": mjs.EntityCfg(model=model)}))
        assert scene["b"].geom_names == ("ball",)


def test_spec_with_assets():
    cube = b"v -1 -1 -1\nv 1 -1 -1\nv 0 1 -1\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"
    xml = '<mujoco><asset><mesh name="m" file="m.obj"/></asset><worldbody><geom type="mesh" mesh="m"/></worldbody></mujoco>'
    from_text = mjs.EntityCfg(model=xml, assets={"m.obj": cube})
    from_spec = mjs.EntityCfg(model=mujoco.MjSpec.from_string(xml, assets={"m.obj": cube}))
    for cfg in (from_text, from_spec):
        scene = mjs.Scene(mjs.SceneCfg(entities={"e": cfg}))
        assert scene.model.nmesh == 1
        again = mujoco.MjModel.from_xml_string(scene.to_xml(), scene.assets())
        assert again.nmeshvert == scene.model.nmeshvert


def test_spec_fn_edits_the_scene_itself():
    def add_marker(spec):
        spec.worldbody.add_site(name="marker", pos=[1, 2, 3])

    scene = ball_scene(spec_fn=add_marker)
    assert scene.model.site("marker").pos.tolist() == [1, 2, 3]


def test_errors_of_spec_fn_are_propagated():
    def broken(spec):
        raise LookupError("no such thing")

    with pytest.raises(LookupError, match="no such thing"):
        ball_scene(spec_fn=broken)


def test_lookup_error_names_the_nearest():
    scene = ball_scene()
    for name in ("ball/ac", "acc"):
        with pytest.raises(KeyError) as error:
            scene[name]
        assert str(error.value) == f"scene: no sensor or entity named '{name}'; did you mean 'ball/acc'?"
    assert "ball/acc" in scene and "ball" in scene and "nothing" not in scene


@pytest.mark.parametrize(
    "cfg, text",
    [
        (lambda: dict(entities={"a": mjs.EntityCfg(model="/nowhere.xml")}), "nowhere.xml"),
        (lambda: dict(entities={"a": mjs.EntityCfg(model="<mujoco><worldbdy/></mujoco>")}), "worldbdy"),
        (lambda: dict(entities={"a": mjs.EntityCfg(model=17)}), "EntityCfg: model must be"),
        (lambda: dict(entities={"a": mjs.EntityCfg(model=BALL, pos=(1, 2))}), "pos must be 3 numbers"),
        (lambda: dict(entities={"a": BALL}), "entities must be a mapping of names to EntityCfg"),
        (lambda: dict(entities=None), "must be a mapping"),
        (lambda: dict(terrain="plane"), "terrain must be TerrainCfg, not"),
        (lambda: dict(sensors=(17,)), "17"),
        (lambda: dict(sensors=None), "must be a sequence"),
        (lambda: dict(extent="big"), "extent must be a number"),
        (lambda: dict(options=mjs.MujocoCfg(timestep=-1)), "timestep"),
        (lambda: dict(options=mjs.MujocoCfg(iterations=1.5)), "iterations must be an int"),
    ],
)
def test_bad_scenes(cfg, text):
    with pytest.raises((ValueError, TypeError), match=text):
        mjs.Scene(mjs.SceneCfg(**cfg()))


def test_entities_are_any_mapping():
    entities = {"b": mjs.EntityCfg(model=BALL)}
    for given in (entities, MappingProxyType(entities), list(entities.items())):
        assert list(mjs.Scene(mjs.SceneCfg(entities=given)).entities) == ["b"]


def test_env_origins():
    np.testing.assert_array_equal(
        ball_scene(env_spacing=3.0).env_origins(2), np.array([[1.5, 0, 0], [-1.5, 0, 0]], np.float32)
    )


def test_a_write_to_the_model_is_refused():
    scene = ball_scene()
    with pytest.raises(AttributeError, match=r"the model is read-only.*SceneCfg\(options=MujocoCfg\(timestep=value\)\) before"):
        scene.model.opt.timestep = 1.0
    assert mjs.Simulation(scene).physics_dt == 0.002


TWO_BALLS = """
<mujoco>
  <worldbody>
    <body name="a"><freejoint/><geom size=".1"/></body>
    <body name="b"><freejoint/><geom size=".1"/><site name="s"/></body>
  </worldbody>
  <sensor><gyro site="s"/></sensor>
</mujoco>
"""


def test_base_is_used_unchanged(tmp_path):
    path = tmp_path / "two.xml"
    path.write_text(TWO_BALLS)
    for base in (TWO_BALLS, path):
        scene = mjs.Scene(mjs.SceneCfg(base=base, entities={"arm": mjs.EntityCfg(model=ARM)}))
        assert list(scene.sensors) == ["sensor_0"]
        assert list(scene.entities) == ["arm"]
        assert scene.model.body("b").id == 2
    with pytest.raises(ValueError, match="the whole model the scene's base"):
        mjs.Scene(mjs.SceneCfg(entities={"two": mjs.EntityCfg(model=TWO_BALLS)}))


def test_generated_terrain():
    kinds = ("rough", "stairs")
    terrain = mjs.TerrainCfg(
        terrain_type="generator", levels=3, sub_terrains={kind: mjs.SubTerrainCfg(kind=kind) for kind in kinds}
    )
    scene = mjs.Scene(mjs.SceneCfg(terrain=terrain))
    tiles, origins = scene.env_tiles(6), scene.tile_origins()
    assert origins.shape == (3, 2, 3)
    np.testing.assert_array_equal(tiles[:, 1], [0, 0, 0, 1, 1, 1])
    np.testing.assert_array_equal(scene.env_origins(6), origins[tiles[:, 0], tiles[:, 1]])
    assert mjs.Scene(mjs.SceneCfg()).env_tiles(2) is None


TOUCH_GRID = """
<mujoco>
  <extension><plugin plugin="mujoco.sensor.touch_grid"><instance name="grid">
    <config key="nchannel" value="1"/><config key="size" value="3 2"/><config key="fov" value="30 20"/>
    <config key="gamma" value="0"/></instance></plugin></extension>
  <worldbody><body name="b"><freejoint/><geom size=".1"/><site name="s"/></body></worldbody>
  <sensor><plugin name="xml" instance="grid" objtype="site" objname="s"/></sensor>
</mujoco>
"""


def test_plugin_sensor():
    library = Path(mujoco.__file__).parent / "plugin" / "libsensor.so"
    if not library.exists():
        pytest.skip("this MuJoCo comes without its sensor plugins")
    mujoco.mj_loadPluginLibrary(str(library))
    sensor = mjs.BuiltinSensorCfg(
        name="touch", sensor_type="plugin", obj=mjs.ObjRef("site", "s", "pad"), instance="pad/grid"
    )
    scene = mjs.Scene(mjs.SceneCfg(entities={"pad": mjs.EntityCfg(model=TOUCH_GRID)}, sensors=[sensor]))
    mjs.Simulation(scene, num_worlds=2)
    assert scene["pad/xml"].data.shape == scene["pad/touch"].data.shape == (2, 6)
