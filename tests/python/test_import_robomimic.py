# SPDX-License-Identifier: Apache-2.0
"""Import of robomimic's and robosuite's files."""

import json
import subprocess
import sys

import h5py
import mujoco
import numpy as np
import pytest
from program_runs import run_program

import mjsense as mjs
from mjsense.core.png import png_of as png


def test_an_exported_recording_comes_back(tmp_path):
    size = dict(width=32, height=24, horizon=8, shadows=False)
    mjs.record("pick", out=tmp_path / "data", num_worlds=2, episodes=2, keep_failures=True, depth=True, seed=3, **size)
    mjs.exporting.export_robomimic(tmp_path / "data", tmp_path / "pick.hdf5")
    mjs.import_robomimic(tmp_path / "pick.hdf5", tmp_path / "back")
    ours, theirs = mjs.Dataset(tmp_path / "data"), mjs.Dataset(tmp_path / "back")
    assert theirs.fps == ours.fps and [e.length for e in theirs.episodes] == [8, 8]
    with h5py.File(tmp_path / "pick.hdf5") as file:
        for i, (a, b) in enumerate(zip(ours.episodes, theirs.episodes)):
            assert (b.task, b.outcome, b.seed) == (a.task, a.outcome, a.seed)
            np.testing.assert_array_equal(b.states, a.states[:-1])
            np.testing.assert_array_equal(b["actions/action"][1:], file[f"data/demo_{i}/actions"][:-1])
            np.testing.assert_array_equal(b["obs/extra/observation/state"], file[f"data/demo_{i}/obs/state"])
            depth = [e.video("wrist_camera_depth")[:8] for e in (a, b)]
            np.testing.assert_allclose(depth[0], depth[1], atol=1e-6)
            colour = [e.video("exo_camera_1")[:8].astype(float) for e in (a, b)]
            assert np.abs(colour[0] - colour[1]).mean() < 5
            for (_, x), (_, y) in zip(a.replay(), b.replay()):
                np.testing.assert_allclose(y.xpos, x.xpos, atol=1e-6)
    done = run_program("verify", tmp_path / "back")
    assert done.returncode == 0 and "intact: 2 files, 2 episodes" in done.stdout, done.stdout + done.stderr


@pytest.fixture
def demonstrations(tmp_path):
    """Three demonstrations as robosuite writes them, two of them with one model, and the folder of the package's textures."""
    xml = """<mujoco><compiler meshdir="meshes/"/><asset>
      <texture type="2d" name="wood" file="/home/someone/robosuite-dev/robosuite/models/assets/arenas/../textures/wood.png"/>
      <material name="wood" texture="wood"/><mesh file="/home/someone/robosuite/models/assets/wedge.obj"/></asset>
      <worldbody><geom type="plane" size="1 1 .1" material="wood"/><body name="cube" pos="0 0 .1"><freejoint/><geom size=".02"/></body>
      <body pos=".3 0 .1"><joint name="lever" axis="0 1 0"/><geom type="mesh" mesh="wedge" mass="HEAVY"/></body></worldbody></mujoco>"""
    textures = tmp_path / "package/models/assets"
    (textures / "arenas").mkdir(parents=True)
    (textures / "textures").mkdir()
    (textures / "textures/wood.png").write_bytes(png(np.full((4, 4, 3), 128, np.uint8)))
    (textures / "wedge.obj").write_text("v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    rng = np.random.default_rng(0)
    with h5py.File(tmp_path / "demo.hdf5", "w") as file:
        file.create_group("data").attrs["env_info"] = json.dumps({"env_name": "Lift", "robots": "Panda"})
        for name, mass in (("demo_1", "1"), ("demo_2", "2"), ("demo_10", "1")):
            demo = file.create_group(f"data/{name}")
            demo.attrs["model_file"] = xml.replace("HEAVY", mass)
            states = rng.normal(size=(5, 1 + 8 + 7))
            states[:, 0] = np.arange(5) / 20
            states[:, 4:8] /= np.linalg.norm(states[:, 4:8], axis=1, keepdims=True)
            demo["states"], demo["actions"] = states, rng.normal(size=(5, 7))
    return tmp_path / "demo.hdf5", tmp_path / "package"


def test_robosuite_demonstrations(demonstrations, tmp_path):
    path, package = demonstrations
    mjs.import_robomimic(path, tmp_path / "out", assets=package)
    episodes = mjs.Dataset(tmp_path / "out").episodes
    assert [(e.house, e.length, e.task) for e in episodes] == [(0, 5, "Lift"), (0, 5, "Lift"), (1, 5, "Lift")] and episodes[0].fps == 20
    with h5py.File(path) as file:
        for episode, name in zip(episodes, ("demo_1", "demo_10", "demo_2")):
            demo, model = file[f"data/{name}"], episode.model()
            assert model.body_mass[2] == (2 if name == "demo_2" else 1) and model.mesh(0).name == "wedge"
            for t, data in episode.replay():
                flat = [data.time, *data.qpos, *data.qvel]
                np.testing.assert_allclose(flat, demo["states"][t], atol=1e-12)
            np.testing.assert_array_equal(episode["actions/action"], np.concatenate([np.zeros((1, 7)), demo["actions"][:-1]]))
            assert mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION) == episode.states.shape[1]


def test_errors_name_the_demonstration(demonstrations, tmp_path):
    path, package = demonstrations
    with pytest.raises(FileNotFoundError, match=r"the model of data/demo_1 names .*/wood\.png', which does not exist"):
        mjs.import_robomimic(path, tmp_path / "out", assets=tmp_path / "nowhere")
    with h5py.File(path, "a") as file:
        del file["data/demo_2/states"]
        file["data/demo_2/states"] = np.zeros((5, 4))
    with pytest.raises(ValueError, match=r"data/demo_2: states have 4 numbers; time, qpos and qvel of its model are 16"):
        mjs.import_robomimic(path, tmp_path / "out", assets=package, episodes=[1])
    with pytest.raises(ValueError, match=r"episodes: 3 is not in .*demo\.hdf5, which has 3 demonstrations"):
        mjs.import_robomimic(path, tmp_path / "other", episodes=[3])
    h5py.File(tmp_path / "empty.hdf5", "w").close()
    with pytest.raises(ValueError, match=r"empty\.hdf5 contains no demonstrations"):
        mjs.import_robomimic(tmp_path / "empty.hdf5", tmp_path / "other")


def test_command(demonstrations, tmp_path):
    path, package = demonstrations
    run = [sys.executable, "-m", "mjsense", "import", "robomimic", path, tmp_path / "out", "--assets", package, "--episodes", "0", "--fps", "10"]
    done = subprocess.run(run, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert mjs.Dataset(tmp_path / "out").fps == 10
