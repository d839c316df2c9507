# SPDX-License-Identifier: Apache-2.0
"""Images per CPU second of MuJoCo's classic renderer through EGL: classic_cameras VIEW WIDTH HEIGHT.

Measures rgb with shadow maps of 4096 (MuJoCo's default) and of 1024, rgb without shadows, and depth, all without multisampling
(its fastest setting). The time includes the update of mjvScene, rendering and reading the image back.
"""

import copy
import json
import statistics
import sys
import time

import opengl  # noqa: F401  before mujoco

# isort: split
import camera_scenes
import mujoco

RUNS = 5


def measure(base: mujoco.MjModel, view: camera_scenes.View, width: int, height: int, kind: str, shadow_map: int) -> float:
    model = copy.copy(base)
    model.vis.quality.offsamples = 0
    if shadow_map:
        model.vis.quality.shadowsize = shadow_map
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    data = mujoco.MjData(model)
    renderer = mujoco.Renderer(model, height, width, max_geom=model.ngeom + 1000)
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    renderer.scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = shadow_map > 0
    if kind == "depth":
        renderer.enable_depth_rendering()
    seconds = []
    for frame in range(RUNS + 1):
        data.qpos[:] = camera_scenes.poses(model.qpos0, 1, frame)[0]
        for name, values in camera_scenes.model_fields(base, view, 1, frame).items():
            getattr(model, name)[:] = values[0]
        mujoco.mj_forward(model, data)
        start = time.process_time()
        renderer.update_scene(data, view.camera, scene_option=option)
        renderer.render()
        if frame:
            seconds.append(time.process_time() - start)
    renderer.close()
    return 1 / statistics.median(seconds)


def main() -> None:
    view, width, height = (camera_scenes.VIEWS | camera_scenes.GROWTH)[sys.argv[1]], int(sys.argv[2]), int(sys.argv[3])
    settings = {"4096": ("rgb", 4096), "1024": ("rgb", 1024), "plain": ("rgb", 0), "depth": ("depth", 0)}
    base = camera_scenes.compiled(view.scene)
    print(json.dumps({name: measure(base, view, width, height, *setting) for name, setting in settings.items()}))


if __name__ == "__main__":
    main()
