# SPDX-License-Identifier: Apache-2.0
"""Images per CPU second of mujoco_warp's ray-traced cameras on the CPU, the renderer of mjlab's CameraSensor:

    warp_cameras VIEW WIDTH HEIGHT WORLDS shadows|plain images.npz

rgb and depth together, with textures, skybox and all lights, and with shadows if `shadows` is passed. The time includes the refit
of its BVH and the images; as for mjsense, kinematics are computed before. rgb and depth of world 0 in frame 0 are written to
images.npz.
"""

import json
import statistics
import sys
import time

import camera_scenes
import mujoco
import mujoco_warp as mjw
import numpy as np
import warp as wp

RUNS = 5


def main() -> None:
    name, width, height, worlds = sys.argv[1], *map(int, sys.argv[2:5])
    shadows, images = sys.argv[5] == "shadows", sys.argv[6]
    wp.config.quiet = True
    view = camera_scenes.VIEWS[name]
    model = camera_scenes.compiled(view.scene)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    skybox = bool((model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX).any())
    with wp.ScopedDevice("cpu"):
        m, d = mjw.put_model(model), mjw.put_data(model, data, nworld=worlds)
        context = mjw.create_render_context(
            model,
            nworld=worlds,
            cam_res=(width, height),
            render_rgb=True,
            render_depth=True,
            use_shadows=shadows,
            render_skybox=skybox,
            enabled_geom_groups=list(camera_scenes.SHOWN_GROUPS),
            cam_active=[view.camera],
        )
        seconds = []
        for frame in range(RUNS + 1):
            d.qpos.assign(camera_scenes.poses(model.qpos0, worlds, frame).astype(np.float32))
            for field, values in camera_scenes.model_fields(model, view, worlds, frame).items():
                setattr(m, field, wp.array(values.astype(np.float32), dtype=getattr(m, field).dtype))
            mjw.kinematics(m, d)
            mjw.com_pos(m, d)
            mjw.camlight(m, d)
            start = time.process_time()
            mjw.refit_bvh(m, d, context)
            mjw.render(m, d, context)
            wp.synchronize()
            if frame:
                seconds.append(time.process_time() - start)
                continue
            rgb = wp.zeros((worlds, height, width), dtype=wp.vec3)
            depth = wp.zeros((worlds, height, width), dtype=float)
            mjw.get_rgb(context, 0, rgb)
            mjw.get_depth(context, 0, 100.0, depth)  # divided by 100 m, then clamped to 1
            np.savez(images, rgb=(255 * rgb.numpy()[0]).round().astype(np.uint8), depth=100 * depth.numpy()[0])
    print(json.dumps({"images_per_second": worlds / statistics.median(seconds)}))


if __name__ == "__main__":
    main()
