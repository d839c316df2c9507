# SPDX-License-Identifier: Apache-2.0
"""Images per CPU second of mujoco-warp-pbr's real-time tier on the CPU:

    warp_pbr_cameras VIEW WIDTH HEIGHT WORLDS SURROUNDINGS.hdr images.npz

rgb with shadows, textures, all lights and the surroundings; one sample for each pixel, and no reflections in mirrors. The time
includes the refit of the BVH and the images; as for mjsense, kinematics are computed before. rgb of world 0 in frame 0 is written
to images.npz.
"""

import json
import statistics
import sys
import time

import camera_scenes
import mujoco
import mujoco_warp as mjw
import mujoco_warp_pbr as mjpbr
import numpy as np
import warp as wp

RUNS = 5


def main() -> None:
    name, width, height, worlds = sys.argv[1], *map(int, sys.argv[2:5])
    surroundings, images = sys.argv[5:7]
    wp.config.quiet = True
    view = camera_scenes.VIEWS[name]
    model = camera_scenes.compiled(view.scene)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with wp.ScopedDevice("cpu"):
        m, d = mjw.put_model(model), mjw.put_data(model, data, nworld=worlds)
        context = mjpbr.create_render_context(
            model,
            nworld=worlds,
            cam_res=(width, height),
            render_rgb=True,
            render_depth=False,
            render_seg=False,
            enabled_geom_groups=list(camera_scenes.SHOWN_GROUPS),
            cam_active=[view.camera],
            envmap=surroundings,
            enable_reflections=False,
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
            mjw.refit_bvh(m, d, context.base)
            mjpbr.render(m, d, context)
            wp.synchronize()
            if frame:
                seconds.append(time.process_time() - start)
                continue
            rgb = wp.zeros((worlds, height, width), dtype=wp.vec3)
            mjpbr.get_rgb(context, 0, rgb)
            np.savez(images, rgb=(255 * rgb.numpy()[0]).round().astype(np.uint8))
    print(json.dumps({"images_per_second": worlds / statistics.median(seconds)}))


if __name__ == "__main__":
    main()
