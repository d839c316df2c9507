# SPDX-License-Identifier: Apache-2.0
"""``record --format lerobot``: a recording that is converted to another format while it is made.

The recording is made in the folder ``OUT.recording`` as always, so it is crash-safe and can be resumed. A thread adds each
published HDF5 file to a data set in the folder ``OUT.part``, which is renamed to ``OUT`` when the recording is complete. After a
crash the data set is written again from the beginning, which takes little time, because the recording contains the videos and the
histograms of their images.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from mjsense.dataset.files import BATCH
from mjsense.exporting.formats import FORMATS, format_of, module_of
from mjsense.exporting.mapping import Mapping, Source
from mjsense.exporting.output import complete_output, needs, part_of

_PERIOD_S = 0.3
_HOUSE = re.compile(r"house_\d+")


class CompleteError(FileExistsError):
    """The data set was complete before."""


@contextlib.contextmanager
def converted(
    out: str | Path,
    *,
    format: str = "lerobot",
    resume: bool = False,
    map: Any = None,
    trim_idle: bool | None = None,
    keep_recording: bool = False,
    quiet: bool = False,
) -> Iterator[Path]:
    """A folder to record to. At the end of the block the recording becomes the data set ``out``, if it is complete.

    Args:
        out: Folder of the data set.
        format: Name of a format that is written while the recording is made.
        resume: Whether the recording may exist.
        map: Features and cameras, as in :func:`mjsense.exporting.export_lerobot`.
        trim_idle: Leave out idle steps, as in :func:`mjsense.exporting.export_lerobot`.
        keep_recording: Keep the recording, ``OUT.recording``, when the data set is complete.
        quiet: Do not print how many steps are left out.

    Raises:
        CompleteError: ``resume`` is True, and the data set is complete.
        FileExistsError: ``resume`` is False, and ``out`` or ``OUT.recording`` exists; or another process writes ``out``.
        FileNotFoundError, ValueError: ``map`` is not a mapping, or ``format`` cannot be written during a recording.
    """
    final, mapping = Path(out), Mapping.of(map)
    if not format_of(format).while_recording:
        known = ", ".join(name for name, one in FORMATS.items() if one.while_recording)
        raise ValueError(
            f"format '{format}' cannot be written during a recording, only {known}: record first, and export the recording"
        )
    for module in ("av", format_of(format).library):
        needs(module, format_of(format).extra)
    writer = module_of(format).Writer
    options = {"map": mapping, "trim_idle": trim_idle, "whole_rate": True}
    with part_of(final) as part, _converted(writer, final, part, resume, options, keep_recording, quiet) as folder:
        yield folder


@contextlib.contextmanager
def _converted(
    writer: Any, final: Path, part: Path, resume: bool, options: dict[str, Any], keep_recording: bool, quiet: bool
) -> Iterator[Path]:
    folder = final.with_name(f"{final.name}.recording")
    if final.is_dir() and any(final.iterdir()):
        if not resume or not (final / writer.LAST_FILE).exists():
            raise FileExistsError(f"{final} exists; name another output, or delete it")
        _remove(folder, part, keep_recording)
        raise CompleteError(f"{final} is complete")
    if folder.exists() and not resume:
        raise FileExistsError(f"{folder} contains an unfinished recording: continue it with resume (--resume), or delete it")
    conversion = _Conversion(writer, folder, final, part, options)
    conversion.start()
    try:
        yield folder
    finally:
        conversion.end()
    if final.exists():
        if conversion.writer is not None and not quiet:
            conversion.writer.print_notes()
        _remove(folder, part, keep_recording)


def _remove(folder: Path, part: Path, keep: bool) -> None:
    """Removes a recording so that a crash leaves nothing that looks like one. A folder that contains anything else stays."""
    if not keep and folder.exists() and all(_HOUSE.fullmatch(path.name) for path in folder.iterdir()):
        folder.rename(part / "removed")
        shutil.rmtree(part / "removed")


class _Conversion(threading.Thread):
    """Writes the data set while the recording grows."""

    def __init__(self, writer: Any, recording: Path, out: Path, part: Path, options: dict[str, Any]) -> None:
        super().__init__(name="mjsense-conversion", daemon=True)
        self._new_writer = writer
        self._recording, self._out, self._part, self._options = recording, out, part, options
        self.writer: Any = None
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
        with contextlib.suppress(_UnfinishedError), complete_output(self._out, self._part) as path:
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
                        source = Source(file, **self._options)
                    except ValueError:  # no episode with a step
                        continue
                    self.writer = self.writer or self._new_writer(source, path)
                    abouts.append((source.features, source.cameras, source.fps, source.robot))
                    for episode in source.episodes:
                        self.writer.add(episode, source)
                if ended:
                    break
                self._ended.wait(_PERIOD_S)
            if not self._complete():
                raise _UnfinishedError
            if self.writer is None or any(about != abouts[0] for about in abouts) or done != files:
                # Files have different features, for example because a move group never acts in one: only all together decide
                # them.
                shutil.rmtree(path, ignore_errors=True)
                whole = Source(self._recording, **self._options)
                self.writer = self._new_writer(whole, path)
                for episode in whole.episodes:
                    self.writer.add(episode)
            self.writer.close()
            _sync(path)


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
