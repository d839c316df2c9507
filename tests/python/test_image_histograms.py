# SPDX-License-Identifier: Apache-2.0
"""Histograms of the images of an episode, which the recorder counts, and the statistics of exports that use them."""

import json

import gymnasium
import h5py
import numpy as np
import pytest

pytest.importorskip("av")
pytest.importorskip("pyarrow")

import mjsense as mjs
from mjsense.dataset import Episode, statistics
from mjsense.exporting import frame_statistics
from mjsense.exporting.frame_statistics import image_histograms

HEIGHT, WIDTH, STEP, LENGTH = 46, 332, 3, 25  # every third row and column: 111 of 332 columns


def image(episode, t):
    """A pattern that differs between all images of a recording, with colours that a video can store."""
    y, x = np.indices((HEIGHT, WIDTH))
    grey = 40 + x // 3 + 2 * t
    return np.stack([grey, grey + y // 2, grey + 5 * episode], 2).astype(np.uint8)


class Patterns(gymnasium.Env):
    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}
    observation_space = action_space = gymnasium.spaces.Box(-1, 1, (1,))
    render_mode = "rgb_array"

    def __init__(self):
        self.episode = -1

    def reset(self, *, seed=None, options=None):
        self.episode, self.t = self.episode + 1, 0
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.t += 1
        return np.zeros(1, np.float32), 0.0, self.t == LENGTH - 1 + self.episode, False, {}

    def render(self):
        return image(self.episode, self.t)


@pytest.fixture
def root(tmp_path):
    """Two episodes of 25 and 26 observations."""
    env = mjs.RecordEpisodes(Patterns(), tmp_path / "data", 2, cameras={"view": "render"})
    while not env.recording.complete:
        env.reset()
        while not env.step(np.zeros(1, np.float32))[2]:
            pass
    env.close()
    return tmp_path / "data"


def expected_histogram(episode):
    return statistics.histograms(image(episode, t)[::STEP, ::STEP] for t in range(LENGTH + episode))[0]


def test_every_raw_image_is_counted(root):
    for number, episode in enumerate(mjs.Dataset(root).episodes):
        np.testing.assert_array_equal(episode.image_histogram("view"), expected_histogram(number))


@pytest.mark.parametrize("export", (mjs.exporting.export_lerobot, mjs.exporting.export_lerobot21))
def test_statistics_of_all_images_without_decoding(export, root, tmp_path, monkeypatch):
    monkeypatch.setattr(frame_statistics, "_decoded", None)
    out = export(root, tmp_path / "out")
    found = json.loads((out / "meta/stats.json").read_text())["observation.images.view"]
    exact = np.concatenate([image(e, t)[::STEP, ::STEP].reshape(-1, 3) for e in range(2) for t in range(LENGTH + e)]) / 255
    for name, value in {"mean": exact.mean(0), "std": exact.std(0), "min": exact.min(0), "max": exact.max(0)}.items():
        np.testing.assert_allclose(np.ravel(found[name]), value, atol=1e-9)
    for name, q in statistics.QUANTILES.items():
        np.testing.assert_allclose(np.ravel(found[name]), np.quantile(exact, q, axis=0), atol=1e-9)
    assert found.get("count") == ([2 * LENGTH + 1] if export is mjs.exporting.export_lerobot else None)  # GR00T's loader expects one number for each of a column
    decoded = statistics.of_images(frame for episode in mjs.Dataset(root).episodes for frame in episode.video("view")[:])
    for name in decoded.keys() - {"count", "min", "max"}:
        np.testing.assert_allclose(found[name], decoded[name], atol=3 / 255, err_msg=name)


def test_key_frames_of_recordings_without_histograms(root):
    with h5py.File(next(root.glob("house_0/*.h5")), "r+") as file:
        del file["traj_0/obs/sensor_data/view"].attrs["histogram"]
    episode = mjs.Dataset(root).episodes[0]
    assert episode.image_histogram("view") is None
    counts, images = image_histograms(episode, "view")
    assert 1 < images < LENGTH and counts.sum() == images * 3 * 16 * 111


def test_images_that_are_left_of_a_trimmed_episode(root):
    whole = mjs.Dataset(root).episodes[0]
    episode = Episode(whole._entry, 0, whole._store, [0, 3, 4])
    assert episode.image_histogram("view") is None
    counts, images = image_histograms(episode, "view")
    expected, _ = statistics.histograms(whole.video("view")[t][::STEP, ::STEP] for t in (0, 3, 4))
    assert images == 3
    np.testing.assert_array_equal(counts, expected)


@pytest.mark.parametrize("copy", (True, False))
def test_rendering_again_keeps_or_counts_them(copy, tmp_path):
    """Images that are rendered again equal the recorded ones."""
    mjs.record("pick", out=tmp_path / "data", episodes=1, horizon=3, keep_failures=True, width=32, height=24)
    mjs.render(tmp_path / "data", tmp_path / "again", copy=copy)
    ours, theirs = (mjs.Dataset(tmp_path / name).episodes[0] for name in ("again", "data"))
    for camera in ("wrist_camera", "exo_camera_1"):
        found = ours.image_histogram(camera)
        assert found is not None and found.sum() == 4 * 3 * 32 * 24
        np.testing.assert_array_equal(found, theirs.image_histogram(camera))
