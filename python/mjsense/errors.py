# SPDX-License-Identifier: Apache-2.0
"""The exception class for unknown names. All other errors are ValueError, TypeError or RuntimeError."""

from __future__ import annotations

import difflib
from collections.abc import Iterable

from mjsense._show import printable


class UnknownNameError(KeyError):
    """A name does not exist. The message contains the most similar names."""

    def __str__(self) -> str:
        # KeyError would print the repr of its argument, with quotes and escapes.
        return printable(str(self.args[0])) if self.args else ""


def unexpected_keyword(context: str, name: str, known: Iterable[str]) -> TypeError:
    """The error for an argument that ``context``, such as ``make_vec()``, does not have."""
    return TypeError(f"{context} got an unexpected keyword argument '{name}'{did_you_mean(name, [one for one in known if one[0] != '_'], 'it takes')}")


def did_you_mean(name: str, known: Iterable[str], listing: str = "") -> str:
    """The end of a message about an unknown name: ``"; did you mean 'qpos' or 'qvel'?"``.

    Args:
        listing: Words before a list of the first 40 known names, which follows if none is similar: ``"; there are qpos, qvel"``. Without
            these words the result is then empty.
    """
    known = list(dict.fromkeys(known))
    spellings: dict[str, list[str]] = {}  # the case of letters is the most frequent mistake
    for one in known:
        spellings.setdefault(one.lower(), []).append(one)
    if near := [one for lower in difflib.get_close_matches(name.lower(), spellings, 3) for one in spellings[lower]][:3]:
        return f"; did you mean {' or '.join(map(repr, near))}?"
    names = [*known[:40], "..."] if len(known) > 40 else known or ["none"]
    return f"; {listing} {', '.join(names)}" if listing else ""
