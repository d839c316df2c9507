# SPDX-License-Identifier: Apache-2.0
"""Exports leave out idle steps: by default in tasks that place an object, and otherwise on request."""

import hashlib
import json
import os
import subprocess
import sys

import h5py
import numpy as np
import pytest
from waiting import MOVES, WAITS, Waiting

import mjsense as mjs
from mjsense.cluster import export_on_ray
from mjsense.commands import run as run_command
from mjsense.exporting.formats import FORMATS, formats_with

av = pytest.importorskip("av")
parquet = pytest.importorskip("pyarrow.parquet")

ARGUMENTS = {"policy": Waiting, "horizon": 2 * MOVES + WAITS, "worlds": 1, "keep_failures": True, "action_noise": False, "shadows": False,
             "width": 64, "height": 48, "cameras": ["wrist_camera"], "replay": False}  # fmt: skip
TRIMMED = formats_with("trim_idle")
NOTE = "in which nothing moves, are left out; --no-trim-idle (trim_idle=False) keeps them"


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Recordings of waiting robots by their task."""
    root = tmp_path_factory.mktemp("recordings")
    return {
        task: mjs.record(task, out=root / task, depth=task == "packing", **ARGUMENTS).path
        for task in ("pick", "pick_and_place", "packing")
    }


def digest(data):
    return hashlib.sha256(data).hexdigest()


def files(path):
    """The contents by name: digests, so that a failure is short, and attributes."""
    if path.is_file():
        with h5py.File(path) as file:
            found = {}
            file.visititems(
                lambda name, item: found.update(
                    {name: digest(item[()].tobytes()) if isinstance(item, h5py.Dataset) else dict(item.attrs)}
                )
            )
        return found
    return {str(p.relative_to(path)): digest(p.read_bytes()) for p in path.rglob("*") if p.is_file()}


@pytest.mark.parametrize("format", TRIMMED)
def test_tasks_that_place_are_trimmed_unless_requested_otherwise(format, recordings, tmp_path, capsys, monkeypatch):
    for library in ("av", FORMATS[format].library):
        pytest.importorskip(library)
    if format == "zarr":  # with several threads, the order of compressed blocks depends on their timing
        monkeypatch.setattr("numcodecs.blosc.use_threads", False)
    for task, usual in (("pick", False), ("pick_and_place", True), ("packing", True)):
        made = {}
        for trim in (None, True, False):
            (tmp_path / f"{task}_{trim}").mkdir()
            out = tmp_path / f"{task}_{trim}" / "data"  # tensorflow-datasets' files contain this name
            made[trim] = files(getattr(mjs, f"export_{format}")(recordings[task], out, trim_idle=trim))
            assert (NOTE in capsys.readouterr().err) == (usual if trim is None else trim)
        assert made[None] == made[usual] != made[not usual]


def test_data_sets_say_how_many_steps_are_left_out(recordings, tmp_path):
    (episode,) = mjs.Dataset(recordings["pick_and_place"]).episodes
    short = episode.trimmed()
    assert episode.trimmed_steps == 0 < short.trimmed_steps == episode.length - short.length < WAITS
    path = mjs.exporting.export_lerobot(recordings["pick_and_place"], tmp_path / "lerobot")
    table = parquet.read_table(path / "meta/episodes/chunk-000/file-000.parquet")
    assert table["trimmed_steps"].to_pylist() == [short.trimmed_steps] and table["length"].to_pylist() == [short.length - 1]
    with h5py.File(mjs.exporting.export_robomimic(recordings["pick_and_place"], tmp_path / "robomimic.hdf5")) as file:
        assert json.loads(file["data/demo_0"].attrs["ep_meta"])["trimmed_steps"] == short.trimmed_steps
        assert file["data/demo_0"].attrs["num_samples"] == short.length - 1


def frames_of(path):
    with av.open(str(path)) as video:
        return [frame.to_ndarray() for frame in video.decode(video=0)]


@pytest.mark.parametrize("format", ["lerobot", "lerobot21"])
def test_only_videos_from_which_frames_are_left_out_are_encoded_again(format, recordings, tmp_path):
    folder = (
        "videos/observation.images.wrist_camera/chunk-000"
        if format == "lerobot"
        else "videos/chunk-000/observation.images.wrist_camera"
    )
    name = "file-000.mp4" if format == "lerobot" else "episode_000000.mp4"
    for task in ("pick", "pick_and_place"):
        out = getattr(mjs, f"export_{format}")(recordings[task], tmp_path / task)
        (episode,) = mjs.Dataset(recordings[task]).episodes
        recorded, written = frames_of(episode.video("wrist_camera").path), frames_of(out / folder / name)
        if task == "pick":
            assert len(written) == episode.length - 1 and all((a == b).all() for a, b in zip(written, recorded))
        else:
            kept = np.flatnonzero(np.isin(np.arange(episode.length), episode.trimmed()._kept))[:-1]
            assert len(written) == len(kept) < episode.length
            errors = np.abs(np.subtract(written, np.array(recorded)[kept], dtype=int)).mean((1, 2))
            assert 0 < errors.max() < 4


def test_videos_do_not_depend_on_what_memory_contained(tmp_path):
    recording = mjs.record("pick_and_place", out=tmp_path / "recording", **{**ARGUMENTS, "width": 224, "height": 224}).path
    videos = []
    for value in ("0", "1"):  # with which glibc fills memory before a program writes to it; elsewhere the variable has no effect
        code = f"import mjsense; mjsense.exporting.export_lerobot({str(recording)!r}, {str(tmp_path / value)!r})"
        subprocess.run([sys.executable, "-c", code], env={**os.environ, "MALLOC_PERTURB_": value}, check=True)
        videos.append(digest(next((tmp_path / value).rglob("*.mp4")).read_bytes()))
    assert videos[0] == videos[1]


def test_exact_depth_beside_a_trimmed_episode(recordings, tmp_path):
    out = mjs.exporting.export_lerobot(recordings["packing"], tmp_path / "out", map={"cameras": {"near": "wrist_camera_depth"}})
    (episode,) = mjs.Dataset(recordings["packing"], trim_idle=True).episodes
    (file,) = (out / "extras/depth/near").iterdir()
    wanted = episode.video("wrist_camera_depth")
    assert (np.array(frames_of(file)) * np.float32(wanted._info.metres_per_unit) == wanted[:]).all()
    with av.open(str(file)) as exact, av.open(str(wanted.path)) as recorded:
        assert exact.streams.video[0].codec_context.name == recorded.streams.video[0].codec_context.name == "ffv1"
        assert exact.streams.video[0].average_rate == recorded.streams.video[0].average_rate


def test_ray_trims_as_one_process_does(recordings, tmp_path):
    ray = pytest.importorskip("ray")
    ray.init("local", num_cpus=1, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
    try:
        with pytest.raises(ValueError, match=r"trim_idle is an option of the formats .* and zarr; mcap shows episodes with their times"):
            export_on_ray(recordings["pick_and_place"], tmp_path / "mcap", format="mcap", trim_idle=True)
        for trim in (None, False):
            ours = export_on_ray(
                recordings["pick_and_place"],
                tmp_path / f"ray_{trim}.hdf5",
                format="robomimic",
                **({} if trim is None else {"trim_idle": trim}),
            )
            theirs = mjs.exporting.export_robomimic(recordings["pick_and_place"], tmp_path / f"alone_{trim}.hdf5", trim_idle=trim)
            assert files(ours) == files(theirs)
    finally:
        ray.shutdown()


def test_recording_to_lerobot_trims_as_the_export_does(tmp_path, capsys):
    for trim in (None, False):
        out = tmp_path / f"direct_{trim}"
        mjs.record("pick_and_place", out=out, format="lerobot", trim_idle=trim, keep_recording=True, **ARGUMENTS)
        assert (NOTE in capsys.readouterr().err) == (trim is None)
        assert files(out) == files(mjs.exporting.export_lerobot(f"{out}.recording", tmp_path / f"exported_{trim}", trim_idle=trim))
        capsys.readouterr()
    with pytest.raises(ValueError, match="map, trim_idle and keep_recording are options of format='lerobot'"):
        mjs.record("pick", out=tmp_path / "no", trim_idle=True, **ARGUMENTS)


def test_program(recordings, tmp_path, capsys):
    def export(*words):
        code = run_command(
            [
                "export",
                words[0],
                str(recordings["pick_and_place"]),
                str(tmp_path / f"out{len(list(tmp_path.iterdir()))}"),
                *words[1:],
            ]
        )
        return code, capsys.readouterr().err

    code, printed = export("lerobot")
    assert code == 0 and NOTE in printed and printed.split(" of ")[0].isdigit()
    assert export("lerobot", "-q") == (0, "")
    code, printed = export("lerobot", "--no-trim-idle")
    assert code == 0 and NOTE not in printed and "15.1515 rows per second are written as 15" in printed
    code, printed = export("lerobot", "--no-trim-idle", "--exact-rate")
    assert code == 0 and "15.1515 rows per second are not a whole number" in printed
    assert export("zarr", "--exact-rate") == (2, "mjsense: --exact-rate is an option of the formats lerobot and lerobot21\n")
    code, printed = export("mcap", "--trim-idle")
    assert code == 2 and "mcap shows episodes with their times" in printed
