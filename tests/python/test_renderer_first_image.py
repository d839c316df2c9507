# SPDX-License-Identifier: Apache-2.0
"""mjsense.Renderer before the first update_scene(), and with data for which mj_forward was not called, draws what mujoco.Renderer draws (see test_renderer_opengl.py), and warns."""

import re
import warnings

import numpy as np
import pytest
from renderer_scenes import BALL, load

import mjsense as mjs

mujoco = pytest.importorskip("mujoco")

KINDS = {"rgb": (np.uint8, (3,)), "depth": (np.float32, ()), "segmentation": (np.int32, (2,))}
NO_POSES = "Renderer: `data` has no poses yet, and no geoms are drawn: call mujoco.mj_forward(model, data) before update_scene()"


def image_of(renderer, kind):
    if kind == "depth":
        renderer.enable_depth_rendering()
    if kind == "segmentation":
        renderer.enable_segmentation_rendering()
    return renderer.render()


@pytest.mark.parametrize("kind", KINDS)
def test_before_the_first_update(kind):
    model, data = load(BALL)
    renderer = mjs.Renderer(model, 20, 30)
    with pytest.warns(UserWarning, match="its camera has no pose: call mujoco.mj_forward.*update_scene") as caught:
        image = image_of(renderer, kind)
    assert caught[0].filename == __file__
    nothing = {"rgb": 0, "depth": 50, "segmentation": -1}[kind]  # zfar = 50, extent = 1
    assert image.dtype == KINDS[kind][0] and image.shape == (20, 30, *KINDS[kind][1]) and (image == nothing).all()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert (renderer.render() == nothing).all()  # warns once
        assert (renderer.render_images([kind])[kind] == nothing).all()
        renderer.update_scene(data, "front")
        assert (renderer.render() != nothing).any()


def test_data_without_poses_warns_once_at_the_caller():
    model, data = load(BALL)
    mujoco.mj_resetData(model, data)
    renderer = mjs.Renderer(model, 20, 30)
    with pytest.warns(UserWarning, match=re.escape(NO_POSES)) as caught:
        renderer.update_scene(data)
    assert caught[0].filename == __file__
    renderer.update_scene(data)
    assert renderer.scene.ngeom == 1
    with pytest.warns(UserWarning, match=r"has no poses yet, .* before render_batch\(\) \(datas\[1\]\)") as caught:
        images = renderer.render_batch([load(BALL)[1], data])
    assert caught[0].filename == __file__
    assert images[0].any() and not images[1].any()


def test_poses_of_a_model_without_bodies():
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom size='.5'/></worldbody></mujoco>")
    data = mujoco.MjData(model)
    renderer = mjs.Renderer(model, 20, 30)
    with pytest.warns(UserWarning, match=re.escape(NO_POSES)):
        renderer.update_scene(data)
    mujoco.mj_forward(model, data)
    renderer = mjs.Renderer(model, 20, 30)
    renderer.update_scene(data)  # a warning would be an error
    assert renderer.render().any()


def test_a_fixed_camera_of_data_without_poses_sees_nothing():
    model, data = load(BALL)
    mujoco.mj_resetData(model, data)
    renderer = mjs.Renderer(model, 20, 30)
    with pytest.warns(UserWarning):
        renderer.update_scene(data, "front")
    with pytest.warns(UserWarning, match="its camera has no pose"):
        assert not renderer.render().any()


def test_the_opengl_context_hints_at_reload():
    renderer = mjs.Renderer(load(BALL)[0], 20, 30)
    for name in ("_mjr_context", "_gl_context"):
        with pytest.raises(AttributeError, match=rf"Renderer has no attribute '{name}'; there is no OpenGL. Call reload\(\) after a change"):
            getattr(renderer, name)
        assert not hasattr(renderer, name)
    with pytest.raises(AttributeError, match=r"Renderer has no attribute 'heigth'$"):
        renderer.heigth
