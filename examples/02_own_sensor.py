# SPDX-License-Identifier: Apache-2.0
"""A user-defined sensor, a camera and a lidar-like scan in one suite."""

import gymnasium
import numpy as np

import mjsense as mjs

ROOM = """
<mujoco>
  <visual><headlight diffuse=".6 .6 .6"/></visual>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1" rgba=".4 .5 .6 1"/>
    <geom name="wall" type="box" size=".1 5 1" pos="2 0 1" rgba=".8 .7 .5 1"/>
    <body name="cart" pos="0 0 .2">
      <joint name="drive" type="slide" axis="1 0 0"/>
      <geom type="box" size=".3 .2 .1" mass="5" rgba=".9 .2 .1 1"/>
      <site name="mast" pos="0 0 .3"/>
      <camera name="front" pos=".3 0 .3" euler="90 -90 0" fovy="70"/>
    </body>
  </worldbody>
  <actuator><velocity name="drive" joint="drive" kv="50"/></actuator>
</mujoco>
"""


class TimeToWall(mjs.Sensor):
    """Seconds until the cart reaches the wall at its present speed."""

    uuid = "time_to_wall"
    observation_space = gymnasium.spaces.Box(0, np.inf, (1,), np.float32)
    unit = "s"

    def compute(self, sim):
        ahead = sim.scene["scan"].data.distances.min(axis=1, keepdims=True)  # m; sensors may read sensors
        speed = np.maximum(sim.qvel[:, :1], 1e-6)
        return np.where(ahead < 0, np.inf, ahead / speed).astype(np.float32)


mast = mjs.ObjRef("site", "mast", "room")
fan = [(np.cos(a), np.sin(a), 0) for a in np.linspace(-0.5, 0.5, 11)]
scene = mjs.Scene(
    mjs.SceneCfg(
        entities={"room": mjs.EntityCfg(model=ROOM)},
        sensors=(
            mjs.RayCastSensorCfg(name="scan", frame=mast, pattern=mjs.UserPatternCfg(directions=fan)),
            mjs.CameraSensorCfg(name="front", camera_name="room/front", width=64, height=48, data_types=("rgb", "depth")),
            TimeToWall(),
        ),
    )
)
sim = mjs.Simulation(scene, num_worlds=3, decimation=10)
sim.ctrl[:, 0] = [0.2, 0.5, 1.0]  # m/s
suite = mjs.SensorSuite(scene.sensors.values())

for _ in range(5):
    sim.step(10)
    observation = suite.get_observations(sim)
    print("t =", sim.time[0].round(2), " wall in", observation["time_to_wall"][:, 0].round(2), "s")

front = observation["front"]
print("picture:", front.rgb.shape, front.rgb.dtype, " depth at its centre:", front.depth[:, 24, 32, 0].round(2), "m")
print("space of one world:", suite.observation_spaces["scan"])
