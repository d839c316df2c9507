# SPDX-License-Identifier: Apache-2.0
"""Export to robomimic, RLDS, Zarr, Rerun and MCAP. MJSENSE_TEST_EXPORTS=1 makes environments with the formats' own readers."""

import json
import os
import shutil
import struct
import subprocess
import sys
from pathlib import Path

import h5py
import mujoco
import numpy as np
import pytest

import mjsense as mjs
from mjsense.core.optional import optional
from mjsense.core.png import png_of
from mjsense.core.rotations import quaternions_of
from mjsense.dataset.model_xml import model_xml
from mjsense.dataset.playback import Stepper
from mjsense.exporting import FORMATS, Source
from mjsense.exporting import zarr as zarr_format
from mjsense.exporting.images import depth_unit, to_uint16
from mjsense.exporting.scene import bodies

ROOT = Path(__file__).parents[2]
STATE = mujoco.mjtState.mjSTATE_INTEGRATION


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """Two episodes of 9 observations, images with an odd height."""
    out = tmp_path_factory.mktemp("data")
    mjs.record("pick", out=out, num_worlds=2, episodes=2, keep_failures=True, width=32, height=23, horizon=8, depth=True, shadows=False, seed=3)
    return out


@pytest.fixture(scope="module")
def source(root):
    return Source(root)


def reader(name, *packages):
    """The Python of the environment build/NAME; the test is skipped if it is not there and not wanted, or cannot be made."""
    folder = ROOT / f"build/{name}"
    if not (folder / "complete").exists():
        if os.environ.get("MJSENSE_TEST_EXPORTS", "0") == "0":
            pytest.skip(f"needs build/{name}; make it: MJSENSE_TEST_EXPORTS=1 ./dev test -k test_export_formats")
        subprocess.run([sys.executable, "-m", "venv", folder], check=True)
        # -I: packages on PYTHONPATH are not part of the environment.
        pip = [folder / "bin/python", "-I", "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries=1"]
        for group in packages:
            done = subprocess.run([*pip, *group], capture_output=True, text=True)
            if done.returncode:
                pytest.skip(f"pip cannot install {' '.join(group)}: {done.stderr.strip()[-300:]}")
        (folder / "complete").touch()
    return folder / "bin/python"


def run_reader(python, script, *arguments):
    done = subprocess.run([python, "-I", "-W", "ignore", Path(__file__).parent / f"export_readers/{script}", *arguments], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]
    return done.stdout.strip().splitlines()[-1]


# The model of an episode as MJCF


@pytest.mark.parametrize("task", ["pick", "open"])
def test_model_xml_simulates_as_the_model_of_the_episode(task, root, tmp_path):
    if task != "pick":
        root = tmp_path
        mjs.record(task, out=root, episodes=1, keep_failures=True, cameras=[], horizon=3, seed=5)
    for episode in mjs.Dataset(root).episodes:
        text, assets = model_xml(episode)
        model = mujoco.MjModel.from_xml_string(text, assets)
        exact = episode.model()
        for field in ("body_mass", "body_inertia", "body_pos", "geom_size", "geom_pos", "geom_quat", "geom_friction", "mat_rgba", "mat_texid"):
            np.testing.assert_allclose(getattr(model, field), getattr(exact, field), rtol=1e-6, atol=1e-8, err_msg=field)
        states = episode.states
        steppers = [Stepper(episode, m, mujoco.MjData(m)) for m in (model, exact)]
        for t in range(1, len(states)):
            ours, theirs = (stepper.step(states[t - 1], t) for stepper in steppers)
            # The compiler makes the convex hulls of all meshes in use; the simulated model has only those of the archive's.
            np.testing.assert_allclose(ours[: 1 + model.nq], theirs[: 1 + model.nq], atol=2e-3)


def test_model_xml_names_a_field_that_mjcf_cannot_express(root, monkeypatch):
    episode = mjs.Dataset(root).episodes[0]
    monkeypatch.setattr("mjsense.dataset.model_xml._set", lambda *_: None)
    with pytest.raises(ValueError, match=r"episode 0 \(trajectories_batch_1_of_1.h5, traj_0\): MJCF cannot express its .*geom_size"):
        model_xml(episode)


def test_model_xml_names_the_fields_of_a_model_that_mujoco_does_not_compile(root, monkeypatch):
    episode = mjs.Dataset(root).episodes[0]
    model = episode.model()
    model.geom_size[np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_BOX)[-1]] = 0
    monkeypatch.setattr("mjsense.dataset.playback.model_of", lambda _: model)
    monkeypatch.setattr("mjsense.dataset.playback.changed_fields", lambda _: ["geom_size"])
    with pytest.raises(ValueError, match=r"traj_0\): MJCF cannot express its geom_size: Error: size 0 must be positive in geom"):
        model_xml(episode)


# robomimic


def test_robomimic_file(root, source, tmp_path):
    out = mjs.exporting.export_robomimic(root, tmp_path / "pick.hdf5")
    with h5py.File(out) as file:
        data = file["data"]
        assert data.attrs["total"] == 16 and json.loads(data.attrs["env_args"])["env_name"] == "mjsense/Pick-Franka-v0"
        assert [list(file[f"mask/{name}"]) for name in ("train", "valid", "success")] == [[b"demo_0"], [b"demo_1"], []]
        for i, episode in enumerate(source.episodes):
            demo, rows = data[f"demo_{i}"], source.rows(episode)
            assert demo.attrs["num_samples"] == 8 and json.loads(demo.attrs["ep_meta"])["lang"] == episode.task
            np.testing.assert_array_equal(demo["actions"], rows["action"])
            np.testing.assert_array_equal(demo["rewards"], rows["reward"][:, 0])
            assert demo["dones"][:].tolist() == [0] * 7 + [1]
            for name, values in {"state": rows["state"], "wrist_camera_image": episode.video("wrist_camera")[:],
                                 "exo_camera_1_depth": episode.video("exo_camera_1_depth")[:][..., None]}.items():  # fmt: skip
                np.testing.assert_array_equal(demo[f"obs/{name}"], values[:-1])
                np.testing.assert_array_equal(demo[f"next_obs/{name}"], values[1:])


def test_robomimic_states_and_model_replay_in_plain_mujoco(root, source, tmp_path):
    out = mjs.exporting.export_robomimic(root, tmp_path / "pick.hdf5")
    with h5py.File(out) as file:
        for i, episode in enumerate(source.episodes):
            demo = file[f"data/demo_{i}"]
            model = mujoco.MjModel.from_xml_string(demo.attrs["model_file"], {name: bytes(content[:]) for name, content in demo.get("assets", {}).items()})
            data, objects = mujoco.MjData(model), episode["env_states/actors"]
            for t, (state, whole) in enumerate(zip(demo["states"], demo["integration_states"])):
                data.time, data.qpos[:], data.qvel[:] = state[0], state[1 : 1 + model.nq], state[1 + model.nq :]
                mujoco.mj_forward(model, data)
                for name, poses in objects.items():
                    if np.isfinite(poses[t]).all():
                        np.testing.assert_allclose(data.body(f"{name}/{name}").xpos, poses[t, :3], atol=1e-6)
                mujoco.mj_setState(model, data, whole, STATE)
                assert np.array_equal(data.qpos, episode.states[t, 1 : 1 + model.nq])


def test_robomimic_of_a_recording_without_data_for_replay(tmp_path):
    mjs.record("pick", out=tmp_path / "data", episodes=1, keep_failures=True, cameras=[], horizon=3, replay=False)
    with h5py.File(mjs.exporting.export_robomimic(tmp_path / "data", tmp_path / "out.hdf5")) as file:
        assert "states" not in file["data/demo_0"] and "model_file" not in file["data/demo_0"].attrs and len(file["data/demo_0/actions"]) == 3


def test_robomimic_reads_it(root, tmp_path):
    python = reader("robomimic", ["torch", "torchvision", "h5py", "numpy", "psutil", "tqdm", "termcolor", "six"], ["--no-deps", "robomimic==0.3.0"])
    assert run_reader(python, "read_robomimic.py", mjs.exporting.export_robomimic(root, tmp_path / "pick.hdf5")) == "read 8"


# RLDS


def test_png_is_lossless():
    av = pytest.importorskip("av")
    rng = np.random.default_rng(0)
    for image, form in ((rng.integers(0, 256, (5, 7, 3), np.uint8), "rgb24"), (rng.integers(0, 65536, (5, 7), np.uint16), "gray16be")):
        decoder = av.CodecContext.create("png", "r")
        frame = (decoder.decode(av.Packet(png_of(image))) + decoder.decode(None))[0]
        assert frame.format.name == form and np.array_equal(frame.to_ndarray(), image)


def test_rlds_files(root, source, tmp_path):
    checksum = pytest.importorskip("google_crc32c", reason="needs google-crc32c").value
    out = mjs.exporting.export_rlds(root, tmp_path / "pick")
    info = json.loads((out / "1.0.0/dataset_info.json").read_text())
    assert info["name"] == "pick" and info["splits"][0]["shardLengths"] == ["2"]
    content = (out / "1.0.0/pick-train.tfrecord-00000-of-00001").read_bytes()
    at, records = 0, []
    while at < len(content):
        (size,) = struct.unpack_from("<Q", content, at)
        for begin, end in ((at, at + 8), (at + 12, at + 12 + size)):
            crc = checksum(content[begin:end])
            assert struct.unpack_from("<I", content, end)[0] == ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF
        records.append(content[at + 12 : at + 12 + size])
        at += 16 + size
    assert len(records) == 2 and sum(map(len, records)) == int(info["splits"][0]["numBytes"])
    for record, episode in zip(records, source.episodes):
        assert source.rows(episode)["action"].astype("<f4").tobytes() in record
        assert png_of(episode.video("wrist_camera")[3]) in record and episode.task.encode() in record
    with pytest.raises(ValueError, match=r"'Pick It' cannot be the name of a data set of tensorflow-datasets; .*, such as 'pick_it'"):
        mjs.exporting.export_rlds(root, tmp_path / "Pick It")


def test_tensorflow_datasets_reads_rlds(root, source, tmp_path):
    pytest.importorskip("google_crc32c", reason="needs google-crc32c")
    python = reader("rlds", ["tensorflow-cpu==2.21.*", "tensorflow-datasets==4.9.10", "importlib_resources"])
    out = mjs.exporting.export_rlds(root, tmp_path / "pick")
    expected = {"episodes": np.array(2)}
    for i, episode in enumerate(source.episodes):
        rows = source.rows(episode)
        expected |= {f"{i}/action": rows["action"].astype(np.float32), f"{i}/reward": rows["reward"][:, 0], f"{i}/outcome": np.array(episode.outcome),
                     f"{i}/is_first": np.arange(8) == 0, f"{i}/is_last": np.arange(8) == 7,
                     f"{i}/language_instruction": np.array([episode.task.encode()] * 8),
                     f"{i}/observation/state": rows["state"][:-1].astype(np.float32)}  # fmt: skip
        for camera in source.cameras:
            depth = episode.video(f"{camera}_depth")
            expected[f"{i}/observation/{camera}"] = episode.video(camera)[:-1]
            expected[f"{i}/observation/{camera}_depth"] = to_uint16(depth[:-1], depth_unit(depth))[..., None]
    np.savez(tmp_path / "expected.npz", **expected)
    assert run_reader(python, "read_rlds.py", out, tmp_path / "expected.npz") == "read 2"


# Zarr


def test_zarr_is_a_replay_buffer(root, source, tmp_path):
    zarr = pytest.importorskip("zarr", reason="needs zarr 2")
    group = zarr.open(str(mjs.exporting.export_zarr(root, tmp_path / "pick.zarr")), "r")
    assert group["meta/episode_ends"][:].tolist() == [8, 16] and all(len(array) == 16 for array in group["data"].values())
    for i, episode in enumerate(source.episodes):
        part, rows = slice(8 * i, 8 * i + 8), source.rows(episode)
        np.testing.assert_array_equal(group["data/action"][part], rows["action"])
        np.testing.assert_array_equal(group["data/state"][part], rows["state"][:-1])
        np.testing.assert_array_equal(group["data/wrist_camera"][part], episode.video("wrist_camera")[:-1])
        np.testing.assert_array_equal(group["data/wrist_camera_depth"][part], episode.video("wrist_camera_depth")[:-1])
    assert group.attrs["names"]["action"][-1] == "gripper_0" and group.attrs["episodes"][1]["outcome"] == source.episodes[1].outcome


def test_zarr_of_parts(source, tmp_path, monkeypatch):
    """Chunks of three images: some lie in one part and are moved, one contains rows of both."""
    pytest.importorskip("zarr", reason="needs zarr 2")
    monkeypatch.setattr(zarr_format, "_CHUNK_BYTES", 3 * 32 * 23 * 3)
    parts = []
    for i in range(2):
        parts.append(tmp_path / str(i))
        zarr_format.write(source.part(i, i + 1), parts[-1])
    assert {path.name for path in (parts[1] / "data/wrist_camera").glob("[0-9]*")} == {"2.0.0.0", "3.0.0.0", "4.0.0.0", "5.0.0.0"}
    zarr_format.join(source, parts, tmp_path / "joined")
    zarr_format.write(source, tmp_path / "whole")
    files = [{str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*") if p.is_file()} for out in (tmp_path / "joined", tmp_path / "whole")]
    assert files[0] == files[1]


# The scene, Rerun and MCAP


def test_bodies_of_the_scene(source):
    episode = source.episodes[0]
    shown = {body.name: body for body in bodies(episode)}
    assert len(shown["room/table"].shapes) > 1 and not shown["room/table"].moves and shown["robot_0/fr3_link5"].moves
    cube = shown["blue_cube/blue_cube"]
    np.testing.assert_allclose(cube.positions, episode["env_states/actors/blue_cube"][:, :3], atol=1e-6)
    np.testing.assert_allclose(cube.quats, episode["env_states/actors/blue_cube"][:, 3:7], atol=1e-6)
    assert {shape.kind for body in shown.values() for shape in body.shapes} <= {"box", "ellipsoid", "cylinder", "capsule", "mesh"}


def test_quaternions_of_rotations():
    for quat in ([1, 0, 0, 0], [0, 1, 0, 0], [0, 0.6, 0.8, 0], [0.5, -0.5, 0.5, -0.5], [0.1, 0.7, -0.1, 0.7]):
        matrix, back = np.empty(9), np.empty(9)
        mujoco.mju_quat2Mat(matrix, np.array(quat) / np.linalg.norm(quat))
        mujoco.mju_quat2Mat(back, quaternions_of(matrix.reshape(1, 3, 3))[0])
        np.testing.assert_allclose(back, matrix, atol=1e-12)


def test_rerun_files_are_valid(root, tmp_path):
    rerun_cli = pytest.importorskip("rerun_cli", reason="needs rerun-sdk")
    out = mjs.exporting.export_rerun(root, tmp_path / "rerun")
    files = sorted(out.iterdir())
    assert [file.name for file in files] == ["episode_00000000.rrd", "episode_00000001.rrd"]
    program = Path(rerun_cli.__file__).parent / "rerun"
    done = subprocess.run([program, "rrd", "verify", *files], capture_output=True, text=True, env={**os.environ, "HOME": str(tmp_path)})
    assert done.returncode == 0 and "2 files verified without error" in done.stdout + done.stderr
    done = subprocess.run([program, "rrd", "print", files[0]], capture_output=True, text=True, env={**os.environ, "HOME": str(tmp_path)})
    for entity in ("/world/cameras/wrist_camera/colour", "/world/cameras/exo_camera_1/depth", "/features/action", "/task", "blue_cube.blue_cube"):
        assert entity in done.stdout, entity


def with_videos(root, folder, b_frames):
    """A copy of a recording whose videos are encoded with this number of B-frames."""
    av = pytest.importorskip("av")
    shutil.copytree(root, folder)
    for episode in mjs.Dataset(root).episodes:
        for camera in Source(root).cameras:
            video = episode.video(camera)
            with av.open(str(folder / video.path.relative_to(root)), "w") as container:
                stream = container.add_stream("libx264", rate=video.fps, options={"bf": str(b_frames), "crf": "10", "g": "5"})
                stream.width, stream.height, stream.pix_fmt = 32, 24, "yuv420p"
                for frame in video[:]:
                    container.mux(stream.encode(av.VideoFrame.from_ndarray(np.pad(frame, ((0, 1), (0, 0), (0, 0)), "edge"), format="rgb24")))
                container.mux(stream.encode(None))
    for path in folder.rglob("*.h5"):
        with h5py.File(path, "r+") as file:
            videos: list[h5py.Dataset] = []
            file.visititems(lambda name, item, found=videos: found.append(item) if "/sensor_data/" in name else None)
            for video in videos:  # their checksums are those of the recorder's files
                video.attrs.pop("crc32", None)
    return folder


def test_mcap_files(root, tmp_path):
    av = pytest.importorskip("av")
    reading, decoding = (pytest.importorskip(name, reason="needs mcap-protobuf-support") for name in ("mcap.reader", "mcap_protobuf.decoder"))
    pytest.importorskip("foxglove_schemas_protobuf")
    data = with_videos(root, tmp_path / "data", 0)
    out, source = mjs.exporting.export_mcap(data, tmp_path / "out"), Source(data)
    for episode in source.episodes:
        with open(out / f"episode_{episode.index:08d}.mcap", "rb") as file:
            reader = reading.make_reader(file, validate_crcs=True, decoder_factories=[decoding.DecoderFactory()])
            assert next(reader.iter_metadata()).metadata["task"] == episode.task
            times: dict[str, list[int]] = {}
            for _, channel, message in reader.iter_messages():
                times.setdefault(channel.topic, []).append(message.log_time)
            assert times["/state"] == [t * 66_000_000 for t in range(9)] and times["/action"] == times["/state"][:-1]
            cameras = [f"/cameras/wrist_camera/{topic}" for topic in ("video", "depth", "calibration")]
            assert all(times[topic] == times["/state"] for topic in [*cameras, "/joint_states", "/tf"]) and times["/scene"] == [0]

            decoder, frames = av.CodecContext.create("h264", "r"), []
            for _, _, _, message in reader.iter_decoded_messages(topics=[cameras[0]]):
                assert message.format == "h264" and message.data.startswith(b"\0\0\0\1")
                frames += decoder.decode(av.Packet(message.data))
            frames += decoder.decode(None)
            found = np.stack([frame.to_ndarray(format="rgb24")[:23] for frame in frames])
            np.testing.assert_array_equal(found, episode.video("wrist_camera")[:])
            for t, (_, _, _, message) in enumerate(reader.iter_decoded_messages(topics=[cameras[1]])):
                assert np.array_equal(np.frombuffer(message.data, "<f4").reshape(23, 32), episode.video("wrist_camera_depth")[t])
            shown = next(reader.iter_decoded_messages(topics=["/scene"]))[3]
            frame_ids = {f"body/{body.name}" for body in bodies(episode)}
            assert {entity.frame_id for entity in shown.entities} == frame_ids
            first = next(reader.iter_decoded_messages(topics=["/tf"]))[3]
            assert {transform.child_frame_id for transform in first.transforms} == frame_ids | set(source.cameras)


def test_mcap_refuses_b_frames_or_encodes_again(root, tmp_path):
    pytest.importorskip("mcap_protobuf", reason="needs mcap-protobuf-support")
    pytest.importorskip("foxglove_schemas_protobuf")
    reading, decoding = (pytest.importorskip(name) for name in ("mcap.reader", "mcap_protobuf.decoder"))
    av = pytest.importorskip("av")
    data = with_videos(root, tmp_path / "data", 2)
    with pytest.raises(ValueError, match=r"\.mp4 has B-frames, which .* record without B-frames, or pass encode_again=True"):
        mjs.exporting.export_mcap(data, tmp_path / "out")
    assert not (tmp_path / "out").exists() and not (tmp_path / "out.part").exists()
    out = mjs.exporting.export_mcap(data, tmp_path / "out", encode_again=True)
    with open(out / "episode_00000000.mcap", "rb") as file:
        reader = reading.make_reader(file, decoder_factories=[decoding.DecoderFactory()])
        decoder = av.CodecContext.create("h264", "r")
        messages = [message for *_, message in reader.iter_decoded_messages(topics=["/cameras/wrist_camera/video"])]
        frames = [frame for message in messages for frame in decoder.decode(av.Packet(message.data))] + decoder.decode(None)
    found = np.stack([frame.to_ndarray(format="rgb24")[:23] for frame in frames]).astype(float)
    assert len(messages) == 9 and np.abs(found - mjs.Dataset(data).episodes[0].video("wrist_camera")[:]).mean() < 3


# The command


def test_command_exports(root, tmp_path):
    run = [sys.executable, "-m", "mjsense", "export"]
    done = subprocess.run([*run, "robomimic", root, tmp_path / "a.hdf5", "--episodes", "1"], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout == f"Wrote {tmp_path / 'a.hdf5'}.\n", done.stderr
    with h5py.File(tmp_path / "a.hdf5") as file:
        assert list(file["data"]) == ["demo_0"]
    done = subprocess.run([*run, "robomimic", root, tmp_path / "b.hdf5", "--encode-again"], capture_output=True, text=True)
    assert done.returncode == 2 and "--encode-again is an option of the format mcap" in done.stderr


@pytest.mark.parametrize("name", [name for name in FORMATS if name != "robomimic"])  # whose library reads recordings, too
def test_a_missing_library_is_an_error_with_the_extra(name, root, tmp_path, monkeypatch):
    module = FORMATS[name].library
    for loaded in [m for m in sys.modules if m == module or m.startswith(f"{module}.")]:
        monkeypatch.delitem(sys.modules, loaded)
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ModuleNotFoundError, match=rf"pip install 'mjsense\[{FORMATS[name].extra}\]'"):
        mjs.export(root, tmp_path / "out", format=name)


def test_a_package_that_cannot_be_imported_is_an_error_that_names_it(tmp_path, monkeypatch):
    (tmp_path / "zarr").mkdir()
    (tmp_path / "zarr/__init__.py").write_text("from json import cbuffer_sizes")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "zarr", raising=False)
    with pytest.raises(ImportError, match=r"This export needs zarr, which is installed but cannot be imported: .*cbuffer_sizes.*pip install 'mjsense\[zarr\]'"):
        optional("zarr", "zarr", "This export")
