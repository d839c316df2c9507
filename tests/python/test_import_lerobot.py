# SPDX-License-Identifier: Apache-2.0
"""Import of LeRobot data sets."""

import json
import zipfile

import h5py
import numpy as np
import pytest

pytest.importorskip("av")
pytest.importorskip("pyarrow")

from program_runs import run_program

import mjsense as mjs
from mjsense import commands


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A recording, and its export with depth."""
    folder = tmp_path_factory.mktemp("lerobot")
    mjs.record("pick", out=folder / "data", num_worlds=2, episodes=2, keep_failures=True, depth=True, seed=3, width=32, height=24, horizon=8, shadows=False)
    cameras = {"wrist": "wrist_camera", "eye": "exo_camera_1", "eye_depth": "exo_camera_1_depth"}
    mjs.exporting.export_lerobot(folder / "data", folder / "out", map={"state": "obs/agent/qpos/arm", "cameras": cameras, "features": {"tcp": "obs/extra/tcp_pose"}})
    return folder


def test_an_exported_recording_comes_back(made, tmp_path):
    mjs.import_lerobot(made / "out", tmp_path / "back")
    ours, theirs = mjs.Dataset(made / "data"), mjs.Dataset(tmp_path / "back")
    assert theirs.fps == 15 and [e.length for e in theirs.episodes] == [8, 8]
    for a, b in zip(ours.episodes, theirs.episodes):
        assert (b.task, b.success, b.outcome) == (a.task, a.success, "no success")
        with h5py.File(b.path) as file:
            assert json.loads(file[b.trajectory]["obs_scene"][()])["policy_dt_ms"] == 1000 / 15
        np.testing.assert_array_equal(b["obs/extra/observation/state"], a["obs/agent/qpos/arm"][:-1].astype(np.float32))
        np.testing.assert_array_equal(b["obs/extra/observation/tcp"], a["obs/extra/tcp_pose"][:-1].astype(np.float32))
        np.testing.assert_array_equal(b["actions/action"][1:, :7], a["actions/joint_pos/arm"][1:-1].astype(np.float32))
        np.testing.assert_array_equal(b["rewards"], a["rewards"][:-1])
        assert np.abs(b.video("wrist")[:].astype(float) - a.video("wrist_camera")[:8]).mean() < 5
        np.testing.assert_allclose(b.video("eye_depth")[:], a.video("exo_camera_1_depth")[:8].clip(0.01, 10), atol=0.004)
    done = run_program("verify", tmp_path / "back")
    assert done.returncode == 0 and "2 episodes" in done.stdout, done.stdout + done.stderr


def test_with_a_scene_it_is_replayed_and_rendered(made, tmp_path):
    with zipfile.ZipFile(next(made.glob("data/house_0/*.zip"))) as archive:
        archive.extractall(tmp_path / "scene")
    ours = mjs.Dataset(made / "data").episodes
    joints = [f"robot_0/fr3_joint{i}" for i in range(1, 8)]
    mjs.import_lerobot(made / "out", tmp_path / "back", episodes=[1], scene=tmp_path / "scene/model.xml", joints=joints)
    (again,) = mjs.Dataset(tmp_path / "back").episodes
    for (_, a), (_, b) in zip(ours[1].replay(), again.replay()):
        np.testing.assert_array_equal([b.joint(name).qpos for name in joints], np.float32([a.joint(name).qpos for name in joints]))
    top = {"pos": [0.5, 0, 1.6], "lookat": [0.5, 0, 0], "width": 32, "height": 24}
    mjs.render(tmp_path / "back", tmp_path / "again", cameras=[], add_cameras={"top": top})
    assert mjs.Dataset(tmp_path / "again").episodes[0].video("top")[:].std() > 1


def test_errors(made, tmp_path, capsys):
    (tmp_path / "scene.xml").write_text("<mujoco><worldbody><body><joint name='arm_9'/><geom size='1'/></body></worldbody></mujoco>")
    with pytest.raises(mjs.UnknownNameError, match=r"no hinge or slide joint 'arm_0'.*of arm_9"):
        mjs.import_lerobot(made / "out", tmp_path / "a", scene=tmp_path / "scene.xml")
    with pytest.raises(ValueError, match=r"names 1 joint, but observation.state has 7 numbers"):
        mjs.import_lerobot(made / "out", tmp_path / "a", scene=tmp_path / "scene.xml", joints=["arm_9"])
    with pytest.raises(FileNotFoundError, match="is not a LeRobot data set"):
        mjs.import_lerobot(made / "data", tmp_path / "a")
    (tmp_path / "old/meta").mkdir(parents=True)
    (tmp_path / "old/meta/info.json").write_text(json.dumps({"codebase_version": "v2.1"}))
    with pytest.raises(ValueError, match=r"has the version 'v2.1', expected v3.0"):
        mjs.import_lerobot(tmp_path / "old", tmp_path / "a")
    for text, wrong in [("[]", "is a list, not an object"), ("{", "is not JSON text"), ('{"codebase_version": "v3.0", "features": {}}', "has no 'fps'")]:
        (tmp_path / "old/meta/info.json").write_text(text)
        with pytest.raises(ValueError, match=f"info.json.*{wrong}"):
            mjs.import_lerobot(tmp_path / "old", tmp_path / "a")
    with pytest.raises(ValueError, match=r"scene: MuJoCo cannot load .*info\.json"):
        mjs.import_lerobot(made / "out", tmp_path / "a", scene=tmp_path / "old/meta/info.json")
    assert commands.run(["import", "robomimic", "x.hdf5", "a", "--scene", "x.xml"]) == 2
    assert "--scene is not an option of the format robomimic" in capsys.readouterr().err
