# SPDX-License-Identifier: Apache-2.0
"""One line of progress on stderr, for work that takes long."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from mjsense.tasks.record_job import RecordProgress

T = TypeVar("T")
_PERIOD = 0.1  # s between two updates of a line that is overwritten
_LOG_PERIOD = 10.0  # s between two lines of a file


def interactive() -> bool:
    """Whether stderr is a terminal, or the output of a notebook, so that a line can be overwritten."""
    return sys.stderr is not None and (sys.stderr.isatty() or type(sys.stderr).__module__.startswith("ipykernel."))


class ProgressLine:
    """A line that is overwritten; where that is impossible, a new line every ten seconds."""

    def __init__(self) -> None:
        self._overwrite = interactive()
        self._shown, self._due = "", 0.0

    def show(self, text: str, *, last: bool = False) -> None:
        """Shows the text, unless the one before is very recent. ``last``: shows it in any case, and ends the line."""
        now = time.monotonic()
        if not last and now < self._due:
            return
        self._due = now + (_PERIOD if self._overwrite else _LOG_PERIOD)
        if self._overwrite:
            sys.stderr.write("\r" + text.ljust(len(self._shown)) + ("\n" if last else ""))
        elif text != self._shown:
            sys.stderr.write(text + "\n")
        sys.stderr.flush()
        self._shown = text


def line_of(progress: Any) -> ProgressLine | None:
    """The line that an argument ``progress`` asks for: True: one; None: one where it can be overwritten; False or a function: none."""
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
    """``progress`` itself if it is a function; otherwise a function of the number of items that are done and of all, which shows them.

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


def of_recording(p: RecordProgress) -> str:
    """``3/10 episodes  75 % success  412 steps/s  0:41 left``, as the program shows it."""
    ended, seconds = p.succeeded + p.failed, max(p.seconds, 1e-9)
    parts = [f"{p.kept}/{p.wanted} episodes", f"{100 * p.succeeded / ended:.0f} % success" if ended else "", f"{p.steps / seconds:.0f} steps/s"]
    parts.append(f"{p.frames / seconds:.0f} frames/s" if p.frames else "")
    parts.append(f"{clock(p.seconds_left)} left" if p.seconds_left == p.seconds_left and p.kept < p.wanted else "")
    return "  ".join(filter(None, parts))
