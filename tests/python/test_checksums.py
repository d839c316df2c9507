# SPDX-License-Identifier: Apache-2.0
"""Readers compare what they read with the checksums in the files, and arrays that they return belong to the caller."""

import shutil

import h5py
import numpy as np
import pytest
from edited_recordings import changed, file_of

pytest.importorskip("av")

import mjsense as mjs
from mjsense.exporting import export_lerobot, export_robomimic

CAMERA = "wrist_camera"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "data"
    mjs.record("pick", out=out, episodes=2, horizon=4, keep_failures=True, width=32, height=24, cameras=[CAMERA], depth=True, segmentation=True, seed=5, progress=False)
    return out


@pytest.fixture
def root(made, tmp_path):
    return shutil.copytree(made, tmp_path / "data")


def every(root):
    return [dataset[i] for dataset in [mjs.Dataset(root)] for i in range(len(dataset))]


@pytest.mark.parametrize("stream", ["obs/extra/tcp_pose", "numbers/obs/agent/qpos/arm", "rewards", "success"])
def test_a_changed_number_is_noticed(root, tmp_path, stream):
    """A change that leaves the file whole for the HDF5 library."""
    with h5py.File(file_of(root), "a") as file:
        rows = file[f"traj_0/{stream}"]
        values = rows[:]
        values.view(np.uint8).ravel()[-1] ^= 1
        rows[:] = values
    text = rf"{file_of(root).name} traj_0/{stream} differs from what was recorded: its checksum is not .*`mjsense verify` lists"
    features = {"map": {"features": {"tool": "obs/extra/tcp_pose"}}}
    for read in (every, lambda root: mjs.Dataset(root).episodes[0][stream.removeprefix("numbers/")],
                 lambda root: export_robomimic(root, tmp_path / "out.hdf5", **features)):  # fmt: skip
        with pytest.raises(ValueError, match=text):
            read(root)
    with changed(file_of(root)):  # removes the checksums
        pass
    assert every(root)


def test_a_changed_instruction_is_noticed(root):
    with h5py.File(file_of(root), "a") as file:
        text = file["traj_0/obs_scene"][()]
        attributes = dict(file["traj_0/obs_scene"].attrs)
        del file["traj_0/obs_scene"]
        file["traj_0"].create_dataset("obs_scene", data=text.replace(b"Pick", b"Drop"))
        file["traj_0/obs_scene"].attrs.update(attributes)
    with pytest.raises(ValueError, match=r"traj_0/obs_scene differs from what was recorded"):
        _ = mjs.Dataset(root).episodes[0].task


@pytest.mark.parametrize("without_av", [False, True])
@pytest.mark.parametrize("damage", ["bit", "swapped"])
@pytest.mark.parametrize("kind", ["mp4", "mkv"])
def test_a_changed_video_is_noticed(root, tmp_path, monkeypatch, kind, damage, without_av):
    monkeypatch.setattr("mjsense.dataset.video.have_av", lambda: not without_av)
    first, second = sorted(root.glob(f"house_0/*.{kind}"))
    if damage == "swapped":
        moved = first.rename(tmp_path / "moved")
        second.rename(first)
        moved.rename(second)
    else:
        data = bytearray(first.read_bytes())
        data[-len(data) // 2] ^= 16
        first.write_bytes(data)
    text = rf"{first.name} differs from what was recorded: its checksum is "
    for read in (every, lambda root: export_lerobot(root, tmp_path / "out")) if kind == "mp4" else (every,):
        with pytest.raises(RuntimeError, match=text):
            read(root)


def test_a_video_that_changes_while_it_is_read(root):
    """The table of its packets is that of another file."""
    video = mjs.Dataset(root, cache_mb=0).episodes[0].video(CAMERA)
    first = video[0]
    data = video.path.read_bytes()
    video.path.unlink()
    video.path.write_bytes(data)
    with pytest.raises(RuntimeError, match=r"mp4: changed while it was being read"):
        video[3]
    assert (mjs.Dataset(root).episodes[0].video(CAMERA)[0] == first).all()


@pytest.mark.parametrize("without_av", [False, True])
def test_arrays_that_are_handed_out_belong_to_the_caller(root, monkeypatch, without_av):
    """Neither the values nor the shape, type and strides of an array change what later readers get."""
    monkeypatch.setattr("mjsense.dataset.video.have_av", lambda: not without_av)
    dataset = mjs.Dataset(root, streams=["obs", "actions", "replay"])
    episode = dataset.episodes[0]

    def values():
        found = {f"sample {name}": value for name, value in dataset[1].items()}
        found |= {name: episode[name] for name in episode.streams}
        return found | {"states": episode.states, "frame": episode.video(CAMERA)[1], "histogram": episode.image_histogram(CAMERA)}

    before = {name: (value.copy() if isinstance(value, np.ndarray) else value) for name, value in values().items()}
    for value in values().values():
        if isinstance(value, np.ndarray) and value.size:
            value.fill(0)
            value.shape = (value.size,)
            if value.dtype.kind == "f":
                value.dtype = np.uint8
    for name, value in values().items():
        np.testing.assert_array_equal(value, before[name], err_msg=name)
        assert not isinstance(value, np.ndarray) or (value.dtype, value.shape, value.strides) == (before[name].dtype, before[name].shape, before[name].strides)
    scene, settings = episode.obs_scene, episode.settings
    scene["instruction"] = settings["task"] = "other"
    scene.setdefault("objects", {}).clear()
    assert episode.obs_scene["objects"] and episode.task != "other" and episode.settings["task"] == "pick"
    episode.streams.clear()
    assert episode.streams
