# SPDX-License-Identifier: Apache-2.0
"""gymnasium-robotics' and Meta-World's ``render()``."""

from images import compare, end, require_opengl

require_opengl()

import gymnasium
import gymnasium_robotics
import metaworld  # noqa: F401

from mjsense.compat import gymnasium as adapter

gymnasium.register_envs(gymnasium_robotics)

META_WORLD = {"id": "Meta-World/MT1", "camera_name": "corner2", "seed": 0}
ENVIRONMENTS = {
    "FetchPickAndPlace": ({"id": "FetchPickAndPlace-v4"}, 30),
    "PointMaze": ({"id": "PointMaze_UMaze-v3"}, 40),
    "AntMaze": ({"id": "AntMaze_UMaze-v5"}, 29),
    "AdroitHandDoor": ({"id": "AdroitHandDoor-v1"}, 30),
    "Meta-World reach": ({**META_WORLD, "env_name": "reach-v3"}, 30),
    "Meta-World drawer-open": ({**META_WORLD, "env_name": "drawer-open-v3"}, 30),
}

for name, (arguments, psnr) in ENVIRONMENTS.items():
    images = []
    for adapt in (lambda env: env, adapter.use):
        env = adapt(gymnasium.make(**arguments, render_mode="rgb_array", width=84, height=84, disable_env_checker=True))
        env.reset(seed=0)
        env.action_space.seed(0)
        for _ in range(2):
            env.step(env.action_space.sample())
        env.render()
        images.append(env.render())
        env.close()
    compare(name, *images, psnr)

# A second call of use() closes the renderer of the first, and env.close() that of the second.
env = adapter.use(gymnasium.make("HalfCheetah-v5", render_mode="rgb_array", width=84, height=84))
env.reset(seed=0)
viewers = []
for shading in ("classic", "pbr"):
    adapter.use(env, shading)
    env.render()
    viewers.append(adapter.renderer_of(env).viewer)
env.close()
for viewer in viewers:
    try:
        viewer._renderer.render()
    except RuntimeError as error:
        assert "used after close()" in str(error), error
    else:
        raise AssertionError("a renderer is not closed")
end()
