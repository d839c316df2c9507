# SPDX-License-Identifier: Apache-2.0
"""Environments beyond stepping: rendering without cameras, rates, names, the expert, text sensors, image sizes."""

import copy
import json
import pickle

import gymnasium
import numpy as np
import pytest
from tasks import Cart

import mjsense as mjs
from mjsense.core import mujoco_names

SMALL = dict(cameras=[], width=64, height=40, render_mode="rgb_array")


class Words(mjs.Sensor):
    uuid = "words"
    is_dict = True
    str_max_len = 50
    observation_space = gymnasium.spaces.Box(0, 255, (50,), np.uint8)

    def get_observation(self, env, task, batch_index=0):
        return {"world": batch_index}


def test_a_default_view_without_cameras():
    env = gymnasium.make("mjsense/Pick-v0", **SMALL)
    observation, _ = env.reset(seed=3)
    assert not any(rows.ndim == 3 for rows in observation.values() if isinstance(rows, np.ndarray))
    picture = env.render()
    assert picture.shape == (40, 64, 3) and picture.std() > 10
    env.close()


@pytest.mark.parametrize(
    ("task", "robot", "role"),
    [("door_opening", "rby1", "door_handle"), ("door_opening", "mobile_franka", "door_handle"), ("pick", "franka", "pickup_obj")],
)
def test_the_default_view_shows_the_robot_and_its_target(task, robot, role):
    """2 % of the pixels of the robot, and 0.03 % of the target: a handle, or a small object behind others."""
    env = mjs.make_vec(task, robot, num_envs=20, **{**SMALL, "width": 320, "height": 240})
    env.reset(seed=0)
    model = env.sim.model
    pixels = env.sim.scene["default_view"].data.segmentation
    seen = 0
    for world in range(20):
        target = json.loads(env._rollout.obs_scene(world))["objects"][role]["body"]
        shown = []
        for root in (model.body("robot_0/base" if robot != "franka" else "robot_0/fr3_link0").id, model.body(target).id):
            below = mujoco_names.bodies_below(model, root)
            geoms = np.flatnonzero(below[model.geom_bodyid])
            shown.append((np.isin(pixels[world, ..., 0], geoms) & (pixels[world, ..., 1] == 5)).mean())
        seen += shown[0] > 0.02 and shown[1] > 0.0003
    assert seen >= 19
    env.close()


def test_the_default_view_of_a_scene_with_its_own_robot():
    env = mjs.make_vec(Cart(), num_envs=2, **{**SMALL, "width": 320, "height": 200})
    env.reset(seed=1)
    first = env.render()
    assert len(first) == 2 and (first[0].max(2) > 20).sum() > 100  # a small cart on a rail, without a light
    for _ in range(15):
        env.step(np.ones((2, 1)))
    assert (env.render()[0] != first[0]).any()
    env.close()


def test_a_view_changes_no_episode():
    rows = []
    for mode in (None, "rgb_array"):
        env = mjs.make_vec("pick", policy="planner", num_envs=2, seed=4, threads=2, **{**SMALL, "render_mode": mode})
        env.reset()
        for _ in range(10):
            observation, *_ = env.step(env.expert_action())
            env.render()
        rows.append(observation["qpos"]["arm"])
        env.close()
    np.testing.assert_array_equal(*rows)


def test_rates():
    env = mjs.make(Cart(), **SMALL)
    assert env.metadata["render_fps"] == 50 and env.worlds.metadata["render_fps"] == 50
    env.close()
    assert mjs.make("pick", cameras=[]).metadata["render_fps"] == pytest.approx(1000 / 66)


def test_the_expert_of_a_single_environment():
    env = mjs.make("pick", policy="planner", cameras=[])
    env.reset(seed=3)
    action = env.expert_action()
    assert env.action_space.contains(action) and env.expert_done is False
    assert env.scene is env.sim.scene and env.worlds.scene is env.sim.scene
    env.close()


def test_names_of_gymnasium(monkeypatch):
    monkeypatch.setattr(mjs.tasks.task, "_TASKS", {})
    monkeypatch.setattr(gymnasium.envs.registration, "registry", dict(gymnasium.registry))
    for name, env_id in (("my-cart.v2", "mjsense/My-cart.v2-v0"), ("_cart", "mjsense/Cart-v0")):
        mjs.register_task(name, Cart)
        env = gymnasium.make(env_id, cameras=[])
        assert env.spec.id == env_id
        env.close()
    mjs.register_task("lab:cart", Cart)  # outside of the grammar: make_vec finds it, gymnasium does not
    mjs.make_vec("lab:cart", cameras=[]).close()
    assert not any("lab:cart" in known.lower() for known in gymnasium.envs.registration.registry)


def test_user_defined_text_sensors_are_observed():
    env = mjs.make_vec(Cart(), num_envs=2, cameras=[], sensors=[Words()])
    observation, _ = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    assert [json.loads(row.tobytes().rstrip(b"\0")) for row in observation["words"]] == [{"world": 0}, {"world": 1}]
    assert "task_info" not in observation
    env.close()


@pytest.mark.parametrize(("given", "shape"), [(dict(width=64), (36, 64)), (dict(height=92), (92, 160)), (dict(width=64, height=64), (64, 64))])
def test_one_side_of_an_image_keeps_the_aspect_ratio(given, shape):
    env = mjs.make("pick", cameras=["wrist_camera"], **given)  # 640 x 368
    assert env.observation_space["wrist_camera"].shape == (*shape, 3)
    env.close()


def test_misspelt_options():
    with pytest.raises(TypeError, match=r"make\(\) got an unexpected keyword argument 'camera'; did you mean 'cameras'"):
        mjs.make("pick", camera=[])
    with pytest.raises(TypeError, match=r"record\(\) got an unexpected keyword argument 'episode'; did you mean 'episodes'"):
        mjs.record("pick", out="x", episode=3)


@pytest.mark.parametrize("again", (copy.copy, copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))), ids=("copy", "deepcopy", "pickle"))
def test_environments_are_copied_and_pickled_by_their_arguments(again):
    options = dict(cameras=[], observations=["obj_start"], horizon=3, seed=4)
    for env in (mjs.make_vec("pick", num_envs=2, **options), mjs.make("pick", **options), gymnasium.make("mjsense/Pick-Franka-v0", **options)):
        env.reset()
        second = env.reset()[0]["obj_start"]
        other = again(env)
        if type(other).__module__.startswith("mjsense"):
            assert other.spec == env.spec and other.observation_space == env.observation_space
        if type(other).__module__.startswith("mjsense") or again is not copy.copy:  # the shallow copy of a wrapper wraps the same environment
            first = other.reset(seed=4)[0]["obj_start"]
            np.testing.assert_array_equal(other.reset()[0]["obj_start"], second)
            np.testing.assert_array_equal(env.reset(seed=4)[0]["obj_start"], first)
            other.close()
        env.close()


def test_environments_of_objects_are_not_copied():
    env = mjs.make_vec(Cart(), num_envs=2, **SMALL)
    with pytest.raises(TypeError, match=r"cannot be copied or pickled, because its argument task cannot: .*; make it with the name or the class"):
        pickle.dumps(env)
    env.close()
    env = copy.deepcopy(mjs.make(Cart, **SMALL))
    assert env.reset(seed=1)[0].keys() == env.observation_space.keys()
    env.close()
