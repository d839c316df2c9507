# SPDX-License-Identifier: Apache-2.0
"""One line of progress on stderr, for work that takes long."""

from __future__ import annotations

import math
import os
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import Any, TextIO, TypeVar

T = TypeVar("T")
_PERIOD = 0.1  # s between two updates of a line that is overwritten
_LOG_PERIOD = 10.0  # s between two lines of a file
_MARK_PERIOD = 1.0  # s between two lines of a file that say something new


def interactive() -> bool:
    """Whether stderr is a terminal, or the output of a notebook, so that a line can be overwritten."""
    return sys.stderr is not None and (sys.stderr.isatty() or type(sys.stderr).__module__.startswith("ipykernel."))


class ProgressLine:
    """A line that is overwritten; where that is impossible, a new line every ten seconds, or when the work has reached a mark."""

    def __init__(self) -> None:
        self._overwrite = interactive()
        self._shown, self._latest, self._at, self._mark = "", "", -math.inf, None

    def show(self, text: str, mark: Any = None, *, last: bool = False) -> None:
        """Shows the text, unless the one before is very recent.

        Args:
            mark: The state of the work, such as the number of ended episodes. Where lines are not overwritten, another value
                shows the text after one second instead of ten.
            last: Show the text in any case, and end the line.
        """
        now = time.monotonic()
        self._latest = text
        period = _PERIOD if self._overwrite else _LOG_PERIOD if mark == self._mark else _MARK_PERIOD
        if last or now - self._at >= period:
            self._at, self._mark = now, mark
            self._write(text, last)

    def end(self) -> None:
        """Shows the latest text, if it is not shown yet, and ends the line."""
        if self._latest:
            self._write(self._latest, True)

    def clear(self) -> None:
        """Removes the line, if it can be overwritten."""
        if self._overwrite and self._shown:
            self._write("", False)
            sys.stderr.write("\r")
            sys.stderr.flush()

    def _write(self, text: str, last: bool) -> None:
        if self._overwrite:
            if sys.stderr.isatty():  # a longer line would wrap, and "\r" would not return to its beginning
                text = text[: terminal_width(sys.stderr) - 1]
            sys.stderr.write("\r" + text.ljust(len(self._shown)) + ("\n" if last else ""))
        elif text != self._shown:
            sys.stderr.write(text + "\n")
        sys.stderr.flush()
        self._shown = text


def terminal_width(stream: TextIO) -> int:
    """Number of columns of the terminal that shows a stream, otherwise that of ``COLUMNS`` or 80."""
    try:
        columns = os.get_terminal_size(stream.fileno()).columns
    except OSError:  # no terminal, or a stream without a file descriptor
        columns = 0
    given = os.environ.get("COLUMNS", "")
    return columns if columns > 1 else int(given) if given.isdecimal() and int(given) > 1 else 80


def line_of(progress: Any) -> ProgressLine | None:
    """The line that an argument ``progress`` asks for: True: one; None: one where it can be overwritten; False or a function:
    none."""
    return ProgressLine() if progress is True or (progress is None and interactive()) else None


def tracked(items: Iterable[T], total: int, what: str, *, enabled: bool | None = None) -> Iterator[T]:
    """The items; the line counts them and estimates the remaining time.

    Args:
        what: Name of the items in the plural.
        enabled: None: only where the line can be overwritten.
    """
    if enabled is False or (enabled is None and not interactive()):
        yield from items
        return
    line, began, done = ProgressLine(), time.monotonic(), 0
    line.show(f"0/{total} {what}")
    try:
        for item in items:
            yield item
            done += 1
            left = (time.monotonic() - began) / done * (total - done)
            line.show(f"{done}/{total} {what}" + (f"  {clock(left)} left" if done < total else ""), last=done == total)
    finally:
        if done < total:
            line.show(f"{done}/{total} {what}", last=True)


def counter(what: str, progress: bool | Callable[[int, int], None] | None) -> Callable[[int, int], None]:
    """``progress`` itself if it is a function; otherwise a function of the number of items that are done and of all, which shows
    them.

    Args:
        what: Name of the items in the plural.
        progress: None: only where the line can be overwritten.
    """
    if callable(progress):
        return progress
    if progress is False or (progress is None and not interactive()):
        return lambda done, total: None
    line = ProgressLine()
    return lambda done, total: line.show(f"{done}/{total} {what}", last=done == total)


def clock(seconds: float) -> str:
    """``0:07``, ``2:31:07``"""
    minutes, s = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02}:{s:02}" if hours else f"{minutes}:{s:02}"
