# SPDX-License-Identifier: Apache-2.0
"""Files of other programs: layouts that differ from robosuite's and LeRobot's defaults, and files that anyone may have made."""

import json
import os
import struct
import zipfile
import zlib
from fractions import Fraction

import h5py
import numpy as np
import pytest
from program_runs import run_program

import mjsense as mjs
from mjsense.core.png import png_of

MODEL = """<mujoco><asset>{}</asset><worldbody><geom type="plane" size="1 1 .1"/><body><joint type="hinge"/><geom size=".1"/></body></worldbody></mujoco>"""


def picture(t, h=32, w=48):
    """The right way up: the top quarter is red, below it is grey level 10 t."""
    image = np.full((h, w, 3), 10 * t, np.uint8)
    image[: h // 4] = (255, 0, 0)
    return image


# ---------------------------------------------------------------------------------------------- robomimic


def robomimic(path, asset="", length=5, change=None, env_args=None, model=True):
    with h5py.File(path, "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_name": "Lift", "env_kwargs": {"control_freq": 20}}) if env_args is None else env_args
        demo = data.create_group("demo_0")
        if model:
            demo.attrs["model_file"] = MODEL.format(asset)
            demo["states"] = np.zeros((length, 3))
        demo["actions"] = np.arange(7.0 * length).reshape(length, 7)
        demo["rewards"], demo["dones"] = np.zeros(length), np.zeros(length)
        demo["obs/joint"] = np.arange(2.0 * length).reshape(length, 2)
        if change:
            change(file, demo)
    return path


def replaced(name, value):
    def change(_, demo):
        del demo[name]
        demo[name] = value

    return change


def test_libero(tmp_path):
    """Images bottom row first, named _rgb; the instruction in problem_info; a model with files of another machine."""
    with h5py.File(tmp_path / "demo.hdf5", "w") as file:
        data = file.create_group("data")
        data.attrs["env_args"] = json.dumps({"env_name": "Libero_Kitchen", "env_kwargs": {"control_freq": 20}})
        data.attrs["macros_image_convention"] = "opengl"
        data.attrs["problem_info"] = json.dumps({"language_instruction": "open the top drawer"})
        demo = data.create_group("demo_0")
        demo.attrs["model_file"] = MODEL.format("<mesh name='m' file='/Users/someone/chiliocosm/assets/bowl/bowl.obj'/>")
        demo["states"], demo["actions"] = np.zeros((4, 3)), np.zeros((4, 7))
        for name in ("agentview_rgb", "eye_in_hand_rgb"):
            demo[f"obs/{name}"] = np.stack([picture(t)[::-1] for t in range(4)])
    with pytest.raises(FileNotFoundError, match=r"the model of data/demo_0 names '/Users/.*bowl\.obj'.* or leave the model out with model=False \(--without-model\)"):
        mjs.import_robomimic(tmp_path / "demo.hdf5", tmp_path / "a")
    mjs.import_robomimic(tmp_path / "demo.hdf5", tmp_path / "b", model=False)
    data = mjs.Dataset(tmp_path / "b")
    (episode,) = data.episodes
    cameras = {name.removeprefix("obs/sensor_data/") for name in data.streams if name.startswith("obs/sensor_data/")}
    assert episode.task == "open the top drawer" and episode.fps == 20 and cameras == {"agentview", "eye_in_hand"}
    for name in cameras:
        frames = episode.video(name)[:].astype(int)
        for t in range(4):
            assert np.abs(frames[t] - picture(t)).mean() < 4
    with pytest.raises(ValueError, match="has no data for replay"):
        episode.model()
    (tmp_path / "assets/bowl").mkdir(parents=True)
    (tmp_path / "assets/bowl/bowl.obj").write_text("v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    mjs.import_robomimic(tmp_path / "demo.hdf5", tmp_path / "c", assets=tmp_path / "assets")
    assert mjs.Dataset(tmp_path / "c").episodes[0].model().nmesh == 1


@pytest.mark.parametrize("name, value, message", [
    ("states", np.zeros((8, 3)), "states has 8 rows, and actions has 5; expected the same number"), ("states", np.zeros((3, 3)), "states has 3 rows"),
    ("obs/joint", np.zeros((4, 2)), "obs/joint has 4 rows"), ("rewards", np.zeros(2), "rewards has 2 rows"), ("rewards", np.full(5, np.nan), r"rewards\[0\] is not finite"),
    ("dones", np.zeros((5, 3)), r"dones has the shape \[5, 3\], expected \[5\]"), ("states", np.zeros((5, 9)), "states have 9 numbers; time, qpos and qvel"),
    ("states", np.full((5, 3), 1e300), r"states\[0, 0\]: is 1e\+300"), ("obs/joint", np.array([b"x"] * 5), "'joint' is .S1, expected an array of numbers"),
    ("obs/joint", 5.0, "'joint' is float64, expected an array of numbers"),
], ids=str)  # fmt: skip
def test_arrays_of_demonstrations(tmp_path, name, value, message):
    path = robomimic(tmp_path / "demo.hdf5", change=replaced(name, value))
    with pytest.raises(ValueError, match=rf"demo\.hdf5: data/demo_0.*{message}") as error:
        mjs.import_robomimic(path, tmp_path / "out")
    assert "\n" not in str(error.value) and not list(tmp_path.glob("out*"))


@pytest.mark.parametrize("text, message", [
    ("[]", "env_args is a list, not an object"), ("{", "env_args is not JSON text"), ("null", "env_args is null"), ("[" * 100000, "nested deeper than 60"),
    ('{"env_kwargs": 5}', "env_kwargs: is 5, expected a JSON object"), ('{"env_kwargs": {"control_freq": "1e999999999"}}', "control_freq: is '1e999999999', expected a number"),
    ('{"env_kwargs": {"control_freq": -5}}', "control_freq: is -5"), ('{"env_kwargs": {"control_freq": 1e300}}', r"control_freq: is 1e\+300, expected a number from 0.001"),
    ('{"mjsense": {"policy_dt_ms": 1e-320}}', "policy_dt_ms: is 1e-320"), ('{"env_name": 5}', "env_name: is 5, expected a text"),
], ids=range(10))  # fmt: skip
def test_env_args(tmp_path, text, message):
    with pytest.raises(ValueError, match=message):
        mjs.import_robomimic(robomimic(tmp_path / "demo.hdf5", env_args=text), tmp_path / "out")


@pytest.mark.parametrize("stored", [np.bytes_, lambda text: np.array(text, "S200"), lambda text: np.frombuffer(text.ljust(200, b"\0"), np.uint8)],
                         ids=["bytes", "padded", "array"])  # fmt: skip
def test_texts_of_a_fixed_length(tmp_path, stored):
    text = json.dumps({"env_name": "Lift", "env_kwargs": {"control_freq": 25}}).encode()
    mjs.import_robomimic(robomimic(tmp_path / "demo.hdf5", env_args=stored(text)), tmp_path / "out", model=False)
    assert mjs.Dataset(tmp_path / "out").episodes[0].fps == 25


def test_links_and_bombs(tmp_path):
    with h5py.File(tmp_path / "other.h5", "w") as file:
        file["x"] = np.zeros((5, 2))

    def external(_, demo):
        del demo["obs/joint"]
        demo["obs/joint"] = h5py.ExternalLink("other.h5", "x")

    def storage(_, demo):
        del demo["obs/joint"]
        demo["obs"].create_dataset("joint", (5, 4), "u1", external=[("/etc/passwd", 0, 20)])

    def virtual(_, demo):
        del demo["obs/joint"]
        layout = h5py.VirtualLayout((5, 2), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", (5, 2), "f8")
        demo["obs"].create_virtual_dataset("joint", layout)

    def rows(_, demo):
        del demo["actions"]
        demo.create_dataset("actions", (10**10, 7), "f8", chunks=(10**6, 7), compression="gzip")

    def image(_, demo):
        demo["obs"].create_dataset("big_image", (5, 40000, 40000, 3), "u1", chunks=(1, 1000, 40000, 3), compression="gzip")

    for change, message in ((external, "obs/joint is an external link"), (storage, "obs/joint is stored in other files"), (virtual, "obs/joint is a virtual dataset"),
                            (rows, "actions has 10000000000 rows"), (image, "obs/big_image has rows of 4800000000 bytes")):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            mjs.import_robomimic(robomimic(tmp_path / "demo.hdf5", change=change), tmp_path / "out")
    for name in ("..\\x_image", "a\nb_image", "-i_image"):
        with pytest.raises(ValueError, match=r"cannot be used, expected letters|is not a plain name"):
            mjs.import_robomimic(robomimic(tmp_path / "demo.hdf5", change=lambda _, demo: demo["obs"].create_dataset(name, data=np.zeros((5, 4, 4, 3), np.uint8))), tmp_path / "o")


def test_only_files_that_mujoco_reads_are_archived(tmp_path):
    """And only those of the folder of the data set and of the assets."""
    (tmp_path / "private").mkdir()
    (tmp_path / "private/id_rsa").write_text("a canary")
    (tmp_path / "private/photo.png").write_bytes(png_of(np.zeros((4, 4, 3), np.uint8)))
    (tmp_path / "data").mkdir()
    path = tmp_path / "data/demo.hdf5"
    builtin = f"<texture name='t' type='2d' builtin='flat' width='4' height='4' file='{tmp_path}/private/id_rsa'/>"
    mjs.import_robomimic(robomimic(path, builtin), tmp_path / "out")
    with zipfile.ZipFile(next(tmp_path.glob("out/house_0/model_*.zip"))) as archive:
        assert archive.namelist() == ["model.xml"] and b"id_rsa" not in archive.read("model.xml")
    (tmp_path / "data/link.png").symlink_to(tmp_path / "private/photo.png")
    os.mkfifo(tmp_path / "data/pipe.png")
    for file, kind in ((f"{tmp_path}/private/photo.png", FileNotFoundError), ("../private/photo.png", FileNotFoundError), ("link.png", ValueError), ("pipe.png", FileNotFoundError),
                       ("/dev/zero", FileNotFoundError)):  # fmt: skip
        with pytest.raises(kind):
            mjs.import_robomimic(robomimic(path, f"<texture name='t' type='2d' file='{file}'/>"), tmp_path / "other")
    (tmp_path / "data/own.png").write_bytes(png_of(np.zeros((4, 4, 3), np.uint8)))
    mjs.import_robomimic(robomimic(path, "<texture name='t' type='2d' file='own.png'/>"), tmp_path / "own")
    with pytest.raises(ValueError, match="'include' reads other files"):
        mjs.import_robomimic(robomimic(path, "<include file='x.xml'/>"), tmp_path / "other")


def test_empty_and_short_demonstrations_are_named(tmp_path):
    def add(file, demo):
        file.copy(demo, file["data"], "demo_1")
        del file["data/demo_1/actions"], file["data/demo_1/states"], file["data/demo_1/obs"], file["data/demo_1/rewards"], file["data/demo_1/dones"]
        file["data/demo_1/actions"] = np.zeros((0, 7))

    path = robomimic(tmp_path / "demo.hdf5", length=1, change=add)
    with pytest.warns(UserWarning) as warned:
        mjs.import_robomimic(path, tmp_path / "out")
    texts = [str(one.message) for one in warned]
    assert any("data/demo_1 has no rows, and 1 of 2 demonstrations are left out" in text for text in texts)
    assert any("data/demo_0: one row, whose action is left out" in text for text in texts)
    assert [e.length for e in mjs.Dataset(tmp_path / "out").episodes] == [1]
    with pytest.raises(ValueError, match="no demonstration has rows"):
        mjs.import_robomimic(path, tmp_path / "other", episodes=[1])


# ---------------------------------------------------------------------------------------------- LeRobot


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    """Six images of 32 x 48 pixels."""
    av = pytest.importorskip("av")
    pytest.importorskip("pyarrow")
    path = tmp_path_factory.mktemp("video") / "file.mp4"
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", rate=10, options={"crf": "5"})
        stream.width, stream.height, stream.pix_fmt = 48, 32, "yuv420p"
        for t in range(6):
            file.mux(stream.encode(av.VideoFrame.from_ndarray(picture(t))))
        file.mux(stream.encode())
    return path.read_bytes()


def lerobot(root, video, change=None, length=6):
    import pyarrow as pa
    import pyarrow.parquet as pq

    cam = "observation.images.cam"
    for folder in ("meta/episodes/chunk-000", "data/chunk-000", f"videos/{cam}/chunk-000"):
        (root / folder).mkdir(parents=True)
    (root / f"videos/{cam}/chunk-000/file-000.mp4").write_bytes(video)
    info = {
        "codebase_version": "v3.0", "fps": 10, "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "video_path": "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
        "features": {"observation.state": {"dtype": "float32", "shape": [2], "names": ["a", "b"]}, "action": {"dtype": "float32", "shape": [2]},
                     cam: {"dtype": "video", "shape": [32, 48, 3], "names": ["height", "width", "channels"]}},
    }  # fmt: skip
    rows = {"observation.state": [[float(t), 1.0] for t in range(length)], "action": [[float(t), 2.0] for t in range(length)],
            "episode_index": [0] * length, "task_index": [0] * length}  # fmt: skip
    episode = {"episode_index": 0, "tasks": ["do it"], "length": length, "data/chunk_index": 0, "data/file_index": 0, f"videos/{cam}/chunk_index": 0,
               f"videos/{cam}/file_index": 0, f"videos/{cam}/from_timestamp": 0.0}  # fmt: skip
    tasks = {"task": ["do it"], "task_index": [0]}
    if change:
        change(info=info, rows=rows, episode=episode, tasks=tasks, root=root)
    (root / "meta/info.json").write_text(json.dumps(info))
    pq.write_table(pa.table(rows), root / "data/chunk-000/file-000.parquet")
    pq.write_table(pa.Table.from_pylist([episode]), root / "meta/episodes/chunk-000/file-000.parquet")
    pq.write_table(pa.table(tasks), root / "meta/tasks.parquet")
    return root


def feature(key, **values):
    return lambda info, **_: info["features"][key].update(values)


CAM, STATE = "observation.images.cam", "observation.state"


@pytest.mark.parametrize("about", [
    dict(shape=[32, 48, 3], names=None), dict(shape=[3, 32, 48], names=None), dict(shape=[3, 32, 48], names=["channels", "height", "width"]),
    dict(shape=[3, 32, 48], names=["c", "h", "w"]), dict(shape=[32, 48, 3], names=["height", "width", "channel"]),
], ids=str)  # fmt: skip
def test_channels_may_be_first(video, tmp_path, about):
    mjs.import_lerobot(lerobot(tmp_path / "set", video, feature(CAM, **about)), tmp_path / "out", crf=5)
    (episode,) = mjs.Dataset(tmp_path / "out").episodes
    frames = episode.video("cam")[:].astype(int)
    assert frames.shape == (6, 32, 48, 3) and all(np.abs(frames[t] - picture(t)).mean() < 6 for t in range(6))
    assert episode.fps == Fraction(10) and episode.task == "do it"
    np.testing.assert_array_equal(episode["obs/extra/observation/state"][:, 0], range(6))


def test_several_tasks_of_an_episode(video, tmp_path):
    def change(rows, episode, tasks, **_):
        tasks.update(task=["reach", "lift", "grasp"], task_index=[0, 1, 2])
        episode["tasks"] = ["reach", "grasp"]
        rows["task_index"] = [0, 0, 0, 2, 2, 2]

    mjs.import_lerobot(lerobot(tmp_path / "set", video, change), tmp_path / "out")
    (episode,) = mjs.Dataset(tmp_path / "out").episodes
    assert episode.task == "reach, then grasp" and episode.obs_scene["tasks"] == ["reach", "grasp"]
    np.testing.assert_array_equal(episode["obs/extra/observation/task"], [0, 0, 0, 1, 1, 1])

    def wrong(rows, **others):
        change(rows=rows, **others)
        rows["task_index"][4] = 1

    with pytest.raises(ValueError, match="episode 0: task_index is 1, expected that of a task of the episode"):
        mjs.import_lerobot(lerobot(tmp_path / "wrong", video, wrong), tmp_path / "other")


def info_value(key, value):
    return lambda info, **_: info.__setitem__(key, value)


def row_value(key, value):
    return lambda rows, **_: rows.__setitem__(key, value)


def episode_value(key, value):
    return lambda episode, **_: episode.__setitem__(key, value)


def playlist(root, **_):
    (root / f"videos/{CAM}/chunk-000/file-000.mp4").write_text("#EXTM3U\n#EXTINF:1,\nhttp://127.0.0.1:1/x.ts\n#EXT-X-ENDLIST\n")


def large_images(info, **_):
    info["features"] |= {f"{CAM}_{i}": {"dtype": "video", "shape": [5792, 5792, 3], "names": None} for i in range(6)}


def png_with_texts():
    content = png_of(picture(0))
    text = b"zTXt" + b"a\0\0" + zlib.compress(bytes(1 << 20), 9)
    chunk = struct.pack(">I", len(text) - 4) + text + struct.pack(">I", zlib.crc32(text))
    return content[:33] + 256 * chunk + content[33:]


def image_bytes(content):
    def change(info, rows, **_):
        info["features"][CAM]["dtype"] = "image"
        rows[CAM] = [{"bytes": content, "path": "/etc/passwd"}] * 6

    return change


@pytest.mark.parametrize("change, message", [
    (info_value("data_path", "/tmp/x.parquet"), "data_path: is '/tmp/x.parquet', expected the name of a file inside"),
    (info_value("data_path", "../x.parquet"), "expected the name of a file inside"), (info_value("data_path", 5), "data_path: is 5, expected a text"),
    (info_value("data_path", "\ud800"), r"data_path: is '\\ud800', which has half of a surrogate pair, expected Unicode text"),
    (info_value("data_path", "data/{chunk_index.__class__.__mro__}"), "expected fields such as"), (info_value("data_path", "{chunk_index:2000000000d}"), "expected fields such as"),
    (info_value("data_path", "{nothing}"), "expected only the fields chunk_index, file_index"), (info_value("video_path", "/dev/zero"), "expected the name of a file inside"),
    (info_value("fps", "1e999999999"), "fps: is '1e999999999', expected a number"), (info_value("fps", 0), "fps: is 0"), (info_value("fps", 1e300), "fps: is 1e"),
    (info_value("features", []), r"features: is \[\], expected a JSON object"), (feature(STATE, shape=[10**9, 10**9]), "shape: is 1000000000"),
    (feature(STATE, shape=[-1]), "shape: is -1"), (feature(STATE, dtype="S2000000000"), "dtype is 'S2000000000', expected one of"), (feature(STATE, dtype=[1]), "dtype: is"),
    (feature(STATE, names=5), "names is 5, expected a list of texts"), (feature(CAM, shape=[100000, 100000, 3]), "shape: is 100000"),
    (feature(CAM, shape=[16000, 16000, 3]), "16000 x 16000 pixels, the limit is"), (feature(CAM, shape=[64, 48, 3]), "images of 32 x 48 pixels, and info.json states 64 x 48"),
    (feature(CAM, shape=[5, 32, 48], names=None), "expected 1, 3 or 4 channels"), (feature(CAM, shape=[3, 32, 48], names=["h", "w", "c"]), "expected 1, 3 or 4 channels"),
    (row_value(STATE, [None] * 6), "observation.state: row 0 is None, expected 2 numbers of the type float32"), (row_value(STATE, ["x"] * 6), "row 0 is 'x'"),
    (row_value(STATE, [[1.0, 2.0]] * 3 + [[1.0]] * 3), r"row 3 is \[1.0\], expected 2 numbers"), (episode_value("length", 3), "has 6 rows of episode 0, whose length is 3"),
    (episode_value("length", 10**12), "length of episode 0: is 1000000000000"), (episode_value("tasks", [5]), r"tasks of episode 0 is \[5\], expected a list of texts"),
    (episode_value(f"videos/{CAM}/from_timestamp", float("nan")), "from_timestamp of .* is nan"), (playlist, "is neither an MP4 nor a Matroska file"),
    (image_bytes(b"#EXTM3U\nhttp://127.0.0.1:1/x.ts\n"), "is neither a PNG nor a JPEG file"), (image_bytes(None), "expected the bytes of a PNG or JPEG file"),
    (image_bytes(b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\1\0\0\0\1\0\0"), "images of 65536 x 65536 pixels"),
    (large_images, "one observation has more than 536870912 bytes"), (image_bytes(png_with_texts()), "its texts may unpack to .* bytes, the limit is"),
    (row_value("episode_index", ["0"] * 6), "has no column episode_index of whole numbers"), (row_value("action", [b"x" * 20] * 6), "row 0 is b'xxx"),
], ids=range(37))  # fmt: skip
def test_values_of_data_sets(video, tmp_path, change, message):
    root = lerobot(tmp_path / "set", video, change)
    with pytest.raises(ValueError, match=message) as error:
        mjs.import_lerobot(root, tmp_path / "out")
    assert "\n" not in str(error.value) and str(root) in str(error.value) and not list(tmp_path.glob("out*"))


def test_a_text_of_many_rows_is_not_copied_for_each(video, tmp_path, monkeypatch):
    """Parquet stores a text once: 380 kB of a file were 4 GB of rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    from mjsense.dataset import lerobot_reader

    monkeypatch.setattr(lerobot_reader, "_MAX_TABLE", 1 << 20)
    root = lerobot(tmp_path / "set", video, image_bytes(b"\x89PNG" + bytes(400_000)))
    assert (root / "data/chunk-000/file-000.parquet").stat().st_size < 100_000
    with pytest.raises(ValueError, match=r"data/chunk-000/file-000.parquet: its rows have more than 1048576 bytes, which is the limit"):
        mjs.import_lerobot(root, tmp_path / "out")
    episodes = pa.table({"episode_index": [0], "length": [6], "tasks": [["x" * 1000] * 2000]})
    pq.write_table(episodes, root / "meta/episodes/chunk-000/file-000.parquet")
    with pytest.raises(ValueError, match=r"episodes/chunk-000/file-000.parquet: its rows have more than 1048576 bytes, which is the limit"):
        mjs.import_lerobot(root, tmp_path / "out")
    pq.write_table(episodes.set_column(0, "episode_index", pa.array([b"0" * 20], pa.binary(20))), root / "meta/episodes/chunk-000/file-000.parquet")
    with pytest.raises(ValueError, match=r"the column 'episode_index' has values of more than 16 bytes"):
        mjs.import_lerobot(root, tmp_path / "out")


def test_images_in_several_row_groups(video, tmp_path):
    """Each group has dictionaries of its own, and images that are too many for one follow it."""
    import pyarrow.parquet as pq

    def change(info, rows, **_):
        info["features"][CAM]["dtype"] = "image"
        rows[CAM] = [{"bytes": png_of(picture(t)), "path": f"{t}.png"} for t in range(6)]

    path = lerobot(tmp_path / "set", video, change) / "data/chunk-000/file-000.parquet"
    pq.write_table(pq.read_table(path), path, row_group_size=4, dictionary_pagesize_limit=200)
    mjs.import_lerobot(tmp_path / "set", tmp_path / "out", crf=5)
    (episode,) = mjs.Dataset(tmp_path / "out").episodes
    frames = episode.video("cam")[:].astype(int)
    assert all(np.abs(frames[t] - picture(t)).mean() < 6 for t in range(6))


def test_arrays_that_do_not_fit_together(tmp_path, monkeypatch):
    from mjsense.dataset import foreign_values

    monkeypatch.setattr(foreign_values, "MAX_BYTES", 1 << 20)
    path = robomimic(tmp_path / "a.hdf5", model=False, change=lambda file, demo: [demo.create_dataset(f"obs/a{i}", data=np.zeros((5, 8192))) for i in range(4)])
    with pytest.raises(ValueError, match=r"data/demo_0: its arrays of numbers have 131\d+ bytes, the limit is 1048576"):
        mjs.import_robomimic(path, tmp_path / "out")


@pytest.mark.parametrize("name", ["../../x", "/abs", "", "-i", "a\nb", "a:b"])
def test_names_of_features(video, tmp_path, name):
    def change(info, rows, **_):
        info["features"][f"observation.{name}"] = info["features"].pop(STATE)
        rows[f"observation.{name}"] = rows.pop(STATE)

    with pytest.raises(ValueError, match="cannot be used, expected letters"):
        mjs.import_lerobot(lerobot(tmp_path / "set", video, change), tmp_path / "out")


def test_links_out_of_a_data_set(video, tmp_path):
    root = lerobot(tmp_path / "set", video)
    place = root / f"videos/{CAM}/chunk-000/file-000.mp4"
    (tmp_path / "private.mp4").write_bytes(video)
    place.unlink()
    place.symlink_to(tmp_path / "private.mp4")
    with pytest.raises(ValueError, match=r"file-000\.mp4 is a link to .*private\.mp4, which is outside of"):
        mjs.import_lerobot(root, tmp_path / "out")
    place.unlink()
    os.mkfifo(place)
    with pytest.raises(ValueError, match="is not a regular file"):
        mjs.import_lerobot(root, tmp_path / "out2")
    # The layout of the Hugging Face Hub's cache.
    (tmp_path / "hub/snapshots").mkdir(parents=True)
    (tmp_path / "hub/blobs").mkdir()
    place.unlink()
    root.rename(tmp_path / "hub/snapshots/0123")
    (tmp_path / "hub/blobs/abc").write_bytes(video)
    (tmp_path / "hub/snapshots/0123" / place.relative_to(root)).symlink_to("../../../../../blobs/abc")
    mjs.import_lerobot(tmp_path / "hub/snapshots/0123", tmp_path / "out3")


def test_short_and_empty_episodes_are_named(video, tmp_path):
    with pytest.warns(UserWarning, match=r"1 of 1 episodes have one row, whose action is left out: \[0\]"):
        mjs.import_lerobot(lerobot(tmp_path / "one", video, length=1), tmp_path / "out")
    with pytest.raises(ValueError, match="no episode has rows"):
        mjs.import_lerobot(lerobot(tmp_path / "none", video, episode_value("length", 0)), tmp_path / "other")


def test_values_that_are_not_numbers_are_kept_and_intact(video, tmp_path):
    mjs.import_lerobot(lerobot(tmp_path / "set", video, row_value(STATE, [[float("nan"), 1.0]] * 6)), tmp_path / "out")
    mjs.import_robomimic(robomimic(tmp_path / "demo.hdf5", change=replaced("obs/joint", np.full((5, 2), np.nan))), tmp_path / "out2")
    for out, name in ((tmp_path / "out", "state"), (tmp_path / "out2", "joint")):
        assert np.isnan(mjs.Dataset(out).episodes[0][f"obs/extra/observation/{name}"][:, 0]).all()
        done = run_program("verify", out)
        assert done.returncode == 0 and "intact" in done.stdout, done.stdout + done.stderr
