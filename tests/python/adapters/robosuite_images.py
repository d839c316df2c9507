# SPDX-License-Identifier: Apache-2.0
"""robosuite's camera observations: agentview and wrist of Lift and PickPlace, with depth and segmentation."""

import numpy as np
from images import compare, compare_depth, end, require_opengl

require_opengl()

import robosuite
from robosuite.environments import base
from robosuite.utils.camera_utils import get_real_depth_map

from mjsense.compat import robosuite as adapter

CAMERAS = ["agentview", "robot0_eye_in_hand"]
own_context = base.MjRenderContextOffscreen


def observation(name, segmentation):
    """The environment and its observation after two steps."""
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
    out["rendered"] = env.sim.render(width=90, height=60, camera_name="frontview")
    return env, out


used = []
for name, segmentation in (("Lift", "instance"), ("Lift", "class"), ("PickPlace", "element")):
    base.MjRenderContextOffscreen = own_context
    own, theirs = observation(name, segmentation)
    adapter.use()
    env, ours = observation(name, segmentation)
    assert theirs.keys() == ours.keys()
    for key in theirs:
        if key.endswith("_depth"):  # 0 to 1
            assert np.median(np.abs(theirs[key] - ours[key])) < 1e-4, key
        elif "image" in key or "segmentation" in key or key == "rendered":
            compare(f"{name} {key}", theirs[key], ours[key], 30)
        else:
            np.testing.assert_array_equal(theirs[key], ours[key])
    own.close()
    used.append((name, env, ours))

# OpenGL's depth buffer has an error of 5e-5, which is 2.6 mm for agentview.
for name, env, observation in used:
    for camera in CAMERAS:
        depth = get_real_depth_map(env.sim, observation[f"{camera}_depth"])[::-1, :, 0].astype(np.float32)
        compare_depth(f"{name} {camera}", env.sim.model._model, env.sim.data._data, camera, depth)
end()
