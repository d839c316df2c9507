# SPDX-License-Identifier: Apache-2.0
"""A world with its own values looks like a model that was compiled with them: to the bit, by either renderer."""

import mujoco
import numpy as np
import pytest

import mjsense as mjs

PARTS = dict(
    material='texture="checks" texrepeat="2 2"',
    floor='rgba=".4 .4 .4 1"',
    light='pos="1 -1 2" dir="-.3 .3 -1" type="spot" cutoff="50"',
    box='type="box" size=".3 .3 .3" material="m"',
    tet='type="mesh" mesh="tet" rgba=".8 .5 .2 1"',
    hidden='size=".3" group="4" rgba="0 .9 .1 1"',
    eye='fovy="50"',
    chip='sensorsize=".004 .003" focal=".003 .003" principal="0 0" resolution="64 48"',
)
XML = """
<mujoco>
  <statistic extent="4" center="0 0 0"/>
  <asset>
    <texture name="checks" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 1 0" width="64" height="64"/>
    <texture name="ramp" type="2d" builtin="gradient" rgb1="0 0 1" rgb2="1 1 0" width="64" height="64"/>
    <texture name="dice" type="cube" builtin="flat" mark="cross" rgb1="0 .5 1" rgb2="1 1 0" width="32" height="32"/>
    <material name="m" {material}/><material name="other" texture="ramp" rgba="1 .8 .8 1"/><material name="floor" {floor}/>
    <mesh name="tet" vertex="0 0 0  .4 0 0  0 .4 0  0 0 .4"/>
  </asset>
  <worldbody>
    <light {light}/><light pos="-1 1 2" dir=".3 -.3 -1" type="directional" diffuse=".3 .3 .3"/>
    <geom type="plane" size="3 3 .1" material="floor"/>
    <geom name="box" pos="0 0 .3" {box}/><geom name="tet" pos=".7 0 .1" {tet}/><geom name="hidden" pos="0 .9 .4" {hidden}/>
    <camera name="eye" pos="0 -2.5 1.5" xyaxes="1 0 0 0 .5 .86" {eye}/>
    <camera name="chip" pos="0 -2.5 1.5" xyaxes="1 0 0 0 .5 .86" {chip}/>
  </worldbody>
</mujoco>
"""
BOX, TET, HIDDEN, EYE, CHIP = 1, 2, 3, 0, 1  # ids
RGB = (0, mujoco.mjtTextureRole.mjTEXROLE_RGB)
CASES = [  # field, where, value, part of the XML, in which this becomes that
    ("geom_rgba", TET, (0.1, 0.2, 0.9, 1), "tet", ".8 .5 .2 1", ".1 .2 .9 1"),
    ("geom_rgba", TET, (0.1, 0.2, 0.9, 0.4), "tet", ".8 .5 .2 1", ".1 .2 .9 .4"),
    ("geom_rgba", TET, (0.8, 0.5, 0.2, 0), "tet", ".2 1", ".2 0"),
    ("geom_matid", TET, 1, "tet", 'mesh="tet"', 'mesh="tet" material="other"'),
    ("geom_group", HIDDEN, 0, "hidden", 'group="4"', ""),
    ("geom_size", BOX, (0.2, 0.4, 0.5), "box", ".3 .3 .3", ".2 .4 .5"),
    ("geom_type", BOX, mujoco.mjtGeom.mjGEOM_ELLIPSOID, "box", 'type="box"', 'type="ellipsoid"'),
    ("mat_rgba", 0, (0.5, 0.5, 1, 1), "material", "texture", 'rgba=".5 .5 1 1" texture'),
    ("mat_specular", 0, 1, "material", "texture", 'specular="1" texture'),
    ("mat_shininess", 0, 0.05, "material", "texture", 'shininess=".05" texture'),
    ("mat_emission", 0, 0.6, "material", "texture", 'emission=".6" texture'),
    ("mat_reflectance", 2, 0.6, "floor", "rgba", 'reflectance=".6" rgba'),
    ("mat_texid", RGB, 1, "material", "checks", "ramp"),
    ("mat_texid", RGB, 2, "material", "checks", "dice"),
    ("mat_texid", RGB, -1, "material", 'texture="checks"', ""),
    ("mat_texrepeat", 0, (5, 3), "material", "2 2", "5 3"),
    ("mat_texuniform", 0, 1, "material", "texture", 'texuniform="true" texture'),
    ("light_diffuse", 0, (1, 0.2, 0.2), "light", "pos", 'diffuse="1 .2 .2" pos'),
    ("light_ambient", 0, (0.3, 0.2, 0.2), "light", "pos", 'ambient=".3 .2 .2" pos'),
    ("light_specular", 0, (1, 0.2, 0.9), "light", "pos", 'specular="1 .2 .9" pos'),
    ("light_active", 0, 0, "light", "pos", 'active="false" pos'),
    ("light_castshadow", 0, 0, "light", "pos", 'castshadow="false" pos'),
    ("light_cutoff", 0, 20, "light", "50", "20"),
    ("light_exponent", 0, 1, "light", "pos", 'exponent="1" pos'),
    ("light_attenuation", 0, (0.5, 0.5, 0.2), "light", "pos", 'attenuation=".5 .5 .2" pos'),
    ("light_type", 0, mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, "light", "spot", "directional"),
    ("cam_fovy", EYE, 70, "eye", "50", "70"),
    ("cam_projection", EYE, mujoco.mjtProjection.mjPROJ_ORTHOGRAPHIC, "eye", "fovy", 'projection="orthographic" fovy'),
    ("cam_intrinsic", CHIP, (0.002, 0.0025, 0.0002, 0.0001), "chip",
     'focal=".003 .003" principal="0 0"', 'focal=".002 .0025" principal=".0002 .0001"'),
]  # fmt: skip
PHYSICAL = [
    ("light_diffuse", 0, (1, 0.2, 0.2), "light", "pos", 'diffuse="1 .2 .2" pos'),
    ("light_intensity", 0, 2000, "light", "pos", 'intensity="2000" pos'),
    ("light_type", 0, mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, "light", "spot", "directional"),
    ("mat_rgba", 0, (0.5, 0.5, 1, 1), "material", "texture", 'rgba=".5 .5 1 1" texture'),
    ("mat_emission", 0, 0.6, "material", "texture", 'emission=".6" texture'),
    ("mat_metallic", 0, 0.9, "material", "texture", 'metallic=".9" texture'),
    ("mat_roughness", 0, 0.05, "material", "texture", 'roughness=".05" texture'),
    ("mat_reflectance", 2, 0.6, "floor", "rgba", 'reflectance=".6" rgba'),
]


def simulate(renderer, num_worlds, shading="classic", **changed):
    types = ("rgb", "depth", "segmentation")
    cameras = [
        mjs.CameraSensorCfg(
            f"{name}_image", camera_name=name, width=64, height=48, data_types=types, use_shadows=True, renderer=renderer, shading=shading
        )
        for name in ("eye", "chip")
    ]
    scene = mjs.Scene(mjs.SceneCfg(base=XML.format(**{**PARTS, **changed}), sensors=cameras))
    try:
        return scene, mjs.Simulation(scene, num_worlds=num_worlds)
    except RuntimeError as error:
        if renderer == "opengl":
            pytest.skip(str(error))
        raise


def images(scene, world):
    return [array[world].copy() for name in ("eye_image", "chip_image") for array in scene[name].fields.values()]


@pytest.mark.parametrize("field, where, value, part, old, new", PHYSICAL, ids=[f"{c[0]}-{c[5]}" for c in PHYSICAL])
def test_randomized_world_with_physical_shading(field, where, value, part, old, new):
    test_randomized_world("rays", field, where, value, part, old, new, "pbr")


@pytest.mark.parametrize("renderer", ["rays", "opengl"])
@pytest.mark.parametrize("field, where, value, part, old, new", CASES, ids=[f"{c[0]}-{c[5]}" for c in CASES])
def test_randomized_world(renderer, field, where, value, part, old, new, shading="classic"):
    scene, sim = simulate(renderer, 3, shading)
    before = images(scene, 1)
    values = sim.model_field(field).copy()
    values[1][where] = value
    sim.randomize(field, values)
    after = images(scene, 1)
    assert not all(map(np.array_equal, before, after)), "nothing changed"
    for world in (0, 2):
        assert all(map(np.array_equal, before, images(scene, world))), "another world changed"
    assert old in PARTS[part]
    compiled, _keep = simulate(renderer, 1, shading, **{part: PARTS[part].replace(old, new)})
    for got, want in zip(after, images(compiled, 0), strict=True):
        np.testing.assert_array_equal(got, want)


def test_mesh_that_is_unused_in_the_compiled_model():
    """A world may give a geom a mesh that the compiled model shows nowhere."""
    xml = XML.format(**PARTS).replace("</asset>", '<mesh name="big" vertex="0 0 0  .8 0 0  0 .8 0  0 0 .8"/></asset>')
    camera = mjs.CameraSensorCfg("image", camera_name="eye", width=64, height=48, data_types=("rgb", "segmentation"))
    scene = mjs.Scene(mjs.SceneCfg(base=xml, sensors=[camera]))
    sim = mjs.Simulation(scene, num_worlds=2)
    ids = sim.model_field("geom_dataid").copy()
    ids[1, TET] = sim.model.mesh("big").id
    sim.randomize("geom_dataid", ids)
    seen = (scene["image"].data.segmentation[..., 0] == TET).sum(axis=(1, 2))
    assert seen[1] > 2 * seen[0] > 0
