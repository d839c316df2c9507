# SPDX-License-Identifier: Apache-2.0
"""Images of molmo-spaces' own renderer and of the same class after mjsense.compat.molmospaces.use()."""

from images import compare, end, require_opengl

require_opengl()

from pathlib import Path

import gymnasium
import mujoco
from molmo_spaces.renderer.opengl_rendering import MjOpenGLRenderer

import mjsense.compat.molmospaces

for name, psnr in {"humanoid": 30, "ant": 30, "half_cheetah": 30, "walker2d": 30}.items():
    model = mujoco.MjModel.from_xml_path(str(Path(gymnasium.__file__).parent / f"envs/mujoco/assets/{name}.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    theirs = MjOpenGLRenderer(model=model, width=160, height=120)
    with mjsense.compat.molmospaces.used():
        ours = MjOpenGLRenderer(model=model, width=160, height=120)
    for kind in ("rgb", "depth", "segmentation"):
        images = []
        for renderer in (theirs, ours):
            if kind != "rgb":
                getattr(renderer, f"enable_{kind}_rendering")()
            for _ in range(2):  # the first scene of a renderer has no camera yet, which changes the headlight
                renderer.update(data)
                image = renderer.render()
            images.append(image)
        compare(f"{name} {kind}", *images, psnr, 0.5 * model.vis.map.zfar * model.stat.extent)
    theirs.close()
    ours.close()
end()
