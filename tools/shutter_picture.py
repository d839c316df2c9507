# SPDX-License-Identifier: Apache-2.0
"""Writes docs/pictures/shutter.jpg: a fan and a falling ball without an image sensor, with a global shutter, and with the rolling
shutter of a D435 in a bright and in a dark room. python tools/shutter_picture.py
"""

from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

import mjsense as mjs

BLADES = "".join(
    f"<geom type='box' size='.16 .045 .004' pos='{0.19 * np.cos(a):.4f} {0.19 * np.sin(a):.4f} 0' "
    f"euler='0 0 {a:.4f}' material='blade'/>"
    for a in np.arange(5) * 2 * np.pi / 5
)
XML = f"""
<mujoco>
  <compiler angle="radian"/>
  <asset>
    <texture name="checks" type="2d" builtin="checker" rgb1=".8 .75 .65" rgb2=".45 .4 .35" width="64" height="64"/>
    <material name="wall" texture="checks" texrepeat="14 14" roughness=".9"/>
    <material name="blade" rgba=".85 .25 .1 1" roughness=".3"/>
    <material name="hub" rgba=".25 .25 .28 1" metallic="1" roughness=".3"/>
    <material name="ball" rgba=".1 .35 .8 1" roughness=".25"/>
  </asset>
  <worldbody>
    <light pos="-.6 -1.5 1.2" dir=".3 1 -.5" diffuse="LAMP" bulbradius=".1"/>
    <geom type="plane" size="3 3 .1" pos="0 .6 0" euler="1.5708 0 0" material="wall"/>
    <body name="fan" pos="-.25 .3 0" euler="1.5708 0 0">
      <joint type="hinge" axis="0 0 1"/>{BLADES}<geom type="cylinder" size=".06 .03" material="hub"/>
    </body>
    <body name="ball" pos=".45 .2 .62"><freejoint/><geom size=".1" material="ball"/></body>
    <camera name="view" pos="0 -1.1 0" xyaxes="1 0 0 0 0 1"/>
  </worldbody>
</mujoco>
"""
SIZE = (400, 300)


def image(light: float = 1, **options: Any) -> np.ndarray:
    lamp = " ".join(f"{light * x:g}" for x in (1, 0.95, 0.85))
    camera = mjs.CameraSensorCfg(
        name="cam", camera_name="w/view", width=SIZE[0], height=SIZE[1], shading="pbr", use_shadows=True, samples=4, **options
    )
    entity = mjs.EntityCfg(model=XML.replace("LAMP", lamp))
    scene = mjs.Scene(mjs.SceneCfg(entities={"w": entity}, sensors=[camera], options=mjs.MujocoCfg(timestep=0.0005)))
    sim = mjs.Simulation(scene, num_worlds=1)
    sim.qvel[0, 0] = 2 * np.pi * 9  # 9 turns a second
    sim.forward()
    for _ in range(600):
        sim.step()
    return scene["cam"].data.rgb[0].copy()


def main() -> None:
    global_shutter = mjs.sensors.ImagerCfg(full_well=4300, read_noise=1.7, bits=10, f_number=2, exposure_time=1 / 100)
    images = [
        image(),
        image(imager_values=global_shutter, motion_samples=32),
        image(8, imager="d435", motion_samples=32, exposure=11, environment_intensity=8.0),
        image(imager="d435", motion_samples=32),
    ]
    rows = np.concatenate([np.concatenate(images[:2], 1), np.concatenate(images[2:], 1)], 0)
    path = Path(__file__).parents[1] / "docs/pictures/shutter.jpg"
    Image.fromarray(rows).save(path, quality=90)
    print(path)


if __name__ == "__main__":
    main()
