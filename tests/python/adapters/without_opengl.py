# SPDX-License-Identifier: Apache-2.0
"""All adapters in one process that has no OpenGL: with MUJOCO_GL=disable the packages' own images are errors."""

import os

os.environ["MUJOCO_GL"] = "disable"

import dm_control.suite  # before robosuite, which sets MUJOCO_GL to egl
import gym_aloha  # noqa: F401
import gymnasium
import metaworld  # noqa: F401
import robosuite

import mjsense.compat.dm_control
import mjsense.compat.gymnasium
import mjsense.compat.robosuite

mjsense.compat.dm_control.use()
mjsense.compat.robosuite.use()

env = dm_control.suite.load("cheetah", "run")
images = {"cheetah": env.physics.render(84, 84)}
env = robosuite.make("Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=True)
images["Lift"] = env.reset()["agentview_image"]
env = gymnasium.make("gym_aloha/AlohaInsertion-v0", obs_type="pixels_agent_pos")
images["ALOHA"] = env.reset(seed=0)[0]["pixels"]["top"]
env = mjsense.compat.gymnasium.use(gymnasium.make("Meta-World/MT1", env_name="reach-v3", render_mode="rgb_array"))
env.reset(seed=0)
images["Meta-World"] = env.render()
for name, image in images.items():
    assert image.std() > 20, name
with open("/proc/self/maps") as maps:
    assert "libEGL" not in maps.read()
