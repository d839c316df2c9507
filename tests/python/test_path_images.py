# SPDX-License-Identifier: Apache-2.0
"""Images with shading="path": the same bits at any number of threads and worlds, near those of pbr, bad options."""

import mujoco
import numpy as np
import pytest

import mjsense as mjs

XML = """
<mujoco>
  <asset>
    <texture name="checker" type="2d" builtin="checker" rgb1=".7 .7 .6" rgb2=".3 .4 .3" width="64" height="64"/>
    <material name="floor" texture="checker" texrepeat="6 6" roughness=".8"/>
    <material name="metal" rgba=".9 .7 .3 1" metallic="1" roughness=".4"/>
    <material name="glass" rgba=".3 .4 .9 .4"/>
  </asset>
  <worldbody>
    <light pos="1 -1 3" dir="-.3 .3 -1" bulbradius=".2"/>
    <geom type="plane" size="3 3 .1" material="floor"/>
    <geom type="box" size=".3 .2 .4" pos="0 0 .4" rgba=".8 .3 .2 1"/>
    <geom type="box" size=".1 .1 .1" pos="-.5 -.5 .3" material="glass"/>
    <body name="ball" pos=".6 0 .3"><freejoint/><geom size=".2" material="metal"/></body>
    <camera name="view" pos="0 -2.5 1.6" xyaxes="1 0 0 0 .5 .86"/>
  </worldbody>
</mujoco>
"""


def images(worlds: int = 1, threads: int = 1, kinds: tuple[str, ...] = ("rgb",), **options: object) -> dict[str, np.ndarray]:
    settings: dict[str, object] = {"shading": "path", "samples_per_pixel": 8, "width": 60, "height": 45} | options
    camera = mjs.CameraSensorCfg(name="cam", camera_name="w/view", data_types=kinds, use_shadows=True, **settings)
    scene = mjs.Scene(mjs.SceneCfg(entities={"w": mjs.EntityCfg(model=XML)}, sensors=[camera]))
    sim = mjs.Simulation(scene, num_worlds=worlds, threads=threads)
    sim.qpos[:, 0] = 0.6 + 0.1 * np.arange(worlds)
    sim.forward()
    return {name: getattr(scene["cam"].data, name).copy() for name in kinds}


def test_the_same_bits_at_any_number_of_threads_and_worlds() -> None:
    reference = images(9, 1)["rgb"]
    for threads in (2, 5):
        np.testing.assert_array_equal(images(9, threads)["rgb"], reference)
    np.testing.assert_array_equal(images(1, 2)["rgb"][0], reference[0])


def test_other_images_are_those_of_classic_shading() -> None:
    kinds = ("depth", "segmentation", "normals")
    classic, path = images(kinds=kinds, shading="classic"), images(kinds=(*kinds, "rgb"), samples_per_pixel=1)
    for name in kinds:
        np.testing.assert_array_equal(classic[name], path[name])


def test_hdr_is_the_radiance_of_the_image() -> None:
    both = images(kinds=("rgb", "hdr"), tone_mapping="linear")
    linear = np.clip(both["hdr"] / (1.2 * 2**8), 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(both["rgb"], 255 * encoded, atol=1.5)
    np.testing.assert_array_equal(images(kinds=("hdr",), threads=2)["hdr"], both["hdr"])


def test_pbr_is_near_the_reference() -> None:
    path = images(samples_per_pixel=256)["rgb"].astype(float)
    decibels = {
        shading: 10 * np.log10(255**2 / np.mean((images(shading=shading, samples=16, shadow_samples=16)["rgb"] - path) ** 2))
        for shading in ("pbr", "classic")
    }
    assert decibels["pbr"] > 25 > 15 > decibels["classic"], decibels


@pytest.mark.parametrize("value", [0, 65537])
def test_bad_numbers_of_samples(value: int) -> None:
    with pytest.raises(ValueError, match="samples_per_pixel"):
        images(samples_per_pixel=value)
    model = mujoco.MjModel.from_xml_string(XML)
    with mjs.Renderer(model, 20, 20) as renderer, pytest.raises(ValueError, match="samples_per_pixel"):
        renderer.samples_per_pixel = value


def test_renderer_has_the_images_of_cameras() -> None:
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    data.qpos[0] = 0.6
    mujoco.mj_forward(model, data)
    with mjs.Renderer(model, 45, 60) as renderer:
        renderer.update_scene(data, "view")
        classic = renderer.render().copy()
        renderer.shading, renderer.samples_per_pixel = "path", 64
        reference = images(samples_per_pixel=64)["rgb"][0].astype(float)
        assert np.abs(renderer.render() - reference).mean() < 0.5
        renderer.shading = "classic"
        np.testing.assert_array_equal(renderer.render(), classic)
