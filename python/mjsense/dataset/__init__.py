# SPDX-License-Identifier: Apache-2.0
"""Reading of recordings: rows and frames, statistics, and replay in MuJoCo. h5py is imported at the first access to a file."""

from mjsense.dataset.dataset import Dataset
from mjsense.dataset.episode import Episode, Stream
from mjsense.dataset.replay_check import Deviation, EpisodeCheck, ReplayReport, check_replay, replay
from mjsense.dataset.video import Video

__all__ = ["Dataset", "Deviation", "Episode", "EpisodeCheck", "ReplayReport", "Stream", "Video", "check_replay", "replay"]
