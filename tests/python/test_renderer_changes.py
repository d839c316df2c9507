# SPDX-License-Identifier: Apache-2.0
"""A renderer draws only the parts of an image that may have changed. Its images equal those of a renderer without earlier images."""

import numpy as np
import pytest
from renderer_scenes import SHAPES, SOFT, load

import mjsense as mjs

mujoco = pytest.importorskip("mujoco")


def assert_equal_to_new(model, data, renderer, **scene):
    renderer.update_scene(data, **scene)
    found = renderer.render_images()
    with mjs.Renderer(model, renderer.height, renderer.width) as other:
        other.update_scene(data, **scene)
        for kind, image in other.render_images().items():
            np.testing.assert_array_equal(found[kind], image, err_msg=kind)
    return found["rgb"]


def edit(model, data, rng, what):
    """Changes the model or data in one way."""
    match what:
        case "joint":
            data.qpos[rng.integers(model.nq)] += rng.uniform(-0.2, 0.2)
        case "color":
            model.geom_rgba[rng.integers(model.ngeom)] = rng.uniform(0.2, 1, 4)
        case "size":
            model.geom_size[rng.integers(2, model.ngeom)] *= rng.uniform(0.8, 1.2)
        case "light":
            model.light_diffuse[0] = rng.uniform(0.2, 1, 3)
        case "light pose":
            model.light_pos[0] += rng.uniform(-0.2, 0.2, 3)
        case "camera":
            model.cam_pos[0] += rng.uniform(-0.1, 0.1, 3)
        case "texture":
            model.tex_data[:] = rng.integers(0, 256, model.tex_data.shape)
        case "mesh":
            model.mesh_vert *= np.float32(1.1)
        case "height field":
            model.hfield_data[:] = rng.uniform(0, 1, model.hfield_data.shape)
        case "material":
            model.mat_shininess[:] = rng.uniform(0, 1, model.nmat)
        case "hidden":
            model.geom_group[rng.integers(model.ngeom)] ^= 4
    mujoco.mj_forward(model, data)


EDITS = ["joint", "color", "size", "light", "light pose", "camera", "texture", "mesh", "height field", "material", "hidden"]


@pytest.mark.parametrize("reflectance", [0, 0.2])
def test_images_after_edits(reflectance):
    model, data = load(SHAPES)
    model.mat_reflectance[:] = reflectance
    mujoco.mj_forward(model, data)
    rng = np.random.default_rng(1)
    images = []
    with mjs.Renderer(model, 90, 120) as renderer:
        for what in [*EDITS, "none", *rng.permutation(EDITS)]:
            edit(model, data, rng, what)
            for camera in (0, 2, -1):
                images.append(assert_equal_to_new(model, data, renderer, camera=camera))
    assert len({image.tobytes() for image in images}) > len(images) / 2  # the edits are seen


def test_images_with_decorations_and_other_sizes():
    model, data = load(SHAPES, steps=50)
    option = mujoco.MjvOption()
    with mjs.Renderer(model, 90, 120) as renderer:
        for flags in ([], ["mjVIS_CONTACTPOINT", "mjVIS_CONTACTFORCE"], ["mjVIS_JOINT"], ["mjVIS_TRANSPARENT"], []):
            option.flags[:] = mujoco.MjvOption().flags
            for flag in flags:
                option.flags[getattr(mujoco.mjtVisFlag, flag)] = 1
            for size in ((90, 120), (33, 47)):
                renderer.update_scene(data, 0, option)
                image = renderer.render_images(["rgb"], height=size[0], width=size[1])["rgb"]
                with mjs.Renderer(model, *size) as other:
                    other.update_scene(data, 0, option)
                    np.testing.assert_array_equal(image, other.render())
            mujoco.mj_step(model, data)


def test_images_of_flexes():
    model, data = load(SOFT)
    with mjs.Renderer(model, 90, 120) as renderer:
        for _ in range(4):
            assert_equal_to_new(model, data, renderer, camera=0)
            mujoco.mj_step(model, data, 5)
            mujoco.mj_forward(model, data)


def test_worlds_in_turns():
    model, _ = load(SHAPES)
    datas = [mujoco.MjData(model) for _ in range(3)]
    rng = np.random.default_rng(2)
    with mjs.Renderer(model, 60, 80) as renderer:
        for _ in range(3):
            for data in datas:
                edit(model, data, rng, "joint")
                assert_equal_to_new(model, data, renderer, camera=0)
