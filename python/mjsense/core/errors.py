# SPDX-License-Identifier: Apache-2.0
"""The exception class for unknown names. All other errors are ValueError, TypeError or RuntimeError."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable


def printable(text: str) -> str:
    """Replaces control characters and bidirectional marks by '?', because names come from untrusted files."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)


_NUMBER_OF_WORLDS = {"num_worlds", "num_envs", "worlds"}  # Gymnasium's and mjlab's word is num_envs


class UnknownNameError(KeyError):
    """A name does not exist. The message contains the most similar names."""

    def __str__(self) -> str:
        # KeyError would print the repr of its argument, with quotes and escapes.
        return printable(str(self.args[0])) if self.args else ""


def unexpected_keyword(context: str, name: str, known: Iterable[str]) -> TypeError:
    """The error for an argument that ``context``, such as ``make_vec()``, does not have."""
    names = [one for one in known if one[0] != "_"]
    same = [one for one in names if {one, name} <= _NUMBER_OF_WORLDS]
    near = f"; did you mean '{same[0]}'?" if same else did_you_mean(name, names, "it takes")
    return TypeError(f"{context} got an unexpected keyword argument '{name}'{near}")


def nearest(name: str, known: Iterable[str], cutoff: float = 0.6) -> list[str]:
    """Up to three names that are similar to ``name``: first those with the same last part (``robot/base`` for ``base``), then
    those that differ least, whatever the case of their letters; without these, those whose last parts differ least."""
    known = list(known)

    def close(part: Callable[[str], str]) -> list[str]:
        spellings: dict[str, list[str]] = {}
        for one in known:
            spellings.setdefault(part(one).lower(), []).append(one)
        return [one for lower in difflib.get_close_matches(name.lower(), spellings, 3, cutoff) for one in spellings[lower]]

    near = [one for one in known if one.endswith(f"/{name}")] + close(str)
    return list(dict.fromkeys(near or close(lambda one: one.rsplit("/", 1)[-1])))[:3]


def did_you_mean(name: str, known: Iterable[str], listing: str = "") -> str:
    """The end of a message about an unknown name: ``"; did you mean 'qpos' or 'qvel'?"``.

    Args:
        listing: Words before a list of the first 40 known names, which follows if none is similar: ``"; there are qpos, qvel"``.
            Without these words the result is then empty.
    """
    known = list(dict.fromkeys(known))
    if near := nearest(name, known):
        return f"; did you mean {' or '.join(map(repr, near))}?"
    names = [*known[:40], "..."] if len(known) > 40 else known or ["none"]
    return f"; {listing} {', '.join(names)}" if listing else ""
