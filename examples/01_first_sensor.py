# SPDX-License-Identifier: Apache-2.0
"""A scene, four worlds, an accelerometer: what it reads in free fall and after landing."""

import mjsense as mjs

BALL = """
<mujoco>
  <worldbody>
    <body name="ball" pos="0 0 1">
      <freejoint/>
      <geom size=".1" mass="1"/>
      <site name="imu"/>
    </body>
  </worldbody>
</mujoco>
"""

scene = mjs.Scene(
    mjs.SceneCfg(
        entities={"ball": mjs.EntityCfg(model=BALL)},
        terrain=mjs.TerrainCfg(),
        sensors=(
            mjs.BuiltinSensorCfg(name="acc", sensor_type="accelerometer", obj=mjs.ObjRef("site", "imu", "ball")),
            mjs.ContactSensorCfg(
                name="floor",
                primary=mjs.ContactMatch("body", "ball", "ball"),
                fields=("found", "force"),
                reduce="netforce",
                track_air_time=True,
            ),
        ),
    )
)
sim = mjs.Simulation(scene, num_worlds=4, decimation=10)
sim.qpos[:, 2] = [0.5, 1.0, 1.5, 2.0]  # each world its own height (m)
sim.forward()

acc = scene["ball/acc"]
print(acc.spec)
print("falling:", acc.data[:, 2].round(3))

sim.step(150)  # 3 s
data = scene["floor"].data
print("landed:", acc.data[:, 2].round(2), "m/s^2 upwards")
print("force on the floor:", data.force[:, 0, 2].round(2), "N")
print("in contact for:", data.current_contact_time[:, 0].round(2), "s")
