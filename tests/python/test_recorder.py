# SPDX-License-Identifier: Apache-2.0
import json

import gymnasium
import h5py
import numpy as np
import pytest
from scenes import ball_scene

import mjsense as mjs


class Height(mjs.Sensor):
    """Height of the ball."""

    uuid = "height"
    observation_space = gymnasium.spaces.Box(-10, 10, (1,), np.float64)
    unit = "m"

    def compute(self, sim):
        return sim.qpos[:, 2:3]


def simulation():
    camera = mjs.CameraSensorCfg(name="eye", pos=(0, -2, 0.5), quat=(0.7, 0.7, 0, 0), width=16, height=8, data_types=("rgb", "depth"))
    return mjs.Simulation(ball_scene(camera), num_worlds=2, decimation=10)


def read(recorder, *keys):
    with h5py.File(next(recorder.path.glob("*.h5"))) as file:
        return [file[key][()] for key in keys]


def test_user_defined_loop(tmp_path):
    sim = simulation()
    heights = []
    with mjs.Recorder(sim, tmp_path, [*sim.scene.sensors.values(), Height()], episodes=2, settings={"gravity": 9.81}) as recorder:
        for world in range(2):
            recorder.begin_episode(world, episode=world, seed=4)
        recorder.append()
        for step in range(5):
            sim.step()
            heights.append(sim.qpos[:, 2].copy())
            recorder.append(reward=[1, 2], success=[step == 4, False], truncated=step == 4)
        recorder.finish_episode(0, {"task_description": "fall"}, outcome="success")
        recorder.finish_episode(1)
        assert recorder.kept == 2 and recorder.enough and not recorder.recording(0)
    rows, rewards, success, truncated, scene = read(
        recorder, "traj_0/obs/extra/height", "traj_1/rewards", "traj_0/success", "traj_0/truncated", "traj_0/obs_scene"
    )
    np.testing.assert_array_equal(rows[1:, 0], np.array(heights)[:, 0])
    assert rewards.tolist() == [0, 2, 2, 2, 2, 2] and success.tolist() == [False] * 5 + [True] and truncated.tolist() == success.tolist()
    assert json.loads(scene) == {"task_description": "fall"}
    names = sorted(path.stem for path in recorder.path.glob("episode_00000000*"))
    assert names == ["episode_00000000_eye", "episode_00000000_eye_depth"]
    with h5py.File(next(recorder.path.glob("*.h5"))) as file:
        assert '"gravity":9.81' in file.attrs["recording"] and file["traj_0"].attrs["outcome"] == "success"
        assert file["traj_0/obs/sensor_data/eye"].attrs["fps"] == "50"
    assert recorder.stats["rows"] == 12


def test_all_camera_fields_are_recorded(tmp_path):
    camera = mjs.CameraSensorCfg(
        name="eye", pos=(0, -2, 0.5), quat=(0.7, 0.7, 0, 0), width=16, height=8, data_types=("rgb", "segmentation", "normals")
    )
    sim = mjs.Simulation(ball_scene(camera), num_worlds=1)
    with mjs.Recorder(sim, tmp_path, episodes=1) as recorder:
        recorder.begin_episode(0, episode=0)
        recorder.append()
        seen = {field: getattr(sim.scene["eye"].data, field)[0].copy() for field in ("segmentation", "normals", "intrinsics", "pose")}
        recorder.finish_episode(0)
    with pytest.raises(RuntimeError, match="complete"):
        recorder.append()
    with h5py.File(next(recorder.path.glob("*.h5"))) as file:
        assert "eye" in file["traj_0/obs/sensor_data"]
        for field, value in seen.items():
            np.testing.assert_array_equal(file[f"traj_0/obs/extra/eye_{field}"][0], value)


def test_unfinished_recording_can_be_resumed(tmp_path):
    sim = simulation()
    sensors = [Height()]
    recorder = mjs.Recorder(sim, tmp_path, sensors, episodes=2)
    recorder.begin_episode(0, 0)
    recorder.append([0])
    recorder.finish_episode(0)
    recorder.begin_episode(0, 1)
    recorder.append([0])
    recorder.abandon_episode(0)
    recorder.begin_episode(1, 2)
    recorder.append([1])
    recorder.discard_episode(1, "fell")
    recorder.flush()
    assert recorder.kept == 1 and recorder.decided(2) and not recorder.decided(1)
    del recorder
    with pytest.raises(ValueError, match="resume"):
        mjs.Recorder(sim, tmp_path, sensors, episodes=2)
    with mjs.Recorder(sim, tmp_path, sensors, episodes=2, resume=True) as recorder:
        assert recorder.kept == 1 and recorder.decided(2)
        recorder.begin_episode(0, 1)
        recorder.append([0])
        recorder.finish_episode(0)
    assert recorder.enough


def test_errors(tmp_path):
    class Loose(mjs.Sensor):
        uuid = "loose"

    sim = simulation()
    for call, error, text in [
        (lambda: mjs.Recorder(sim, tmp_path, [3]), TypeError, "not a sensor: 3 is not a mjsense.Sensor"),
        (lambda: mjs.Recorder(sim, tmp_path, [Loose()]), ValueError, "sensor 'loose' cannot be recorded"),
        (lambda: mjs.Recorder(sim, tmp_path, episodes=0), ValueError, "episodes"),
        (lambda: mjs.Recorder(sim, tmp_path, fps=0), ValueError, "fps is 0"),
        (lambda: recorder.begin_episode(2, 0), ValueError, r"world 2: must be in \[0, 2\)"),
        (lambda: recorder.append([0], reward=[1, 2]), ValueError, r"reward has shape \(2,\), expected one value, or \(1,\) for the worlds \[0\]"),
        (lambda: recorder.append([1]), Exception, "1"),
    ]:
        recorder = mjs.Recorder(sim, tmp_path / str(len(list(tmp_path.iterdir()))), [sim.scene["eye"]], episodes=1)
        recorder.begin_episode(0, 0)
        with pytest.raises(error, match=text):
            call()
        recorder.abandon_episode(0)


def test_episodes_can_be_added_and_replaced(tmp_path):
    sim, height = simulation(), Height()

    def record(episodes, **options):
        with mjs.Recorder(sim, tmp_path, [height], episodes=episodes, **options) as recorder:
            for number in range(recorder.first_attempt, recorder.first_attempt + episodes):
                recorder.begin_episode(0, number)
                recorder.append([0])
                recorder.finish_episode(0)
            return recorder.first_attempt

    assert record(1) == 0
    with pytest.raises(ValueError, match="resume it, append to it, overwrite it"):
        record(2)
    assert record(2, append=True) == 1
    assert [episode.number for episode in mjs.Dataset(tmp_path).episodes] == [0, 1, 2]
    with pytest.raises(ValueError, match="choose one of resume, append and overwrite"):
        record(1, append=True, overwrite=True)
    assert record(1, overwrite=True) == 0
    assert [episode.number for episode in mjs.Dataset(tmp_path).episodes] == [0]
