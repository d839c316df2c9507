# SPDX-License-Identifier: Apache-2.0
"""Images of mjsense.Renderer compared with those of mujoco.Renderer."""

import os

import numpy as np
import pytest
from renderer_scenes import BALL, SHAPES, SOFT, load
from test_renderer import REFUSED

import mjsense as mjs

mujoco = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def opengl():
    os.environ.setdefault("MUJOCO_GL", "egl")
    pytest.importorskip("OpenGL")
    model, _ = load(BALL)
    try:
        mujoco.Renderer(model, 8, 8).close()
    except Exception as error:
        pytest.skip(f"mujoco.Renderer does not work here: {error}")


def both(model, data, camera, option=None):
    images = []
    for Renderer in (mujoco.Renderer, mjs.Renderer):
        with Renderer(model, 240, 320) as renderer:
            for _ in range(2):  # MuJoCo's first image has infinite planes at another place than the following ones
                renderer.update_scene(data, camera, option)
            row = [renderer.render()]
            renderer.enable_depth_rendering()
            row.append(renderer.render())
            renderer.enable_segmentation_rendering()
            row.append(renderer.render())
            images.append(row)
    return list(zip(*images, strict=True))


def compare(images, psnr):
    rgb, depth, segmentation = images
    error = np.mean((rgb[0].astype(float) - rgb[1]) ** 2)
    assert 10 * np.log10(255**2 / max(error, 1e-9)) > psnr
    assert np.median(np.abs(depth[0] - depth[1])) < 1e-5
    assert np.quantile(np.abs(depth[0] - depth[1]), 0.98) < 5e-3
    assert (segmentation[0] == segmentation[1]).all(-1).mean() > 0.998


def enable(renderer, kind):
    if kind == "depth":
        renderer.enable_depth_rendering()
    if kind == "segmentation":
        renderer.enable_segmentation_rendering()


@pytest.mark.parametrize("kind", ["rgb", "depth", "segmentation"])
def test_before_the_first_update_as_in_opengl(opengl, kind):
    model, _ = load(SHAPES)
    with mujoco.Renderer(model, 20, 30) as renderer:
        enable(renderer, kind)
        expected = renderer.render()
    with mjs.Renderer(model, 20, 30) as renderer, pytest.warns(UserWarning):
        enable(renderer, kind)
        image = renderer.render()
    assert image.dtype == expected.dtype
    np.testing.assert_allclose(image, expected, rtol=1e-4)


@pytest.mark.parametrize("scene", [BALL, SHAPES, SOFT])
def test_data_without_poses_as_in_opengl(opengl, scene):
    model, data = load(scene)
    mujoco.mj_resetData(model, data)
    with pytest.warns(UserWarning, match="has no poses yet, and no geoms are drawn"):
        rgb, depth, segmentation = both(model, data, -1)
    error = np.mean((rgb[0].astype(float) - rgb[1]) ** 2)
    assert 10 * np.log10(255**2 / max(error, 1e-9)) > 34
    np.testing.assert_allclose(depth[1], depth[0], rtol=1e-4)
    np.testing.assert_array_equal(segmentation[1], segmentation[0])


@pytest.mark.parametrize("camera", ["view", "below", "flat", "sensor", -1])
def test_shapes_look_as_in_opengl(opengl, camera):
    images = both(*load(SHAPES, 60), camera)
    if camera == "flat" and mujoco.__version__ < "4":  # whose depth of orthographic cameras is wrong
        images[1] = (images[1][1],) * 2
    compare(images, 34)


@pytest.mark.parametrize(
    "flag", [i for i in range(int(mujoco.mjtRndFlag.mjNRNDFLAG)) if mujoco.mjtRndFlag(i).name[6:] not in REFUSED]
)
def test_all_other_flags_of_the_scene_do_what_they_do_in_opengl(opengl, flag):
    model, data = load(SHAPES, 60)
    images = []
    for Renderer in (mujoco.Renderer, mjs.Renderer):
        with Renderer(model, 240, 320) as renderer:
            for _ in range(2):
                renderer.update_scene(data, "view")
            renderer.scene.flags[flag] = 1 - renderer.scene.flags[flag]
            images.append(renderer.render().astype(float))
    assert 10 * np.log10(255**2 / np.mean((images[0] - images[1]) ** 2)) > 34


@pytest.mark.parametrize(("tilt", "fog", "haze"), [(1, (0.3, 1.5), 0.3), (0.2, (5, 40), 0.8)], ids=["surfaces", "sky and haze"])
def test_fog_is_that_of_opengl(opengl, tilt, fog, haze):
    model, data = (
        load(f"""<mujoco><visual><map zfar="30" fogstart="{fog[0]}" fogend="{fog[1]}" haze="{haze}"/><rgba fog=".9 .2 .5 1"/></visual>
        <statistic extent="2" center="0 0 .4"/><asset><material name="floor" reflectance=".4"/>
        <texture type="skybox" builtin="gradient" rgb1=".2 .6 .8" rgb2="0 0 .2" width="64" height="384"/></asset>
        <worldbody><light pos="0 0 6"/><camera name="view" pos="0 -2 2.5" xyaxes="1 0 0 0 {tilt} 1"/><geom type="plane" size="0 0 .1" material="floor"/>
        <geom size=".3" pos="0 0 .4" rgba="0 1 0 1"/><geom type="box" size=".2 .02 .2" pos="-.5 -.6 .5" rgba="1 1 0 .5"/></worldbody></mujoco>""")
    )
    images = []
    for Renderer in (mujoco.Renderer, mjs.Renderer):
        with Renderer(model, 120, 160) as renderer:
            for _ in range(2):
                renderer.update_scene(data, "view")
            without = renderer.render()
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_FOG] = 1
            images.append(renderer.render().astype(float))
            assert (np.abs(images[-1] - without).max(-1) > 10).mean() > 0.3
    assert 10 * np.log10(255**2 / np.mean((images[0] - images[1]) ** 2)) > 40


@pytest.mark.parametrize("flag", range(int(mujoco.mjtVisFlag.mjNVISFLAG)))
def test_visual_flags_do_what_they_do_in_opengl(opengl, flag):
    option = mujoco.MjvOption()
    option.flags[flag] = not option.flags[flag]
    model, data = load(SHAPES, 60)
    rgb, _, _ = both(model, data, "view", option)
    error = np.mean((rgb[0].astype(float) - rgb[1]) ** 2)
    assert 10 * np.log10(255**2 / error) > 31.5


def test_the_frustum_of_a_camera_looks_as_in_opengl(opengl):
    model, data = load("""<mujoco><worldbody><light pos="0 0 3"/><geom size=".05" pos="0 .5 0"/>
        <camera xyaxes="1 0 0 0 0 1" resolution="4 3" fovy="60"/></worldbody></mujoco>""")
    option = mujoco.MjvOption()
    option.flags[mujoco.mjtVisFlag.mjVIS_CAMERA] = 1
    rgb, depth, segmentation = both(model, data, -1, option)  # from inside
    assert 10 * np.log10(255**2 / np.mean((rgb[0].astype(float) - rgb[1]) ** 2)) > 30
    assert np.quantile(np.abs(depth[0] - depth[1]), 0.98) < 5e-3
    assert (segmentation[0] == segmentation[1]).all(-1).mean() > 0.99


@pytest.mark.parametrize(
    ("light", "region"),
    [('type="directional"', 'shadowclip=".4"'), ('type="spot" cutoff="40" exponent="1"', 'shadowscale=".4"')],
    ids=["directional", "spot"],
)
def test_shadows_end_where_they_end_in_opengl(opengl, light, region):
    boxes = "".join(
        f'<geom type="box" size=".05 .05 .2" pos="{0.3 * x} {0.3 * y} .3"/>' for x in range(-5, 6) for y in range(-5, 6)
    )
    model, data = (
        load(f"""<mujoco><visual><map {region}/><headlight diffuse=".2 .2 .2"/></visual><statistic extent="2" center="0 0 0"/>
        <worldbody><light pos=".2 0 2" dir=".2 .1 -1" {light}/><camera pos="0 -2 2.5" xyaxes="1 0 0 0 .8 .6"/>
        <geom type="plane" size="3 3 .1"/>{boxes}</worldbody></mujoco>""")
    )
    compare(both(model, data, 0), 30)


@pytest.mark.parametrize("light", ['type="directional"', 'type="spot" cutoff="60"'], ids=["directional", "spot"])
@pytest.mark.parametrize("distance", [0.05, 0.15, -0.05])
def test_geoms_near_a_light_cast_shadows_as_in_opengl(opengl, light, distance):
    # light (o) above a box (=), above the floor; the near plane of the light's shadow map is 0.1 m below it
    model, data = (
        load(f"""<mujoco><visual><map znear=".05"/><headlight diffuse=".1 .1 .1"/></visual><statistic extent="2" center="0 0 0"/>
        <worldbody><light pos="0 0 1" dir="0 0 -1" {light}/><camera pos="0 -1 1" xyaxes="1 0 0 0 .7 .7"/>
        <geom type="plane" size="2 2 .1"/><geom type="box" size=".2 .2 .005" pos="0 0 {1 - distance}"/></worldbody></mujoco>""")
    )
    theirs, ours = both(model, data, 0)[0]
    assert 10 * np.log10(255**2 / np.mean((theirs.astype(float) - ours) ** 2)) > 30


@pytest.mark.parametrize(("repeat", "uniform"), [(1, "true"), (3, "false"), (3, "true")])
def test_textured_meshes_look_as_in_opengl(opengl, repeat, uniform):
    model, data = (
        load(f"""<mujoco><asset><texture name="t" type="2d" builtin="checker" rgb1="1 0 0" rgb2="0 0 1" width="64" height="64"/>
        <material name="m" texture="t" texrepeat="{repeat} {repeat}" texuniform="{uniform}"/>
        <mesh name="prism" vertex="0 0 0  1 0 0  0 1 0  0 0 -1  1 0 -1  0 1 -1" texcoord="0 0  1 0  0 1  .5 .5  1 .5  .5 1"
         face="0 1 2  3 5 4  0 4 1  0 3 4  1 4 5  1 5 2  0 2 5  0 5 3"/></asset>
        <worldbody><light pos="0 0 3" castshadow="false"/><camera name="view" pos="0 0 3"/><geom type="mesh" mesh="prism" material="m"/></worldbody></mujoco>""")
    )
    compare(both(model, data, "view"), 31)


@pytest.mark.parametrize("skin", [0, 1])
def test_flexes_look_as_in_opengl(opengl, skin):
    option = mujoco.MjvOption()
    option.flags[mujoco.mjtVisFlag.mjVIS_FLEXSKIN] = skin
    option.flags[mujoco.mjtVisFlag.mjVIS_FLEXVERT] = 1 - skin
    compare(both(*load(SOFT, 30), "view", option), 33)


# Gymnasium


@pytest.mark.parametrize("mode", ["rgb_array", "depth_array", "rgbd_tuple"])
def test_gymnasium_environments_render_as_with_opengl(opengl, mode):
    for needed in ("glfw", "imageio"):  # which Gymnasium's renderer imports
        pytest.importorskip(needed)
    gymnasium = pytest.importorskip("gymnasium")
    from mjsense.compat.gymnasium import use

    images = []
    for adapt in (lambda env: env, use):
        env = adapt(gymnasium.make("HalfCheetah-v5", render_mode=mode, width=96, height=80))
        env.reset(seed=0)
        env.render()
        image = env.render()
        images.append(image if isinstance(image, tuple) else (image,))
    for theirs, ours in zip(*images, strict=True):
        assert theirs.shape == ours.shape
        assert theirs.dtype == ours.dtype
        if ours.dtype == np.uint8:
            assert 10 * np.log10(255**2 / np.mean((theirs.astype(float) - ours) ** 2)) > 30
        else:
            assert np.median(np.abs(theirs - ours)) < 1e-3
