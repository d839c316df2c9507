# SPDX-License-Identifier: Apache-2.0
"""Recorded episodes in plain MuJoCo: equal bit for bit, and deviations are named."""

import json
import os
import re
import shutil
import subprocess
import sys

import h5py
import mujoco
import numpy as np
import pytest
from edited_recordings import changed, file_of
from program_runs import run_program

import mjsense as mjs

SMALL = dict(num_worlds=2, episodes=2, keep_failures=True, cameras=[], seed=3)


@pytest.fixture(scope="module")
def pick(tmp_path_factory):
    """Episodes in which the object is pushed or slips."""
    out = tmp_path_factory.mktemp("pick")
    mjs.record("pick", out=out, perturb=1.0, horizon=20, **SMALL)
    return out


@pytest.fixture(scope="module")
def door(tmp_path_factory):
    """A mobile robot, whose controllers run several times in a step."""
    out = tmp_path_factory.mktemp("door")
    mjs.record("door_opening", out=out, horizon=20, **SMALL)
    return out


@pytest.fixture
def copied(pick, tmp_path):
    shutil.copytree(pick, tmp_path / "data")
    return tmp_path / "data"


@pytest.mark.parametrize("name", ["pick", "door"])
def test_equal_bit_for_bit(name, request):
    root = request.getfixturevalue(name)
    with h5py.File(file_of(root)) as file:
        assert ("ctrl" in file["traj_0/replay"]) == (name == "door")
    report = mjs.check_replay(root)
    assert report and report.ok, report
    assert repr(report) == "2 of 2 episodes (40 steps) replay equal bit for bit"
    assert [(e.episode, e.steps, e.stepwise, e.open_loop) for e in report.episodes] == [(0, 20, None, None), (1, 20, None, None)]


def test_a_long_perturbed_episode(tmp_path):
    """Long enough that the object is grasped and disturbed."""
    mjs.record("pick", out=tmp_path, perturb=1.0, horizon=90, **{**SMALL, "episodes": 1})
    report = mjs.check_replay(tmp_path)
    assert report, report


def test_states_and_actions(pick):
    dataset = mjs.Dataset(pick)
    episode = dataset.episodes[1]
    assert episode.states.shape == (21, mujoco.mj_stateSize(episode.model(), mujoco.mjtState.mjSTATE_INTEGRATION))
    robot = episode["env_states/articulations/franka"]
    tool = {}
    for from_ in ("states", "actions"):
        for t, data in episode.replay(from_):
            joints = [mujoco.mj_name2id(data.model, mujoco.mjtObj.mjOBJ_JOINT, f"robot_0/fr3_joint{i}") for i in range(1, 8)]
            address = data.model.jnt_qposadr[joints]
            np.testing.assert_array_equal(data.qpos[address], robot[t, :7])
            tool.setdefault(from_, []).append(data.xpos.copy())
        assert t == 20
    np.testing.assert_array_equal(tool["states"], tool["actions"])
    visited = [(e.index, t) for e, t, _ in mjs.replay(dataset, from_="actions")]
    assert visited == [(k, t) for k in range(2) for t in range(21)]
    model = episode.model()
    data = mujoco.MjData(model)
    episode.set_state(model, data, 7)
    np.testing.assert_array_equal(data.xpos, tool["states"][7])
    state = np.empty(episode.states.shape[1])
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    np.testing.assert_array_equal(state, episode.states[7])
    assert next(episode.replay(model=model, data=data))[1] is data
    with pytest.raises(ValueError, match="from_ is 'ctrl': must be one of states, actions"):
        episode.replay("ctrl")


def test_each_episode_has_its_own_model(pick):
    dataset = mjs.Dataset(pick)
    a, b = (e.model() for e in dataset.episodes)
    assert (a.mat_rgba != b.mat_rgba).any() or (a.geom_size != b.geom_size).any()
    a.geom_size[:] = 1
    assert (dataset.episodes[0].model().geom_size != 1).any()


def test_a_changed_state_is_named(copied):
    """The joint, the step and the part of the state."""
    model = mjs.Dataset(copied).episodes[1].model()
    joint = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, "robot_0/fr3_joint4")
    with changed(file_of(copied)) as file:
        states = file["traj_1/replay/state"]
        row = states[12]
        value = row[1 + model.jnt_qposadr[joint]]
        row[1 + model.jnt_qposadr[joint]] = np.nextafter(value, 10)
        states[12] = row
    report = mjs.check_replay(copied)
    assert not report and report.episodes[0].ok and not report.episodes[1].ok
    for found in (report.episodes[1].stepwise, report.episodes[1].open_loop):
        assert (found.step, found.field, found.element, found.count) == (12, "qpos", "joint 'robot_0/fr3_joint4'[0]", 1)
        assert found.replayed == value and found.recorded == np.nextafter(value, 10)
    assert "1 of 2 episodes (40 steps) replay equal bit for bit" in repr(report)
    assert re.search(r"episode 1, stepwise: step 12: qpos of joint 'robot_0/fr3_joint4'\[0\]: recorded ", repr(report))


@pytest.mark.parametrize("damaged", [False, True])
def test_without_the_package_mujoco(copied, door, damaged):
    """The states are simulated by the MuJoCo that mjsense contains, with the same report."""
    if damaged:
        with changed(file_of(copied)) as file:
            row = file["traj_1/replay/state"][12]
            row[5] = np.nextafter(row[5], 10)
            file["traj_1/replay/state"][12] = row
    for root in (copied,) if damaged else (copied, door):
        words = [sys.executable, "-m", "mjsense", "replay", root, "--json"]
        done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "MJSENSE_MUJOCO": "private"})
        assert json.loads(done.stdout) == mjs.check_replay(root).to_dict(), done.stderr
        assert done.returncode == damaged


def test_every_part_of_the_state_has_a_name(door):
    from mjsense.dataset import replay_check
    from mjsense.dataset.episode_worlds import OwnStepper

    episode = mjs.Dataset(door).episodes[0]
    stepper, own = replay_check._stepper(episode), OwnStepper(episode)
    size = mujoco.mj_stateSize(stepper.model, mujoco.mjtState.mjSTATE_INTEGRATION)
    assert [stepper.part(i) for i in range(size)] == [own.part(i) for i in range(size)]
    fields = set()
    for i in range(size):
        recorded, replayed = np.zeros(size), np.zeros(size)
        replayed[i] = 1
        found = replay_check._deviation(stepper, 3, recorded, replayed)
        assert found.count == 1 and found.replayed == 1
        fields.add(found.field)
    assert {"time", "qpos", "qvel", "warmstart", "ctrl", "xfrc_applied", "mocap_pos", "mocap_quat"} <= fields


def test_program(pick, door):
    """``mjsense replay``: exit code, report and JSON."""

    def run(*words):
        return run_program("replay", *map(str, words))

    done = run(pick, "--verify", "--episodes", 1, "--json")
    report = json.loads(done.stdout)
    assert done.returncode == 0 and report["ok"] and [e["episode"] for e in report["episodes"]] == [1], done.stderr
    assert "env_states/articulations/franka" in report["episodes"][0]["sensors"]["equal"]
    done = run(door, "--from", "states")  # a robot with several control ticks in a step
    assert done.returncode == 0 and "2 of 2 episodes (40 steps) replay equal bit for bit" in done.stdout, done.stdout
    assert "actions/joint_pos_rel: the action that the policy chose" in done.stdout
    wrong = run(pick, "--from", "state")
    assert wrong.returncode == 2 and "--from is 'state': must be one of actions, states; did you mean 'states'?" in wrong.stderr and wrong.stderr.count("\n") == 1


def test_without_data_for_replay(tmp_path):
    mjs.record("pick", out=tmp_path, replay=False, horizon=5, **{**SMALL, "episodes": 1})
    dataset = mjs.Dataset(tmp_path)
    assert dataset[3]["obs/agent/qpos/arm"].shape == (7,) and len(dataset) == 6
    for use in (lambda: mjs.check_replay(dataset), lambda: dataset.episodes[0].states, lambda: dataset.episodes[0].model(),
                lambda: next(mjs.replay(tmp_path))):  # fmt: skip
        with pytest.raises(ValueError, match=r"has no data for replay\. Record it again without --no-replay"):
            use()


def test_errors(copied):
    archive = next(copied.glob("house_0/model_*.zip"))
    archive.rename(copied / "moved.zip")
    with pytest.raises(FileNotFoundError, match="needs the model archive"):
        mjs.check_replay(copied)
    (copied / "moved.zip").rename(archive)
    with h5py.File(file_of(copied), "a") as file:
        states = file["traj_0/replay/state"][:]
        del file["traj_0/replay/state"]
        file["traj_0/replay/state"] = states[:, 1:]
    with pytest.raises(ValueError, match=f"recorded state has {states.shape[1] - 1} numbers, that of MuJoCo .* has {states.shape[1]}"):
        mjs.check_replay(copied)
    with pytest.raises(ValueError, match="cannot be combined"):
        mjs.check_replay(mjs.Dataset(copied), episodes=[0])
    assert mjs.check_replay(copied, episodes=[1])
