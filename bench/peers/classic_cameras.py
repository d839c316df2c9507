"""Images a second of MuJoCo's classic renderer through EGL: classic_cameras SCENE WIDTH HEIGHT rgb|depth.

Without multisampling, its fastest setting. Timed are the update of mjvScene, the picture and reading it back.
"""

import json
import statistics
import sys
import time

import opengl  # noqa: F401  before mujoco

import camera_scenes
import mujoco

RUNS = 5


def main() -> None:
    name, width, height, kind = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    model = camera_scenes.compiled(name)
    model.vis.quality.offsamples = 0
    model.vis.global_.offwidth, model.vis.global_.offheight = width, height
    data = mujoco.MjData(model)
    renderer = mujoco.Renderer(model, height, width)
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    if kind == "depth":
        renderer.enable_depth_rendering()
    seconds = []
    for frame in range(RUNS + 1):
        data.qpos[:] = camera_scenes.poses(model.qpos0, 1, frame)[0]
        mujoco.mj_forward(model, data)
        start = time.process_time()
        renderer.update_scene(data, camera_scenes.CAMERAS[name], scene_option=option)
        renderer.render()
        if frame:
            seconds.append(time.process_time() - start)
    print(json.dumps({"images_per_second": 1 / statistics.median(seconds)}))


if __name__ == "__main__":
    main()
