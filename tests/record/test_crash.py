# SPDX-License-Identifier: Apache-2.0
"""Tests with kill -9 at random times: finished episodes stay readable, --resume continues, and no episode is recorded twice."""

import random
import signal
import subprocess
import time

import h5py
import pytest

OPTIONS = ["--episodes", "7", "--batches", "3", "--worlds", "3", "--steps", "8", "--discard", "4", "--print"]


def contents(out):
    return {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*") if p.is_file()}


def episodes_of(files):
    found = set()
    for path in files:
        with h5py.File(path) as f:
            found |= {str(traj.attrs["episode"]) for traj in f.values() if len(traj["obs/agent/qpos"]) == len(traj["success"])}
    return found


@pytest.fixture(scope="module")
def whole(record_fake, tmp_path_factory):
    """The files of an uninterrupted recording and its episodes. Episodes beyond the requested number are not stored."""
    out = tmp_path_factory.mktemp("whole")
    record_fake(out, *OPTIONS)
    return contents(out), episodes_of(out.glob("house_0/*.h5"))


@pytest.mark.parametrize("seed", range(2))
def test_kill_and_resume(record_fake, whole, tmp_path, seed):
    rng = random.Random(seed)
    files, wanted = whole
    finished = []  # episodes that the program reported as stored
    for _ in range(12):
        process = subprocess.Popen(
            [record_fake.program, tmp_path, *OPTIONS, "--resume", "--step-ms", "4"], stdout=subprocess.PIPE, text=True
        )
        time.sleep(rng.uniform(0.02, 0.8))
        process.send_signal(signal.SIGKILL)
        finished += [line.split()[1] for line in process.communicate()[0].splitlines() if line.startswith("finished")]
        if (tmp_path / "house_0").exists() and not (tmp_path / "house_0/.recording").exists():
            break  # the recording finished before the kill
        check_readable(record_fake, tmp_path, wanted.intersection(finished))
    record_fake(tmp_path, *OPTIONS, "--resume")
    assert len(set(finished)) == len(finished), "an episode was recorded twice"
    assert contents(tmp_path) == files


def check_readable(record_fake, out, finished):
    house = out / "house_0"
    assert finished <= episodes_of([*house.glob("*.h5"), *house.glob(".recording/episode_????????/traj.h5")])
    for path in house.glob("*.h5"):  # files with a final name are complete, including their videos
        assert "\nintact" in "\n" + record_fake("verify", path).stdout


def test_repair_completes_a_killed_recording(record_fake, tmp_path):
    record_fake(tmp_path, *OPTIONS, "--stop-after", 2)
    house = tmp_path / "house_0"
    (house / ".recording/episode_00000099.part.1").mkdir()
    assert "published 2 finished episodes" in record_fake("repair", tmp_path).stdout
    assert not (house / ".recording").exists()
    assert "intact: 1 file, 2 episodes" in record_fake("verify", tmp_path).stdout
    done = record_fake(tmp_path, *OPTIONS, check=False)
    assert done.returncode == 2 and "already contains recorded trajectories" in done.stderr
