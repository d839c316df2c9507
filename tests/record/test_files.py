# SPDX-License-Identifier: Apache-2.0
"""Tests of recorded files with h5py, ffmpeg and MolmoSpaces' readers."""

import hashlib
import json
import os
import subprocess
import zlib

import h5py
import numpy as np
import pytest
import readers

EPISODES, WIDTH, HEIGHT = 8, 64, 48


@pytest.fixture(scope="module")
def house(record_fake, tmp_path_factory):
    out = tmp_path_factory.mktemp("data")
    record_fake(out, "--episodes", EPISODES, "--worlds", 3, "--steps", 12, "--discard", 5, "--red-green")
    return out / "house_0"


@pytest.fixture(scope="module")
def files(house):
    return sorted(house.glob("*.h5"))


def test_names(house, files):
    assert [f.name for f in files] == ["trajectories_batch_1_of_2.h5", "trajectories_batch_2_of_2.h5"]
    kept = [i for i in range(9) if i != 4]  # attempt 4 was discarded
    videos = {f"episode_{i:08d}_wrist_camera{k}" for i in kept for k in (".mp4", "_depth.mp4", "_depth.mkv")}
    archive = {f"model_{hashlib.sha256(b'a' * 5000).hexdigest()[:12]}.zip"}
    assert {p.name for p in house.iterdir()} == videos | {f.name for f in files} | archive


def test_carried_data(record_fake, house, tmp_path):
    """Data of another recording that the new one does not have, with their attributes, equal byte for byte."""
    record_fake(tmp_path / "more", "--episodes", 1, "--worlds", 1, "--steps", 10, "--cameras", 2, "--no-video")
    source = next((tmp_path / "more").rglob("*.h5"))
    record_fake(tmp_path / "out", "--episodes", 1, "--worlds", 1, "--steps", 10, "--carry", source)
    assert "intact" in record_fake("verify", tmp_path / "out").stdout
    with h5py.File(source) as old, h5py.File(next((tmp_path / "out").rglob("*.h5"))) as new:
        names = []
        old["traj_0"].visititems(lambda name, item: names.append(name) if isinstance(item, h5py.Dataset) else None)
        for name in names:
            if name != "obs_scene":
                a, b = old["traj_0"][name], new["traj_0"][name]
                assert a[()].tobytes() == b[()].tobytes() and dict(a.attrs) == dict(b.attrs), name
        assert {name.split("/")[2] for name in names if name.startswith("obs/sensor_param/")} == {"wrist_camera", "exo_camera_1"}
    missing = record_fake(tmp_path / "other", "--episodes", 1, "--steps", 10, "--carry", tmp_path / "nothing.h5", check=False)
    assert missing.returncode == 2 and "nothing.h5" in missing.stderr


def test_molmospaces_scripts_accept_every_trajectory(files):
    for path in files:
        assert not list(readers.missing_video_names(path))
        assert readers.validate(path, visible=[("wrist_camera", "pickup_obj")]) == [[]] * 4


def test_validation_can_fail(files, tmp_path):
    copy = tmp_path / files[0].name
    copy.write_bytes(files[0].read_bytes())  # the videos are not copied
    assert all("does not exist" in c[0] for c in readers.validate(copy))


def test_dtypes_and_lengths(files):
    expected = {
        "rewards": ("float32", ()), "success": ("bool", ()), "fail": ("bool", ()),
        "terminated": ("bool", ()), "truncated": ("bool", ()),
        "actions/joint_pos": ("uint8", (2000,)), "actions/commanded_action": ("uint8", (2000,)),
        "obs/agent/qpos": ("uint8", (2000,)), "obs/agent/qvel": ("uint8", (2000,)),
        "obs/extra/task_info": ("uint8", (4000,)), "obs/extra/tcp_pose": ("float32", (7,)),
        "obs/extra/policy_phase": ("int64", ()), "obs/extra/policy_num_retries": ("int64", ()),
        "obs/extra/object_image_points/pickup_obj/wrist_camera/points": ("float32", (10, 2)),
        "obs/extra/object_image_points/pickup_obj/wrist_camera/num_points": ("int32", (1,)),
        "obs/extra/robot/imu_acc": ("float32", (3,)), "obs/extra/tactile": ("uint16", (2, 3, 4)),
        "obs/extra/feet/found": ("bool", (4,)),
        "obs/sensor_param/wrist_camera/cam2world_gl": ("float64", (4, 4)),
        "obs/sensor_param/wrist_camera/extrinsic_cv": ("float64", (3, 4)),
        "obs/sensor_param/wrist_camera/intrinsic_cv": ("float64", (3, 3)),
        "env_states/actors/cup": ("float32", (13,)), "env_states/articulations/panda": ("float32", (31,)),
    }  # fmt: skip
    for path in files:
        with h5py.File(path) as f:
            for traj in f.values():
                T = len(traj["success"])
                for name, (dtype, shape) in expected.items():
                    assert (str(traj[name].dtype), traj[name].shape) == (dtype, (T, *shape)), name
                for key in ("wrist_camera", "wrist_camera_depth", "wrist_camera_depth_16bit"):
                    assert (str(traj["obs/sensor_data"][key].dtype), traj["obs/sensor_data"][key].shape) == ("uint8", (100,))
                assert traj["obs_scene"].shape == () and h5py.check_string_dtype(traj["obs_scene"].dtype).encoding == "utf-8"


def test_values(files):
    with h5py.File(files[0]) as f:
        assert [t.attrs["episode"] for t in f.values()] == [0, 1, 2, 3]
        traj = f["traj_1"]
        T, e = len(traj["success"]), 1
        t = np.arange(T)
        np.testing.assert_array_equal(traj["obs/extra/tcp_pose"][:], (1000 * e + t[:, None] + np.arange(7) / 8).astype(np.float32))
        np.testing.assert_array_equal(traj["obs/extra/policy_phase"][:], 1000 * e + t)
        np.testing.assert_array_equal(traj["obs/extra/feet/found"][:], (t[:, None] + np.arange(4)) % 3 == 0)
        np.testing.assert_array_equal(traj["rewards"][:], 0.25 * t)
        np.testing.assert_array_equal(traj["terminated"][:], t == T - 1)
        np.testing.assert_array_equal(traj["fail"][:], ~traj["success"][:])
        info = readers.rows(traj["obs/extra/task_info"])
        assert info[0]["position_error"] == np.inf and info[2] == {"position_error": 0.25, "success": False}
        assert np.isnan(traj["obs/extra/object_image_points/pickup_obj/wrist_camera/points"][:, 1:]).all()
        arm = [row["arm"] for row in readers.rows(traj["obs/agent/qpos"])]
        np.testing.assert_array_equal(arm, np.float32(np.sin(0.1 * t[:, None] + np.arange(7)) + 0.01 * e))


def test_attributes(files):
    with h5py.File(files[0]) as f:
        recording = json.loads(f.attrs["recording"])
        assert recording["settings"] == {"task": "fake", "seed": 0} and recording["fps"] == "500/33"
        traj = f["traj_0"]
        assert traj.attrs["seed"] == 1000 and traj.attrs["outcome"] == "success"
        imu = traj["obs/extra/robot/imu_acc"].attrs
        assert (imu["unit"], imu["frame"], imu["description"]) == ("m/s^2", "site robot/imu", "a number that counts")
        assert json.loads(imu["spec"])["shape"] == [3]
        depth = traj["obs/sensor_data/wrist_camera_depth_16bit"].attrs
        assert (depth["encoding"], depth["metres_per_unit"], depth["unit"]) == ("depth16", 0.0002, "m")

        def described(name, item):
            if isinstance(item, h5py.Dataset):
                assert {"unit", "frame", "description"} <= set(item.attrs) and item.attrs["description"], name

        traj.visititems(described)
        assert traj.attrs["steps"] == len(traj["success"]) - 1


def test_numbers_equal_the_json_rows(files):
    """The numbers of a sensor that MolmoSpaces stores as JSON rows are also arrays, with their type, unit and mask."""
    with h5py.File(files[0]) as f:
        for traj in f.values():
            leaves = {}
            traj["numbers"].visititems(lambda name, item: leaves.update({name: item}) if isinstance(item, h5py.Dataset) else None)
            assert {"obs/agent/qpos/arm", "obs/agent/qvel/arm", "actions/joint_pos/arm"} <= set(leaves)
            for name, numbers in leaves.items():
                place, *keys = name.split("/")
                while not isinstance(traj[place], h5py.Dataset):
                    place = f"{place}/{keys.pop(0)}"
                if keys[0] == "given":
                    continue
                given = leaves.get("/".join([place, "given", *keys]), np.ones(len(numbers), bool))
                for row, values, is_given in zip(readers.rows(traj[place]), numbers, given, strict=True):
                    for key in keys:
                        row = row.get(key) if row is not None else None
                    assert (row is not None) == is_given, name
                    np.testing.assert_array_equal(values, row if is_given else np.zeros_like(values), err_msg=name)


def test_checksums(house, files):
    with h5py.File(files[1]) as f:
        for traj in f.values():
            scene = traj["obs_scene"]
            assert scene.attrs["crc32"] == f"{zlib.crc32(scene[()]):08x}"
            for name in ("rewards", "success", "obs/agent/qpos", "obs/extra/feet/found", "obs/sensor_param/wrist_camera/extrinsic_cv"):
                assert traj[name].attrs["crc32"] == f"{zlib.crc32(traj[name][:].tobytes()):08x}", name
            for dataset in traj["obs/sensor_data"].values():
                video = (house / readers.file_name(dataset)).read_bytes()
                assert (dataset.attrs["crc32"], dataset.attrs["bytes"]) == (f"{zlib.crc32(video):08x}", len(video))
    data = files[1].read_bytes()
    at = data.rindex(b"\nmjsense: crc32 ")
    assert data[at:].decode() == f"\nmjsense: crc32 {zlib.crc32(data[:at]):08x} of the {at:>16} bytes above\n"


def test_videos(house, files):
    with h5py.File(files[0]) as f:
        traj = f["traj_2"]
        T = len(traj["success"])
        name = {k: house / readers.file_name(d) for k, d in traj["obs/sensor_data"].items()}
        units = traj["obs/sensor_data/wrist_camera_depth_16bit"].attrs["metres_per_unit"]
    rgb = readers.probe(name["wrist_camera"])
    assert (rgb["codec_name"], rgb["pix_fmt"], rgb["r_frame_rate"]) == ("h264", "yuv420p", "500/33")
    assert (rgb["width"], rgb["height"], int(rgb["nb_read_frames"])) == (WIDTH, HEIGHT, T)
    frames = readers.decode(name["wrist_camera"], "rgb24", (HEIGHT, WIDTH, 3)).astype(int)
    assert np.abs(frames[5, HEIGHT // 2, 2 * 5 + 8] - [220, 60, 80]).max() < 25  # the ball at its position in frame 5

    x, y, t = np.arange(WIDTH), np.arange(HEIGHT)[:, None], np.arange(T)[:, None, None]
    metres = np.float32(0.3) + np.float32(0.001) * (x + 2 * y + t).astype(np.float32)
    codes = readers.decode(name["wrist_camera_depth_16bit"], "gray16le", (HEIGHT, WIDTH))
    assert (codes[:, 0, 0] == 0).all() and (codes[:, 0, -1] == 65535).all()  # first column: invalid; last column: infinitely far
    inner = np.s_[:, 1:, :]
    assert np.abs(codes[inner] * units - metres[inner]).max() <= units / 2 * 1.01

    lossy = readers.decode(name["wrist_camera_depth"], "rgb24", (HEIGHT, WIDTH, 3)).astype(float)
    peer = (lossy[..., 0] * 256 + lossy[..., 1] - 1) / 65534 * 0.5 + 0.05
    inside = metres < 0.5
    assert np.median(np.abs(peer - metres)[inside]) < 0.01  # MolmoSpaces' lossy encoding


@pytest.mark.parametrize("size", [(33, 17), (640, 362)])
def test_images_are_not_rescaled(record_fake, tmp_path, size):
    record_fake(tmp_path, "--episodes", 1, "--worlds", 1, "--steps", 3, "--width", size[0], "--height", size[1])
    for path in tmp_path.rglob("*.m*"):
        stream = readers.probe(path)
        even = [(n + 1) // 2 * 2 for n in size] if path.suffix == ".mp4" else list(size)
        assert [stream["width"], stream["height"]] == even


def test_statistics_and_results(files):
    stats = readers.statistics(files[0])
    assert {"actions/joint_pos/arm", "actions/ee_pose/gripper", "obs/agent/qpos/arm"} <= set(stats)
    count = sum(h5py.File(files[0])[f"traj_{i}/success"].shape[0] - 2 for i in range(4))
    assert stats["actions/joint_pos/arm"]["count"] == count
    results = list(readers.collect_episode_results(files[0]))
    assert [r["steps"] for r in results] == [10, 11, 12, 10] and all(r["success"] for r in results)
    assert results[1]["task_description"] == "Pick up the cup 1"
    state, action = next(readers.training_samples(files[0]))
    np.testing.assert_allclose(action, np.sin(0.1 + np.arange(7)), atol=1e-6)
    assert state["base"] == []


def test_h5py_can_add_to_the_files(files, tmp_path):
    copy = tmp_path / "copy.h5"
    copy.write_bytes(files[0].read_bytes())
    with h5py.File(copy, "r+") as f:
        f["valid_traj_mask"] = np.ones(4, bool)
        f["stats/traj_0/obs/agent/qpos"] = "{}"
    with h5py.File(copy) as f:
        assert f["valid_traj_mask"][:].all() and len(f["traj_3/success"]) == 12


def test_only_stock_filters(files):
    def stock(name, item):
        if isinstance(item, h5py.Dataset):
            assert item.compression in (None, "gzip") and not item.shuffle, name

    with h5py.File(files[0]) as f:
        f.visititems(stock)


# ---- files written by MolmoSpaces


@pytest.fixture
def peer_file(tmp_path):
    """A file like those of MolmoSpaces: LZF, no attributes, no names of videos."""
    house = tmp_path / "house_3"
    house.mkdir()
    T = 40
    with h5py.File(house / "trajectories_batch_1_of_1.h5", "w") as f:
        traj = f.create_group("traj_0")
        text = np.zeros((T, 2000), np.uint8)
        for t in range(T):
            row = json.dumps({"arm": [0.1 * t, float(t % 7)], "base": []}, separators=(",", ":")).encode()
            text[t, : len(row)] = list(row)
        for name in ("actions/joint_pos", "obs/agent/qpos", "obs/agent/qvel"):
            traj.create_dataset(name, data=text, compression="lzf")
        noise = np.random.default_rng(0).normal(size=(T, 7)).astype(np.float32)
        traj.create_dataset("obs/extra/tcp_pose", data=noise, compression="lzf")
        traj.create_dataset("obs/sensor_param/wrist_camera/intrinsic_cv", data=np.tile(np.eye(3), (T, 1, 1)), compression="lzf")
        for name in ("success", "fail", "terminated", "truncated"):
            traj.create_dataset(name, data=np.full(T, name == "fail"), compression="lzf")
        traj.create_dataset("rewards", data=np.zeros(T, np.float32), compression="lzf")
        traj["obs_scene"] = json.dumps({"task_type": "pick"})
    video = house / "episode_00000000_wrist_camera_batch_1_of_1.mp4"
    command = ["ffmpeg", "-v", "error", "-f", "lavfi", "-i", "testsrc=size=64x48:rate=10", "-frames:v", str(T), video]
    subprocess.run(command, check=True)
    return house / "trajectories_batch_1_of_1.h5", noise


def test_molmospaces_files_are_understood(record_fake, peer_file):
    path, noise = peer_file
    done = record_fake("verify", path.parent)
    assert "names no video of camera 'wrist_camera'" in done.stdout and "intact: 1 file, 1 episode, 40 observations" in done.stdout
    listing = record_fake("inspect", path).stdout
    line = next(row for row in listing.splitlines() if "tcp_pose" in row)
    assert f"{noise.mean():.4g}" in line and f"{noise.std():.4g}" in line
    assert "added 1 video name" in record_fake("repair", path.parent).stdout
    assert readers.validate(path) == [[]]
    assert record_fake("repair", path.parent).stdout == "nothing to repair\n"
    assert "1 video\n" in record_fake("verify", path.parent).stdout


# ---- detection of damage


def damage(path, name, change):
    with h5py.File(path, "r+") as f:
        dataset = f[name]
        values = dataset[()]
        change(values)
        dataset[...] = values


@pytest.mark.parametrize(
    "name, change, complaint",
    [
        ("traj_0/actions/joint_pos", lambda v: v[3].__setitem__(5, 0x7B), "joint_pos row 3 is not JSON text"),
        ("traj_1/fail", lambda v: v.__setitem__(2, False), "row 2 is not the opposite of success"),
        ("traj_1/obs/sensor_data/wrist_camera", lambda v: v.__setitem__(3, 0x58), "does not exist"),
        ("traj_0/rewards", lambda v: v.__setitem__(1, 7.5), "traj_0/rewards differs from what was recorded: its checksum is"),
    ],
)
def test_verify_finds_damage(record_fake, house, tmp_path, name, change, complaint):
    for path in house.iterdir():
        os.link(path, tmp_path / path.name)  # a hard link, because symbolic links are not followed
    copy = tmp_path / "trajectories_batch_1_of_2.h5"
    copy.unlink()
    copy.write_bytes((house / copy.name).read_bytes())
    damage(copy, name, change)
    done = record_fake("verify", tmp_path, check=False)
    assert done.returncode == 1 and complaint in done.stdout, done.stdout


def test_verify_finds_broken_videos(record_fake, house, tmp_path):
    for path in house.iterdir():
        (tmp_path / path.name).write_bytes(path.read_bytes())
    victims = sorted(tmp_path.glob("*_wrist_camera.mp4"))
    victims[0].write_bytes(victims[0].read_bytes()[:-400])
    victims[1].write_bytes(victims[5].read_bytes())
    done = record_fake("verify", tmp_path, check=False)
    assert done.returncode == 1
    first = f"'{victims[0].name}' "  # by ffmpeg 5, and by ffmpeg 9
    assert f"{first}cannot be read" in done.stdout or f"{first}has 0 frames" in done.stdout, done.stdout


def test_contact_sheet(record_fake, house, tmp_path):
    record_fake("sheet", house, tmp_path / "sheet.png")
    probe = readers.probe(tmp_path / "sheet.png")
    assert probe["codec_name"] == "png" and probe["width"] > 8 * 100

