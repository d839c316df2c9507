# SPDX-License-Identifier: Apache-2.0
"""Three worlds that look different: colour, light and camera randomised; pictures, ids and a point cloud."""

import numpy as np

import mjsense as mjs

ROOM = """
<mujoco>
  <asset><material name="paint" rgba=".8 .2 .2 1"/></asset>
  <worldbody>
    <light name="lamp" pos="0 0 3" dir="0 0 -1"/>
    <geom name="floor" type="plane" size="4 4 .1"/>
    <body name="box" pos="0 0 .3"><geom name="box" type="box" size=".3 .3 .3" material="paint"/></body>
    <body name="mast" pos="-2 0 1"><site name="top"/></body>
    <camera name="eye" pos="-2 0 1.2" xyaxes="0 -1 0 .35 0 1" fovy="60"/>
  </worldbody>
</mujoco>
"""

scene = mjs.Scene(
    mjs.SceneCfg(
        entities={"room": mjs.EntityCfg(model=ROOM)},
        sensors=(
            mjs.CameraSensorCfg(
                "eye",
                camera_name="room/eye",
                width=160,
                height=120,
                samples=4,
                use_shadows=True,
                data_types=("rgb", "depth", "segmentation"),
            ),
            mjs.LidarSensorCfg(
                "lidar",
                frame=mjs.ObjRef("site", "top", "room"),
                range_noise_std=0.01,
                scan=mjs.SpinningScanCfg(channels=32, elevation_min_deg=-40, elevation_max_deg=10),
            ),
        ),
    )
)
sim = mjs.Simulation(scene, num_worlds=3, seed=7)
rng = np.random.default_rng(7)
sim.randomize("mat_rgba", np.concatenate([rng.uniform(0.1, 1, (3, 1, 3)), np.ones((3, 1, 1))], axis=2))
sim.randomize("light_diffuse", rng.uniform(0.3, 1, (3, 1, 3)))
sim.randomize("cam_fovy", [[50], [60], [70]])

images = scene["eye"].data
box = sim.model.geom("room/box").id
print("pixels of the box:", (images.segmentation[..., 0] == box).sum(axis=(1, 2)))
print("its colour:", [rgb[ids[..., 0] == box].mean(axis=0).round().tolist() for rgb, ids in zip(images.rgb, images.segmentation)])
with open("eye.ppm", "wb") as file:  # any picture viewer
    file.write(b"P6 160 120 255\n" + images.rgb[0].tobytes())

lidar = scene["lidar"]
print("returns:", (lidar.data.distances >= 0).sum(axis=1))
lidar.write_point_cloud("cloud.ply", world=2)
