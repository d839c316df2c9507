# SPDX-License-Identifier: Apache-2.0
"""``record --format lerobot``: a recording that is converted to LeRobot v3.0 while it is made.

The recording is made in the folder ``OUT.recording`` as always, so it is crash-safe and can be resumed. A thread adds each published HDF5
file to the data set ``OUT.part``, which is renamed to ``OUT`` when the recording is complete. After a crash the data set is
written again from the beginning; the statistics of images, which take most of the time, are kept next to the recording.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np

from mjsense.dataset.files import BATCH
from mjsense.export.frame_statistics import DEFAULT_FRAMES, frame_histograms
from mjsense.export.lerobot import Writer
from mjsense.export.mapping import Source
from mjsense.export.output import needs, new_output

_PERIOD_S = 0.3


class CompleteError(FileExistsError):
    """The data set was complete before."""


@contextlib.contextmanager
def converted(out: str | Path, *, resume: bool = False, map: Any = None, keep_recording: bool = False) -> Iterator[Path]:
    """A folder to record to. At the end of the block the recording becomes the LeRobot data set ``out``, if it is complete.

    Args:
        out: Folder of the data set.
        resume: Whether the recording may exist.
        map: Features and cameras, as in :func:`mjsense.export_lerobot`.
        keep_recording: Keep the recording, ``OUT.recording``, when the data set is complete.

    Raises:
        CompleteError: ``resume`` is True, and the data set is complete.
        FileExistsError: ``resume`` is False, and ``out`` or ``OUT.recording`` exists.
    """
    final = Path(out)
    folder, removed = (final.with_name(f"{final.name}{end}") for end in (".recording", ".removed"))
    for module in ("av", "pyarrow"):
        needs(module)
    shutil.rmtree(removed, ignore_errors=True)
    if final.is_dir() and any(final.iterdir()):
        if not resume:
            raise FileExistsError(f"{final} exists; name another output, or delete it")
        _remove(folder, removed, keep_recording)
        raise CompleteError(f"{final} is complete")
    if folder.exists() and not resume:
        raise FileExistsError(f"{folder} contains an unfinished recording: continue it with resume (--resume), or delete it")
    conversion = _Conversion(folder, final, map)
    conversion.start()
    try:
        yield folder
    finally:
        conversion.end()
    if final.exists():
        _remove(folder, removed, keep_recording)


def _remove(folder: Path, removed: Path, keep: bool) -> None:
    """Removes a recording so that a crash leaves nothing that looks like one."""
    if not keep and folder.exists():
        folder.rename(removed)
        shutil.rmtree(removed)


class _Conversion(threading.Thread):
    """Writes the data set while the recording grows."""

    def __init__(self, recording: Path, out: Path, map: Any) -> None:
        super().__init__(name="mjsense-lerobot", daemon=True)
        self._recording, self._out, self._map = recording, out, map
        self._ended, self._error = threading.Event(), None

    def end(self) -> None:
        """Waits for the rest of the conversion. Raises its error."""
        self._ended.set()
        self.join()
        if self._error is not None:
            raise self._error

    def run(self) -> None:
        try:
            while not self._files() and not self._ended.wait(_PERIOD_S):
                pass
            if self._files():
                self._convert()
        except Exception as error:
            self._error = error

    def _files(self) -> list[Path]:
        """Published HDF5 files, in the order of their batches."""
        found = ((match, path) for path in self._recording.glob("house_*/*.h5") if (match := BATCH.fullmatch(path.name)))
        return [path for _, path in sorted((int(match[1]), path) for match, path in found)]

    def _complete(self) -> bool:
        return not any(self._recording.glob("house_*/.recording"))

    def _convert(self) -> None:
        with contextlib.suppress(_UnfinishedError), new_output(self._out) as path:
            writer: Writer | None = None
            abouts: list[tuple[Any, ...]] = []
            done: list[Path] = []
            while True:
                ended = self._ended.is_set()
                files = self._files()
                for number, file in enumerate(files):
                    if number < len(done):
                        continue
                    if int(BATCH.fullmatch(file.name)[1]) != number + 1 and not ended:  # pyright: ignore[reportOptionalSubscript]
                        break
                    done.append(file)
                    try:
                        source = Source(file, map=self._map)
                    except ValueError:  # no episode with a step
                        continue
                    writer = writer or Writer(source, path, DEFAULT_FRAMES, self._histograms)
                    abouts.append((source.features, source.cameras, source.fps, source.robot))
                    for episode in source.episodes:
                        writer.add(episode, source)
                if ended:
                    break
                self._ended.wait(_PERIOD_S)
            if not self._complete():
                raise _UnfinishedError
            if writer is None or any(about != abouts[0] for about in abouts) or done != files:
                # Files have different features, for example because a move group never acts in one: only all together decide them.
                shutil.rmtree(path, ignore_errors=True)
                whole = Source(self._recording, map=self._map)
                writer = Writer(whole, path, DEFAULT_FRAMES, self._histograms)
                for episode in whole.episodes:
                    writer.add(episode)
            writer.close()
            _sync(path)

    def _histograms(self, path: Path, length: int, frames: int | Literal["key"]) -> tuple[np.ndarray, int]:
        """The histograms of a video, kept in a file."""
        kept = self._recording / f"statistics/{path.parent.name}_{path.name}.npy"
        with contextlib.suppress(FileNotFoundError, ValueError, EOFError):
            counts = np.load(kept)
            return counts[:3], int(counts[3, 0])
        counts, images = frame_histograms(path, length, frames)
        kept.parent.mkdir(parents=True, exist_ok=True)
        part = kept.with_suffix(".part")
        with part.open("wb") as file:
            np.save(file, np.concatenate([counts, np.full((1, counts.shape[1]), images)]))
            file.flush()
            os.fsync(file.fileno())
        part.rename(kept)
        return counts, images


class _UnfinishedError(Exception):
    """The recording was interrupted."""


def _sync(folder: Path) -> None:
    """Writes all files to the disk: the recording may be removed next."""
    for path in (folder, *folder.rglob("*")):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)
