# SPDX-License-Identifier: Apache-2.0
"""Unknown cameras, poses that are not finite, and closed environments: each is an error of mjsense or of the package, never an image."""

import os

os.environ["MUJOCO_GL"] = "disable"

import re

import dm_control.suite
import gymnasium
import mujoco
import numpy as np
import robosuite

from mjsense.compat import dm_control as control
from mjsense.compat import gymnasium as gym
from mjsense.compat import robosuite as suite

control.use()
suite.use()


def expect(message, function, *args, **kwargs):
    try:
        function(*args, **kwargs)
    except (ValueError, TypeError, RuntimeError, AttributeError, mujoco.FatalError, control.wrapper.Error) as error:
        assert re.search(message, str(error)), error
    else:
        raise AssertionError(f"no error with {message!r}")


def cheetah(**camera):
    env = gym.use(gymnasium.make("HalfCheetah-v5", render_mode="rgb_array", width=32, height=32, **camera))
    env.reset(seed=0)
    return env


NOT_FINITE = r"geom 2 of the scene \(geom '\w+', id 2\) has a pose, size or colour that is not finite"

expect('The camera "trakc" does not exist. Nearest: track', cheetah, camera_name="trakc")
expect("fixed camera id is outside", cheetah(camera_id=7).render)
env = cheetah()
env.render()
env.unwrapped.data.geom_xpos[2] = np.nan
expect(NOT_FINITE, env.render)
env.close()
expect(r"used after close\(\)", env.render)

expect("with a mujoco_renderer", gym.use, "HalfCheetah-v5")
expect("call use in the function that makes each environment", gym.use, gymnasium.make_vec("HalfCheetah-v5", 2, "sync"))

physics = dm_control.suite.load("cheetah", "run").physics
expect("'camera' with name 'sied' does not exist", physics.render, 32, 32, "sied")
expect("camera_id=9 is invalid", physics.render, 32, 32, 9)
limits = physics.model.vis.global_
expect(f"Image width {limits.offwidth + 1} > framebuffer width {limits.offwidth}", physics.render, 32, limits.offwidth + 1)
expect(f"Image height {limits.offheight + 1} > framebuffer height {limits.offheight}", physics.render, limits.offheight + 1, 32)
limits.offwidth, limits.offheight = 1000, 900
assert physics.render(900, 1000, camera_id=0).shape == (900, 1000, 3)
physics.render(32, 32)
physics.data.geom_xpos[2] = np.nan
expect(NOT_FINITE, physics.render, 32, 32)

env = robosuite.make("Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=True, camera_heights=32, camera_widths=32)
env.reset()
draw = {"width": 32, "height": 32}
expect('No "camera" with name agentveiw exists. Available .*agentview', env.sim.render, camera_name="agentveiw", **draw)
env.sim.data._data.geom_xpos[2] = np.nan
expect(NOT_FINITE, env.sim.render, camera_name="agentview", **draw)
env.close()
expect("'NoneType' object has no attribute 'render'", lambda: env.sim.render(camera_name="agentview", **draw))
