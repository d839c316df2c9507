# SPDX-License-Identifier: Apache-2.0
"""Tasks with third-party trainers and Gymnasium's registry. Tests of a trainer are skipped if it is not installed."""

import importlib
import re
import sys
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from wheels import wheel

import mjsense as mjs
from mjsense.tasks.rl._numbers import Actions, Numbers, checked_env

sys.path.append(str(Path(__file__).parents[2] / "examples/walk"))

OPTIONS = {"cameras": [], "threads": 2, "observations": ["qpos", "tcp_pose"]}


def same_step(task="pick", **options):
    return mjs.make_vec(task, autoreset_mode="same_step", **{"num_envs": 3, "horizon": 4, **OPTIONS, **options})


def test_registered():
    env = gymnasium.make("mjsense/Pick-Franka-v0", horizon=3, **OPTIONS)
    other = mjs.make("pick", "franka", horizon=3, **OPTIONS)
    observation, _ = env.reset(seed=5)
    np.testing.assert_array_equal(observation["qpos"]["arm"], other.reset(seed=5)[0]["qpos"]["arm"])
    for _ in range(3):
        observation, _, terminated, truncated, info = env.step(env.action_space.sample())
    assert truncated and not terminated and info["success"] is False
    assert info["episode_info"]["seed"] == 5 and info["episode_info"]["number"] == 0
    env.close()
    other.close()
    worlds = gymnasium.make_vec("mjsense/Pick-v0", num_envs=2, vectorization_mode="vector_entry_point", **OPTIONS)
    assert isinstance(worlds, mjs.tasks.TaskVectorEnv) and worlds.num_envs == 2
    worlds.close()
    for task in mjs.task_names():
        assert f"mjsense/{''.join(w.capitalize() for w in task.split('_'))}-v0" in gymnasium.registry


def test_own_tasks_are_registered(monkeypatch):
    pytest.importorskip("mujoco")  # the example edits a spec with it
    from walk import Walk

    monkeypatch.setattr(mjs.tasks.task, "_TASKS", {})
    monkeypatch.setattr(gymnasium.envs.registration, "registry", dict(gymnasium.registry))
    mjs.register_task("walk_rough", Walk)
    mjs.register_task("a name of words", Walk)  # no name for gymnasium
    assert gymnasium.spec("mjsense/WalkRough-v0").kwargs == {"task": "walk_rough"}


def test_numbers():
    env = same_step(observations=["tcp_pose", "qpos"])
    numbers = Numbers(env, ["qpos", "tcp_pose"])
    observation, _ = env.reset(seed=0)
    row = numbers.of(observation, 3)
    assert row.dtype == np.float32 and row.shape == (3, numbers.size) and numbers.box().contains(row[0])
    np.testing.assert_array_equal(row[:, numbers.columns["qpos/arm"]], observation["qpos"]["arm"])
    np.testing.assert_array_equal(row[:, numbers.columns["tcp_pose"]], np.float32(observation["tcp_pose"]))
    assert row.base is None and list(numbers.columns) == ["qpos/arm", "qpos/gripper", "tcp_pose"]
    with pytest.raises(ValueError, match="no sensor or stream 'tcp'"):
        Numbers(env, ["tcp"])
    env.close()


def test_actions_are_scaled_around_a_mean():
    space = gymnasium.spaces.Box(np.float32([-1, 0, -np.inf]), np.float32([3, 1, np.inf]))
    np.testing.assert_array_equal(Actions(space, None, None).commands(np.array([[-1.0, 1, 5], [0, -9, 0]])), [[-1, 1, 5], [1, 0, 0]])
    np.testing.assert_array_equal(Actions(space, 0.5, [1, 2, 3]).commands(np.ones((1, 3))), [[1.5, 1, 3.5]])
    with pytest.raises(ValueError, match=r"action_mean: .* neither a number nor 3 numbers"):
        Actions(space, [1, 2], None)


def test_unsuitable_environments_are_rejected():
    with pytest.raises(TypeError, match=r"env must be what mjsense\.make_vec"):
        checked_env(3, "SB3VecEnv")
    env = mjs.make_vec("pick", **OPTIONS)
    with pytest.raises(ValueError, match="autoreset_mode is 'next_step'"):
        checked_env(env, "SB3VecEnv")
    env.close()


def test_walk():
    """The task of examples/walk: its observations have the documented meaning."""
    pytest.importorskip("mujoco")  # the example edits a spec with it
    from walk import Walk

    task = Walk(rough=False)
    env = same_step(task, observations=["feeling"], num_envs=4, horizon=20)
    observation, _ = env.reset(seed=0)
    numbers = observation["feeling"]
    np.testing.assert_allclose(numbers[:, 6:9], [[0, 0, 1]] * 4, atol=1e-6)
    np.testing.assert_array_equal(numbers[:, 9:12], np.float32(task.command))
    np.testing.assert_allclose(numbers[:, -187:] / 5 + 0.3, 0.27, atol=0.04)  # the trunk's height above the plane
    task.command[:] = 0
    for _ in range(20):
        observation, reward, terminated, truncated, infos = env.step(np.tile(task.stand, (4, 1)))
        assert not terminated.any()
    assert truncated.all() and infos["final_info"]["success"].all() and (reward > 0.04).all()  # at most 0.045: it stands, as commanded
    assert np.isfinite(observation["feeling"]).all() and (observation["feeling"] != numbers).any()
    env.close()


def test_walk_with_a_go1():
    """Unitree's, which comes without motors: with those of the example it stands, and its feet and scan are found."""
    pytest.importorskip("mujoco")  # the example edits a spec with it
    from walk import Walk

    task = Walk(wheel("mjlab") / "mjlab/asset_zoo/robots/unitree_go1/xmls/go1.xml", rough=False)
    env = same_step(task, observations=["feeling"], num_envs=2, horizon=20)
    env.reset(seed=0)
    assert (env.sim.model.dof_armature[6:] == 0.01).all() and (env.sim.model.dof_damping[6:] == 0.5).all()
    for _ in range(20):
        observation, _, terminated, truncated, _ = env.step(np.tile(task.stand, (2, 1)))
        assert not terminated.any()
    assert truncated.all() and np.isfinite(observation["feeling"]).all()
    np.testing.assert_array_equal(env.sim.scene["feet"].data.found.shape, (2, 4))
    env.close()


def test_stable_baselines3():
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO

    from mjsense.tasks.rl.sb3 import SB3VecEnv

    env = same_step()
    worlds = SB3VecEnv(env)
    worlds.seed(7)
    first = worlds.reset()
    assert first.shape == (3, 16) and worlds.action_space.shape == (8,)
    other = same_step()
    np.testing.assert_array_equal(other.reset(seed=7)[0]["tcp_pose"], first[:, 9:])
    for step in range(4):
        rows, reward, done, infos = worlds.step(np.zeros((3, 8)))
        observation, *_, final = other.step(np.tile(worlds._commands.mean, (3, 1)))
        np.testing.assert_array_equal(rows[:, 9:], observation["tcp_pose"])
        assert done.all() == (step == 3) and reward.dtype == np.float32
    assert infos[1]["TimeLimit.truncated"] and infos[1]["episode"]["l"] == 4 and not infos[1]["is_success"]
    np.testing.assert_array_equal(infos[1]["terminal_observation"][9:], final["final_obs"][1]["tcp_pose"])
    assert worlds.get_attr("num_envs") == [3, 3, 3] and worlds.env_method("render", indices=[0]) == [None]
    trained = PPO("MlpPolicy", worlds, n_steps=8, batch_size=24, n_epochs=1, seed=0).learn(48)
    assert trained.ep_info_buffer[-1]["l"] == 4
    other.close()
    worlds.close()


def test_stable_baselines3_with_pictures():
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.vec_env import VecTransposeImage

    from mjsense.tasks.rl.sb3 import SB3VecEnv

    env = same_step(cameras=["wrist_camera"], width=64, height=48, observations=["qpos", "wrist_camera"])
    worlds = VecTransposeImage(SB3VecEnv(env))
    picture = env.rows["wrist_camera"]
    observation = worlds.reset()
    np.testing.assert_array_equal(observation["wrist_camera"], picture.transpose(0, 3, 1, 2))
    assert observation["state"].shape == (3, 9)
    for _ in range(4):
        observation, _, done, infos = worlds.step(np.zeros((3, 8)))
    assert done.all() and infos[0]["terminal_observation"]["wrist_camera"].shape == (3, 48, 64)
    worlds.close()


def test_stable_baselines3_with_pictures_only():
    """Nothing but images, of which depth is one: a dict without a row of numbers, whose values are those of its space."""
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO

    from mjsense.tasks.rl.sb3 import SB3VecEnv

    options = dict(cameras=["wrist_camera"], width=40, height=36, depth=True)
    env = same_step(**options, observations=["wrist_camera", "wrist_camera_depth"])
    worlds = SB3VecEnv(env)
    spaces = {name: (space.shape, space.dtype.name) for name, space in worlds.observation_space.items()}
    assert spaces == {"wrist_camera": ((36, 40, 3), "uint8"), "wrist_camera_depth": ((1, 36, 40), "float32")}
    observation = worlds.reset()
    np.testing.assert_array_equal(observation["wrist_camera_depth"][:, 0], env.rows["wrist_camera_depth"])
    for _ in range(4):
        observation, _, done, infos = worlds.step(np.zeros((3, 8)))
    assert done.all() and worlds.observation_space.contains(infos[2]["terminal_observation"])
    assert worlds.observation_space.contains({name: rows[2] for name, rows in observation.items()})
    normalized = PPO("MultiInputPolicy", worlds, n_steps=5, batch_size=15, n_epochs=1, policy_kwargs={"normalize_images": False}, device="cpu")
    assert {type(part).__name__ for part in normalized.policy.features_extractor.extractors.values()} == {"NatureCNN"}
    PPO("MultiInputPolicy", worlds, n_steps=5, batch_size=15, n_epochs=1, device="cpu").learn(30)
    worlds.close()


def test_the_page_s_policy_is_learned():
    """docs/train.md: training with the page's code reaches the stated return."""
    pytest.importorskip("stable_baselines3")
    page = (Path(__file__).parents[2] / "docs/train.md").read_text()
    code = next(block for block in re.findall(r"^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL) if "SB3VecEnv(" in block)
    names = {"__name__": "page"}
    exec(compile(code, "docs/train.md", "exec"), names)
    returns = [episode["r"] for episode in names["policy"].ep_info_buffer]
    assert len(returns) == 100 and np.mean(returns) > -4  # chance: -13


def test_rsl_rl():
    pytest.importorskip("rsl_rl")
    import torch

    from mjsense.tasks.rl.rsl import RslRlVecEnv

    env = same_step()
    worlds = RslRlVecEnv(env, {"policy": None, "critic": ["tcp_pose"]})
    observation = worlds.get_observations()
    assert observation["policy"].shape == (3, 16) and observation["critic"].shape == (3, 7)
    assert (worlds.num_envs, worlds.num_actions, worlds.max_episode_length) == (3, 8, 4)
    for step in range(4):
        observation, reward, done, extras = worlds.step(torch.zeros(3, 8))
        assert done.all() == (step == 3) and extras["time_outs"].all() == done.all()
    assert reward.shape == (3,) and reward.dtype == torch.float32 and worlds.episode_length_buf.tolist() == [0, 0, 0]
    assert extras["log"]["/success"] == 0 and worlds.get_observations() is observation
    worlds.close()


@pytest.mark.parametrize("module, missing, package", [("sb3", "stable_baselines3.common.vec_env", "stable-baselines3"),
                                                      ("rsl", "rsl_rl.env", "rsl-rl-lib")])  # fmt: skip
def test_without_the_trainer(monkeypatch, module, missing, package):
    monkeypatch.delitem(sys.modules, f"mjsense.tasks.rl.{module}", raising=False)
    monkeypatch.setitem(sys.modules, missing, None)
    with pytest.raises(ModuleNotFoundError, match=f"pip install {package} "):
        importlib.import_module(f"mjsense.tasks.rl.{module}")
