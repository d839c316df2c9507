# SPDX-License-Identifier: Apache-2.0
"""Recordings of sensors and of any Gymnasium environment."""

from mjsense.recording.record_episodes import RecordEpisodes, RecordVectorEpisodes
from mjsense.recording.recorder import Recorder

__all__ = ["RecordEpisodes", "RecordVectorEpisodes", "Recorder"]
