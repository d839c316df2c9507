# SPDX-License-Identifier: Apache-2.0
"""Images per CPU second of MuJoCo's Filament renderer through Vulkan, in software if there is no GPU:

    filament_cameras SCENE CAMERA WIDTH HEIGHT rgb|depth image.npz

One image at a time without multisampling; rgb with shadows but without reflections, its most expensive feature. The time includes
the update of its scene, rendering and reading the image back. mujoco.rendering.filament.Renderer needs Python 3.12, so this
program calls mjrf directly in the same manner. Frame 0 is written to image.npz.
"""

import json
import statistics
import sys
import time

import camera_scenes
import mujoco
import mujoco.studio.window
import numpy as np
from mujoco import mjrf
from mujoco.rendering.filament.model_scene import ModelScene

RUNS = 5


def camera(model: mujoco.MjModel, data: mujoco.MjData, name: str) -> mjrf.Camera:
    view = mujoco.MjvCamera()
    view.type, view.fixedcamid = int(mujoco.mjtCamera.mjCAMERA_FIXED), model.cam(name).id
    c = mujoco.mjv_camera2GLCamera(model, data, view)
    return mjrf.Camera(
        pos=c.pos,
        forward=c.forward,
        up=c.up,
        frustum_bottom=c.frustum_bottom,
        frustum_top=c.frustum_top,
        frustum_near=c.frustum_near,
        frustum_far=c.frustum_far,
    )


def metres(depth: np.ndarray, camera: mjrf.Camera) -> np.ndarray:
    """Depth in metres from Filament's depth buffer, which is 1 at the near plane and 0 at the far plane. 0 where there is no
    surface."""
    near, far = camera.frustum_near, camera.frustum_far
    return np.where(depth > 0, near * far / (near + depth * (far - near)), 0).astype(np.float32)


def main() -> None:
    name, view, kind, file = sys.argv[1], sys.argv[2], sys.argv[5], sys.argv[6]
    width, height = int(sys.argv[3]), int(sys.argv[4])
    model = camera_scenes.compiled(name)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    config = mjrf.ContextConfig()
    config.software_rendering = True
    context = mjrf.Context(config)
    scene = context.create_scene(mjrf.SceneParams())
    everything = ModelScene(context, model, scene)
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    everything._renderables.set_options(option)
    scene.set_msaa(1)

    pixels = np.zeros((height, width, 3), np.uint8) if kind == "rgb" else np.zeros((height, width), np.float32)
    color = mjrf.PixelFormat.PIXEL_FORMAT_RGB8 if kind == "rgb" else mjrf.PixelFormat.PIXEL_FORMAT_R32F
    target = context.create_render_target(mjrf.RenderTargetConfig(color_format=color))
    target.resize(width, height)
    read = mjrf.ReadRequest(target=target)
    read.set_buffer(pixels)
    request = mjrf.RenderRequest()
    request.scene, request.target = scene, target
    request.viewport.width, request.viewport.height = width, height
    request.reflections = request.haze = False
    request.shadows = request.skybox = request.post_processing = kind == "rgb"
    if kind == "depth":
        request.draw_mode = mjrf.DrawMode.DRAW_MODE_DEPTH

    seconds = []
    for frame in range(RUNS + 1):
        data.qpos[:] = camera_scenes.poses(model.qpos0, 1, frame)[0]
        mujoco.mj_forward(model, data)
        start = time.process_time()
        everything.update(data)
        request.camera = camera(model, data, view)
        context.wait_for_frame(context.render([request], [read]))
        if frame:
            seconds.append(time.process_time() - start)
        else:
            np.savez(file, image=pixels if kind == "rgb" else metres(pixels, request.camera))
    print(json.dumps({"images_per_second": 1 / statistics.median(seconds)}))


if __name__ == "__main__":
    main()
