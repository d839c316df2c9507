# SPDX-License-Identifier: Apache-2.0
"""Recordings that someone has changed on purpose: each reader gives one line that says what is wrong, or the right values, and ``mjsense
verify`` refuses what a reader refuses. Nothing outside of the recording is read or written, and nothing is started."""

import contextlib
import json
import math
import os
import re
import resource
import shutil
import struct
import time
from fractions import Fraction

import h5py
import numpy as np
import pytest
from edited_recordings import changed, describe, file_of, rename_video

pytest.importorskip("av")

import mjsense as mjs
from mjsense.cluster import tools
from mjsense.dataset.description import Description
from mjsense.dataset.json_rows import decode
from mjsense.dataset.places import is_plain_name, open_plain
from mjsense.dataset.video_decoder import Packets
from mjsense.evaluation import results
from mjsense.exporting import export_lerobot, export_robomimic

CAMERA = "wrist_camera"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "data"
    mjs.record("pick", out=out, episodes=1, horizon=4, keep_failures=True, width=32, height=24, cameras=[CAMERA], depth=True, seed=5, progress=False)
    return out


@pytest.fixture
def root(made, tmp_path):
    return shutil.copytree(made, tmp_path / "data")


def read(root, out):
    dataset = mjs.Dataset(root)
    for i in range(len(dataset)):
        dataset[i]
    for episode in dataset.episodes:
        assert repr(episode) and episode.settings is not None
        for name, stream in episode.streams.items():
            if stream.kind != "video":
                episode[name]


READERS = {
    "read": read,
    "lerobot": lambda root, out: export_lerobot(root, out / "lerobot"),
    "robomimic": lambda root, out: export_robomimic(root, out / "data.hdf5"),
    "render": lambda root, out: mjs.render(root, out / "render", width=16, height=12, progress=False),
}


def errors_of(root):
    """Errors of ``mjsense verify``."""
    found = tools.verify(str(root))
    assert found is not None
    assert found["ok"] == (not any(f["error"] for f in found["findings"]))
    return [f"{f['place']} {f['text']}" for f in found["findings"] if f["error"]]


def refusals(root, out, readers):
    """The message of each reader that refuses a recording, within a second of CPU time and 1 GB of memory more than before."""
    refused = {}
    for name in readers:
        before, cpu = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, time.process_time()
        try:
            READERS[name](root, out)
        except (ValueError, LookupError, OSError, RuntimeError) as error:
            refused[name] = str(error.args[0])
            assert "\n" not in refused[name] and str(root) in refused[name]
            assert time.process_time() - cpu < 5
        assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 1_000_000
    return refused


def assert_refused(root, out, text, readers=("read", "robomimic")):
    """Every reader names what is wrong, and verify does."""
    found = refusals(root, out, readers)
    assert found.keys() == set(readers) and all(text in message for message in found.values()), found
    found = errors_of(root)
    assert any(text in error or "description of the recording" in error for error in found), found


def test_an_unchanged_recording_is_read_and_verified(root, tmp_path):
    assert refusals(root, tmp_path, READERS) == {}
    assert errors_of(root) == []


# ------------------------------------------------------------------------------------------------------------ the description


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda about: about.update(fps="1e999999999"), "fps is '1e999999999'; it must be a rate"),
        (lambda about: about.update(fps="1/0"), "fps is '1/0'; it must be a rate"),
        (lambda about: about.update(fps="-15"), "fps is '-15'; it must be a rate"),
        (lambda about: about.update(fps="nan"), "fps is 'nan'; it must be a rate"),
        (lambda about: about.update(fps="1" * 5000), "it must be a rate"),
        (lambda about: about.update(fps=[15]), "fps is [15]; it must be a rate"),
        (lambda about: about.update(versions={"mujoco": math.nan}), "contains the number nan; all numbers must be finite"),
        (lambda about: about.update(gzip=12), "gzip is 12; it must be a whole number from 0 to 9"),
        (lambda about: about.update(model_archive="../../model.zip"), "model_archive is '../../model.zip'; it must be a plain name"),
        (lambda about: about.update(model_archive="/etc/hostname"), "model_archive is '/etc/hostname'; it must be a plain name"),
        (lambda about: about.update(model_archive=7), "model_archive is 7; it must be a plain name"),
        (lambda about: about.update(settings=[1]), "settings is [1]; it must be an object"),
        (lambda about: about["video"].update(crf=500), "video.crf is 500; it must be a whole number from 0 to 51"),
        (lambda about: about["video"].update(preset="-y"), "video.preset is '-y'; it must be one of ultrafast"),
        (lambda about: about["video"].update(threads=True), "video.threads is True; it must be a whole number"),
        (lambda about: about["settings"].update(policy_dt_ms=1e15), "policy_dt_ms is 1000000000000000.0; it must be a number above 0"),
        (lambda about: about["settings"].update(policy_dt_ms="x"), "policy_dt_ms is 'x'; it must be a number above 0"),
        (lambda about: about["settings"].update(samples=-1), "samples is -1; it must be a whole number"),
        (lambda about: about["settings"].update(render={"brightness": "x"}), "render.brightness is 'x'; it must be a number above 0"),
        (lambda about: about["settings"]["cameras"][0].update(name="../../../escaped"), "cameras[0].name is '../../../escaped'; it must be a plain name"),
        (lambda about: about["settings"]["cameras"][0].update(width=10**9), "cameras[0].width is 1000000000; it must be a whole number from 1 to 16384"),
        (lambda about: about["settings"]["cameras"].append("x"), "cameras[1] is 'x'; it must be an object"),
    ],
)  # fmt: skip
def test_values_of_the_description(root, tmp_path, change, text):
    describe(root, change)
    assert_refused(root, tmp_path, text, ("read",))


@pytest.mark.parametrize(("text", "says"), [("{oops", "is not JSON text"), ("[]", "is a list, not an object"), ("[" * 30000 + "]" * 30000, "is nested deeper")])
def test_text_of_the_description(root, tmp_path, text, says):
    with changed(file_of(root)) as file:
        file.attrs["recording"] = text
    assert_refused(root, tmp_path, f"the attribute 'recording' {says}", ("read",))


def test_a_program_that_the_description_names_is_not_started(root, tmp_path):
    """Options of the recorder that are not about the images are not taken from a file."""
    program, mark = tmp_path / "encode", tmp_path / "was_started"
    program.write_text(f'#!/bin/sh\ntouch {mark}\nexec ffmpeg "$@"\n')
    program.chmod(0o755)
    describe(root, lambda about: about["video"].update(ffmpeg=str(program), archive=["../x.zip", "y"], max_encoders=0, queue_frames=-1))
    mjs.render(root, tmp_path / "out", width=16, height=12, progress=False)
    assert mjs.check_replay(root, states=True, progress=False)
    assert not mark.exists()
    assert "ffmpeg" not in file_of(tmp_path / "out").read_bytes().decode(errors="replace")
    assert any("video.ffmpeg, which is never recorded" in error for error in errors_of(root))


def test_another_recording_is_not_replaced(root, made, tmp_path):
    describe(root, lambda about: about["video"].update(overwrite=True))
    precious = shutil.copytree(made, tmp_path / "out")
    before = {path: path.read_bytes() for path in sorted(precious.rglob("*")) if path.is_file()}
    with pytest.raises((ValueError, RuntimeError), match=r"resume|overwrite"):
        mjs.render(root, precious, width=16, height=12, progress=False)
    assert {path: path.read_bytes() for path in sorted(precious.rglob("*")) if path.is_file()} == before


def test_a_robot_of_a_file_is_not_read(root, tmp_path):
    """The streams are compared on the archived model instead."""
    describe(root, lambda about: about["settings"].update(robot=str(tmp_path / "robot.toml")))
    report = mjs.check_replay(root, actions=False, states=True, progress=False)
    assert report.ok and "of a file that the recording names is not read: robot" in repr(report)
    with pytest.raises(ValueError, match="a file, which is not taken from a recording"):
        mjs.render(root, tmp_path / "out", camera_system="droid", progress=False)


def test_settings_of_other_programs():
    """A recorder's own settings may have any name and value. Those that are not of our type are not used."""
    settings = {"samples": "many", "cameras": ["front"], "code": "1a2b3c", "render": True, "shadows": 3}
    found = Description.parse(json.dumps({"fps": "30", "settings": settings}), "x.h5")
    assert (found.fps, found.settings, found.all_settings) == (Fraction(30), {"cameras": []}, settings)


# ---------------------------------------------------------------------------------------------------------- names and files


@pytest.mark.parametrize("name", ["/etc/passwd", "../secret.mp4", "..", "a/b.mp4", "/dev/zero", "a\nb.mp4"])
def test_a_video_name_is_no_path(root, tmp_path, name):
    rename_video(root, CAMERA, name)
    assert_refused(root, tmp_path, "plain file name", ("read", "lerobot"))


@pytest.mark.parametrize("kind", ["link", "fifo", "folder"])
def test_a_video_is_a_regular_file(root, tmp_path, kind):
    place = root / "house_0/other.mp4"
    if kind == "link":
        shutil.copy(next(root.glob("house_0/*.mp4")), tmp_path / "secret.mp4")
        place.symlink_to(tmp_path / "secret.mp4")
    elif kind == "fifo":
        os.mkfifo(place)
    else:
        place.mkdir()
    rename_video(root, CAMERA, "other.mp4")
    expected = {"link": "is a symbolic link, which is not followed", "fifo": "is a pipe", "folder": "is a"}[kind]
    assert_refused(root, tmp_path, expected, ("read", "lerobot"))


@pytest.mark.parametrize("content", ["#EXTM3U\n#EXT-X-TARGETDURATION:1\n#EXTINF:1,\n{}\n#EXT-X-ENDLIST\n", "ffconcat version 1.0\nfile {}\n"])
@pytest.mark.parametrize("without_av", [False, True])
def test_a_playlist_is_no_video(root, tmp_path, monkeypatch, content, without_av):
    """The content of a file does not choose how it is read: a playlist would open other files."""
    monkeypatch.setattr("mjsense.dataset.video.have_av", lambda: not without_av)
    secret = shutil.copy(next(root.glob("house_0/*.mp4")), tmp_path / "secret.mp4")
    (root / "house_0/list.mp4").write_text(content.format(secret))
    rename_video(root, CAMERA, "list.mp4")
    with changed(file_of(root)) as file:
        del file[f"traj_0/obs/sensor_data/{CAMERA}"].attrs["crc32"]
    with pytest.raises(RuntimeError, match=r"list\.mp4: (not a video that can be read|ffmpeg cannot decode it)"):
        mjs.Dataset(root)[0]
    assert errors_of(root)


@pytest.mark.parametrize("without_av", [False, True])
@pytest.mark.parametrize("name", ["a:b", "file:x", "http:"])
def test_a_folder_with_a_colon(made, tmp_path, monkeypatch, name, without_av):
    """The relative path of a recording is never read as an address."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("mjsense.dataset.video.have_av", lambda: not without_av)
    shutil.copytree(made, name)
    (tmp_path / "x").mkdir()
    np.testing.assert_array_equal(mjs.Dataset(name).episodes[0].video(CAMERA)[:], mjs.Dataset(made).episodes[0].video(CAMERA)[:])
    export_lerobot(name, tmp_path / "lerobot")
    assert errors_of(name) == []


def test_a_file_and_a_folder_that_are_links(root, tmp_path):
    moved = tmp_path / "moved.h5"
    file_of(root).rename(moved)
    (root / "house_0/trajectories_batch_1_of_1.h5").symlink_to(moved)
    assert_refused(root, tmp_path, "is a symbolic link, which is not followed", ("read",))
    other = tmp_path / "other"
    other.mkdir()
    (other / "house_0").symlink_to(root / "house_0")
    with pytest.raises(OSError, match="house_0: is a symbolic link, which is not followed"):
        mjs.Dataset(other)


@pytest.mark.parametrize("wrong", ["", ".", "..", "a/b", "/a", "a\0b", "a\x1b[31m", "x" * 300, "é" * 200, "\udc80"])
def test_plain_names(wrong):
    assert not is_plain_name(wrong) and is_plain_name("episode_00000000_wrist_camera.mp4") and is_plain_name("a:b ü.mp4")


def test_a_device_is_not_read(tmp_path):
    with pytest.raises(OSError, match="/dev/zero: is a device, not a file"):
        open_plain(__import__("pathlib").Path("/dev/zero"))


# --------------------------------------------------------------------------------------------------------------------- HDF5


def dataset_of(make):
    """Adds a stream ``obs/extra/evil`` that a function makes: ``make(group, rows)``."""

    def change(file):
        make(file["traj_0/obs/extra"], len(file["traj_0/rewards"]))

    return change


def virtual(group, rows):
    layout = h5py.VirtualLayout((rows, 1), "f8")
    layout[:] = h5py.VirtualSource("/tmp/other.h5", "x", (50, 1), "f8")[:rows]
    group.create_virtual_dataset("evil", layout)


def short_chunk(group, rows):
    """A chunk of 8 bytes, which the HDF5 library would read beyond its end."""
    group.create_dataset("evil", shape=(rows, 1000), dtype="f8", chunks=(rows, 1000), compression="gzip").id.write_direct_chunk((0, 0), b"x\x9ccddd\xe4\x02\x00\x00\x1e\x00\x0a")


def short_plain_chunk(group, rows):
    """The same without a filter: h5py gives what was in the memory after its only byte."""
    group.create_dataset("evil", shape=(rows, 1000), dtype="f8", chunks=(rows, 1000)).id.write_direct_chunk((0, 0), b"x")


def long_plain_chunk(group, rows):
    """More bytes than the chunk has: HDF5 would write them all into the memory that h5py allocates for a whole chunk."""
    group.create_dataset("evil", shape=(rows, 1), dtype="f8", chunks=(rows, 1)).id.write_direct_chunk((0, 0), b"x" * 4_000_000)


def json_rows(row):
    def make(group, rows):
        made = group.create_dataset("evil", data=np.tile(np.frombuffer(row, np.uint8), (rows, 1)), compression="gzip")
        made.attrs["encoding"] = "json"

    return dataset_of(make)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (dataset_of(virtual), "virtual dataset, which is not read"),
        (dataset_of(lambda g, n: g.create_dataset("evil", shape=(n, 4), dtype="u1", external=[("/etc/passwd", 0, 4 * n)])), "files, which are not read"),
        (dataset_of(lambda g, n: g.create_dataset("evil", shape=(n, 10**9), chunks=(1, 10**7), dtype="f8", compression="gzip")), "has rows of 8000000000 bytes"),
        (dataset_of(lambda g, n: g.create_dataset("evil", shape=(n, 10**6, 8), chunks=(n, 10**6, 8), dtype="f8", compression="gzip")), "has chunks of 320000000 bytes"),
        (dataset_of(lambda g, n: g.create_dataset("evil", shape=(n, 4 * 10**6), chunks=(1, 10**6), dtype="f8", compression="gzip")), "declares 160000000 bytes but stores 0"),
        (dataset_of(short_chunk), "is damaged: one of its chunks does not"),
        (dataset_of(short_plain_chunk), "is damaged: one of its chunks has 1 byte, expected 40000"),
        (dataset_of(long_plain_chunk), "is damaged: one of its chunks has 4000000 bytes, expected 40"),
        (dataset_of(lambda g, n: g.create_dataset("evil", data=np.zeros((n + 1, 3)))), f"has {6} rows"),
        (json_rows(b'{"a":' * 20000 + b"1" + b"}" * 20000), "evil row 0 is"),
        (json_rows(b'{"../../escaped": [1.0]}'), "has the key '../../escaped', which is not a plain name"),
        (json_rows(b'{"": 1}'), "has the key '', which is not a plain name"),
        (json_rows(json.dumps({f"k{i}": i for i in range(5000)}).encode()), "has more than 4096 keys"),
        (json_rows(b"[1]"), "evil row 0"),
        (lambda file: file.move("traj_0", "traj_x"), "traj_x"),
        (lambda file: file.move("traj_0", "traj_" + "9" * 200), "traj_999"),
        (lambda file: file["traj_0/obs/sensor_data/wrist_camera"].attrs.__setitem__("width", 10**9), "width is 1000000000"),
        (lambda file: file["traj_0/obs/sensor_data/wrist_camera"].attrs.__setitem__("width", 16384), "pixels"),
        (lambda file: file["traj_0/obs/sensor_data/wrist_camera"].attrs.__setitem__("fps", "1e999999999"), "fps is '1e999999999'"),
        (lambda file: file["traj_0/obs/sensor_data/wrist_camera"].attrs.__setitem__("encoding", "hls"), "its encoding is 'hls'"),
        (lambda file: file["traj_0"].attrs.__setitem__("episode", -3), "the attribute 'episode' is np.int64(-3)"),
        (lambda file: file["traj_0"].attrs.__setitem__("outcome", "x" * 60000 * 2), "the attribute 'outcome' has 120000 bytes"),
        (lambda file: file["traj_0"].attrs.__setitem__("outcome", np.zeros(3)), "the attribute 'outcome' is"),
    ],
)  # fmt: skip
def test_hdf5(root, tmp_path, change, text):
    with changed(file_of(root)) as file:
        change(file)
    found = refusals(root, tmp_path, ("read", "robomimic"))
    assert found and text in found["read"], found
    assert errors_of(root)


@contextlib.contextmanager
def with_second_episode(root):
    """The file of a recording to which a copy of its episode is added."""
    with changed(file_of(root)) as file:
        file.copy("traj_0", "traj_1")
        file["traj_1"].attrs["episode"] = 1
        for name in file["traj_1/obs/sensor_data"].values():
            video = file_of(root).with_name(name[:].tobytes().rstrip(b"\0").decode())
            shutil.copy(video, video.with_name(f"copied_{video.name}"))
            name[:] = np.frombuffer(f"copied_{video.name}".encode().ljust(len(name), b"\0"), np.uint8)
        yield file


def test_every_episode_is_checked(root):
    """Also the one whose streams are, by their names, those of the episode before."""
    with with_second_episode(root) as file:
        file["traj_1/obs/extra/tcp_pose"].attrs["unit"] = np.arange(3)
    with pytest.raises(ValueError, match=r"traj_1/obs/extra/tcp_pose: the attribute 'unit' is .* not a text"):
        _ = mjs.Dataset(root).episodes[1].streams
    assert any("traj_1/obs/extra/tcp_pose 'unit' has 3 values, expected 1" in text for text in errors_of(root)), errors_of(root)


def with_shape(place, shape, dtype):
    def change(file):
        del file[place]
        file[place] = np.zeros((len(file["traj_0/rewards"]), *shape), dtype)

    return change


@pytest.mark.parametrize(
    ("change", "text", "who"),
    [
        (with_shape("traj_1/obs/extra/tcp_pose", (5,), "f4"), r"tcp_pose is float32 \[[57]\]; in another episode of the recording it is float32 \[[57]\]", ("read",)),
        (with_shape("traj_1/obs/extra/tcp_pose", (7,), "f8"), r"tcp_pose is float(32|64) \[7\]; in another episode", ("read",)),
        (with_shape("traj_1/numbers/obs/agent/qpos/arm", (6,), "f8"), r"qpos/arm is float(32|64) \[[67]\]; in another episode", ("read", "lerobot", "robomimic")),
        (with_shape("traj_1/numbers/actions/joint_pos/arm", (), "f8"), r"joint_pos/arm is float64 \[7?\]; in another episode", ("read", "lerobot", "robomimic")),
        (with_shape("traj_1/rewards", (2,), "f4"), r"traj_1/rewards is float32 \[\d, 2\]; it must be one number for each observation", ("read", "lerobot", "robomimic", "render")),
        (with_shape("traj_0/terminated", (), "f4"), r"traj_0/terminated is float32 \[\d\]; it must be one bool for each observation", ("read", "lerobot", "robomimic", "render")),
        (with_shape("traj_1/obs/sensor_param/wrist_camera/intrinsic_cv", (2, 3), "f8"), r"intrinsic_cv is float64 \[\d, 2, 3\]; it must be a matrix of 3 x 3 numbers", ("read",)),
        (lambda file: file["traj_1/obs/sensor_data/wrist_camera"].attrs.__setitem__("width", 64), r"is rgb (32|64) x 24; in another episode of the recording it is rgb (32|64) x 24", ("read", "lerobot", "render")),
        (lambda file: file["traj_1/obs/sensor_data/wrist_camera"].attrs.__setitem__("fps", "15"), "fps is 15; that of its recording is 500/33", ("read", "lerobot", "render")),
        (lambda file: file.__delitem__("traj_1/numbers/actions/joint_pos/arm"), "has no 'numbers/actions/joint_pos/arm', which another episode of the recording has", ()),
    ],
    ids=range(10),
)  # fmt: skip
def test_episodes_of_a_recording_have_the_same_streams(root, tmp_path, change, text, who):
    with with_second_episode(root) as file:
        change(file)
    found = refusals(root, tmp_path, who)
    assert found.keys() == set(who) and all(re.search(text, one) for one in found.values()), found
    # The C++ check, which comes first, compares the size of a video.
    assert any(re.search(f"{text}|is 32 x 24 pixels, expected 64 x 24", one) for one in errors_of(root)), errors_of(root)


@pytest.mark.parametrize("kind", ["external", "soft", "hard loop", "reference", "opaque"])
def test_what_is_no_stream_is_left_out(root, tmp_path, kind):
    """Readers see only datasets of numbers that hard links reach; verify names the others."""
    before = set(mjs.Dataset(root).streams)
    with h5py.File(tmp_path / "secret.h5", "w") as secret:
        secret["x"] = np.arange(5.0)
    with changed(file_of(root)) as file:
        group, rows = file["traj_0/obs/extra"], len(file["traj_0/rewards"])
        if kind in ("external", "soft"):
            group["evil"] = h5py.ExternalLink(str(tmp_path / "secret.h5"), "x") if kind == "external" else h5py.SoftLink("/traj_0/obs/extra/evil")
        elif kind == "hard loop":
            group["evil"] = file["traj_0/obs"]
        elif kind == "reference":
            group.create_dataset("evil", (rows,), dtype=h5py.ref_dtype)
        else:
            group.create_dataset("evil", data=np.zeros(rows, "V7"))
    assert refusals(root, tmp_path, ("read", "robomimic", "lerobot")) == {}
    assert set(mjs.Dataset(root).streams) == before and errors_of(root)
    with pytest.raises((ValueError, KeyError), match="obs/extra/evil"):
        mjs.Dataset(root).episodes[0]["obs/extra/evil"]


def test_more_data_than_a_file_can_hold_is_not_unpacked(root, tmp_path):
    """A dataset of 1.2 GB zeros in 1 MB, in chunks of the allowed size."""
    with changed(file_of(root)) as file:
        rows = len(file["traj_0/rewards"])
        made = file["traj_0/obs/extra"].create_dataset("evil", shape=(rows, 8 * 10**6), chunks=(1, 10**6), dtype="f8", compression="gzip", fillvalue=0)
        for t in range(rows):
            made[t] = np.zeros(8 * 10**6)
        made[0, 0] = 1
        file["traj_0"].move("rewards", "old")
        del file["traj_0/old"]
        file["traj_0"].create_dataset("rewards", data=np.zeros(rows, np.float32))
    found = refusals(root, tmp_path, ("read",))
    if rows * 64 * 10**6 > (1 << 29) + 200 * file_of(root).stat().st_size:
        assert "more than the" in found["read"] and errors_of(root)


def test_streams_that_the_description_lists(root):
    """A stream that is gone is named."""
    for place in ("obs/sensor_data/wrist_camera", "obs/extra/tcp_pose", "actions/joint_pos", "obs/agent/qpos", "replay", "env_states/articulations"):
        copy = shutil.copytree(root, root.with_name("copy"))
        with changed(file_of(copy)) as file:
            del file[f"traj_0/{place}"]
        assert any(place.split("/")[0] in error and "was recorded" in error for error in errors_of(copy)), (place, errors_of(copy))
        shutil.rmtree(copy)


@pytest.mark.parametrize(("kind", "more"), [("camera", {}), ("body", {"pos": [0, 0, 1], "quat": [1, 0, 0, 0]})])
def test_a_frame_of_a_camera_that_the_model_lacks(root, tmp_path, kind, more):
    describe(root, lambda about: about["settings"]["cameras"][0].update({kind: "robot_0/gone", **more}))
    assert_refused(root, tmp_path, f"camera 'wrist_camera': no {kind} named 'robot_0/gone'", ("render",))


def test_a_rendering_names_a_scene_with_numbers_that_json_lacks(root, tmp_path):
    with changed(file_of(root)) as file:
        scene = bytes(file["traj_0/obs_scene"][()]).decode().rstrip("\0")
        del file["traj_0/obs_scene"]
        file["traj_0"].create_dataset("obs_scene", data='{"text": NaN, ' + scene[1:])
    with pytest.raises(ValueError, match=r"\.h5 traj_0/obs_scene is not JSON text: it has the word NaN$"):
        mjs.render(root, tmp_path / "rendered", cameras=["wrist_camera"])
    assert any("traj_0/obs_scene" in error and "NaN or an infinite number" in error for error in errors_of(root))


def test_a_text_of_numbers_is_named(root, tmp_path):
    with changed(file_of(root)) as file:
        del file["traj_0/obs_scene"]
        file["traj_0"].create_dataset("obs_scene", data=np.array(-1))
    with pytest.raises(ValueError, match=r"\.h5 traj_0/obs_scene is of the type int64; it must be a text$"):
        mjs.Dataset(root).episodes[0].obs_scene


def test_errors_of_the_hdf5_library_name_the_file_and_the_place(root, tmp_path):
    """An empty dataset, a text that is not JSON, and a file whose inside is noise."""

    def no_value(file, place):
        del file[place]
        file[place] = h5py.Empty("S1")

    def no_json(file, place):
        del file[place]
        file[place] = np.frombuffer(b"noise", np.uint8)

    for name, edit, place, readers, message in (
        ("empty text", no_value, "traj_0/obs_scene", READERS, r"\.h5 traj_0/obs_scene is empty: it has neither a value nor rows$"),
        ("empty rows", no_value, "traj_0/rewards", READERS, r"\.h5 traj_0/rewards is empty: it has neither a value nor rows$"),
        ("no JSON", no_json, "traj_0/obs_scene", ["render"], r"\.h5 traj_0/obs_scene is not JSON text: Expecting value: line 1 column 1"),
    ):
        data = shutil.copytree(root, tmp_path / name)
        with h5py.File(file_of(data), "a") as file:
            edit(file, place)
        refused = refusals(data, tmp_path / f"out of {name}", readers)
        assert refused.keys() == set(readers) and all(re.search(message, text) for text in refused.values()), (name, refused)
        assert errors_of(data), name
    path = file_of(root)
    path.write_bytes(path.read_bytes()[:2048] + np.random.default_rng(0).bytes(path.stat().st_size - 2048))
    refused = refusals(root, tmp_path, READERS)
    assert refused.keys() == READERS.keys() and all(path.name in text for text in refused.values()), refused


def test_a_unit_of_the_model_that_is_no_text_is_reported(root):
    with changed(file_of(root)) as file:
        file["traj_0/replay/model/geom_dataid"].attrs["unit"] = [-1.0]
    assert any("replay/model/geom_dataid" in error and "'unit' is not a text" in error for error in errors_of(root)), errors_of(root)


def test_an_attribute_of_many_numbers_is_named_in_one_line(root):
    with changed(file_of(root)) as file:
        file["traj_0/success"].attrs["unit"] = np.full((20, 20), math.nan)
    with pytest.raises(ValueError, match=r"traj_0/success: the attribute 'unit' is [^\n]*, not a text$"):
        mjs.Dataset(root).episodes[0].streams


def test_a_description_leaves_room_for_that_of_a_rendering(root):
    deep = "x"
    for _ in range(62):
        deep = [deep]
    describe(root, lambda about: about.update(unknown=deep))
    assert any("nested deeper than 60 levels" in error for error in errors_of(root))


def boxes(content, path, change):
    """The boxes of an MP4 file, of which the contents of one are changed."""
    made, at = b"", 0
    while at < len(content):
        size, name = struct.unpack_from(">I4s", content, at)
        inner = content[at + 8 : at + size]
        if path and name == path[0]:
            inner = boxes(inner, path[1:], change) if path[1:] else change(inner)
        made += struct.pack(">I4s", 8 + len(inner), name) + inner
        at += size
    return made


TABLES = [b"moov", b"trak", b"mdia", b"minf", b"stbl"]


def test_packets_that_overlap(root):
    """A file of a megabyte that states ten thousand packets of a megabyte takes hours to read."""
    path = min(root.glob("house_0/*.mp4"))
    content = path.read_bytes()
    assert content.rindex(b"moov") > content.rindex(b"mdat")  # so that the tables can grow
    Packets(path, Fraction(15), 5, (32, 24), "")
    count, begin = 5, content.index(b"mdat") + 4
    overlapping = boxes(content, [*TABLES, b"stsz"], lambda _: struct.pack(">III", 0, len(content) - begin - 1000, count))
    overlapping = boxes(overlapping, [*TABLES, b"stsc"], lambda _: struct.pack(">IIIII", 0, 1, 1, 1, 1))
    overlapping = boxes(overlapping, [*TABLES, b"stco"], lambda _: struct.pack(f">II{count}I", 0, count, *[begin] * count))
    path.write_bytes(overlapping)
    with pytest.raises(RuntimeError, match=r"\.mp4: has packets of \d+ bytes in \d+; its episode has 5 observations"):
        Packets(path, Fraction(15), 5, (32, 24), "")


def test_times_that_are_not_those_of_an_episode(root):
    """PyAV takes numbers of frames of at most 63 bits."""
    path = min(root.glob("house_0/*.mp4"))
    slow = boxes(path.read_bytes().replace(b"edts", b"free"), [*TABLES, b"stts"], lambda _: struct.pack(">IIII", 0, 1, 5, 10**9))
    path.write_bytes(boxes(slow, [*TABLES[:3], b"mdhd"], lambda inner: inner[:12] + struct.pack(">I", 1) + inner[16:]))
    with pytest.raises(RuntimeError, match=r"\.mp4: has the time of frame -?\d+; its episode has 5 observations"):
        Packets(path, Fraction(10**6), 5, (32, 24), "")


@pytest.mark.parametrize("values, dtype", [(["1", "2"], object), ([None, "1"], object), ([["1"], ["2"]], object), ([1, "2"], object), ([1, None], float), ([True, 2], float), ([[1, 2], [3, 4]], float)])
def test_texts_of_digits_stay_texts(values, dtype):
    lines = [json.dumps({"a": value}).encode() for value in values]
    rows = np.array([list(line.ljust(max(map(len, lines)), b"\0")) for line in lines], np.uint8)
    ((found, _),) = decode(rows).values()
    assert found.dtype == dtype and (dtype is float or found.tolist() == values)


def test_results_of_any_numbers(root):
    """The largest seed, and a policy's count that is none."""

    def change(file):
        file["traj_0"].attrs["seed"] = np.uint64(2**64 - 1)
        for name, values in (("policy_num_retries", np.full(5, np.nan)), ("policy_latency", np.full(5, 1e300))):
            file["traj_0/obs/extra"].pop(name, None)
            file[f"traj_0/obs/extra/{name}"] = values

    with changed(file_of(root)) as file:
        change(file)
    found = results(root)
    assert [(row.seed, row.retries) for row in found.rows] == [(2**64 - 1, -1)]
    assert found.to_table()["seed"].to_pylist() == [2**64 - 1]
    (root / "evaluation.json").symlink_to(root / "elsewhere.json")
    with pytest.raises(OSError, match=r"evaluation.json: is a symbolic link, which is not followed"):
        results(root)
