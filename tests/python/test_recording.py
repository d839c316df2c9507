# SPDX-License-Identifier: Apache-2.0
import subprocess
import sys

import gymnasium
import h5py
import numpy as np
import pytest

import mjsense as mjs

PROGRAM = [sys.executable, "-m", "mjsense"]
SMALL = dict(num_worlds=2, width=48, height=32, shadows=False, seed=1)


class Hand(mjs.Sensor):
    """Height of every body."""

    uuid = "heights"
    observation_space = gymnasium.spaces.Box(-10, 10, (3,), np.float32)
    unit = "m"

    def compute(self, sim):
        return sim.data.xpos[:, :3, 2].astype(np.float32)


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    seen = []
    summary = mjs.record(
        out=tmp_path_factory.mktemp("data"), episodes=1, sensors=[Hand()], progress=seen.append, **SMALL
    )
    return summary, seen


def test_summary_and_progress(recording):
    summary, seen = recording
    assert summary.kept == 1 and summary.enough and not summary.interrupted
    assert isinstance(seen[-1], mjs.tasks.RecordProgress) and seen[-1].kept == 1
    assert summary.steps == sum(n - 1 for n in summary.lengths)


def test_user_defined_sensor_is_recorded(recording):
    files = list(recording[0].path.rglob("*.h5"))
    assert len(files) == 1
    with h5py.File(files[0]) as file:
        rows = file["traj_0/obs/extra/heights"]
        assert rows.shape[1:] == (3,) and rows.dtype == np.float32
        assert rows.attrs["unit"] in ("m", b"m")
        assert len(rows) == len(file["traj_0/obs/extra/heights"])


def test_bad_arguments(tmp_path):
    for kwargs, error, text in [
        (dict(task="pik"), KeyError, "did you mean 'pick'"),
        (dict(robot="frank"), KeyError, "franka"),
        (dict(policy="x"), KeyError, "planner"),
        (dict(cameras=["wrist"]), KeyError, "wrist"),
        (dict(episodes=0), ValueError, "episodes is 0"),
        (dict(num_worlds=0), ValueError, "worlds is 0"),
        (dict(episodes="2"), TypeError, "episodes must be an int"),
        (dict(sensors=[3]), TypeError, "not a mjsense.Sensor"),
    ]:
        with pytest.raises(error, match=text):
            mjs.record(**{"out": tmp_path, **SMALL, **kwargs})


def test_errors_of_a_sensor_end_the_recording(tmp_path):
    class Broken(Hand):
        def compute(self, sim):
            raise ArithmeticError("no")

    with pytest.raises(mjs.SensorError, match="sensor 'heights': compute"):
        mjs.record(out=tmp_path, episodes=1, sensors=[Broken()], **SMALL)
    with pytest.raises(ValueError, match="cannot be recorded"):
        Broken.observation_space = None
        mjs.record(out=tmp_path, episodes=1, sensors=[Broken()], **SMALL)


def test_interrupt(tmp_path):
    def stop(progress):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mjs.record(out=tmp_path, episodes=2, progress=stop, **SMALL)
    # Finished episodes are kept, and the recording can be resumed.
    summary = mjs.record(out=tmp_path, episodes=2, resume=True, **SMALL)
    assert summary.kept == 2 and summary.enough


def test_the_program_writes_the_same_bytes(tmp_path):
    options = ["--episodes", "1", "--horizon", "3", "--keep-failures", "--size", "48x32", "--no-shadows", "--seed", "1"]
    subprocess.run([*PROGRAM, "record", "pick", "--out", tmp_path / "a", "-q", "--no-sheet", *options], check=True, capture_output=True)
    mjs.record("pick", out=tmp_path / "b", episodes=1, horizon=3, keep_failures=True, width=48, height=32, shadows=False, seed=1)
    names = sorted(path.name for path in (tmp_path / "a/house_0").iterdir())
    assert names == sorted(path.name for path in (tmp_path / "b/house_0").iterdir()) and len(names) == 4
    for name in names:
        assert (tmp_path / "a/house_0" / name).read_bytes() == (tmp_path / "b/house_0" / name).read_bytes(), name


def test_meshes_option(tmp_path, monkeypatch):
    monkeypatch.delenv("MJSENSE_FRANKA_MESHES", raising=False)
    monkeypatch.setattr("mjsense.core.installed_files.installed_meshes", lambda texts: {})
    with pytest.raises(ValueError, match="robot 'franka': its real meshes were not found"):
        mjs.record(out=tmp_path, meshes="real", **SMALL)
    with pytest.raises(ValueError, match=r"meshes.*must be one of auto, shapes, real"):
        mjs.make_vec("pick", meshes="mesh")
    monkeypatch.setenv("MJSENSE_FRANKA_MESHES", str(tmp_path / "nowhere"))
    with pytest.raises(ValueError, match="MJSENSE_FRANKA_MESHES"):
        mjs.make_vec("pick")


def test_nan_in_a_stream_is_reported_unless_its_description_names_it(tmp_path):
    class Lost(mjs.Sensor):
        """Distance to a thing that is lost."""

        uuid = "lost"
        observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (2,), np.float32)

        def compute(self, sim):
            return np.array([[1, np.nan]] * sim.num_worlds, np.float32)

    class Known(Lost):
        """Distance to a thing; NaN while it is lost."""

        uuid = "known"

    result = {}
    for sensor in (Lost(), Known()):
        out = tmp_path / sensor.uuid
        mjs.record(out=out, episodes=1, sensors=[sensor], cameras=[], horizon=5, keep_failures=True, seed=1)
        done = subprocess.run([*PROGRAM, "verify", out], capture_output=True, text=True, check=False)
        result[sensor.uuid] = done.returncode, done.stdout
    assert result["known"][0] == 0, result["known"][1]
    assert result["lost"][0] != 0
    assert "obs/extra/lost holds 6 NaN, the first in row 0, and its description does not say what NaN means" in result["lost"][1]
