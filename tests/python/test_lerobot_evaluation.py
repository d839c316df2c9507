# SPDX-License-Identifier: Apache-2.0
"""Policies lerobot:DIR, and the environments of lerobot_env_mjsense. What needs LeRobot runs in environments of its own."""

import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from lerobot_environments import ROOT, with_mjsense

av = pytest.importorskip("av")
pytest.importorskip("pyarrow")

import pyarrow.parquet as pq

import mjsense as mjs
from mjsense.evaluation.lerobot_features import Features
from mjsense.evaluation.lerobot_policy import LeRobotPolicy

MAP = {"state": ["obs/agent/qpos", "obs/extra/tcp_pose"], "cameras": {"eye": "exo_camera_1"}, "features": {"environment_state": "obs/extra/obj_start"}}
OPTIONS = {"seed": 5, "width": 64, "height": 64, "shadows": False}


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    folder = tmp_path_factory.mktemp("recorded")
    mjs.record("pick", out=folder / "data", num_worlds=2, episodes=2, horizon=12, keep_failures=True, progress=False, **OPTIONS)
    return folder


@pytest.mark.parametrize("map", (None, MAP), ids=("default", "map"))
def test_the_features_are_those_of_an_export(recorded, tmp_path, map):
    mjs.exporting.export_lerobot(recorded / "data", tmp_path / "out", map=map)
    info = json.loads((tmp_path / "out/meta/info.json").read_text())["features"]
    table = pq.read_table(next(tmp_path.glob("out/data/*/*.parquet")))
    env = mjs.make_vec("pick", num_envs=2, **OPTIONS)
    features = Features(env.specs, env.action_groups, map)
    expected = {name: tuple(about["shape"]) for name, about in info.items() if name.startswith("observation.")}
    assert {name: features.shape(name) for name in features.streams} == expected
    env.reset(options={"episodes": [1, 0]})
    first = [table["episode_index"].to_pylist().index(number) for number in (1, 0)]
    for name in expected:
        rows = features.rows(name, env.rows)
        if name.startswith("observation.images."):
            camera = name.rpartition(".")[2] if map is None else map["cameras"][name.rpartition(".")[2]]
            videos = [mjs.Dataset(recorded / "data").episodes[number].video(camera)[0] for number in (1, 0)]
            assert rows.dtype == np.uint8 and np.abs(rows.astype(float) - np.stack(videos)).mean() < 4
        else:
            np.testing.assert_array_equal(rows, np.stack([table[name][i].as_py() for i in first]).astype(np.float32))
    assert len(features.action) == info["action"]["shape"][0] == 8


def test_an_action_in_another_order_and_with_a_group_that_holds():
    env = mjs.make_vec("pick", num_envs=1, cameras=[])
    features = Features(env.specs, env.action_groups, {"action": ["actions/joint_pos/gripper", "actions/commanded_action/arm"]})
    np.testing.assert_array_equal(features.commands(np.arange(8.0)), [1, 2, 3, 4, 5, 6, 7, 0])
    alone = Features(env.specs, env.action_groups, {"action": "actions/joint_pos/arm"})
    assert alone.held == ("gripper",) and alone.layout() == "arm 7"


@pytest.mark.parametrize("controller", ("ee_pose", "joint_position_relative"))
def test_joint_targets_are_no_commands_of_another_controller(controller):
    env = mjs.make_vec("pick", num_envs=1, cameras=[], arm_controller=controller)
    with pytest.raises(ValueError, match=r"it has 'actions/joint_pos/arm' \(7 numbers, rad\), but the controller of 'arm' takes 7 numbers \("):
        Features(env.specs, env.action_groups)


def test_features_that_are_not_here():
    env = mjs.make_vec("pick", num_envs=1, width=32, height=32)
    features = Features(env.specs, env.action_groups, {"cameras": {"eye": "exo_camera"}})
    with pytest.raises(ValueError, match=r"this needs the feature 'observation.images.eyes'; did you mean 'observation.images.eye'"):
        features.check(["observation.images.eyes"], "this")
    with pytest.raises(ValueError, match=r"of the camera 'exo_camera'; did you mean 'exo_camera_1'"):
        features.check(["observation.images.eye"], "this")
    with pytest.raises(ValueError, match=r"there is no stream 'obs/extra/tcp_pos' here; did you mean 'tcp_pose'"):
        Features(env.specs, env.action_groups, {"state": "obs/extra/tcp_pos"})


def test_an_environment_plays_the_episodes_of_a_reset():
    env = mjs.make_vec("pick", num_envs=2, cameras=[], seed=5)
    _, infos = env.reset(options={"episodes": [7, 3]})
    first = env.sim.state[:].copy()
    assert infos["episode_info"]["number"].tolist() == [7, 3]
    env.reset(options={"episodes": [3], "reset_mask": np.array([True, False])})
    np.testing.assert_array_equal(env.sim.state[0], first[1])
    assert env.reset()[1]["episode_info"]["number"].tolist() == [0, 1]
    for numbers, message in (([1], "has 1 number for 2 worlds"), ([1, -1], "must be ints from 0 on")):
        with pytest.raises(ValueError, match=message):
            env.reset(options={"episodes": numbers})


def checkpoint(folder, step=None):
    folder.mkdir()
    (folder / "config.json").write_text('{"type": "act"}')
    for name in ("policy_preprocessor.json", "policy_postprocessor.json"):
        (folder / name).write_text(json.dumps({"name": "x", "steps": [step or {"registry_name": "device_processor", "config": {}}]}))
    return folder


def test_checkpoints_that_are_refused(tmp_path, monkeypatch):
    with pytest.raises(FileNotFoundError, match=r"has no config.json; did you mean '.*/last/pretrained_model'"):
        inner = tmp_path / "run/checkpoints/last"
        inner.mkdir(parents=True)
        checkpoint(inner / "pretrained_model")
        LeRobotPolicy(str(tmp_path / "run"))
    code = {"class": "subprocess.Popen", "config": {"args": ["touch", str(tmp_path / "ran")]}}
    with pytest.raises(ValueError, match="steps by the name of a class are refused, because they can run any code"):
        LeRobotPolicy(str(checkpoint(tmp_path / "code", code)))
    assert not (tmp_path / "ran").exists()
    (tmp_path / "run/checkpoints/last/pretrained_model/policy_postprocessor.json").unlink()
    with pytest.raises(FileNotFoundError, match=r"has no policy_postprocessor\.json; checkpoints of LeRobot before 0\.4"):
        LeRobotPolicy(str(tmp_path / "run/checkpoints/last/pretrained_model"))
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(ModuleNotFoundError, match=r"needs the package torch \(LeRobot 0.4.4 or newer, pip install lerobot\)"):
        mjs.evaluation.policy_from(f"lerobot:{checkpoint(tmp_path / 'good')}")


def run(python, variables, *words, fails=False):
    done = subprocess.run([python, *map(str, words)], capture_output=True, text=True, env={**os.environ, **variables})
    assert (done.returncode != 0) == fails, done.stdout[-2000:] + done.stderr[-4000:]
    return done.stdout + done.stderr


def environments():
    """The module of lerobot_env_mjsense that does not need LeRobot."""
    path = ROOT / "packaging/lerobot_env_mjsense/lerobot_env_mjsense/environments.py"
    spec = importlib.util.spec_from_file_location("lerobot_environments_of_mjsense", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_environments_of_lerobot(tmp_path):
    module, options = environments(), {"task": "pick", "cameras": ["exo_camera_1"], "horizon": 3, **OPTIONS}
    plain = mjs.make_vec(num_envs=2, **options)
    env = module.LeRobotVectorEnv(options, 2, map={"features": {"environment_state": "obs/extra/obj_start"}})
    observation, infos = env.reset(seed=[7, 8])
    plain.reset(options={"episodes": [7, 8]})
    assert infos["episode_info"]["number"].tolist() == [7, 8] and env.observation_space.contains(observation)
    np.testing.assert_array_equal(observation["pixels"]["exo_camera_1"], plain.rows["exo_camera_1"])
    np.testing.assert_array_equal(observation["environment_state"], plain.rows["obj_start"].astype(np.float32))
    assert env.call("task_description") == tuple(plain.instructions) and env.call("_max_episode_steps") == (3, 3) and env.call("task") == ("pick",) * 2
    for step in range(3):
        actions = np.concatenate([observation["agent_pos"][:, :7], np.zeros((2, 1), np.float32)], 1)
        observation, _, terminated, truncated, infos = env.step(actions)
        assert ("final_info" in infos) == (step == 2) and (truncated.all(), terminated.any()) == (step == 2, False)
    assert infos["final_info"]["is_success"].tolist() == [False, False]
    np.testing.assert_array_equal(env.call("render")[1], observation["pixels"]["exo_camera_1"][1])
    with pytest.raises(AttributeError, match="no attribute 'fps'; it has task_description"):
        env.call("fps")
    one = module.LeRobotEnv({**options, "cameras": []}, episodes=[4, 9])
    for seed, number in ((1000, 4), (1001, 9), (1002, 4)):
        one.reset(seed=seed)
        plain.reset(options={"episodes": [number, number]})
        np.testing.assert_array_equal(one._env._env.sim.state[0], plain.sim.state[0])
    assert one.render().ndim == 3 and one.task == "pick" and one.task_description == plain.instructions[0]


@pytest.mark.parametrize("version", ("0.4.4", "0.6.1"))
def test_mjsense_and_lerobot_eval_play_the_same_episodes(recorded, tmp_path, version):
    """With a policy that LeRobot trained on the export. The states are equal in every bit."""
    python, variables = with_mjsense(version)
    scripts, trained = Path(__file__).parent / "adapters", tmp_path / "act"
    mjs.exporting.export_lerobot(recorded / "data", tmp_path / "out")
    run(python, variables, scripts / "lerobot_act.py", tmp_path / "out", trained, "act", 3)
    small = ["--seed", "5", "--width", "64", "--height", "64", "--no-shadows", "--horizon", "20"]
    evaluation = ["-m", "mjsense", "evaluate", "pick", "--policy", f"lerobot:{trained}", "--episodes", "2", "--worlds", "2", "--out", tmp_path / "ours"]
    run(python, variables, *evaluation, *small)
    run(python, variables, *evaluation[:-3], "1", "--out", tmp_path / "alone", *small)
    run(python, variables, scripts / "lerobot_steps.py", "rollout", trained, tmp_path / "theirs.npz", 5, 20, 2)
    theirs = np.load(tmp_path / "theirs.npz")
    for world, episode in enumerate(mjs.Dataset(tmp_path / "ours").episodes):
        mine = np.concatenate([episode["obs/agent/qpos/arm"], episode["obs/agent/qpos/gripper"]], 1)
        # The last observation of LeRobot 0.4.4 is the first of the next episode.
        np.testing.assert_array_equal(mine.astype(np.float32)[:20], theirs["states"][world][:20])
    assert "largest difference" in run(python, variables, scripts / "lerobot_steps.py", "memory", trained, 3)
    serve = ["-m", "mjsense", "serve", f"lerobot:{trained}", "--task", "pick", "--size", "64x64", "--port", "0"]
    with subprocess.Popen([python, *map(str, serve)], stdout=subprocess.PIPE, text=True, env={**os.environ, **variables}) as server:
        assert server.stdout is not None
        try:
            url = next(found[0] for line in server.stdout if (found := re.search(r"ws://\S+\d", line)))  # LeRobot prints lines before it
            served = mjs.evaluate("pick", policy=url, episodes=2, num_worlds=2, horizon=20, out=tmp_path / "served", progress=False, **OPTIONS)
        finally:
            server.terminate()
    # The server computes one row for each call, and torch's results depend on the number of rows.
    for mine, other in zip(mjs.Dataset(tmp_path / "alone").episodes, served.dataset.episodes, strict=True):
        np.testing.assert_array_equal(other.states, mine.states)
    words = ["--env.type=mjsense", "--env.task=pick", "--env.env_seed=5", "--env.width=64", "--env.height=64", "--env.horizon=20", "--seed=0",
             "--env.options={shadows: false}", f"--policy.path={trained}", "--policy.device=cpu", "--eval.batch_size=2", "--eval.n_episodes=2",
             f"--output_dir={tmp_path / 'eval'}"]  # fmt: skip
    if version == "0.4.4":  # it does not look for distributions lerobot_env_*
        words.append("--env.discover_packages_path=lerobot_env_mjsense")
    run(python, variables, "-m", "lerobot.scripts.lerobot_eval", *words)
    found = json.loads((tmp_path / "eval/eval_info.json").read_text())["per_task"][0]["metrics"]
    assert found["successes"] == pq.read_table(tmp_path / "ours/results.parquet")["success"].to_pylist()
    mine = [episode.video("wrist_camera") for episode in mjs.Dataset(tmp_path / "ours").episodes]
    for episode, path in enumerate(found["video_paths"]):
        with av.open(path) as file:
            theirs = [frame.to_ndarray(format="rgb24").astype(float) for frame in file.decode(video=0)]
        moved = np.abs(mine[episode][19].astype(float) - mine[episode][0]).mean()
        assert np.abs(mine[episode][19] - theirs[19]).mean() < 0.5 * moved, (episode, moved)
    text = run(python, variables, *evaluation[:-1], tmp_path / "wrong", "--width", "32", "--height", "64", "--horizon", "5", fails=True)
    assert "was trained with images of 64x64 as 'observation.images.exo_camera_1', and here they have 32x64 pixels" in text, text


def test_policies_with_memory_have_one_for_each_world(recorded, tmp_path):
    python, variables = with_mjsense("0.4.4")
    scripts = Path(__file__).parent / "adapters"
    mjs.exporting.export_lerobot(recorded / "data", tmp_path / "out")
    run(python, variables, scripts / "lerobot_act.py", tmp_path / "out", tmp_path / "diffusion", "diffusion", 1)
    assert "largest difference" in run(python, variables, scripts / "lerobot_steps.py", "memory", tmp_path / "diffusion", 3)
