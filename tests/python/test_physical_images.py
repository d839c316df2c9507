# SPDX-License-Identifier: Apache-2.0
"""Images with shading="pbr": the same bits for any number of threads and worlds, other outputs as with classic shading, bad options."""

import sys
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
        ({"exposure_mode": "auto"}, "exposure_mode 'auto' and imager need linear radiance, thus shading 'pbr' or 'path'; it is 'classic'"),
        ({"shading": "pbr", "imager": "d436"}, "imager is 'd436': must be one of none, d435, zed_mini"),
        (
            {"shading": "pbr", "imager": "d435", "imager_values": mjs.sensors.ImagerCfg()},
            "imager is 'd435' and imager_values are given",
        ),
        ({"environment_intensity": -1}, "environment_intensity"),
        ({"tone_mapping": "aces"}, "must be one of neutral, filmic, linear, agx"),
        ({"white_balance": 1000}, "white_balance"),
        ({"shading": "pbr", "environment": "studo"}, "environment: no surroundings named 'studo'; did you mean 'studio'"),
        ({"shading": "pbr", "environment": "skybox"}, "the model has no skybox texture"),
        ({"shading": "pbr", "environment": "x.exr"}, "environment 'x.exr': no such file"),
        ({"shading": "pbr", "environment": "x.jpg"}, "only pictures of type .hdr and .exr"),
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
        with pytest.raises(ValueError, match="must be one of classic, pbr, path"):
            renderer.shading = "ray"
        renderer.shading = "classic"
        np.testing.assert_array_equal(renderer.render(), classic)


LAMP = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <asset><texture name="around" type="cube" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8" height="8"/></asset>
  <worldbody>
    <light name="around" type="image" texture="around" intensity="314.16" diffuse="1 .5 .25"/>
    <light name="lamp" type="directional" dir="0 0 -1" diffuse="1 1 1" intensity="314.16" castshadow="false"/>
    <geom type="plane" size="3 3 .1" rgba="1 1 1 1"/>
    <body name="ball" pos="5 0 1"><freejoint/><geom size=".1"/></body>
    <camera name="view" pos="0 0 1"/>
  </worldbody>
</mujoco>
"""
"""A white floor, lit by the surroundings with 314 lux and by a lamp with as much: 100 cd/m^2 each in red."""


class Lamp:
    """The floor in worlds whose lamps can be changed."""

    def __init__(self, worlds: int = 1, threads: int = 1, **options: object) -> None:
        camera = mjs.CameraSensorCfg(name="cam", camera_name="w/view", width=32, height=24, shading="pbr", ambient_occlusion=False, **options)
        self.scene = mjs.Scene(mjs.SceneCfg(entities={"w": mjs.EntityCfg(model=LAMP)}, sensors=[camera]))
        self.sim = mjs.Simulation(self.scene, num_worlds=worlds, threads=threads)
        self.lights = np.tile(np.array(self.sim.model.light_diffuse, np.float32), (worlds, 1, 1))

    def shine(self, light: int, world: int, color: tuple[float, float, float]) -> None:
        self.lights[world, light] = color
        self.sim.randomize("light_diffuse", self.lights)

    def seen(self, kind: str = "rgb") -> np.ndarray:
        return np.array(getattr(self.scene["cam"].data, kind), float)


def test_image_lights_have_a_colour_and_intensity_in_each_world() -> None:
    """The illuminance of the surroundings is their intensity; as with other lights, the colour is diffuse."""
    lamp = Lamp(2, data_types=("hdr",), environment_rotation=20)
    for world in (0, 1):
        lamp.shine(1, world, (0, 0, 0))
    lamp.shine(0, 1, (0.5, 0.5, 0.5))
    lamp.sim.forward()
    radiance = lamp.seen("hdr").mean((1, 2))
    np.testing.assert_allclose(radiance[0], (100, 50, 25), rtol=0.03)  # white reflects a little as a mirror
    np.testing.assert_allclose(radiance[1], (50, 50, 50), rtol=0.03)
    model = mujoco.MjModel.from_xml_string(LAMP)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mjs.Renderer(model, 24, 32) as renderer:
        renderer.shading = "pbr"
        renderer.update_scene(data, "view")
        warm = renderer.render().mean((0, 1))
    assert warm[0] > warm[1] + 5 > warm[2] + 10


def test_automatic_exposure_follows_the_light() -> None:
    """The first image is exposed for middle grey; after a change, 63 % of it follow in one time constant; a reset meters anew."""
    lamp = Lamp(2, exposure_mode="auto", exposure_time_constant=0.1, tone_mapping="linear")
    lamp.shine(0, 0, (1, 1, 1))
    lamp.shine(0, 1, (1, 1, 1))

    def grey() -> np.ndarray:  # linear, of 1 for white
        x = lamp.seen().mean((1, 2, 3)) / 255
        return ((x + 0.055) / 1.055) ** 2.4

    lamp.sim.forward()
    np.testing.assert_allclose(grey(), 0.18, rtol=0.03)
    lamp.shine(0, 1, (0.1, 0.1, 0.1))  # from 200 to 110 cd/m^2
    steps = round(0.1 / lamp.sim.model.opt.timestep)
    for _ in range(steps):
        lamp.sim.step()
    seen = grey()
    np.testing.assert_allclose(seen[0], 0.18, rtol=0.03)
    np.testing.assert_allclose(seen[1], 0.18 * (110 / 200) ** np.exp(-1), rtol=0.04)
    np.testing.assert_array_equal(grey(), seen)  # a second read gives the same image
    lamp.sim.reset([1])
    np.testing.assert_allclose(grey(), 0.18, rtol=0.03)


def test_noise_of_image_sensors() -> None:
    """The variance is that of photons and reading, and grows with the gain; the corners are darker; worlds and threads do not matter."""
    values = mjs.sensors.ImagerCfg(full_well=2000, read_noise=10, bits=16, f_number=2, exposure_time=1 / 64, vignetting=0)

    def linear(lamp: Lamp) -> np.ndarray:
        lamp.sim.forward()
        x = lamp.seen() / 255
        return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)

    with pytest.raises(ValueError, match="bits is 0: must be between 1 and 16"):
        mjs.sensors.ImagerCfg(bits=0)
    plain = {"tone_mapping": "linear", "environment_intensity": 0.0}
    for exposure, gain, light in ((8, 1, 1.0), (6, 4, 0.25)):  # with f/2 and 1/64 s, EV 8 needs no gain
        shown = []
        for imager in (values, None):
            lamp = Lamp(1, exposure=exposure, imager_values=imager, **plain)
            lamp.shine(1, 0, (light, light, light))
            shown.append(linear(lamp))
        noise, mean, well = shown[0] - shown[1], shown[1].mean(), 2000 / gain
        assert 0.2 < mean < 0.5
        variance = (mean * well + 100) / well**2
        assert abs(noise.mean()) < 5 * np.sqrt(variance / noise.size)
        np.testing.assert_allclose(noise.std(), np.sqrt(variance), rtol=0.08)
    corners = linear(Lamp(1, imager_values=mjs.sensors.ImagerCfg(full_well=1e12, read_noise=0, bits=16, vignetting=1), **plain))[0, :, :, 0]
    whole = linear(Lamp(1, **plain))[0, :, :, 0]
    x, y = (np.arange(32) - 15.5) / 12 * np.tan(np.pi / 8), (np.arange(24) - 11.5) / 12 * np.tan(np.pi / 8)
    np.testing.assert_allclose(corners / whole, 1 / (1 + x[None] ** 2 + y[:, None] ** 2) ** 2, atol=0.02)
    reference = images(4, 1, shading="pbr", imager="d435", exposure_mode="auto")["rgb"]
    for threads in (2, 5):
        np.testing.assert_array_equal(images(4, threads, shading="pbr", imager="d435", exposure_mode="auto")["rgb"], reference)
    np.testing.assert_array_equal(images(1, 1, shading="pbr", imager="d435", exposure_mode="auto")["rgb"][0], reference[0])
    assert np.mean(images(1, 1, shading="pbr", imager="zed_mini")["rgb"] != images(1, 1, shading="pbr")["rgb"]) > 0.3


def test_surroundings_of_openexr_pictures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """They are those of the same .hdr picture; without the package, and for bad files, there is one error."""
    rgb = np.full((8, 16, 3), 0.25, np.float32)
    rgb[:, :8] = (2, 0.5, 0)
    path = tmp_path / "sky.exr"

    def seen() -> np.ndarray:
        return images(1, 1, 1, ("rgb",), shading="pbr", environment=str(path))["rgb"]

    path.write_bytes(b"no picture")
    with monkeypatch.context() as patch:
        patch.setitem(sys.modules, "OpenEXR", None)
        with pytest.raises(ModuleNotFoundError, match=r"environment '.*sky.exr' needs OpenEXR: pip install 'mjsense\[exr\]'"):
            seen()
    openexr = pytest.importorskip("OpenEXR")

    def write(name: str, pixels: np.ndarray) -> None:
        openexr.File({"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage}, {name: pixels}).write(str(path))

    for name, pixels, message in (
        ("", rgb, "not an OpenEXR picture, or damaged"),
        ("RGB", rgb[:, :9], "9 x 8 pixels; an equirectangular image is twice as wide as high"),
        ("Y", rgb[..., 0].copy(), "no channel R; there are Y"),
        ("RGB", np.where(rgb == 2, np.nan, rgb), "radiance nan in column 0, row 0"),
        ("RGB", -rgb, "radiance -2 in column 0, row 0"),
    ):
        if name:
            write(name, np.ascontiguousarray(pixels))
        with pytest.raises(ValueError, match=f"environment '.*sky.exr': {message}"):
            seen()
    about = {"type": openexr.scanlineimage, "displayWindow": (np.zeros(2, np.int32), np.array([15, 7], np.int32))}
    openexr.File([openexr.Part(dict(about), {"RGB": rgb}, name) for name in "ab"]).write(str(path))
    with pytest.raises(ValueError, match=r"environment '.*sky.exr': 2 pictures; a file with one is expected"):
        seen()
    write("RGB", rgb)
    from_exr = seen()
    texel = {(2, 0.5, 0): (128, 32, 0, 130), (0.25, 0.25, 0.25): (128, 128, 128, 127)}
    rgbe = np.array([[texel[tuple(x)] for x in row] for row in rgb.tolist()], np.uint8)
    path = tmp_path / "sky.hdr"
    path.write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 8 +X 16\n" + rgbe.tobytes())
    np.testing.assert_array_equal(seen(), from_exr)
