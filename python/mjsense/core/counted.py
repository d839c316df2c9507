# SPDX-License-Identifier: Apache-2.0
"""Numbers of things in texts."""

from __future__ import annotations

_IRREGULAR = {"body": "bodies", "success": "successes"}


def counted(count: int, noun: str) -> str:
    """``"1 episode"``, ``"2 episodes"``."""
    return f"{count} {noun if count == 1 else _IRREGULAR.get(noun, f'{noun}s')}"
