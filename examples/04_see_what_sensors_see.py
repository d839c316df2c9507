# SPDX-License-Identifier: Apache-2.0
"""Rays, contacts and a camera's frustum, drawn into MuJoCo's own picture of a robot; the same as arrays for other viewers."""

import os
import sys
from pathlib import Path

os.environ.setdefault("MUJOCO_GL", "egl")  # only for mujoco.Renderer: mjsense's cameras need no OpenGL

import mujoco

import mjsense as mjs

LEG = """
<body name="{name}" pos="{x} {y} 0">
  <joint name="{name}_hip" axis="0 1 0" damping="2"/>
  <geom type="capsule" fromto="0 0 0 -.1 0 -.18" size=".025" mass=".5"/>
  <body name="{name}_shank" pos="-.1 0 -.18">
    <joint name="{name}_knee" axis="0 1 0" damping="2"/>
    <geom type="capsule" fromto="0 0 0 .1 0 -.18" size=".018" mass=".2"/>
    <geom name="{name}_foot" pos=".1 0 -.18" size=".03" mass=".05"/>
  </body>
</body>"""
LEGS = {"FL": (0.25, 0.15), "FR": (0.25, -0.15), "RL": (-0.25, 0.15), "RR": (-0.25, -0.15)}
DOG = f"""
<mujoco>
  <visual><headlight ambient=".3 .3 .3" diffuse=".4 .4 .4"/></visual>
  <default><geom rgba=".75 .75 .78 1"/><position kp="60"/></default>
  <worldbody>
    <light pos="1 -1 4" dir="-.2 .2 -1"/>
    <body name="trunk" pos="0 0 .5">
      <freejoint/>
      <geom type="box" size=".28 .11 .06" mass="6" rgba=".25 .3 .4 1"/>
      <site name="imu" pos="0 0 .1"/>
      <camera name="head" pos=".3 0 .02" xyaxes="0 -1 0 .4 0 1" fovy="50"/>
      {"".join(LEG.format(name=name, x=x, y=y) for name, (x, y) in LEGS.items())}
    </body>
  </worldbody>
  <actuator>{"".join(f'<position joint="{n}_hip"/><position joint="{n}_knee"/>' for n in LEGS)}</actuator>
</mujoco>"""

scene = mjs.Scene(
    mjs.SceneCfg(
        entities={"dog": mjs.EntityCfg(model=DOG)},
        terrain=mjs.TerrainCfg(),
        sensors=(
            mjs.RayCastSensorCfg(  # debug_vis: drawn unasked
                name="scan",
                frame=mjs.ObjRef("body", "trunk", "dog"),
                pattern=mjs.GridPatternCfg(size=(1.2, 0.8), resolution=0.1),
                ray_alignment="yaw",
                include_geom_groups=None,
                debug_vis=True,
            ),
            mjs.ContactSensorCfg(
                name="feet",
                primary=mjs.ContactMatch("geom", ".*_foot", "dog"),
                debug_vis=True,
                viz=mjs.sensors.ContactVizCfg(force_scale=0.01),
            ),
            mjs.CameraSensorCfg(
                name="head",
                camera_name="dog/head",
                width=64,
                height=48,
                debug_vis=True,
                viz=mjs.sensors.CameraVizCfg(frustum_depth=0.4),
            ),
            mjs.BuiltinSensorCfg(name="gyro", sensor_type="gyro", obj=mjs.ObjRef("site", "imu", "dog")),
        ),
    )
)
sim = mjs.Simulation(scene, num_worlds=2, decimation=5)
sim.step(200)

# As arrays, for matplotlib, rerun, viser ...: centres or starts, vectors, colours.
world = 1
shapes = sim.debug_shapes(world)
print(shapes)
forces = [i for i, label in enumerate(shapes.labels) if label.endswith("_force")]
print("the feet press on the floor with", (-shapes.vectors[forces].sum(0)[2] / 0.01).round(1), "N")

# As geoms of MuJoCo's: in the viewer sim.draw(viewer.user_scn, world), here in a picture.
data = mujoco.MjData(sim.model)
mujoco.mj_setState(sim.model, data, sim.state[world], mujoco.mjtState.mjSTATE_INTEGRATION)
mujoco.mj_forward(sim.model, data)
view = mujoco.MjvCamera()
view.lookat, view.distance, view.azimuth, view.elevation = data.body("dog/trunk").xpos + (0.1, 0, -0.1), 1.5, 125, -20
try:
    renderer = mujoco.Renderer(sim.model, 480, 640)
except (ImportError, RuntimeError) as error:
    print("no picture, mujoco.Renderer lacks OpenGL:", error)
else:
    renderer.update_scene(data, view)
    left_out = sim.draw(renderer.scene, world)
    left_out += sim.draw(renderer.scene, world, sensors="dog/gyro")  # sensors without debug_vis are drawn if they are named
    path = Path(sys.argv[1] if len(sys.argv) > 1 else "sensors.ppm")
    path.write_bytes(b"P6 640 480 255\n" + renderer.render().tobytes())
    print(f"{path}: {left_out} shapes found no room")
