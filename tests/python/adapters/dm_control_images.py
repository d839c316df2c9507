# SPDX-License-Identifier: Apache-2.0
"""dm_control's ``Physics.render``, ``Camera`` and pixels wrapper, for cheetah, humanoid and a quadruped on a height field."""

from images import compare, compare_depth, end, require_opengl

require_opengl()

import mujoco
import numpy as np
from dm_control import manipulation, suite
from dm_control.mujoco import Camera, engine
from dm_control.suite.wrappers import pixels

from mjsense.compat.dm_control import Context, use


def environments(domain, task, **pixel_arguments):
    """The same environment twice after four steps: with its own renderer and with mjsense."""
    pair = []
    for adapt in (lambda env: env, use):
        env = adapt(suite.load(domain, task, task_kwargs={"random": 0}))
        if pixel_arguments:
            env = pixels.Wrapper(env, **pixel_arguments)
        env.reset()
        action = np.random.default_rng(1).uniform(-1, 1, env.action_spec().shape)
        for _ in range(4):
            timestep = env.step(action)
        pair.append((env, timestep))
    return pair


def expect_error(match, function, *args, **kwargs):
    try:
        function(*args, **kwargs)
    except ValueError as error:
        assert match in str(error), error
    else:
        raise AssertionError(f"no error with {match!r}")


depths = []
for domain, task, bound in (("cheetah", "run", 34), ("humanoid", "stand", 34), ("quadruped", "escape", 32)):
    (theirs, _), (ours, _) = environments(domain, task)
    assert isinstance(ours.physics.contexts.gl, Context)
    assert not isinstance(theirs.physics.contexts.gl, Context)
    for camera in (-1, 0):
        for size in ((84, 84), (120, 160)):
            for kind in ({}, {"segmentation": True}):
                images = [env.physics.render(*size, camera_id=camera, **kind) for env in (theirs, ours)]
                compare(f"{domain} camera {camera} {kind}", *images, bound)
        depths.append((domain, ours.physics, camera, ours.physics.render(84, 84, camera_id=camera, depth=True)))

    option = engine.wrapper.MjvOption()
    option.flags[mujoco.mjtVisFlag.mjVIS_JOINT] = True
    option.geomgroup[0] = 0

    def add_ball(physics, scene):
        scene.ngeom += 1
        mujoco.mjv_initGeom(
            scene.geoms[scene.ngeom - 1],
            mujoco.mjtGeom.mjGEOM_SPHERE,
            np.full(3, 0.2),
            physics.data.xpos[1] + [0, 0, 0.6],
            np.eye(3).ravel(),
            np.array([1, 0, 0, 1], np.float32),
        )
        scene.geoms[scene.ngeom - 1].category = mujoco.mjtCatBit.mjCAT_DECOR  # which mjv_initGeom leaves undefined

    for what, arguments in {
        "scene_option": {"scene_option": option},
        "scene_callback": {"scene_callback": add_ball},
        "render_flag_overrides": {"render_flag_overrides": {"shadow": False}},
    }.items():
        images = [env.physics.render(84, 84, camera_id=0, **arguments) for env in (theirs, ours)]
        compare(f"{domain} {what}", *images, bound - 2)
        assert (images[1] != ours.physics.render(84, 84, camera_id=0)).any(), what

    images = [Camera(env.physics, 64, 96, 0).render() for env in (theirs, ours)]
    compare(f"{domain} Camera", *images, bound)

    expect_error("overlay", ours.physics.render, overlays=[engine.TextOverlay("text")])
    expect_error("WIREFRAME", ours.physics.render, render_flag_overrides={"wireframe": True})
    expect_error("cannot both be", ours.physics.render, depth=True, segmentation=True)

    (_, theirs), (_, ours) = environments(domain, task, render_kwargs={"height": 84, "width": 84, "camera_id": 0})
    compare(f"{domain} pixels wrapper", theirs.observation["pixels"], ours.observation["pixels"], bound)

# A new model in the same Physics, and a new height field (quadruped's reset), show in the next image.
env = use(suite.load("quadruped", "escape", task_kwargs={"random": 0}))
env.reset()
before = env.physics.render(84, 84, camera_id=0)
env.reset()
assert (env.physics.render(84, 84, camera_id=0) != before).any()
xml, assets = suite.cheetah.get_model_and_assets()
env.physics.reload_from_xml_string(xml, assets)
cheetah = suite.load("cheetah", "run")
compare("reloaded", cheetah.physics.render(84, 84), env.physics.render(84, 84), 34)

# The free camera follows changes of the model, and flags that a callback sets hold for one image.
before = env.physics.render(84, 84)


def without_shadows(_, scene):
    scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = False


assert (env.physics.render(84, 84, scene_callback=without_shadows) != before).any()
np.testing.assert_array_equal(env.physics.render(84, 84), before)
for physics in (env.physics, cheetah.physics):
    physics.model.stat.center[2] += 0.4
compare("another centre", cheetah.physics.render(84, 84), env.physics.render(84, 84), 34)

# Uploads show a change of a texture that is too small to be found without them.
texture = """<mujoco><asset><texture name="t" type="2d" builtin="flat" rgb1="{} 0 0" width="64" height="64"/><material name="m" texture="t"/></asset>
<worldbody><geom type="plane" size="1 1 .1" material="m"/><camera name="above" pos="0 0 2" fovy="60"/></worldbody></mujoco>"""
physics = use(engine.Physics.from_xml_string(texture.format(0)))
camera = Camera(physics, 128, 128, "above")
before = [camera.render(), physics.render(128, 128, "above")]
physics.model.tex_data[8:88] = 255
with physics.contexts.gl.make_current() as context:
    context.call(mujoco.mjr_uploadTexture, physics.model.ptr, physics.contexts.mujoco.ptr, 0)
    expect_error("needs OpenGL", context.call, mujoco.mjr_render, None, None, None)
for image, old in zip([camera.render(), physics.render(128, 128, "above")], before, strict=True):
    assert (image != old).any()
physics.reload_from_xml_string(texture.format(1))
np.testing.assert_array_equal(camera.render(), physics.render(128, 128, "above"))

# A copy, and the physics that composer's environments make for each episode.
assert isinstance(physics.copy().contexts.gl, Context)
env = use(use(manipulation.load("stack_2_bricks_features", seed=0)))
for _ in range(2):
    env.reset()
    assert isinstance(env.physics.contexts.gl, Context)

# All later physics.
use()
physics = suite.load("cheetah", "run").physics
assert isinstance(physics.contexts.gl, Context)
try:
    use(object())
except TypeError as error:
    assert "has no physics" in str(error)
else:
    raise AssertionError("use(object()) is accepted")

# dm_control's own depth has an error of 1.2 mm at 1 m, which grows with the square of the distance.
for domain, physics, camera, depth in depths:
    compare_depth(f"{domain} camera {camera}", physics.model.ptr, physics.data.ptr, camera, depth)
end()
