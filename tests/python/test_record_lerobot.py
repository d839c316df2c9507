# SPDX-License-Identifier: Apache-2.0
"""record --format lerobot: equal to a recording that is exported, also after SIGKILL at any moment."""

import os
import random
import signal
import subprocess
import sys
import time

import pytest

pytest.importorskip("av")
pytest.importorskip("pyarrow")

import mjsense as mjs
from mjsense.exporting import record_lerobot
from mjsense.exporting.mapping import Source
from mjsense.exporting.output import part_of
from mjsense.exporting.record_lerobot import CompleteError

ARGUMENTS = {"horizon": 12, "keep_failures": True, "width": 32, "height": 24, "num_worlds": 2, "seed": 5, "episodes": 6, "max_attempts": 6, "batches": 3}
WORDS = ["record", "pick", "--horizon", "12", "--keep-failures", "--size", "32x24", "--worlds", "2", "--seed", "5", "--episodes", "6",
         "--max-attempts", "6", "--batches", "3", "--format", "lerobot", "--resume", "-q"]  # fmt: skip
KILLS = int(os.environ.get("MJSENSE_TEST_KILLS", "3"))


def tree(root):
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    folder = tmp_path_factory.mktemp("exported")
    mjs.record("pick", out=folder / "recording", **ARGUMENTS)
    return tree(mjs.exporting.export_lerobot(folder / "recording", folder / "out"))


def test_it_equals_an_exported_recording(exported, tmp_path):
    summary = mjs.record("pick", out=tmp_path / "out", format="lerobot", keep_recording=True, **ARGUMENTS)
    assert summary.path == tmp_path / "out" and tree(tmp_path / "out") == exported
    assert mjs.check_replay(tmp_path / "out.recording", episodes=[0]).ok
    with pytest.raises(FileExistsError, match="exists; name another output"):
        mjs.record("pick", out=tmp_path / "out", format="lerobot", **ARGUMENTS)
    with pytest.raises(CompleteError):
        mjs.record("pick", out=tmp_path / "out", format="lerobot", resume=True, **ARGUMENTS)
    assert [path.name for path in tmp_path.iterdir()] == ["out"]  # without keep_recording
    with pytest.raises(ValueError, match=r"append .*cannot be combined with format='lerobot'"):
        mjs.record("pick", out=tmp_path / "more", format="lerobot", append=True, **ARGUMENTS)


def test_files_with_different_features_are_converted_together(exported, tmp_path, monkeypatch):
    def source(place, **options):
        return Source(place, **options | ({"map": {"state": "obs/extra/tcp_pose"}} if place.name == "trajectories_batch_1_of_3.h5" else {}))

    monkeypatch.setattr(record_lerobot, "Source", source)
    mjs.record("pick", out=tmp_path / "out", format="lerobot", **ARGUMENTS)
    assert tree(tmp_path / "out") == exported


@pytest.mark.parametrize("keep", (False, True))
def test_the_program_prints_the_files_that_are_there(keep, tmp_path):
    """The recording is deleted at the end, unless it is kept."""
    words = [word for word in WORDS if word not in ("-q", "--resume")]
    command = [sys.executable, "-m", "mjsense", *words, "--out", str(tmp_path / "out"), *(["--keep-recording"] if keep else [])]
    printed = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    assert "stats.json" in printed and f"{tmp_path}/out\n" in printed
    assert ("trajectories_batch_1_of_3.h5" in printed) == keep


def test_another_process_that_writes_it_is_not_disturbed(tmp_path):
    """Its unfinished output stays, when the same command is started again, or an export to the same place."""
    mjs.record("pick", out=tmp_path / "out.recording", **{**ARGUMENTS, "width": 16, "height": 16, "horizon": 3})
    with part_of(tmp_path / "out") as part:
        (part / "meta").mkdir()
        for write in (lambda: mjs.record("pick", out=tmp_path / "out", format="lerobot", resume=True, **ARGUMENTS),
                      lambda: mjs.exporting.export_lerobot(tmp_path / "out.recording", tmp_path / "out")):  # fmt: skip
            with pytest.raises(FileExistsError, match=r"another process writes .*/out$"):
                write()
        assert (part / "meta").exists()
        assert sorted(path.name for path in tmp_path.iterdir()) == ["out.part", "out.recording"]
    assert [path.name for path in tmp_path.iterdir()] == ["out.recording"]


def test_kill_at_any_moment(exported, tmp_path, capsys):
    """Each recording is killed once or twice at random times, and resumed."""
    rng, rows, kills, took = random.Random(1), [], 0, 0.0
    while kills < KILLS:
        out = tmp_path / f"out_{len(rows)}"
        command, row = [sys.executable, "-m", "mjsense", *WORDS, "--out", str(out)], []
        while True:
            begun = time.monotonic()
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
            if took and len(row) < 2 and kills < KILLS:
                try:
                    process.wait(rng.uniform(0.2, took))
                except subprocess.TimeoutExpired:
                    process.send_signal(signal.SIGKILL)
                    process.communicate()
                    states = [name for name in (".recording", ".part", "") if out.with_name(out.name + name).exists()]
                    row.append(f"{time.monotonic() - begun:.2f} s: {' '.join(f'OUT{name}' for name in states) or 'nothing'}")
                    kills += 1
                    continue
            error = process.communicate()[1]
            assert (process.returncode, error) == (0, "")  # -q
            took = took or time.monotonic() - begun
            break
        assert tree(out) == exported, row
        assert [path.name for path in tmp_path.glob(f"{out.name}*")] == [out.name]
        rows.append(row)
    with capsys.disabled():
        print("", *(f"{i}: {'; '.join(row)}" for i, row in enumerate(rows) if row), sep="\n")
