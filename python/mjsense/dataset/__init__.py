# SPDX-License-Identifier: Apache-2.0
"""Reading of recordings: rows and frames, statistics, replay in MuJoCo, and rendering again. h5py is imported at the first access
to a file."""

from mjsense.dataset.dataset import Dataset
from mjsense.dataset.deviation import Deviation
from mjsense.dataset.episode import Episode
from mjsense.dataset.quality import EpisodeQuality
from mjsense.dataset.rendering import RenderProgress, RenderSummary, render
from mjsense.dataset.replay_check import EpisodeCheck, ReplayReport, check_replay, replay
from mjsense.dataset.sensor_check import SensorCheck
from mjsense.dataset.streams import Stream
from mjsense.dataset.video import Video

__all__ = [
    "Dataset",
    "Deviation",
    "Episode",
    "EpisodeCheck",
    "EpisodeQuality",
    "RenderProgress",
    "RenderSummary",
    "ReplayReport",
    "SensorCheck",
    "Stream",
    "Video",
    "check_replay",
    "render",
    "replay",
]
