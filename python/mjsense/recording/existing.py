# SPDX-License-Identifier: Apache-2.0
"""Folders that already have a recording."""

from __future__ import annotations

from pathlib import Path


def require_no_recording(house: Path, *offered: str) -> None:
    """Refuses a folder with a recording before the work begins.

    The recorder does the same later, and its message names all options of recordings.

    Args:
        house: The folder ``house_N`` to write.
        offered: What the caller offers instead: ``"resume it"``.
    """
    if any(house.glob("trajectories_batch_*.h5")):
        found = "recorded trajectories"
    elif (house / ".recording/recording.json").exists():
        found = "an unfinished recording"
    else:
        return
    raise ValueError(f"'{house}' already contains {found}; {', '.join(offered)}, or choose another directory")
