# SPDX-License-Identifier: Apache-2.0
"""mjsense.exporting: the files of LeRobot's formats, read with PyArrow and PyAV. test_lerobot.py reads them with LeRobot."""

import contextlib
import json
import shutil
from fractions import Fraction
from pathlib import Path

import h5py
import numpy as np
import pytest

pytest.importorskip("av")
pq = pytest.importorskip("pyarrow.parquet")

import av

import mjsense as mjs
from mjsense import commands
from mjsense.dataset import statistics
from mjsense.exporting import Mapping, Source, frame_statistics, lerobot, lerobot_depth, lerobot_files, mapping
from mjsense.exporting.mapping import _filled
from mjsense.exporting.output import new_output
from mjsense.exporting.remux import Concatenation

SMALL = dict(num_worlds=2, episodes=2, keep_failures=True, width=32, height=23, horizon=12, shadows=False, seed=3)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """Two houses with different quality of the videos: 2 and 1 episodes of 13 observations."""
    out = tmp_path_factory.mktemp("data")
    mjs.record("pick", out=out, **SMALL)
    mjs.record("pick", out=out, house=1, crf=30, **{**SMALL, "episodes": 1, "seed": 4})
    return out


@pytest.fixture(scope="module")
def v3(root, tmp_path_factory):
    return mjs.exporting.export_lerobot(root, tmp_path_factory.mktemp("export") / "v3")


def rows(folder):
    return pq.ParquetDataset(sorted(folder.rglob("*.parquet"))).read().to_pydict()


def frames(path):
    with av.open(str(path)) as video:
        stream = video.streams.video[0]
        found = [((frame.pts or 0) * (stream.time_base or 0), frame.to_ndarray(format="rgb24", threads=1)) for frame in video.decode(stream)]
        assert stream.average_rate is not None
        return stream.average_rate, [time for time, _ in found], [image for _, image in found]


def test_rows_are_states_with_the_actions_taken_there(root, v3):
    data, dataset = rows(v3 / "data"), mjs.Dataset(root)
    at = 0
    for position, episode in enumerate(dataset.episodes):
        part = slice(at, at + 12)
        state = np.concatenate([episode["obs/agent/qpos/arm"], episode["obs/agent/qpos/gripper"]], 1)
        action = np.concatenate([episode["actions/joint_pos/arm"], episode["actions/joint_pos/gripper"]], 1)
        np.testing.assert_array_equal(data["observation.state"][part], state[:-1].astype(np.float32))
        np.testing.assert_array_equal(data["action"][part], action[1:].astype(np.float32))
        np.testing.assert_array_equal(data["next.reward"][part], episode["rewards"][1:])
        np.testing.assert_array_equal(data["next.success"][part], episode["success"][1:])
        assert data["next.done"][part] == [False] * 11 + [True] and data["frame_index"][part] == list(range(12))
        np.testing.assert_array_equal(data["timestamp"][part], (np.arange(12) / 15).astype(np.float32))
        assert data["episode_index"][part] == [position] * 12 and data["index"][part] == list(range(at, at + 12))
        tasks = pq.read_table(v3 / "meta/tasks.parquet").to_pydict()
        assert tasks["task"][data["task_index"][at]] == episode.task
        at += 12
    info = json.loads((v3 / "meta/info.json").read_text())
    assert info["total_frames"] == at == 36 and info["total_episodes"] == 3 and info["robot_type"] == "franka" and info["fps"] == 15
    assert rows(v3 / "meta/episodes")["recorded_fps"] == [500 / 33] * 3
    assert info["features"]["action"]["names"] == [*(f"arm_{i}" for i in range(7)), "gripper_0"]
    assert info["features"]["observation.images.wrist_camera"]["shape"] == [24, 32, 3]
    assert {name: column["dtype"] for name, column in info["features"].items()}.items() >= {
        "action": "float32", "next.success": "bool", "task_index": "int64", "observation.images.wrist_camera": "video"}.items()  # fmt: skip


def test_a_mapping_object_is_accepted(root):
    assert Source(root, map=Mapping(state=("obs/extra/tcp_pose",)), episodes=[0]).features["state"].size == 7


def test_videos_have_the_same_frames(root, v3):
    """Each row has one. The two houses have different codec parameters, so the second has a file of its own."""
    episodes = rows(v3 / "meta/episodes")
    prefix = "videos/observation.images.wrist_camera/"
    assert episodes[prefix + "file_index"] == [0, 0, 1] and episodes[prefix + "from_timestamp"] == [0, 12 / 15, 0]
    for position, episode in enumerate(mjs.Dataset(root).episodes):
        file = episodes[prefix + "file_index"][position]
        rate, times, images = frames(v3 / f"{prefix}chunk-000/file-{file:03d}.mp4")
        assert rate == 15 and times == [n / rate for n in range(len(times))] and len(images) == (24, 12)[file]
        first = round(episodes[prefix + "from_timestamp"][position] * rate)
        for image, expected in zip(images[first : first + 12], episode.video("wrist_camera")[:12], strict=True):
            np.testing.assert_array_equal(image[:23], expected)


def assert_frames_by_row(root, out):
    """As LeRobot's StreamingLeRobotDataset reads: the frame of a row is at ``index / fps`` in its file, and the file has no other frames."""
    info, data = json.loads((out / "meta/info.json").read_text()), rows(out / "data")
    rate, times, images = frames(out / "videos/observation.images.wrist_camera/chunk-000/file-000.mp4")
    assert len(images) == info["total_frames"] and rate == Fraction(info["fps"]).limit_denominator(1000)
    for index, position, t in zip(data["index"], data["episode_index"], data["frame_index"], strict=True):
        assert times[index] == index / rate
        expected = mjs.Dataset(root).episodes[position].video("wrist_camera")[t]
        assert np.abs(np.subtract(images[index][:23], expected, dtype=float)).mean() < 5, (position, t)


def test_frames_are_found_by_the_number_of_their_row(root, tmp_path):
    for exact in (False, True):
        out = mjs.exporting.export_lerobot(root / "house_0", tmp_path / str(exact), exact_rate=exact)
        assert_frames_by_row(root / "house_0", out)
        timestamps = rows(out / "data")["timestamp"]
        np.testing.assert_array_equal(timestamps[:12], (np.arange(12) * (0.066 if exact else 1 / 15)).astype(np.float32))


def test_videos_with_b_frames_also_have_one_frame_for_each_row(root, tmp_path):
    """Their last packet is not their last frame, so they are encoded again."""
    shutil.copytree(root / "house_0", tmp_path / "house_0")
    for video in (tmp_path / "house_0").glob("*wrist*.mp4"):
        rate, _, images = frames(video)
        with av.open(str(video), "w") as file:
            stream = file.add_stream("libx264", rate=rate, options={"bf": "3", "b-adapt": "0", "crf": "18"})
            stream.width, stream.height, stream.pix_fmt = 32, 24, "yuv420p"
            for image in images:
                file.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")))
            file.mux(stream.encode(None))
    for path in (tmp_path / "house_0").glob("*.h5"):
        with h5py.File(path, "a") as file:
            for trajectory in file.values():
                del trajectory["obs/sensor_data/wrist_camera"].attrs["crc32"]  # of the former video
    out = mjs.exporting.export_lerobot(tmp_path / "house_0", tmp_path / "v3")
    assert_frames_by_row(tmp_path / "house_0", out)


def test_rates(root, capsys):
    """A whole rate if that changes the time by at most 5 %; stderr says what happens."""
    source = Source(root, whole_rate=True)
    assert (source.fps, source.recorded_fps) == (15, Fraction(500, 33)) and Source(root).fps == Fraction(500, 33)
    for fps, whole in ((20, 20), (Fraction(500, 33), 15), (Fraction(30000, 1001), 30), (12.5, 12), (2.5, 2.5), (0.3, 0.3)):
        assert mapping._whole(Fraction(fps)) == Fraction(whole), fps
    lerobot_files.print_rate(source)
    assert "15.1515 rows per second are written as 15" in (printed := capsys.readouterr().err) and "times are 1.0% longer" in printed
    lerobot_files.print_rate(Source(root))
    assert "15.1515 rows per second are not a whole number" in (printed := capsys.readouterr().err) and "--policy-dt 50" in printed
    source.recorded_fps = Fraction(15)
    lerobot_files.print_rate(source)
    assert not capsys.readouterr().err


def test_statistics(root, v3):
    found, data = json.loads((v3 / "meta/stats.json").read_text()), rows(v3 / "data")
    actions = np.array(data["action"], np.float64)
    for name, expected in (("mean", actions.mean(0)), ("std", actions.std(0)), ("q01", np.quantile(actions, 0.01, axis=0))):
        np.testing.assert_allclose(found["action"][name], expected, atol=1e-9)
    assert found["action"]["count"] == [36] and np.shape(found["timestamp"]["max"]) == (1,)
    recorded = mjs.Dataset(root).episodes
    counts = np.sum([episode.image_histogram("wrist_camera") for episode in recorded], 0)
    for name, expected in statistics.of_histograms(counts, sum(episode.length for episode in recorded)).items():
        np.testing.assert_array_equal(found["observation.images.wrist_camera"][name], expected, err_msg=name)
    episodes = rows(v3 / "meta/episodes")
    assert np.shape(episodes["stats/observation.images.wrist_camera/mean"][0]) == (3, 1, 1)
    np.testing.assert_allclose(episodes["stats/action/max"][1], actions[12:24].max(0))


@pytest.mark.parametrize(("keyint", "count"), ((20, 4), (2, 31), (250, 4)))
def test_statistics_use_key_frames_or_every_20th(keyint, count, tmp_path):
    """61 frames. A video with one key frame would give statistics of the initial state only."""
    path = tmp_path / "video.mp4"
    with av.open(str(path), "w") as file:
        stream = file.add_stream("libx264", rate=20, options={"g": str(keyint), "sc_threshold": "0"})
        stream.width, stream.height, stream.pix_fmt = 32, 16, "yuv420p"
        for t in range(61):
            file.mux(stream.encode(av.VideoFrame.from_ndarray(np.full((16, 32, 3), 4 * t, np.uint8), format="rgb24")))
        file.mux(stream.encode(None))
    counts, images = frame_statistics.key_frame_histograms(path, 61)
    assert images == count and counts.sum() == count * 3 * 16 * 32
    assert np.flatnonzero(counts[0]).max() > 150


def test_files_are_limited_in_size(root, tmp_path, monkeypatch):
    monkeypatch.setattr(lerobot, "DATA_FILE_MB", 1e-4)
    monkeypatch.setattr(lerobot, "VIDEO_FILE_MB", 1e-4)
    monkeypatch.setattr(lerobot, "FILES_PER_CHUNK", 2)
    mjs.exporting.export_lerobot(root, tmp_path / "out")
    files = sorted(str(path.relative_to(tmp_path / "out")) for path in (tmp_path / "out").rglob("file-*"))
    places = ["chunk-000/file-000", "chunk-000/file-001", "chunk-001/file-000"]
    cameras = ["videos/observation.images.exo_camera_1", "videos/observation.images.wrist_camera"]
    assert files == [*(f"{folder}/{place}.parquet" for folder in ("data", "meta/episodes") for place in places),
                     *(f"{folder}/{place}.mp4" for folder in cameras for place in places)]  # fmt: skip
    assert rows(tmp_path / "out/meta/episodes")["data/chunk_index"] == [0, 0, 1]


def test_a_long_file_ends_before_its_times_are_inexact():
    """LeRobot adds and compares times in 32 bits. This fails for 4 frames of an episode of 60 s in the first hour."""
    videos = lerobot._Videos(Path("unused"), Fraction(500, 33))
    videos._video.frames = 100
    assert videos._found_by_time(909)
    videos._video.frames = 53030
    assert videos._found_by_time(100) and not videos._found_by_time(909)


def test_depth_in_lerobot_form_with_the_exact_file(tmp_path):
    mjs.record("pick", out=tmp_path / "data", depth=True, cameras=["wrist_camera"], **{**SMALL, "episodes": 1})
    cameras = {"cameras": {"eye": "wrist_camera", "eye_depth": "wrist_camera_depth"}}
    out = mjs.exporting.export_lerobot(tmp_path / "data", tmp_path / "out", map=cameras)
    video = mjs.Dataset(tmp_path / "data").episodes[0].video("wrist_camera_depth")
    assert (out / "extras/depth/eye_depth/episode_000000.mkv").read_bytes() == video.path.read_bytes()
    key = "observation.images.eye_depth"
    with av.open(str(out / f"videos/{key}/chunk-000/file-000.mp4")) as file:
        codes = np.stack([frame.to_ndarray(format="gray12le") for frame in file.decode(video=0)])
    expected = video[:-1].clip(0.01, 10)
    assert (np.abs(lerobot_depth.LEVELS[codes] - expected) <= (expected + 3.5) * 1.7e-4).all()
    info = json.loads((out / "meta/info.json").read_text())["features"][key]
    assert info["shape"] == [23, 32, 1] and info["info"]["is_depth_map"] and info["info"]["video.depth_max"] == 10
    stats = json.loads((out / "meta/stats.json").read_text())[key]
    np.testing.assert_allclose(stats["mean"], expected.mean().reshape(1, 1, 1), rtol=1e-3)
    np.testing.assert_allclose(np.ravel(stats["q50"]), np.median(expected), atol=2e-3)
    with pytest.raises(ValueError, match=r"LeRobot v2\.1 has no depth images; leave 'eye_depth' out"):
        mjs.exporting.export_lerobot21(tmp_path / "data", tmp_path / "v21", map=cameras)


def test_lerobot21(root, tmp_path):
    out = mjs.exporting.export_lerobot21(root, tmp_path / "v21")
    info = json.loads((out / "meta/info.json").read_text())
    assert (info["codebase_version"], info["total_videos"], info["total_frames"]) == ("v2.1", 6, 36)
    for position, episode in enumerate(mjs.Dataset(root).episodes):
        place = {"episode_chunk": 0, "episode_index": position}
        data = pq.read_table(out / info["data_path"].format(**place)).to_pydict()
        np.testing.assert_array_equal(np.array(data["action"])[:, :7], episode["actions/joint_pos/arm"][1:].astype(np.float32))
        video = out / info["video_path"].format(video_key="observation.images.wrist_camera", **place)
        rate, times, images = frames(video)
        assert rate == info["fps"] == 15 and times == [Fraction(n, 15) for n in range(12)]
        np.testing.assert_array_equal([image[:23] for image in images], episode.video("wrist_camera")[:12])
    lines = [json.loads(line) for line in (out / "meta/episodes_stats.jsonl").read_text().splitlines()]
    assert [line["episode_index"] for line in lines] == [0, 1, 2] and lines[0]["stats"]["action"]["count"] == [12]
    modality = json.loads((out / "meta/modality.json").read_text())
    assert modality["state"]["gripper"] == {"start": 7, "end": 9, "original_key": "observation.state"}
    assert modality["video"]["wrist_camera"] == {"original_key": "observation.images.wrist_camera"}
    assert modality["annotation"] == {"human.task_description": {}}
    assert data["annotation.human.task_description"] == data["task_index"] and "annotation.human.task_description" in info["features"]
    for name, column in (("state", "observation.state"), ("action", "action")):  # as GR00T's page on data preparation says
        parts = sorted((part["start"], part["end"]) for part in modality[name].values())
        assert [start for start, _ in parts] == [0, *(end for _, end in parts[:-1])] and parts[-1][1] == info["features"][column]["shape"][0]


def test_groot_reads_the_statistics_and_the_columns_that_modality_names(root, tmp_path):
    """Its loader takes the numbers of a group out of every statistic: of N1 and N1.5 by position."""
    features = {"velocity": "obs/agent/qvel", "rel": "actions/joint_pos_rel", "next.phase": "obs/extra/policy_phase"}
    out = mjs.exporting.export_lerobot21(root, tmp_path / "v21", map={"features": features, "cameras": {}}, episodes=[0])
    modality, found = (json.loads((out / f"meta/{name}.json").read_text()) for name in ("modality", "stats"))
    assert {name: part["original_key"] for name, part in modality["state"].items()} == {
        "arm": "observation.state", "gripper": "observation.state", "phase": "next.phase",
        "velocity_arm": "observation.velocity", "velocity_gripper": "observation.velocity"}  # fmt: skip
    assert {name: part["original_key"] for name, part in modality["action"].items()} == {"arm": "action", "gripper": "action", "rel_arm": "next.rel", "rel_gripper": "next.rel"}
    for part in (*modality["state"].values(), *modality["action"].values()):
        for statistic in found[part["original_key"]].values():
            assert np.array(statistic)[np.arange(part["start"], part["end"])].size == part["end"] - part["start"]
    with pytest.raises(ValueError, match=r"the feature 'state' and the feature 'arm' have the same name in the export, 'state\.arm'"):
        mjs.exporting.export_lerobot21(root, tmp_path / "two", map={"features": {"arm": "obs/agent/qvel/arm"}})


def test_groot_n16_reads_windows_of_every_episode(root, tmp_path):
    """The rules of its loader: an episode's rows are those of `length`, videos are read by row number, a group is a slice of its column and of
    each statistic, a step is a window of `HORIZON` actions, and stats.json is used as it is if each float feature has six statistics."""
    horizon = 8
    out = mjs.exporting.export_lerobot21(root, tmp_path / "v21", map={"features": {"velocity": "obs/agent/qvel"}})
    info, modality, statistics = (json.loads((out / f"meta/{name}.json").read_text()) for name in ("info", "modality", "stats"))
    lines = {name: [json.loads(line) for line in (out / f"meta/{name}.jsonl").read_text().splitlines()] for name in ("episodes", "tasks")}
    sentences = {line["task_index"]: line["task"] for line in lines["tasks"]}
    every = {}
    for entry, episode in zip(lines["episodes"], mjs.Dataset(root).episodes, strict=True):
        number = entry["episode_index"]
        place = {"episode_chunk": number // info["chunks_size"], "episode_index": number}
        data = pq.read_table(out / info["data_path"].format(**place)).to_pydict()
        assert {len(values) for values in data.values()} == {entry["length"]} and entry["length"] >= horizon
        for about in modality["video"].values():
            assert about["original_key"] in info["features"]
            _, _, images = frames(out / info["video_path"].format(video_key=about["original_key"], **place))
            assert len(images) == entry["length"]
        ((name, about),) = modality["annotation"].items()
        assert {sentences[index] for index in data[about.get("original_key", f"annotation.{name}")]} == {episode.task} == set(entry["tasks"])
        groups = {(kind, group): np.array(data[about["original_key"]], np.float32)[:, about["start"] : about["end"]]
                  for kind in ("state", "action") for group, about in modality[kind].items()}  # fmt: skip
        step = entry["length"] - horizon  # the last one with a whole window
        np.testing.assert_array_equal(groups["action", "arm"][step : step + horizon], episode["actions/joint_pos/arm"][step + 1 : step + horizon + 1].astype(np.float32))
        np.testing.assert_array_equal(groups["state", "arm"][step], episode["obs/agent/qpos/arm"][step].astype(np.float32))
        np.testing.assert_array_equal(groups["state", "velocity_arm"][step], episode["obs/agent/qvel/arm"][step].astype(np.float32))
        for key, values in groups.items():
            every.setdefault(key, []).append(values)
    for (kind, group), parts in every.items():
        about, values = modality[kind][group], np.concatenate(parts)
        found = {name: np.array(numbers[about["start"] : about["end"]]) for name, numbers in statistics[about["original_key"]].items()}
        assert {len(numbers) for numbers in found.values()} == {values.shape[1]}, (kind, group)
        for name, wanted in (("min", values.min(0)), ("max", values.max(0)), ("mean", values.mean(0)), ("std", values.std(0))):
            np.testing.assert_allclose(found[name], wanted, atol=1e-5, err_msg=f"{kind}.{group} {name}")
    for name, feature in info["features"].items():
        if "float" in feature["dtype"]:
            assert {"mean", "std", "min", "max", "q01", "q99"} <= set(statistics[name]), name


@pytest.mark.parametrize(("format", "features", "cameras", "message"), (
    ("lerobot", {"next.done": "rewards"}, {}, "LeRobot's column 'next.done' and the feature 'next.done'"),
    ("lerobot", {"observation.state": "obs/extra/tcp_pose"}, {}, "the feature 'state' and the feature 'observation.state'"),
    ("lerobot", {"next.reward": "success"}, {}, "the feature 'next.reward' and the feature 'reward'"),
    ("lerobot21", {"images.eye": "obs/extra/tcp_pose", "observation.images.eye": "obs/extra/tcp_pose"}, {"eye": "wrist_camera"}, "the camera 'eye'"),
    ("lerobot21", {"annotation.human.task_description": "rewards"}, {}, "LeRobot's column 'annotation.human.task_description'"),
    ("robomimic", {"eye_image": "obs/extra/tcp_pose"}, {"eye": "wrist_camera"}, "the feature 'eye_image' and the video 'wrist_camera'"),
    ("robomimic", {"dones": "rewards"}, {}, "robomimic's 'dones' and the feature 'dones'"),
    ("rlds", {"discount": "rewards"}, {}, "RLDS's 'discount' and the feature 'discount'"),
    ("rlds", {"eye": "obs/extra/tcp_pose"}, {"eye": "wrist_camera"}, "the feature 'eye' and the video 'wrist_camera'"),
    ("zarr", {"eye": "obs/extra/tcp_pose"}, {"eye": "wrist_camera"}, "the feature 'eye' and the video 'wrist_camera'"),
    ("zarr", {}, {"action": "wrist_camera"}, "the feature 'action' and the video 'wrist_camera'"),
    ("mcap", {"tf": "obs/extra/tcp_pose"}, {}, "the topic '/tf' and the feature 'tf'"),
))  # fmt: skip
def test_no_two_things_have_one_name(format, features, cameras, message, root, tmp_path):
    try:
        export = getattr(mjs, f"export_{format}")
        with pytest.raises(ValueError, match=f"{message}.* have the same name in the export, '.*'; choose other names in the map"):
            export(root / "house_0", tmp_path / "out", map={"features": features, "cameras": cameras})
    except (ImportError, RuntimeError) as error:
        pytest.skip(str(error))
    assert not list(tmp_path.iterdir())


MAP = """
state = ["obs/agent/qpos/gripper", "obs/agent/qvel/arm"]
action = "actions/joint_pos_rel/arm"
[cameras]
wrist = "wrist_camera"
[features]
tcp_pose = "obs/extra/tcp_pose"
"next.phase" = ["obs/extra/policy_phase"]
"""


def test_a_map_chooses_features(root, tmp_path, capsys):
    (tmp_path / "map.toml").write_text(MAP)
    words = ["export", "lerobot", str(root), str(tmp_path / "out"), "--map", str(tmp_path / "map.toml"), "--episodes", "2"]
    assert commands.run(words) == 0
    info = json.loads((tmp_path / "out/meta/info.json").read_text())
    assert info["total_episodes"] == 1 and [key for key in info["features"] if "images" in key] == ["observation.images.wrist"]
    assert info["features"]["observation.state"]["names"][:3] == ["gripper_0", "gripper_1", "arm_0"]
    assert info["features"]["next.phase"]["dtype"] == "int64" and info["features"]["observation.tcp_pose"]["shape"] == [7]
    assert commands.run(words) == 2 and "exists; name another output" in capsys.readouterr().err


def test_move_groups_without_joints_have_their_command(tmp_path):
    mjs.record("pick", "floating_rum", out=tmp_path, **{**SMALL, "episodes": 1, "cameras": []})
    source = Source(tmp_path)
    assert source.features["action"].parts == {"gripper": slice(0, 1), "base": slice(1, 8)} and not source.cameras
    rows, episode = source.rows(source.episodes[0]), source.episodes[0]
    np.testing.assert_array_equal(rows["action"][:, 1:], episode["actions/commanded_action/base"][1:])


def test_wrong_maps_and_recordings(root, tmp_path):
    for table, message in (
        ({"stat": "obs/agent/qpos"}, "unknown key 'stat'; the keys are state, action, cameras, features"),
        ({"state": [3]}, "'state' must be the name of a stream or a list of names"),
        ({"cameras": "wrist_camera"}, "'cameras' must be a table of names"),
        ({"features": {"reward": "rewards"}}, "the feature name 'reward' is taken"),
        ({"features": {"x": ["obs/extra/tcp_pose", "rewards"]}}, "mixes observations and results of steps"),
        ({"features": {"x": "obs/sensor_data/wrist_camera"}}, "must be numbers"),
    ):
        with pytest.raises(ValueError, match=message):
            Source(root, map=table)
    with pytest.raises(mjs.UnknownNameError, match=r"Feature 'state' \(a map, map= or --map, chooses its streams\): No stream.*qpso"):
        Source(root, map={"state": "obs/agent/qpso"})
    with pytest.raises(mjs.UnknownNameError, match="no video 'wrist'"):
        Source(root, map={"cameras": {"a": "wrist"}})
    with pytest.raises(ValueError, match="no episode"):
        Source(root, success=True)
    assert Mapping.of(None) == Mapping()


def test_images_of_one_size(root, tmp_path):
    mjs.record("pick", out=tmp_path, **{**SMALL, "episodes": 1})
    mjs.record("pick", out=tmp_path, house=1, **{**SMALL, "episodes": 1, "width": 40})
    with pytest.raises(ValueError, match=r"'exo_camera_1' have different sizes: 32x23 \(episode 0\), 40x23 \(episode 1\)"):
        Source(tmp_path)


def test_an_export_of_an_unfinished_recording_says_so(root, tmp_path, capsys):
    Source(root)
    assert not capsys.readouterr().err
    shutil.copytree(root, tmp_path, dirs_exist_ok=True)
    (tmp_path / "house_1/.recording").mkdir()
    for unfinished in (tmp_path, tmp_path / "house_1"):
        Source(unfinished)
        assert capsys.readouterr().err == f"{unfinished} is unfinished; the export has the episodes that are published\n"
    Source(tmp_path / "house_0")
    assert not capsys.readouterr().err


def test_a_failed_export_leaves_nothing(root, tmp_path):
    def stop(done, total):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        mjs.exporting.export_lerobot(root, tmp_path / "out", progress=stop)
    assert not list(tmp_path.iterdir())
    with contextlib.suppress(KeyboardInterrupt), new_output(tmp_path / "out") as part:
        part.mkdir()
        (part / "old").touch()
        shutil.copytree(tmp_path / "out.part", tmp_path / "killed")
        raise KeyboardInterrupt
    (tmp_path / "killed").rename(tmp_path / "out.part")
    mjs.exporting.export_lerobot(root, tmp_path / "out", episodes=[0])
    assert [path.name for path in tmp_path.iterdir()] == ["out"] and not (tmp_path / "out/old").exists()


def test_an_export_deletes_nothing_that_it_has_not_made(root, tmp_path):
    (tmp_path / "poetry.lock").write_text("versions")
    (tmp_path / "poetry.part").mkdir()
    with pytest.raises(FileExistsError, match=r"poetry\.part exists, and no program of mjsense has made it: rename it, or choose another output"):
        mjs.exporting.export_lerobot(root, tmp_path / "poetry", episodes=[0])
    (tmp_path / "poetry.part/thesis.txt").write_text("thesis")
    with pytest.raises(FileExistsError, match=r"poetry\.part exists"):
        mjs.record("pick", out=tmp_path / "poetry", format="lerobot", **SMALL)
    (tmp_path / "poetry.part").rename(tmp_path / "poetry")
    (tmp_path / "poetry.recording/house_0/.recording").mkdir(parents=True)
    with pytest.raises(FileExistsError, match=r"poetry exists; name another output"):
        mjs.record("pick", out=tmp_path / "poetry", format="lerobot", resume=True, **SMALL)
    (tmp_path / "poetry").rename(tmp_path / "mine")
    (tmp_path / "poetry.recording").rename(tmp_path / "mine.recording")
    mjs.exporting.export_lerobot(root, tmp_path / "poetry", episodes=[0])
    assert (tmp_path / "poetry.lock").read_text() == "versions" and (tmp_path / "mine/thesis.txt").read_text() == "thesis"
    assert {path.name for path in tmp_path.iterdir()} == {"poetry", "poetry.lock", "mine", "mine.recording"}


def test_one_process_at_a_time_writes_an_output(root, tmp_path):
    with new_output(tmp_path / "out") as part:
        with pytest.raises(FileExistsError, match=r"another process writes .*out"):
            mjs.exporting.export_lerobot(root, tmp_path / "out")
        part.touch()
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_groups_without_an_action_hold_their_position():
    values, given = np.array([[0.0], [1], [0], [3], [0]]), np.array([False, True, False, True, False])
    measured = np.full((5, 1), 7.0)

    def filled(stream, *arrays):
        return _filled(stream, *arrays, 5, 1).ravel().tolist()

    assert filled("actions/joint_pos/arm", values, given, measured) == [7, 1, 1, 3, 3]
    assert filled("actions/joint_pos_rel/arm", values, given, None) == [0, 1, 0, 3, 0]
    assert filled("actions/ee_pose/arm", values, given, None) == [0, 1, 1, 3, 3]
    assert filled("actions/joint_pos/gripper", None, None, np.zeros((5, 2))) == [0] * 5


def test_a_video_without_all_frames_is_an_error(root, tmp_path):
    video = next(root.glob("house_0/*wrist*.mp4"))
    with pytest.raises(ValueError, match=r"has 13 frames, but its episode has 14 observations; `mjsense verify`"):
        Concatenation(tmp_path / "out.mp4", Fraction(15)).add(video, Fraction(500, 33), 14, 13)
    with pytest.raises(ValueError, match=r"its times are not those of 20 frames per second"):
        Concatenation(tmp_path / "out.mp4", Fraction(15)).add(video, Fraction(20), 13, 12)


def test_folders_of_parts_are_joined_in_a_new_one(tmp_path):
    from mjsense.exporting.output import join_folders

    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / f"{name}.mcap").write_text(name)
    join_folders(None, [tmp_path / "a", tmp_path / "b"], tmp_path / "out")
    assert {path.name: path.read_text() for path in (tmp_path / "out").iterdir()} == {"a.mcap": "a", "b.mcap": "b"}
    with pytest.raises(FileExistsError):
        join_folders(None, [], tmp_path / "out")
