# SPDX-License-Identifier: Apache-2.0
"""Models that the tests share."""

import mjsense as mjs

BALL = """
<mujoco>
  <worldbody>
    <body name="ball" pos="0 0 1">
      <freejoint name="root"/>
      <geom name="ball" size=".1" mass="1"/>
      <site name="imu"/>
      <site name="down" euler="180 0 0"/>
    </body>
  </worldbody>
  <sensor>
    <accelerometer name="acc" site="imu"/>
  </sensor>
</mujoco>
"""

ARM = """
<mujoco>
  <worldbody>
    <body name="upper" pos="0 0 1">
      <joint name="shoulder" type="hinge" axis="0 1 0" range="-90 90" limited="true"/>
      <geom name="upper" type="capsule" fromto="0 0 0 .3 0 0" size=".03"/>
      <body name="fore" pos=".3 0 0">
        <joint name="elbow" type="hinge" axis="0 1 0"/>
        <geom name="fore" type="capsule" fromto="0 0 0 .2 0 0" size=".02"/>
        <site name="hand" pos=".2 0 0"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="shoulder" joint="shoulder"/>
    <motor name="elbow" joint="elbow"/>
  </actuator>
</mujoco>
"""


def ball_scene(*sensors, **kwargs):
    return mjs.Scene(
        mjs.SceneCfg(
            entities={"ball": mjs.EntityCfg(model=BALL)}, terrain=mjs.TerrainCfg(), sensors=sensors, **kwargs
        )
    )


def feet_cfg(**kwargs):
    return mjs.ContactSensorCfg(
        name="touch", primary=mjs.ContactMatch(mode="geom", pattern=".*", entity="ball"), **kwargs
    )
