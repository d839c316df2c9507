# SPDX-License-Identifier: Apache-2.0
"""Images per CPU second of mujoco_warp's ray-traced cameras on the CPU, the renderer of mjlab's CameraSensor, or of
mujoco-warp-pbr's real-time tier:

    warp_cameras VIEW WIDTH HEIGHT WORLDS shadows|plain|SURROUNDINGS.hdr images.npz

mujoco_warp: rgb and depth together, with textures, skybox and all lights, and with shadows if `shadows` is passed. With
surroundings mujoco-warp-pbr: rgb with shadows, textures, all lights and the surroundings; one sample for each pixel, and no
reflections in mirrors. The time includes the refit of the BVH and the images; as for mjsense, kinematics are computed before.
The images of world 0 in frame 0 are written to images.npz.
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
    light, images = sys.argv[5:7]
    pbr = light.endswith(".hdr")
    wp.config.quiet = True
    view = camera_scenes.VIEWS[name]
    model = camera_scenes.compiled(view.scene)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    if pbr:
        import mujoco_warp_pbr as renderer

        options = {"render_depth": False, "render_seg": False, "envmap": light, "enable_reflections": False}
    else:
        renderer = mjw
        skybox = bool((model.tex_type == mujoco.mjtTexture.mjTEXTURE_SKYBOX).any())
        options = {"render_depth": True, "use_shadows": light == "shadows", "render_skybox": skybox}
    with wp.ScopedDevice("cpu"):
        m, d = mjw.put_model(model), mjw.put_data(model, data, nworld=worlds)
        context = renderer.create_render_context(
            model,
            nworld=worlds,
            cam_res=(width, height),
            render_rgb=True,
            enabled_geom_groups=list(camera_scenes.SHOWN_GROUPS),
            cam_active=[view.camera],
            **options,
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
            mjw.refit_bvh(m, d, context.base if pbr else context)
            renderer.render(m, d, context)
            wp.synchronize()
            if frame:
                seconds.append(time.process_time() - start)
                continue
            rgb = wp.zeros((worlds, height, width), dtype=wp.vec3)
            renderer.get_rgb(context, 0, rgb)
            found = {"rgb": (255 * rgb.numpy()[0]).round().astype(np.uint8)}
            if not pbr:
                depth = wp.zeros((worlds, height, width), dtype=float)
                mjw.get_depth(context, 0, 100.0, depth)  # divided by 100 m, then clamped to 1
                found["depth"] = 100 * depth.numpy()[0]
            np.savez(images, **found)
    print(json.dumps({"images_per_second": worlds / statistics.median(seconds)}))


if __name__ == "__main__":
    main()
