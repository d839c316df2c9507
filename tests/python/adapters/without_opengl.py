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



def cheetah():
    return dm_control.suite.load("cheetah", "run", task_kwargs={"random": 0}).physics.render(84, 84)


def lift():
    env = robosuite.make("Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=True, seed=0)
    return env.reset()["agentview_image"]


def reach(**shading):
    env = gymnasium.make("Meta-World/MT1", env_name="reach-v3", render_mode="rgb_array", seed=0)
    env = mjsense.compat.gymnasium.use(env, **shading)
    env.reset(seed=0)
    return env.render()


images = {"cheetah": cheetah(), "Lift": lift(), "Meta-World": reach()}
env = gymnasium.make("gym_aloha/AlohaInsertion-v0", obs_type="pixels_agent_pos")
images["ALOHA"] = env.reset(seed=0)[0]["pixels"]["top"]
for name, image in images.items():
    assert image.std() > 20, name

physical = {"shading": "pbr", "environment": "studio"}
mjsense.compat.dm_control.use(**physical)
mjsense.compat.robosuite.use(**physical)
for name, image in {"cheetah": cheetah(), "Lift": lift(), "Meta-World": reach(**physical)}.items():
    assert image.std() > 10, name
    assert (image != images[name]).mean() > 0.5, name
env = mjsense.compat.gymnasium.use(gymnasium.make("Meta-World/MT1", env_name="reach-v3", render_mode="rgb_array"))
env.reset(seed=0)
classic = env.render().copy()
assert (mjsense.compat.gymnasium.use(env, **physical).render() != classic).mean() > 0.5
for function in (mjsense.compat.dm_control.use, mjsense.compat.robosuite.use, reach):
    try:
        function(shading="pbrr")
    except ValueError as error:
        assert "use: unknown shading 'pbrr'. Nearest: pbr" in str(error), error
    else:
        raise AssertionError(f"{function} accepts an unknown shading")
with open("/proc/self/maps") as maps:
    assert "libEGL" not in maps.read()
