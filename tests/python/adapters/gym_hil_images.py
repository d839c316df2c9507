# SPDX-License-Identifier: Apache-2.0
"""gym-hil's environments with one changed line: mujoco.Renderer is mjsense.Renderer. Their constructor renders before any update_scene()."""

from images import end, require_opengl

require_opengl()

import gym_hil  # noqa: F401
import gymnasium
import mujoco
from compared import Compared

for name in ("PandaPickCubeBase-v0", "PandaArrangeBoxesBase-v0"):
    mujoco.Renderer = Compared
    env = gymnasium.make(f"gym_hil/{name}", image_obs=True)
    observation, _ = env.reset(seed=1)
    for _ in range(3):
        observation = env.step(0 * env.action_space.sample())[0]
    images = observation["pixels"]
    assert set(images) == {"front", "wrist"}
    assert all(image.std() > 5 for image in images.values()), name
    print(name, Compared.images, Compared.worst)
assert Compared.images >= 4
assert min(Compared.worst.values()) >= 30
end()
