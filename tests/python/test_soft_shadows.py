# SPDX-License-Identifier: Apache-2.0
"""Soft shadows: `shadow_samples` points of a light with a radius."""

import numpy as np
import pytest

import mjsense as mjs

ROOM = """
<mujoco>
  <visual><headlight ambient="0.2 0.2 0.2" diffuse="0 0 0" specular="0 0 0"/></visual>
  <worldbody>
    <light name="lamp" pos="0 0 2" type="{kind}" diffuse="0.6 0.6 0.6" specular="0 0 0" bulbradius="{radius}" attenuation="1 0 0"/>
    <geom type="plane" size="2 2 .1" rgba="1 1 1 1"/>
    <body pos="0 0 0.5"><freejoint/><geom type="box" size=".2 .2 .02" rgba="1 0 0 1"/></body>
    <camera name="eye" pos="0 -2 2" xyaxes="1 0 0 0 0.7 0.7"/>
  </worldbody>
</mujoco>"""


def image(samples, radius=0.2, threads=1, kind="point"):
    camera = mjs.CameraSensorCfg("eye", camera_name="room/eye", width=96, height=64, use_shadows=True, shadow_samples=samples)
    room = mjs.EntityCfg(model=ROOM.format(radius=radius, kind=kind))
    scene = mjs.Scene(mjs.SceneCfg(entities={"room": room}, sensors=(camera,)))
    mjs.Simulation(scene, num_worlds=3, threads=threads)
    rgb = np.array(scene["eye"].data.rgb)
    assert (rgb == rgb[0]).all()
    return rgb[0].astype(int)


def test_the_penumbra_has_levels_between_light_and_shadow():
    hard, soft = image(1), image(16)
    ground = (hard[..., 0] == hard[..., 1]) & (hard[..., 1] > 0)
    dark = hard[ground].min()
    between = ground & (soft[..., 0] > dark + 8) & (np.abs(soft - hard).max(-1) > 8)
    assert between.sum() > 50
    assert len(np.unique(soft[between][:, 0])) > 8
    assert np.abs(soft - hard)[40:, :10].max() <= 2  # far from the shadow, the sum of the lights is the light


@pytest.mark.parametrize("changed", [dict(samples=16, radius=0), dict(samples=16, kind="directional")])
def test_lights_without_a_radius_or_position_have_hard_shadows(changed):
    np.testing.assert_array_equal(image(**changed), image(**(changed | {"samples": 1})))


def test_images_do_not_depend_on_the_number_of_threads():
    np.testing.assert_array_equal(image(7), image(7, threads=3))
