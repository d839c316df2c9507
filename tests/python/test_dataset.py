# SPDX-License-Identifier: Apache-2.0
"""mjsense.Dataset against h5py, ffmpeg and NumPy."""

import json
import multiprocessing
import pickle
import shutil
import subprocess
import sys
import tarfile
from fractions import Fraction
from pathlib import Path

import h5py
import numpy as np
import pytest
from edited_recordings import changed
from program_runs import run_program

import mjsense as mjs
from mjsense.dataset import json_rows as rows_as_json
from mjsense.dataset import video, video_decoder

SMALL = dict(num_worlds=2, episodes=2, keep_failures=True, width=32, height=23, horizon=20, shadows=False, seed=3)


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """Two houses: 2 and 1 episodes of 21 observations; the first in two files, with all kinds of videos."""
    out = tmp_path_factory.mktemp("data")
    mjs.record("pick", out=out, depth=True, molmospaces_depth=True, segmentation=True, batches=2, **SMALL)
    mjs.record("pick", out=out, depth=True, molmospaces_depth=True, segmentation=True, house=10, **{**SMALL, "episodes": 1, "seed": 4})
    return out


@pytest.fixture(scope="module")
def dataset(root):
    return mjs.Dataset(root)


@pytest.fixture(params=["av", "threads", "ffmpeg"])
def decoder(request, monkeypatch):
    if request.param != "ffmpeg":
        pytest.importorskip("av")
    monkeypatch.setattr(video, "have_av", lambda: request.param != "ffmpeg")
    if request.param == "threads":
        monkeypatch.setattr(video, "_LARGE_IMAGE", 1)
        monkeypatch.setattr(video, "_threads", lambda: 3)


def trajectories(root):
    for path in sorted(root.glob("house_*/*.h5"), key=lambda p: (int(p.parent.name[6:]), p.name)):
        with h5py.File(path) as file:
            for name in sorted(file):
                yield path, file[name]


def json_rows(data):
    return [json.loads(row.tobytes().rstrip(b"\0")) for row in data[:]]


def test_rows_are_those_of_the_files(root, dataset):
    assert len(dataset) == 63 and [e.length for e in dataset.episodes] == [21] * 3 and dataset.fps == Fraction(500, 33)
    assert [e.house for e in dataset.episodes] == [0, 0, 10] and [e.index for e in dataset.episodes] == [0, 1, 2]
    compared = set()
    for k, (path, trajectory) in enumerate(trajectories(root)):
        episode = dataset.episodes[k]
        assert episode.path == path and episode.outcome == trajectory.attrs["outcome"] and episode.seed == trajectory.attrs["seed"]
        assert episode.obs_scene == json.loads(trajectory["obs_scene"][()]) and episode.task == episode.obs_scene["instruction"]
        samples = [dataset[21 * k + t] for t in range(21)]
        assert [s["frame_index"] for s in samples] == list(range(21)) and {s["episode_index"] for s in samples} == {k}
        assert samples[3]["timestamp"] == pytest.approx(3 * 0.066) and samples[3]["task"] == episode.task
        for name, stream in dataset.streams.items():
            if name in trajectory and stream.kind == "array":
                expected = trajectory[name][:]
                np.testing.assert_array_equal(np.stack([s[name] for s in samples]), expected, err_msg=name)
                np.testing.assert_array_equal(episode[name], expected)
                assert samples[0][name].dtype == expected.dtype and stream.unit == trajectory[name].attrs.get("unit", "")
                compared.add(name)
        for place in ("obs/agent/qpos", "obs/agent/qvel", "actions/joint_pos", "actions/commanded_action"):
            rows = json_rows(trajectory[place])
            for group in ("arm", "gripper"):
                values = np.stack([s[f"{place}/{group}"] for s in samples])
                given = [group in row for row in rows]
                if place.startswith("actions"):
                    assert [bool(s[f"{place}/given/{group}"]) for s in samples] == given
                for value, row in zip(values, rows):
                    assert value.tolist() == row.get(group, [0.0] * len(value))
            assert set(episode[place]) >= {"arm", "gripper"}
        task_info = json_rows(trajectory["obs/extra/task_info"])
        assert [float(s["obs/extra/task_info/position_error"]) for s in samples] == [row["position_error"] for row in task_info]
    assert {"obs/extra/tcp_pose", "rewards", "success", "env_states/articulations/franka"} <= compared
    assert not dataset.episodes[0]["actions/commanded_action/given/arm"][0] and not any(n.startswith("replay/") for n in dataset.streams)
    assert dataset.streams["actions/joint_pos/gripper"].unit == "0 open .. 255 closed"
    assert dataset[-1]["index"] == 62 and dataset.index_of(1, 2) == 23
    with pytest.raises(IndexError, match="63 observations"):
        dataset[63]


def test_samples_do_not_share_memory_with_the_cache(dataset):
    dataset[0]["obs/extra/tcp_pose"][:] = 7
    dataset.episodes[0]["obs/extra/tcp_pose"][:] = 7
    assert (dataset[0]["obs/extra/tcp_pose"] != 7).all()


def test_segmentation_is_read_by_row(root, monkeypatch):
    from mjsense.dataset import dataset as module
    from mjsense.dataset import episode_rows

    small = mjs.Dataset(root, streams=["obs/extra/wrist_camera_segmentation"])[2]
    monkeypatch.setattr(module, "LARGE_ROW", 1)
    monkeypatch.setattr(episode_rows, "LARGE_ROW", 1)
    large = mjs.Dataset(root, streams=["obs/extra/wrist_camera_segmentation"], delta_timestamps={"obs/extra/tcp_pose": [0]})
    name = "obs/extra/wrist_camera_segmentation"
    assert name in large._large
    np.testing.assert_array_equal(large[2][name], small[name])


def decode(path, pixel_format, shape):
    raw = subprocess.run(["ffmpeg", "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", pixel_format, "-"], capture_output=True).stdout
    return np.frombuffer(raw, np.uint16 if pixel_format == "gray16le" else np.uint8).reshape(-1, *shape)


def test_frames_are_those_of_ffmpeg(root, decoder):
    dataset = mjs.Dataset(root)
    rng = np.random.default_rng(0)
    for episode in dataset.episodes[::2]:
        rgb = episode.video("wrist_camera")
        expected = decode(rgb.path, "rgb24", (24, 32, 3))[:, :23]  # an odd height is stored with one more row
        assert len(rgb) == len(expected) == 21 and rgb.shape == expected.shape
        np.testing.assert_array_equal(rgb[:], expected)
        for t in rng.permutation(21):
            sample = dataset[dataset.index_of(episode.index, t)]
            np.testing.assert_array_equal(sample["obs/sensor_data/wrist_camera"], expected[t])
        depth = episode.video("wrist_camera_depth_16bit")
        units = decode(depth.path, "gray16le", (23, 32))
        assert depth[5].dtype == np.float32 and depth.path.suffix == ".mkv"
        np.testing.assert_allclose(depth[:], units * 0.0002, atol=1e-6)
        lossy = episode.video("wrist_camera_depth")
        code = decode(lossy.path, "rgb24", (23, 32, 3)).astype(int) @ [256, 1, 0]
        for t in rng.permutation(21):
            sample = dataset[dataset.index_of(episode.index, t)]
            np.testing.assert_array_equal(sample["obs/sensor_data/wrist_camera_depth_16bit"], units[t] * np.float32(0.0002))
            assert ((sample["obs/sensor_data/wrist_camera_depth"] > 0) == (code[t] > 0)).all()
        np.testing.assert_allclose(lossy[:], np.where(code > 0, (code - 1) / 65534 * 0.5 + 0.05, 0), atol=1e-6)
        # H.264 changes the high byte, of which one unit is 2 mm.
        inside = (depth[:] > 0.06) & (depth[:] < 0.54) & (lossy[:] > 0)
        assert np.median(abs(lossy[:] - depth[:])[inside]) < 0.008
    with pytest.raises(IndexError, match="21 frames"):
        rgb[21]
    with pytest.raises(KeyError, match="no video 'wrist'; it has"):
        episode.video("wrist")


@pytest.mark.parametrize("encoding", ["rgb", "depth16"])
def test_every_frame_of_a_long_video(tmp_path, decoder, encoding):
    """Several key frames, B-frames, random order, and a cache that holds few frames."""
    from mjsense.dataset.cache import Cache

    rgb = encoding == "rgb"
    path = tmp_path / ("long.mp4" if rgb else "long.mkv")
    codec = ["-c:v", "libx264", "-g", "90", "-bf", "3", "-pix_fmt", "yuv420p"] if rgb else ["-c:v", "ffv1", "-g", "1", "-pix_fmt", "gray16le"]
    source = ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", "testsrc=size=32x24:rate=500/33", "-frames:v", "400"]
    subprocess.run([*source, *codec, path], check=True)
    expected = decode(path, "rgb24", (24, 32, 3)) if rgb else decode(path, "gray16le", (24, 32)) * np.float32(0.0002)
    reader = video.FrameReader(Cache(150_000), Cache(150_000))
    frames = mjs.dataset.Video(video.VideoInfo(path, 400, 32, 24, encoding, 0.0002, Fraction(500, 33)), reader)
    for t in [*np.random.default_rng(0).permutation(400)[:16], 89, 90, 88, 179, 180, 399, 0, *range(200, 212)]:
        np.testing.assert_array_equal(frames[int(t)], expected[t], err_msg=str(t))
    with pytest.raises(RuntimeError, match="has no frame 400"):
        mjs.dataset.Video(video.VideoInfo(path, 401, 32, 24, encoding, 0.0002, Fraction(500, 33)), reader)[400]


def test_the_size_of_a_table_of_packets(tmp_path):
    """With it the cache bounds its memory."""
    pytest.importorskip("av")
    path = tmp_path / "x.mkv"
    source = ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", "testsrc=size=32x24:rate=25", "-frames:v", "300"]
    subprocess.run([*source, "-c:v", "ffv1", path], check=True)
    packets = video_decoder.Packets(path, Fraction(25), 300, (32, 24), "")
    tables = [getattr(packets, name) for name in ("offsets", "sizes", "frames", "keys", "key_frames")]
    held = sum(sys.getsizeof(table) + sum(map(sys.getsizeof, table)) for table in tables)
    assert held / 3 < packets.bytes < 3 * held


def test_a_recording_of_the_first_format(tmp_path):
    """Made by a version without data for replay, numbers and checksummed archives, whose videos have B-frames and no tuning."""
    with tarfile.open(Path(__file__).parent / "recordings/first_format.tar.xz") as archive:
        archive.extractall(tmp_path, filter="data")
    for command, expected in (("verify", "intact: 1 file, 1 episode, 3 observations, 2 videos"), ("inspect", "1 x horizon reached")):
        done = run_program(command, tmp_path)
        assert done.returncode == 0 and expected in done.stdout, done.stdout + done.stderr
    dataset = mjs.Dataset(tmp_path)
    episode = dataset.episodes[0]
    rgb, depth = episode.video("wrist_camera"), episode.video("wrist_camera_depth")
    units = decode(depth.path, "gray16le", (12, 16))
    for t in (2, 0, 1):
        np.testing.assert_array_equal(dataset[t]["obs/sensor_data/wrist_camera"], decode(rgb.path, "rgb24", (12, 16, 3))[t])
        np.testing.assert_array_equal(dataset[t]["obs/sensor_data/wrist_camera_depth"], units[t] * np.float32(0.0002))
    assert dataset[2]["obs/agent/qpos/arm"].shape == (7,) and dataset[1]["actions/joint_pos/given/arm"]
    with pytest.raises(ValueError, match="has no data for replay"):
        mjs.check_replay(dataset)


def test_lossless_depth_is_what_the_sensor_measured(tmp_path):
    from scenes import ball_scene

    camera = mjs.CameraSensorCfg(name="eye", pos=(0, -2, 0.5), quat=(0.7, 0.7, 0, 0), width=16, height=8, data_types=("rgb", "depth"))
    sim = mjs.Simulation(ball_scene(camera), num_worlds=1, decimation=10)
    seen = []
    with mjs.Recorder(sim, tmp_path, list(sim.scene.sensors.values()), episodes=1) as recorder:
        recorder.begin_episode(0, episode=0)
        for _ in range(4):
            seen.append(sim.scene.camera("eye").data.depth[0].copy())
            recorder.append()
            sim.step()
        recorder.finish_episode(0)
    depth = mjs.Dataset(tmp_path).episodes[0].video("eye_depth")[:]
    seen = np.stack(seen).reshape(depth.shape)
    assert (seen > 0).any()
    np.testing.assert_allclose(depth, np.minimum(seen, 65535 * 0.0002), atol=1.01e-4)


def test_windows(root):
    dt = 0.066
    dataset = mjs.Dataset(
        root,
        streams=["obs/agent/qpos", "obs/sensor_data/wrist_camera"],
        delta_timestamps={"obs/agent/qpos/arm": [-dt, 0, 2 * dt], "actions/joint_pos": [dt, 2 * dt], "obs/sensor_data/wrist_camera": [-3 * dt, 0]},
    )
    qpos, action = (np.concatenate([e[n] for e in dataset.episodes]) for n in ("obs/agent/qpos/arm", "actions/joint_pos/arm"))
    pictures = np.concatenate([e.video("wrist_camera")[:] for e in dataset.episodes])
    for i in range(len(dataset)):
        start = i // 21 * 21
        sample = dataset[i]

        def window(values, steps):
            return values[np.clip([i + s for s in steps], start, start + 20)], [not start <= i + s < start + 21 for s in steps]

        for name, values, steps in (("obs/agent/qpos/arm", qpos, (-1, 0, 2)), ("actions/joint_pos/arm", action, (1, 2)),
                                    ("obs/sensor_data/wrist_camera", pictures, (-3, 0))):  # fmt: skip
            rows, pad = window(values, steps)
            np.testing.assert_array_equal(sample[name], rows)
            assert sample[f"{name}_is_pad"].tolist() == pad and sample[f"{name}_is_pad"].dtype == bool
        assert sample["actions/joint_pos/given/arm"].shape == (2,) and sample["obs/agent/qpos/gripper"].shape == (2,)
    assert sample.keys() == {"obs/agent/qpos/arm", "obs/agent/qpos/arm_is_pad", "obs/agent/qpos/gripper", "obs/sensor_data/wrist_camera",
                             "obs/sensor_data/wrist_camera_is_pad", "actions/joint_pos/arm", "actions/joint_pos/arm_is_pad",
                             "actions/joint_pos/gripper", "actions/joint_pos/gripper_is_pad", "actions/joint_pos/given/arm",
                             "actions/joint_pos/given/gripper", "episode_index", "frame_index", "index", "timestamp", "task"}  # fmt: skip
    with pytest.raises(ValueError, match=r"delta_timestamps\['rewards'\]: 0.1 s is not a multiple of 1/fps = 0.066000 s"):
        mjs.Dataset(root, delta_timestamps={"rewards": [0.1]})
    assert mjs.Dataset(root, delta_timestamps={"rewards": [0.1]}, tolerance_s=0.04)[0]["rewards"].shape == (1,)


def test_filters_and_names(root, dataset, tmp_path):
    outcomes = {e.outcome for e in dataset.episodes}
    assert len(mjs.Dataset(root, episodes=[2, 0]).episodes) == 2 and mjs.Dataset(root, episodes=[2])[0]["episode_index"] == 2
    assert [e.index for e in mjs.Dataset(root, houses=[10]).episodes] == [2]
    assert len(mjs.Dataset(root, outcome=sorted(outcomes)).episodes) == 3
    assert len(mjs.Dataset(root, outcome="horizon reached*").episodes) == 3 and len(mjs.Dataset(root, outcome=lambda o: "lift" in o)) == 63
    assert len(mjs.Dataset(root, success=True)) == 0 and mjs.Dataset(root, success=True).stats() == {}
    for outcome in ("horizon", ["horizon reached*", "horizon"]):  # a condition may match nothing, but a text is a name
        with pytest.raises(ValueError, match=r"outcome: no episode has the outcome 'horizon'; .* has 3 x 'horizon reached"):
            mjs.Dataset(root, outcome=outcome)
    assert not mjs.Dataset(root, outcome=lambda text: text == "horizon").episodes
    with pytest.raises(ValueError, match=r"houses: 3 is not in .*, which has the houses \[\d, 10\]"):
        mjs.Dataset(root, houses=[10, 3])
    assert list(mjs.Dataset(root / "house_10", streams=["rewards"]).streams) == ["rewards"]
    assert set(mjs.Dataset(root, streams=["obs/sensor_data/*_depth"]).streams) == {
        f"obs/sensor_data/{c}_depth" for c in ("wrist_camera", "exo_camera_1")
    }
    with pytest.raises(ValueError, match=r"3 is not in .* which has 3 episodes"):
        mjs.Dataset(root, episodes=[3])
    assert [episode.index for episode in mjs.Dataset(root, episodes=[True, False, True]).episodes] == [0, 2]
    with pytest.raises(ValueError, match=r"episodes: a mask of 2, but .* has 3 episodes"):
        mjs.Dataset(root, episodes=[True, False])
    with pytest.raises(TypeError, match="episodes must be integers or a mask, not "):
        mjs.Dataset(root, episodes=[0.5])
    with pytest.raises(KeyError, match="No stream, group or pattern 'tcp_pose'; did you mean 'obs/extra/tcp_pose'"):
        mjs.Dataset(root, streams=["tcp_pose"])
    with pytest.raises(KeyError, match="no stream 'obs/extra/tcp_pos'; did you mean 'obs/extra/tcp_pose'"):
        dataset.episodes[0]["obs/extra/tcp_pos"]
    with pytest.raises(FileNotFoundError, match=r"house_3: no such file or directory; did you mean 'house_\d'"):
        mjs.Dataset(root / "house_3")
    with pytest.raises(FileNotFoundError, match="contains no recording"):
        mjs.Dataset(tmp_path)
    (tmp_path / "cut.h5").write_bytes(dataset.episodes[0].path.read_bytes()[:3000])
    with pytest.raises(OSError, match=r"cut.h5: not an HDF5 file that can be read: .*truncated file"):
        mjs.Dataset(tmp_path / "cut.h5")
    assert "63 observations" in repr(dataset) and "obs/agent/qpos/arm: float32 [7] [rad]" in repr(dataset)


def without_numbers(file):
    """Makes it a file of an older version, which has JSON rows only."""
    for trajectory in file.values():
        del trajectory["numbers"]


def test_older_recordings_are_read_from_their_json_rows(tmp_path, root):
    shutil.copytree(root / "house_0", tmp_path / "house_0")
    for path in (tmp_path / "house_0").glob("*.h5"):
        with h5py.File(path, "a") as file:
            without_numbers(file)
    new, old = mjs.Dataset(root / "house_0"), mjs.Dataset(tmp_path)
    names = [name for name in old.streams if name.startswith(("obs/agent/", "actions/"))]
    assert "actions/joint_pos/given/arm" in names and set(old.streams) <= set(new.streams)
    assert {old.streams[name].kind for name in names} == {"json"} and {new.streams[name].kind for name in names} == {"array"}
    for i in range(0, len(old), 5):
        a, b = old[i], new[i]
        for name in names:
            np.testing.assert_array_equal(a[name], b[name], err_msg=name)


def test_a_move_group_that_only_some_episodes_command(tmp_path, root, monkeypatch):
    """A few episodes define a sample; other leaves cause a warning, and are in the sample if they are named."""
    from mjsense.dataset import dataset as module

    shutil.copytree(root / "house_0", tmp_path / "house_0")
    for i, path in enumerate(sorted((tmp_path / "house_0").glob("*.h5"))):
        with changed(path) as file:
            without_numbers(file)
            if i == 0:
                file.copy("traj_0", "traj_1")
                rows = file["traj_1/actions/joint_pos"]
                row = b'{"arm":[0,0,0,0,0,0,0],"base":[1.5,2.5,3.5],"gripper":[1.0]}'
                rows[4] = np.frombuffer(row.ljust(2000, b"\0"), np.uint8)
    every = mjs.Dataset(tmp_path)
    assert every[25]["actions/joint_pos/base"].tolist() == [1.5, 2.5, 3.5] and every[25]["actions/joint_pos/given/base"]
    assert not every[0]["actions/joint_pos/given/base"] and every[0]["actions/joint_pos/base"].tolist() == [0, 0, 0]
    monkeypatch.setattr(module, "_PROBED", 2)
    dataset = mjs.Dataset(tmp_path, streams=["actions/joint_pos"])
    assert "actions/joint_pos/base" not in dataset.streams
    with pytest.warns(UserWarning, match="Episode 1 .* has actions/joint_pos/base, which the first, the last and other"):
        dataset[25]
    named = mjs.Dataset(tmp_path, streams=["actions/joint_pos/base", "rewards"])
    assert named[25]["actions/joint_pos/base"].tolist() == [1.5, 2.5, 3.5] and named[0]["actions/joint_pos/base"].tolist() == [0, 0, 0]


def _sums(dataset, indices, queue):
    queue.put([(i, int(dataset[i]["obs/sensor_data/wrist_camera"].sum()), float(dataset[i]["obs/extra/tcp_pose"].sum())) for i in indices])


@pytest.mark.parametrize("method", ["fork", "spawn"])
@pytest.mark.skipif(sys.platform == "win32", reason="no fork")
def test_workers(root, method):
    dataset = mjs.Dataset(root, streams=["obs/sensor_data/wrist_camera", "obs/extra/tcp_pose"])
    expected = [(i, int(dataset[i]["obs/sensor_data/wrist_camera"].sum()), float(dataset[i]["obs/extra/tcp_pose"].sum())) for i in range(63)]
    fresh = mjs.Dataset(root, streams=["obs/sensor_data/wrist_camera", "obs/extra/tcp_pose"])
    fresh[0]  # files and decoders are open, or were, before the workers start
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    workers = [context.Process(target=_sums, args=(fresh, range(k, 63, 2), queue)) for k in range(2)]
    for worker in workers:
        worker.start()
    try:
        found = sorted(queue.get(timeout=60) + queue.get(timeout=60))
    finally:
        for worker in workers:
            worker.kill()
    assert found == expected
    copy = pickle.loads(pickle.dumps(fresh))
    assert len(pickle.dumps(fresh)) < 100_000 and copy[5]["index"] == 5


def test_statistics(root, dataset):
    stats = dataset.stats()
    qpos = np.concatenate([e["obs/agent/qpos/arm"] for e in dataset.episodes]).astype(np.float64)
    one = stats["obs/agent/qpos/arm"]
    for name, value in dict(min=qpos.min(0), max=qpos.max(0), mean=qpos.mean(0), std=qpos.std(0), q01=np.quantile(qpos, 0.01, 0),
                            q10=np.quantile(qpos, 0.1, 0), q50=np.median(qpos, 0), q90=np.quantile(qpos, 0.9, 0),
                            q99=np.quantile(qpos, 0.99, 0)).items():  # fmt: skip
        np.testing.assert_allclose(one[name], value, err_msg=name)
    assert one["count"].tolist() == [63] and stats["rewards"]["mean"].shape == (1,)
    assert stats["actions/commanded_action/arm"]["count"].tolist() == [60]  # not given at the first observation
    assert not any("/given/" in name for name in stats)
    pictures = np.concatenate([e.video("wrist_camera")[:] for e in dataset.episodes]).reshape(-1, 3) / 255
    image = stats["obs/sensor_data/wrist_camera"]
    assert image["mean"].shape == (3, 1, 1) and image["count"].tolist() == [63]
    for name, value in dict(min=pictures.min(0), max=pictures.max(0), mean=pictures.mean(0), std=pictures.std(0),
                            q10=np.quantile(pictures, 0.1, 0), q99=np.quantile(pictures, 0.99, 0)).items():  # fmt: skip
        np.testing.assert_allclose(image[name].ravel(), value, err_msg=name)
    assert stats["obs/sensor_data/wrist_camera_depth_16bit"]["max"].shape == (1, 1, 1)
    present = np.concatenate([e["env_states/actors/mug"] for e in dataset.episodes])
    present = present[~np.isnan(present[:, 0])]
    assert stats["env_states/actors/mug"]["count"].tolist() == [len(present)]
    if len(present):
        np.testing.assert_allclose(stats["env_states/actors/mug"]["q50"], np.median(present, 0))
    assert dataset.stats(["rewards"]).keys() == {"rewards"}


def test_h5py_is_imported_when_a_file_is_read(root):
    code = """
import sys
import mjsense as mjs
assert "h5py" not in sys.modules
sys.modules["h5py"] = None
try:
    mjs.Dataset(sys.argv[1])
except ModuleNotFoundError as error:
    assert "pip install 'mjsense[dataset]'" in str(error), error
else:
    raise AssertionError
"""
    subprocess.run([sys.executable, "-c", code, root], check=True)


def test_torch_loads_batches(root):
    data = pytest.importorskip("torch.utils.data")
    dataset = mjs.Dataset(root, streams=["obs/sensor_data/wrist_camera", "obs/agent/qpos", "actions/joint_pos", "success"])
    batch = next(iter(data.DataLoader(dataset, batch_size=8, shuffle=True, num_workers=2)))
    assert batch["obs/agent/qpos/arm"].shape == (8, 7) and len(batch["task"]) == 8


def test_files_without_attributes(tmp_path, root):
    """As MolmoSpaces writes them: no attributes, no names of videos."""
    import shutil

    shutil.copytree(root / "house_10", tmp_path / "house_10")
    with h5py.File(next(tmp_path.glob("house_10/*.h5")), "a") as file:

        def strip(name, item):
            for key in list(item.attrs):
                del item.attrs[key]

        strip("", file)
        file.visititems(strip)
        del file["traj_0/obs/sensor_data"], file["traj_0/replay"]
    dataset = mjs.Dataset(tmp_path)
    ours = mjs.Dataset(root, episodes=[2])
    assert dataset.fps == ours.fps and dataset.episodes[0].outcome == "no success" and dataset.episodes[0].seed is None
    assert dataset.streams.keys() == {n for n in ours.streams if not n.startswith("obs/sensor_data/")}
    np.testing.assert_array_equal(dataset[5]["obs/agent/qpos/arm"], ours[5]["obs/agent/qpos/arm"])
    with pytest.raises(KeyError, match="it has no videos"):
        dataset.episodes[0].video("wrist_camera")


def test_integers_that_no_float_has_stay_integers():
    rows = np.frombuffer(b'{"a": 1' + b"0" * 400 + b"}", np.uint8)[None]
    values, given = rows_as_json.decode(rows)["/a"]
    assert values[0] == 10**400 and given.all()
