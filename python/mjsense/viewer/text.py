# SPDX-License-Identifier: Apache-2.0
"""Texts on the page. Instructions, outcomes, names and errors may come from files of others, so all of them pass ``plain`` or
``panel_text``."""

from __future__ import annotations

from collections.abc import Iterable

from mjsense.core.representations import escaped, plain

LABEL = 120
"""Maximum length of labels, in characters."""


def label(text: object) -> str:
    """One line for a label, which the page displays as plain text."""
    return plain(text, LABEL).replace("\n", " ")


def labels(names: Iterable[str]) -> dict[str, str]:
    """Different labels, each with its name."""
    found: dict[str, str] = {}
    for name in names:
        short, count = label(name), 1
        while (key := short if count == 1 else f"{short} ({count})") in found:
            count += 1
        found[key] = name
    return found


def panel_text(title: object, *lines: object) -> str:
    """HTML of a title and lines in the panel that displays exactly these texts; empty ones are left out. Markdown would interpret
    HTML, links and images in them."""
    shown = "".join(f"<div>{escaped(line, 2000)}</div>" for line in lines if line)
    head = f"<b>{escaped(title, 2000)}</b>" if title else ""
    return (
        "<div style='padding:0 .5em "
        f".4em;font-size:.875rem;line-height:1.5;overflow-wrap:anywhere;white-space:pre-wrap'>{head}{shown}</div>"
    )
