# SPDX-License-Identifier: Apache-2.0
"""Motion blur and rolling shutter of image sensors, compared with what a pinhole camera sees of plates in motion."""

import numpy as np
import pytest

import mjsense as mjs

WIDTH, HEIGHT, FOVY, DISTANCE = 200, 120, 45.0, 2.0
PIXELS = HEIGHT / 2 / np.tan(np.radians(FOVY) / 2) / DISTANCE
"""Pixels of one metre at the plates' distance."""
PLATE = "<{} type='box' size='.05 {} 1e-4' pos='0 0 -1e-4' {}/>"
XML = """
<mujoco>
  <visual><headlight active="0"/></visual>
  <asset><material name="glow" rgba="1 1 1 1" emission=".4" specular="0"/></asset>
  <worldbody>
    {still}
    <body name="plate" {mocap}>{joint}<geom size=".01" pos="0 0 -5" rgba="0 0 0 0" mass="1" contype="0" conaffinity="0"/>{plate}</body>
    <body name="carriage"><joint type="slide" axis="1 0 0"/>
      <geom size=".01" pos="0 0 9" rgba="0 0 0 0" mass="1" contype="0" conaffinity="0"/><camera name="view" pos="0 0 2"/></body>
  </worldbody>
</mujoco>
"""
SLIDE = "<joint name='slide' type='slide' axis='1 0 0'/>"
EXACT = {"full_well": 1e12, "read_noise": 0, "bits": 16, "f_number": 4, "vignetting": 0}
"""Without noise; at the default exposure the longest exposure time, up to 62 ms, needs gain."""


def plate(height: float, kind: str = "geom", group: int = 0) -> str:
    more = "material='glow'" + ("" if kind == "site" else " contype='0' conaffinity='0'")
    return PLATE.format(kind, height, f"{more} group='{group}'")


class Shot:
    """A plate in motion in front of a camera."""

    def __init__(self, xml: str, sensor: dict[str, float] | None, worlds: int = 1, threads: int = 1, **options: object) -> None:
        values = {} if sensor is None else {"imager_values": mjs.sensors.ImagerCfg(**(EXACT | sensor))}
        plain = {"shading": "pbr", "tone_mapping": "linear", "environment_intensity": 0.0, "width": WIDTH, "height": HEIGHT}
        camera = mjs.CameraSensorCfg(name="cam", camera_name="w/view", **{**plain, **values, **options})
        entity = mjs.EntityCfg(model=xml)
        self.scene = mjs.Scene(mjs.SceneCfg(entities={"w": entity}, sensors=[camera], options=mjs.MujocoCfg(timestep=0.001)))
        self.sim = mjs.Simulation(self.scene, num_worlds=worlds, threads=threads)

    def light(self) -> np.ndarray:
        """The linear image of the first world, [H, W]."""
        x = np.array(self.scene["cam"].data.rgb[0, :, :, 0], float) / 255
        return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def moments(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean column, in pixels from the centre of the image, and variance of each row's light."""
    x = np.arange(rows.shape[-1]) + 0.5 - rows.shape[-1] / 2
    total = rows.sum(-1)
    mean = (rows * x).sum(-1) / total
    return mean, (rows * (x - mean[:, None]) ** 2).sum(-1) / total


@pytest.mark.parametrize("mover", ["geom", "site", "camera", "mocap"])
def test_blur_is_the_path_during_the_exposure(mover: str) -> None:
    """A plate at v m/s is blurred over v t f / z pixels, up to where it is now, whatever moves it."""
    speed, exposure, steps = 4.0, 0.04, 60
    kind = "site" if mover == "site" else "geom"
    mocap = mover == "mocap"
    xml = XML.format(still="", mocap="mocap='true'" if mocap else "", joint="" if mocap else SLIDE, plate=plate(0.3, kind))
    sites = {"enabled_site_groups": (0,)} if kind == "site" else {}
    shot = Shot(xml, {"exposure_time": exposure}, samples=16, motion_samples=40, **sites)
    sim = shot.sim
    if not mocap:
        sim.qvel[0] = (0, -speed) if mover == "camera" else (speed, 0)
    for _ in range(steps):
        if mocap:
            sim.mocap_pos[0, 0, 0] += speed * sim.model.opt.timestep
        sim.step()
    now = speed * 0.001 * steps
    image = shot.light()
    middle = image[HEIGHT // 2 - 8 : HEIGHT // 2 + 8]
    mean, variance = moments(middle)
    length, width = speed * exposure * PIXELS, 0.1 * PIXELS
    np.testing.assert_allclose(mean, now * PIXELS - length / 2, atol=0.1)
    np.testing.assert_allclose(np.sqrt(12 * variance - width**2), length, atol=0.2)
    lit = (middle > 1e-4).sum(-1)
    np.testing.assert_allclose(lit, length * (1 - 1 / 40) + width, atol=1.5)
    assert middle.sum(-1) == pytest.approx(0.4 * width * np.ones(16), rel=0.02)  # the light is only spread


@pytest.mark.parametrize("shading", ["pbr", "path"])
def test_rolling_shutter_shears_a_vertical_bar(shading: str) -> None:
    """Row y of H shows the bar readout_time (H - 1 - y) / H before the last row does."""
    speed, readout, steps = 4.0, 0.02, 40
    xml = XML.format(still="", mocap="", joint=SLIDE, plate=plate(2, "geom"))
    shot = Shot(xml, {"exposure_time": 1e-4, "readout_time": readout}, samples=16, shading=shading, samples_per_pixel=16)
    shot.sim.qvel[0, 0] = speed
    for _ in range(steps):
        shot.sim.step()
    mean, _ = moments(shot.light())
    rows = HEIGHT - 1 - np.arange(HEIGHT)
    expected = (speed * 0.001 * steps - speed * readout * rows / HEIGHT) * PIXELS
    step = speed * readout / 64 * PIXELS  # rows end at one of 64 times
    np.testing.assert_allclose(mean, expected, atol=step + 0.15)
    shear = np.polyfit(rows, mean, 1)[0] * HEIGHT
    np.testing.assert_allclose(shear, -speed * readout * PIXELS, rtol=0.01)


def test_what_does_not_move_keeps_every_bit() -> None:
    """At rest, and in the part of a picture that shows nothing that moves; other data show the present."""
    imager = {"exposure_time": 0.03, "readout_time": 0.01, "full_well": 1000, "read_noise": 3, "bits": 8}
    still = "<geom type='box' size='.3 .3 .01' pos='-.4 .1 0' material='glow'/>"
    xml = XML.format(still=still, mocap="", joint=SLIDE, plate=plate(0.05))
    kinds = ("rgb", "hdr", "depth", "segmentation")
    for speed in (0.0, 2.0):
        seen = []
        for options in ({"motion_samples": 6}, {"motion_samples": 0}, {"motion_samples": 6, "data_types": ("rgb",)}):
            shot = Shot(xml, imager, **{"data_types": kinds, **options})
            shot.sim.qpos[0, 0] = 0.3
            shot.sim.qvel[0, 0] = speed
            shot.sim.forward()
            for _ in range(50):
                shot.sim.step()
            seen.append({kind: np.array(getattr(shot.scene["cam"].data, kind)) for kind in shot.scene["cam"].cfg.data_types})
        moving, sharp, alone = seen
        for kind in kinds[1:]:
            np.testing.assert_array_equal(moving[kind], sharp[kind])
        np.testing.assert_array_equal(alone["rgb"], moving["rgb"])
        np.testing.assert_array_equal(moving["rgb"][:, :, :90], sharp["rgb"][:, :, :90])
        assert (moving["rgb"] == sharp["rgb"]).all() == (speed == 0)


def test_the_same_bits_at_any_number_of_threads_and_worlds() -> None:
    xml = XML.format(
        still="<geom type='plane' size='2 2 .1' pos='0 0 -.3'/><light pos='0 0 3' diffuse='.8 .8 .8'/>",
        mocap="",
        joint=SLIDE,
        plate=plate(0.3),
    )

    def images(worlds: int, threads: int, every: int = 10, **options: object) -> np.ndarray:
        shot = Shot(xml, None, worlds, threads, **{"imager": "d435", "use_shadows": True, **options})
        shot.sim.qvel[:, 0] = 1 + np.arange(worlds)
        for i in range(60):
            shot.sim.step()
            if i % every == every - 1:
                found = np.array(shot.scene["cam"].data.rgb)
        return found

    for options in ({"exposure_mode": "auto"}, {"environment_intensity": 1.0}):
        reference = images(5, 1, **options)
        for threads in (2, 5):
            np.testing.assert_array_equal(images(5, threads, **options), reference)
        np.testing.assert_array_equal(images(1, 1, **options)[0], reference[0])
        assert (images(1, 1, motion_samples=0, **options) != reference[:1]).mean() > 0.005
    # Tiles that are kept from earlier images do not change later ones.
    np.testing.assert_array_equal(images(5, 2, every=60, environment_intensity=1.0), reference)


def test_a_reset_and_a_written_pose_leave_no_trace() -> None:
    xml = XML.format(still="", mocap="", joint=SLIDE, plate=plate(0.3))
    imager = {"exposure_time": 0.03, "readout_time": 0.01}
    shot, sharp = Shot(xml, imager), Shot(xml, imager, motion_samples=0)
    for each in (shot, sharp):
        each.sim.qvel[0, 0] = 3
        for _ in range(30):
            each.sim.step()
        each.sim.reset()
    np.testing.assert_array_equal(shot.light(), sharp.light())
    for each in (shot, sharp):
        each.sim.qpos[0, 0] = 0.3  # before the first step
        each.sim.forward()
    np.testing.assert_array_equal(shot.light(), sharp.light())


def test_bad_options() -> None:
    xml = XML.format(still="", mocap="", joint=SLIDE, plate=plate(0.3))
    with pytest.raises(ValueError, match="motion_samples is 65: must be between 0 and 64"):
        Shot(xml, {}, motion_samples=65)
    with pytest.raises(ValueError, match="readout_time is -1: must be at least 0"):
        mjs.sensors.ImagerCfg(readout_time=-1)
    long = "camera 'cam': exposure_time and readout_time of its image sensor are 20 s together, in which there are 20000 physics steps"
    with pytest.raises(ValueError, match=long):
        Shot(xml, {"exposure_time": 15, "readout_time": 5})
    Shot(xml, {"exposure_time": 15, "readout_time": 5}, motion_samples=0)
    with pytest.raises(ValueError, match="noise, delays, ray times or exposures of sensor 'cam'"):
        Shot(xml, {}).sim.options.timestep = 0.002
