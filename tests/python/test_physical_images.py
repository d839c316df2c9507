# SPDX-License-Identifier: Apache-2.0
"""Images with shading="pbr": the same bits for any number of threads and worlds, other outputs as with classic shading, bad options."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

import mjsense as mjs

XML = """
<mujoco>
  <asset>
    <material name="metal" rgba=".9 .7 .3 1" metallic="1" roughness=".3"/>
    <material name="mirror" rgba=".5 .5 .5 1" reflectance=".4"/>
    <material name="glass" rgba=".3 .4 .9 .4"/>
  </asset>
  <worldbody>
    <light pos="1 1 3" dir="-.3 -.3 -1" bulbradius=".2"/>
    <geom type="plane" size="3 3 .1" material="mirror"/>
    <geom type="box" size=".3 .2 .4" pos="0 0 .4" rgba=".8 .3 .2 1"/>
    <geom type="box" size=".1 .1 .1" pos="-.5 -.5 .3" material="glass"/>
    <body name="ball" pos=".6 0 .3"><freejoint/><geom size=".2" material="metal"/></body>
    <camera name="view" pos="0 -2.5 1.6" xyaxes="1 0 0 0 .5 .86"/>
  </worldbody>
</mujoco>
"""
KINDS = ("rgb", "depth", "segmentation", "normals")


def images(worlds: int, threads: int, moves: int = 3, kinds: tuple[str, ...] = KINDS, **options: object) -> dict[str, np.ndarray]:
    """Images of all worlds after some moves of the ball, which is somewhere else in each world."""
    camera = mjs.CameraSensorCfg(
        name="cam", camera_name="w/view", width=100, height=70, data_types=kinds, use_shadows=True, shadow_samples=3, **options
    )
    scene = mjs.Scene(mjs.SceneCfg(entities={"w": mjs.EntityCfg(model=XML)}, sensors=[camera]))
    sim = mjs.Simulation(scene, num_worlds=worlds, threads=threads)
    for move in range(moves):
        sim.qpos[:, 0] = 0.6 + 0.05 * move + 0.1 * np.arange(worlds)
        sim.forward()
        found = {name: getattr(scene["cam"].data, name).copy() for name in kinds}
    return found


def test_the_same_bits_at_any_number_of_threads_and_worlds() -> None:
    reference = images(4, 1, shading="pbr")["rgb"]
    for threads in (2, 5):
        np.testing.assert_array_equal(images(4, threads, shading="pbr")["rgb"], reference)
    np.testing.assert_array_equal(images(1, 1, shading="pbr")["rgb"][0], reference[0])


def test_images_do_not_depend_on_earlier_ones() -> None:
    """Fixed geoms and unchanged tiles are kept from image to image."""
    reference = images(1, 1, moves=3, shading="pbr")["rgb"]
    camera = mjs.CameraSensorCfg(
        name="cam", camera_name="w/view", width=100, height=70, use_shadows=True, shadow_samples=3, shading="pbr"
    )
    scene = mjs.Scene(mjs.SceneCfg(entities={"w": mjs.EntityCfg(model=XML)}, sensors=[camera]))
    sim = mjs.Simulation(scene, num_worlds=1, threads=1)
    sim.qpos[:, 0] = 0.7
    sim.forward()
    np.testing.assert_array_equal(scene["cam"].data.rgb, reference)


def test_only_colours_differ_from_classic_images() -> None:
    classic, physical = images(2, 1), images(2, 1, shading="pbr")
    for name in KINDS[1:]:
        np.testing.assert_array_equal(classic[name], physical[name])
    assert np.mean(classic["rgb"] != physical["rgb"]) > 0.5


def test_exposure_halves_light() -> None:
    def light(**options: object) -> np.ndarray:
        x = images(1, 1, shading="pbr", tone_mapping="linear", **options)["rgb"] / 255
        return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)

    bright, dark = light(exposure=9), light(exposure=10)
    shown = (bright > 0.05) & (bright < 0.99)
    assert shown.mean() > 0.3
    np.testing.assert_allclose(dark[shown] / bright[shown], 0.5, atol=0.03)


def test_surroundings_light_colour_and_turn(tmp_path: Path) -> None:
    pixels = np.full((8, 16, 4), (40, 40, 40, 128), np.uint8)
    pixels[:, :8] = (200, 20, 20, 130)  # red towards +y
    path = tmp_path / "sky.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + pixels.tobytes())

    def seen(**options: object) -> np.ndarray:
        return images(1, 1, 1, ("rgb",), shading="pbr", **options)["rgb"][0].astype(int)

    model = seen()
    np.testing.assert_array_equal(seen(environment="studio"), model)  # without an image light
    np.testing.assert_array_equal(seen(environment="auto"), model)  # nor a skybox
    red, turned = seen(environment=str(path)), seen(environment=str(path), environment_rotation=180)
    top = np.s_[:4]  # the background: the camera looks along +y
    assert (red[top, :, 0] > red[top, :, 2] + 50).all()
    assert (turned[top, :, 0] < turned[top, :, 2] + 10).all()
    np.testing.assert_array_equal(seen(environment=str(path), environment_rotation=360), red)
    warm, cold = (seen(white_balance=kelvin).mean((0, 1)) for kelvin in (10000, 3500))
    assert warm[0] / warm[2] > 1.2 > 0.8 > cold[0] / cold[2]


def test_hdr_is_the_radiance_of_the_image() -> None:
    """Exposure 8 shows 1.2 * 2^8 cd/m^2 as white. The radiance does not depend on how it is shown, and the colours not on hdr."""
    options = {"shading": "pbr", "tone_mapping": "linear", "samples": 4}
    both = images(2, 1, 2, ("rgb", "hdr"), **options)
    alone = images(2, 2, 2, ("hdr", "depth"), **options)["hdr"]
    np.testing.assert_array_equal(alone, both["hdr"])
    np.testing.assert_array_equal(images(2, 1, 2, ("rgb",), **options)["rgb"], both["rgb"])
    shown = images(2, 1, 2, ("hdr",), **{**options, "exposure": 12, "tone_mapping": "agx", "white_balance": 4000})["hdr"]
    np.testing.assert_allclose(shown, alone, rtol=1e-5)
    radiance = images(1, 1, 1, ("rgb", "hdr"), **{**options, "samples": 1})
    linear = np.clip(radiance["hdr"] / (1.2 * 2**8), 0, 1)
    encoded = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    assert np.abs(255 * encoded - radiance["rgb"]).max() <= 0.6


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"shading": "pbrr"}, "shading is 'pbrr': must be one of classic, pbr"),
        ({"exposure": 99}, "exposure"),
        ({"environment_intensity": -1}, "environment_intensity"),
        ({"tone_mapping": "aces"}, "must be one of neutral, filmic, linear, agx"),
        ({"white_balance": 1000}, "white_balance"),
        ({"shading": "pbr", "environment": "studo"}, "environment: no surroundings named 'studo'; did you mean 'studio'"),
        ({"shading": "pbr", "environment": "skybox"}, "the model has no skybox texture"),
        ({"shading": "pbr", "environment": "x.exr"}, "only Radiance pictures"),
        ({"shading": "pbr", "environment": "none.hdr"}, "environment 'none.hdr': no such file"),
        ({"shading": "pbr", "renderer": "opengl"}, "classic shading only"),
    ],
)
def test_bad_options(options: dict[str, object], message: str) -> None:
    with pytest.raises((ValueError, KeyError), match=message):
        images(1, 1, moves=1, kinds=("rgb",), **options)


def test_renderer_has_the_shading_of_cameras() -> None:
    model = mujoco.MjModel.from_xml_string(XML)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mjs.Renderer(model, 70, 100) as renderer:
        renderer.update_scene(data, "view")
        classic = renderer.render().copy()
        renderer.shading = "pbr"
        physical = renderer.render().copy()
        assert np.mean(classic != physical) > 0.5
        renderer.environment = "auto"  # there is neither an image light nor a skybox
        np.testing.assert_array_equal(renderer.render(), physical)
        with pytest.raises(KeyError, match="did you mean 'studio'"):
            renderer.environment = "stdio"
        with pytest.raises(ValueError, match="must be one of classic, pbr"):
            renderer.shading = "path"
        renderer.shading = "classic"
        np.testing.assert_array_equal(renderer.render(), classic)
