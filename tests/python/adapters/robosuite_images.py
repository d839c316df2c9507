# SPDX-License-Identifier: Apache-2.0
"""robosuite's camera observations: agentview and wrist of Lift and PickPlace, with depth and segmentation."""

import sys

import numpy as np
from images import compare, end, require_opengl

require_opengl()

import robosuite
from robosuite.environments import base
from robosuite.utils.camera_utils import get_real_depth_map

from mjsense.compat import robosuite as adapter

CAMERAS = ["agentview", "robot0_eye_in_hand"]
own_context = base.MjRenderContextOffscreen


def observation(name, segmentation):
    """The observation after two steps, depth in metres."""
    env = robosuite.make(
        name,
        robots="Panda",
        has_renderer=False,
        has_offscreen_renderer=True,
        use_camera_obs=True,
        camera_names=CAMERAS,
        camera_heights=[84, 128],
        camera_widths=[84, 160],
        camera_depths=True,
        camera_segmentations=segmentation,
        seed=3,
    )
    env.reset()
    for _ in range(2):
        out, *_ = env.step(np.full(env.action_dim, 0.1))
    out = {key: np.asarray(value) for key, value in out.items()}
    for key in out:
        if key.endswith("_depth"):
            out[key] = get_real_depth_map(env.sim, out[key])[..., 0].astype(np.float32)
    out["rendered"] = env.sim.render(width=90, height=60, camera_name="frontview")
    env.close()
    return out


for name, segmentation in (("Lift", "instance"), ("Lift", "class"), ("PickPlace", "element")):
    base.MjRenderContextOffscreen = own_context
    theirs = observation(name, segmentation)
    adapter.use()
    ours = observation(name, segmentation)
    assert theirs.keys() == ours.keys()
    for key in theirs:
        if "image" in key or "depth" in key or "segmentation" in key or key == "rendered":
            compare(f"{name} {key}", theirs[key], ours[key], 30)
        else:
            np.testing.assert_array_equal(theirs[key], ours[key])
end()
