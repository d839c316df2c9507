# SPDX-License-Identifier: Apache-2.0
"""Textures of random objects compared with those of mujoco.Renderer: places, mip levels and alpha.

MJSENSE_TEXTURES=200 compares as many random models instead of 18.
"""

import os
import warnings

import numpy as np
import pytest
from textured_models import KINDS, png, random_model

import mjsense as mjs

mujoco = pytest.importorskip("mujoco")
WIDTH, HEIGHT = 240, 180
COUNT = int(os.environ.get("MJSENSE_TEXTURES", "18"))


@pytest.fixture(scope="module")
def opengl():
    os.environ.setdefault("MUJOCO_GL", "egl")
    pytest.importorskip("OpenGL")
    if tuple(int(x) for x in mujoco.__version__.split(".")[:2]) < (3, 13):
        pytest.skip("earlier versions place textures differently from scene cameras")
    try:
        mujoco.Renderer(mujoco.MjModel.from_xml_string("<mujoco/>"), 8, 8).close()
    except Exception as error:
        pytest.skip(f"mujoco.Renderer does not work here: {error}")


def three_images(xml, files):
    """rgb of OpenGL, of the drop-in renderer and of a scene camera, and where the first two show an object."""
    model = mujoco.MjModel.from_xml_string(xml, files)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    images, ids = [], []
    for Renderer in (mujoco.Renderer, mjs.Renderer):
        with Renderer(model, HEIGHT, WIDTH) as renderer:
            for _ in range(2):  # MuJoCo's first image has infinite planes at another place than the following ones
                renderer.update_scene(data, "view")
            images.append(renderer.render().astype(int))
            renderer.enable_segmentation_rendering()
            ids.append(renderer.render())
    camera = mjs.CameraSensorCfg(name="camera", camera_name="e/view", width=WIDTH, height=HEIGHT, enabled_site_groups=(0, 1, 2))
    entity = mjs.EntityCfg(model=xml, assets=files, mocap_base=False)
    scene = mjs.Scene(mjs.SceneCfg(entities={"e": entity}, sensors=(camera,)))
    sim = mjs.Simulation(scene)
    sim.reset()
    images.append(scene["camera"].data.rgb[0].astype(int))
    sim.close()
    return images, (ids[0] == ids[1]).all(-1) & (ids[0][..., 0] >= 0)


def share_off(image, reference, where):
    return float((np.abs(image - reference).max(-1) > 40)[where].mean())


# Only ambient light: the image is the texture. 0.5 % are pixels at edges between faces.
@pytest.mark.parametrize("seed", range(COUNT))
def test_textures_are_those_of_opengl(opengl, seed):
    xml, files = random_model(seed, KINDS[seed % len(KINDS)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # cloth without any force
        (theirs, drop_in, scene), seen = three_images(xml, files)
    assert seen.sum() > 50
    assert share_off(drop_in, theirs, seen) <= 0.005
    assert share_off(scene, theirs, seen) <= 0.005


SKIN = """<deformable><skin material="t" vertex="-.3 0 -.3 .3 0 -.3 .3 0 .3 -.3 0 .3" face="0 1 2 0 2 3" texcoord="0 0 1 0 1 1 0 1">
 <bone body="b" bindpos="0 0 0" bindquat="1 0 0 0" vertid="0 1 2 3" vertweight="1 1 1 1"/></skin></deformable>"""
OBJECTS = {
    "box": '<geom type="box" size=".3 .02 .3" material="t"/>',
    "sphere": '<geom size=".3" material="t"/>',
    "mesh": '<geom type="mesh" mesh="m" material="t"/>',
    "plane": '<geom type="plane" size=".4 .4 1" euler="90 0 0" material="t"/>',
    "site": '<site type="box" size=".3 .02 .3" material="t"/>',
    "skin": '<body name="b"><geom size=".001" group="4"/></body>',
}


# The texture has columns of alpha 0, 0.5 and 1, which a translucent material blends over the red wall and an opaque one ignores.
@pytest.mark.parametrize("alpha", [1, 0.9, 0.5])
@pytest.mark.parametrize("name", OBJECTS)
def test_alpha_of_textures_counts_on_translucent_objects(opengl, name, alpha):
    image = np.full((48, 48, 4), 255.0)
    image[..., :3] = (40, 90, 230)
    image[..., 3] = np.repeat([0, 128, 255], 16)
    material = f'rgba="1 1 1 {alpha}" specular="0"'
    xml = f"""<mujoco><visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/><quality shadowsize="0" offsamples="0"/></visual>
        <statistic extent="2" center="0 0 0"/><asset><texture name="t" type="2d" file="t.png" nchannel="4"/><material name="t" texture="t" {material}/>
        <mesh name="m" vertex="-.3 0 -.3 .3 0 -.3 .3 0 .3 -.3 0 .3 0 .3 0" texcoord="0 0 1 0 1 1 0 1 .5 .5" face="0 1 2 0 2 3 0 4 1 1 4 2 2 4 3 3 4 0"/></asset>
        <worldbody><camera name="view" pos="0 -2 0" xyaxes="1 0 0 0 0 1"/><geom type="box" size="1 .02 1" pos="0 .8 0" rgba="1 0 0 1"/>
        {OBJECTS[name]}</worldbody>{SKIN if name == "skin" else ""}</mujoco>"""
    (theirs, drop_in, scene), _ = three_images(xml, {"t.png": png(image)})
    everywhere = np.ones((HEIGHT, WIDTH), bool)
    assert share_off(drop_in, theirs, everywhere) < 0.003
    assert share_off(scene, theirs, everywhere) < 0.003
    if name == "box":  # blended twice, as MuJoCo does
        seen_through = drop_in[HEIGHT // 2, WIDTH // 2 - 30]
        assert seen_through[0] == (255 if alpha < 1 else 40)
