# SPDX-License-Identifier: Apache-2.0
"""Recordings with an index: every reader takes the folder, the index, and an address of fsspec."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("h5py")
fsspec = pytest.importorskip("fsspec")
pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")

from program_runs import run_program

import mjsense as mjs
from mjsense import commands
from mjsense.cluster import Job, tools
from mjsense.cluster.driver import _Results
from mjsense.cluster.index import write_index
from mjsense.cluster.job import Shard, run_shard
from mjsense.cluster.storage import Storage
from mjsense.dataset.files import entries_of
from mjsense.dataset.remote import resolved

ARGUMENTS = {"task": "pick", "horizon": 4, "keep_failures": True, "width": 32, "height": 24, "num_worlds": 2, "seed": 5}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Three shards of two attempts, and an index of the first five episodes."""
    out = tmp_path_factory.mktemp("index") / "data"
    job = Job(str(out), ARGUMENTS)
    Storage(job.out).write("job.json", b"{}")
    results = [run_shard(job, Shard(n, 2 * n, 2), job.fingerprint()) for n in range(3)]
    write_index(Storage(job.out), results, 5)
    return out


@pytest.fixture
def recording(made, tmp_path, monkeypatch):
    monkeypatch.setenv("MJSENSE_CACHE", str(tmp_path / "cache"))
    return Path(shutil.copytree(made, tmp_path / "data"))


@pytest.fixture
def memory(recording):
    """The same recording at an address."""
    system = fsspec.filesystem("memory")
    system.put(str(recording), "/bucket/pick", recursive=True)
    yield "memory://bucket/pick"
    system.rm("/bucket", recursive=True)


def test_every_reader_takes_the_folder_the_index_and_an_address(recording, memory, tmp_path):
    states = mjs.Dataset(recording).episodes[4].states
    for n, root in enumerate((recording, recording / "index.parquet", f"file://{recording}", memory, f"{memory}/index.parquet")):
        dataset = mjs.Dataset(root)
        assert [episode.number for episode in dataset.episodes] == [0, 1, 2, 3, 4] and len(dataset) == 25
        np.testing.assert_array_equal(dataset.episodes[4].states, states)
        assert dataset.episodes[4].video("wrist_camera")[4].shape == (24, 32, 3)
        assert mjs.check_replay(root, episodes=[0, 4]).ok
        mjs.exporting.export_lerobot(root, tmp_path / f"lerobot_{n}")
        assert tools.verify(str(root))["ok"]
    (first, *others) = [sorted((p.relative_to(f), p.read_bytes()) for p in f.rglob("*") if p.is_file()) for f in tmp_path.glob("lerobot_*")]
    assert len(others) == 4 and all(other == first for other in others)


def test_only_the_shards_that_are_read_are_copied(memory, tmp_path):
    entries, _ = entries_of(*resolved(memory))
    assert [p.name for p in (tmp_path / "cache").glob("*/*/shard_*")] == ["shard_0"]  # the description of the recording
    assert entries[4].path.exists()
    assert sorted(p.name for p in (tmp_path / "cache").glob("*/*/shard_*")) == ["shard_0", "shard_2"]


def test_shards_are_rendered_as_one_recording(recording, tmp_path):
    mjs.render(recording, tmp_path / "large", width=64, height=48)
    again = mjs.Dataset(tmp_path / "large")
    assert [episode.number for episode in again.episodes] == [0, 1, 2, 3, 4] and again.episodes[0].video("wrist_camera").shape[1:] == (48, 64, 3)
    np.testing.assert_array_equal(again.episodes[4].states, mjs.Dataset(recording).episodes[4].states)


def test_verify_and_repair_compare_the_index_with_the_shards(recording):
    found = tools.verify(str(recording))
    assert found["ok"] and found["indexed"] == 5 and tools.repair(str(recording)) == {"actions": [], "failures": []}
    video = next((recording / "shard_1/house_0").glob("*.mp4"))
    video.write_bytes(video.read_bytes()[:-7])
    assert not tools.verify(str(recording))["ok"]
    actions = tools.repair(str(recording))["actions"]
    assert "shard_1" in actions[0] and "record --resume" in actions[0] and "2 episodes of 1 complete shards" in actions[1]
    assert tools.verify(str(recording))["ok"]  # the damaged shard is no longer named
    assert sorted(_Results.read(Storage(str(recording)), Job(str(recording), ARGUMENTS).fingerprint()).done) == [0, 2]


def test_verify_reports_wrong_rows_and_missing_files(recording):
    table = pq.read_table(recording / "index.parquet").to_pylist()
    table[1]["length"], table[2]["trajectory"] = 7, "traj_9"
    pq.write_table(pa.Table.from_pylist(table), recording / "index.parquet")
    shutil.rmtree(recording / "shard_2")
    texts = [f"{f['place']}: {f['text']}" for f in tools.verify(str(recording))["findings"]]
    assert any("row 1: length is 7, but 5" in text for text in texts) and any("has no traj_9" in text for text in texts), texts
    assert any("row 4: shard_2" in text and "cannot be read" in text for text in texts), texts


def test_a_recording_without_an_index_or_without_a_shard(recording, tmp_path, capsys):
    """It is unfinished, or a shard was lost."""
    shutil.rmtree(recording / "shard_1")
    with pytest.raises(FileNotFoundError, match=r"shard_1/house_0/trajectories_batch_1_of_1.h5: no such file or directory"):
        mjs.exporting.export_lerobot(recording, tmp_path / "out")
    (recording / "index.parquet").unlink()
    (recording / "shard_0/done.json").touch()
    (recording / "shard_2/done.json").unlink(missing_ok=True)
    capsys.readouterr()
    mjs.exporting.export_lerobot(recording, tmp_path / "out")
    assert f"{recording} is unfinished; the export has the episodes that are published" in capsys.readouterr().err.splitlines()
    done = subprocess.run([sys.executable, "-m", "mjsense", "inspect", recording], capture_output=True, text=True, check=True)
    assert done.stdout.startswith("no index.parquet: the recording is not complete")


def test_options_of_the_program(recording, capfd):
    assert commands.run(["verify", str(recording), "-q"]) == 0 and not capfd.readouterr().out
    for command in ("verify", "repair"):
        assert commands.run([command, str(recording), "--decod"]) == 2
        assert f"{command}: no option named '--decod'" in capfd.readouterr().err
    shutil.rmtree(recording / "shard_2")
    assert commands.run(["verify", str(recording), "-q"]) == 1 and "shard_2" in capfd.readouterr().out


@pytest.mark.parametrize("command, code, text", (("verify", 0, "5 episodes in index.parquet"), ("inspect", 0, "5 episodes, 0 successes"), ("repair", 0, "nothing to repair")))
def test_program(recording, command, code, text):
    done = run_program(command, f"file://{recording}")
    assert done.returncode == code and text in done.stdout, done.stdout + done.stderr
    assert commands.run(["replay", f"file://{recording}", "--episodes", "0", "-q"]) == 0
