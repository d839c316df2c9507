# SPDX-License-Identifier: Apache-2.0
"""gym-aloha's observations and ``render()``."""

from images import compare, end, require_opengl

require_opengl()

import gym_aloha  # noqa: F401
import gymnasium
import numpy as np

from mjsense.compat import dm_control as adapter


def images(name, mjsense, **kwargs):
    env = gymnasium.make(f"gym_aloha/{name}-v0", obs_type="pixels_agent_pos", **kwargs)
    if mjsense:
        adapter.use(env.unwrapped._env)
    env.reset(seed=0)
    for _ in range(2):
        observation, *_ = env.step(np.full(14, 0.1, np.float32))
    image = env.render()
    for camera in ("top", "angle", "front_close"):
        yield camera, env.unwrapped._env.physics.render(120, 160, camera_id=camera)
    yield "segmentation", env.unwrapped._env.physics.render(120, 160, camera_id="top", segmentation=True)
    yield "render", image
    yield "observation", observation["pixels"]["top"]


for name in ("AlohaTransferCube", "AlohaInsertion"):
    theirs, ours = (list(images(name, mjsense, observation_width=84, observation_height=84)) for mjsense in (False, True))
    for (what, a), (_, b) in zip(theirs, ours, strict=True):
        # OpenGL lights the corners of the table only, and misses the highlight in its middle.
        compare(f"{name} {what}", a, b, 24)
end()
