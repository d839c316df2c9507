# SPDX-License-Identifier: Apache-2.0
"""Requirements of Gymnasium on environments."""

from contextlib import closing

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from tasks import Cart

import mjsense as mjs


def make(**kwargs):
    return mjs.make_vec(Cart(), **{"num_envs": 3, "cameras": [], "threads": 2, "horizon": 4, **kwargs})


@pytest.mark.parametrize("task", [Cart, "pick"])
@pytest.mark.filterwarnings("ignore:.*not having a spec")
@pytest.mark.filterwarnings("ignore:.*(minimum|maximum) value is")  # positions of joints are unbounded
@pytest.mark.filterwarnings("ignore:.*symmetric and normalized")  # actions are what actuators take
def test_gymnasium_checker_passes(task):
    env = mjs.make(task, cameras=[], render_mode=None)
    assert isinstance(env, gymnasium.Env)
    check_env(env)
    env.close()


def test_a_single_environment_is_the_first_of_many():
    task, many = mjs.make(Cart(), cameras=[], horizon=3), make(num_envs=1, horizon=3)
    observation, info = task.reset(seed=5)
    others, _ = many.reset(seed=5)
    assert task.observation_space.contains(observation) and info["episode_info"]["number"] == 0 and info["episode_info"]["seed"] == 5
    for _ in range(3):
        np.testing.assert_array_equal(observation["qpos"]["joints"], others["qpos"]["joints"][0])
        observation, reward, terminated, truncated, info = task.step(task.action_space.high)
        others, rewards, *_ = many.step(many.action_space.high)
        assert type(reward) is float and reward == rewards[0] and type(terminated) is bool and info["success"] is False
    assert truncated
    assert task.reset(options={"episodes": [2]})[1]["episode_info"]["number"] == 2
    task.close()
    many.close()
    with pytest.raises(TypeError, match="num_envs"):
        mjs.make(Cart(), num_envs=3)


def test_images_of_a_single_environment():
    env = mjs.make(Cart(), width=16, height=8, render_mode="rgb_array", observations=["side"])
    env.reset(seed=0)
    assert env.render().shape == (8, 16, 3)
    env.close()


def play(env, steps):
    env.reset(seed=0)
    return [env.step(np.zeros((env.num_envs, 1))) for _ in range(steps)]


def test_next_step():
    env = make()
    assert env.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    steps = play(env, 6)
    assert [s[3].any() for s in steps] == [False] * 3 + [True] + [False] * 2
    assert [s[4]["_success"].all() for s in steps] == [True] * 4 + [False, True]
    assert (steps[4][1] == 0).all()
    env.close()


def test_same_step():
    env = make(autoreset_mode="same_step")
    assert env.metadata["autoreset_mode"] == AutoresetMode.SAME_STEP
    ended = play(env, 4)[-1]
    observation, _, _, truncated, infos = ended
    assert truncated.all() and infos["_final_obs"].all() and infos["_final_info"].all()
    assert not infos["_success"].any() and infos["final_info"]["_success"].all()
    last = infos["final_obs"][1]
    assert env.single_observation_space.contains(last)
    # The last moment of the old episode, and the first of the new one.
    assert last["actions/commanded_action"]["given"]["joints"] and not observation["actions/commanded_action"]["given"]["joints"].any()
    assert last["qpos"]["joints"][0] != observation["qpos"]["joints"][1, 0]
    again = [env.step(np.zeros((3, 1)))[3].any() for _ in range(4)]
    assert again == [False] * 3 + [True]
    # The same episodes as with the other modes.
    other = make()
    other.reset(seed=0)
    for _ in range(5):
        second = other.step(np.zeros((3, 1)))[0]
    np.testing.assert_array_equal(observation["qpos"]["joints"], second["qpos"]["joints"])
    env.close()
    other.close()


def test_disabled():
    env = make(autoreset_mode=AutoresetMode.DISABLED)
    steps = play(env, 4)
    assert [s[3].any() for s in steps] == [False] * 3 + [True]
    for call, actions in ((env.step, np.zeros((3, 1))), (env.step_chunk, np.zeros((3, 2, 1)))):
        with pytest.raises(gymnasium.error.ResetNeeded, match=r"the episodes of all worlds have ended: call reset\(\) first"):
            call(actions)
    mask = np.array([False, True, False])
    observation, _ = env.reset(options={"reset_mask": mask})
    moved = (observation["qpos"]["joints"] != steps[3][0]["qpos"]["joints"])[:, 0]
    np.testing.assert_array_equal(moved, mask)
    for step in range(4):  # the others say that they have ended, and rest
        observation, reward, terminated, truncated, infos = env.step(np.zeros((3, 1)))
        assert infos["_success"].tolist() == [False, True, False] and not terminated.any()
        assert truncated.tolist() == [True, step == 3, True] and not reward[~mask].any()
        np.testing.assert_array_equal(observation["qpos"]["joints"][~mask], steps[3][0]["qpos"]["joints"][~mask])
    env.reset()
    assert not env.step(np.zeros((3, 1)))[3].any()
    env.close()


def test_disabled_repeats_why_an_episode_has_ended():
    env = make(autoreset_mode="disabled")
    env.reset(seed=0)
    done = np.array([True, False, False])
    for step in range(4):
        _, _, terminated, truncated, _ = env.step(np.zeros((3, 1)), done)
        assert terminated.tolist() == done.tolist() and truncated.tolist() == [False, step == 3, step == 3]
    env.close()


def test_unknown_modes():
    with pytest.raises(ValueError, match="autoreset_mode must be one of next_step, same_step, disabled, not 'never'"):
        make(autoreset_mode="never")


def test_seeds():
    env = make()
    first = env.reset(seed=3)[0]["qpos"]["joints"]
    np.testing.assert_array_equal(env.reset(seed=[3, 4, 5])[0]["qpos"]["joints"], first)
    assert (env.reset(seed=4)[0]["qpos"]["joints"] != first).all()
    assert (env.reset()[0]["qpos"]["joints"] != first).all()
    fresh = make(seed=3)
    np.testing.assert_array_equal(fresh.reset()[0]["qpos"]["joints"], first)
    with pytest.raises(ValueError, match="a list must be s, s"):
        env.reset(seed=[3, 3, 3])
    for wrong in (1.5, "x", True):
        with pytest.raises(TypeError, match="seed must be an int"):
            env.reset(seed=wrong)
    env.close()
    fresh.close()


def test_chunk_equals_its_steps():
    single, chunked = make(horizon=10), make(horizon=10)
    single.reset(seed=0)
    chunked.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (3, 4, 1))
    rewards = 0
    for k in range(4):
        observation, reward, *_ = single.step(actions[:, k])
        rewards = rewards + reward
    others, reward, _, truncated, infos = chunked.step_chunk(actions)
    np.testing.assert_array_equal(observation["qpos"]["joints"], others["qpos"]["joints"])
    np.testing.assert_allclose(reward, rewards)
    assert not truncated.any() and infos["_success"].all()
    assert chunked.step_chunk(np.zeros((3, 9, 1)))[3].all()  # ends with the horizon
    for wrong in (np.zeros((3, 1)), np.zeros((3, 0, 1)), np.zeros((3, 2, 2))):
        with pytest.raises(ValueError, match=r"expected \(3, "):
            chunked.step_chunk(wrong)
    single.close()
    chunked.close()


def test_no_observation_is_text():
    env = mjs.make_vec("pick", num_envs=1, cameras=[])
    observation, _ = env.reset(seed=0)

    def arrays(value):
        return [a for v in value.values() for a in (arrays(v) if isinstance(v, dict) else [v])]

    assert all(a.dtype.kind in "fib" for a in arrays(observation))
    assert {"qpos", "qvel", "actions/joint_pos", "grasp_state_pickup_obj"} <= set(observation)
    env.close()


def ended(env, options=None):
    """(number, success) of each episode in the order in which they end, and the number of steps."""
    infos, found = env.reset(**(options or {}))[1], []
    for step in range(1, 200):
        _, _, terminated, truncated, infos = env.step(np.tile(env.single_action_space.high, (env.num_envs, 1)))
        final = infos.get("final_info", infos)
        for world in np.flatnonzero(terminated | truncated):
            found.append((int(final["episode_info"]["number"][world]), bool(final["success"][world])))
        if env.all_played:
            return found, step
    raise AssertionError("not all episodes were played")


@pytest.mark.parametrize("mode", ["next_step", "same_step"])
def test_given_episodes_are_played_once_each(mode):
    numbers = [7, 3, 12, 5, 4]
    results = {}
    for worlds in (1, 2, 8):
        with closing(mjs.make_vec(Cart(), num_envs=worlds, cameras=[], horizon=6, seed=2, episodes=numbers, autoreset_mode=mode)) as env:
            played, _ = ended(env)
            assert sorted(number for number, _ in played) == sorted(numbers)
            results[worlds] = dict(played)
            assert env.all_played
            with pytest.raises(gymnasium.error.ResetNeeded, match="all given episodes have been played"):
                env.step(np.zeros(env.action_space.shape))
            assert dict(ended(env)[0]) == results[worlds]  # again from the first one
    assert results[1] == results[2] == results[8]


def test_an_episode_has_the_same_start_by_its_number():
    with closing(mjs.make_vec(Cart(), num_envs=4, cameras=[], seed=9)) as env:
        start = env.reset()[0]["qpos"]["joints"][3]
    with closing(mjs.make_vec(Cart(), num_envs=2, cameras=[], seed=9, episodes=[3])) as env:
        observation, info = env.reset()
        np.testing.assert_array_equal(observation["qpos"]["joints"][0], start)
        assert info["_episode_info"].tolist() == [True, False] and info["episode_info"]["number"][0] == 3
        _, _, terminated, truncated, infos = env.step(np.zeros(env.action_space.shape))
        assert infos["_success"].tolist() == [True, False] and not (terminated | truncated)[1]


@pytest.mark.parametrize("episodes, text", [([], "list of different numbers"), ([1, 1], "different numbers"), ([-1], "has -1"), ([0.5], "episodes")])
def test_wrong_episodes_are_refused(episodes, text):
    with pytest.raises((ValueError, TypeError), match=text):
        mjs.make_vec(Cart(), episodes=episodes)
