# SPDX-License-Identifier: Apache-2.0
"""Packages of other people, unpacked and not installed: bench/fetch.py."""

import sys
from pathlib import Path

import pytest


def wheel(name):
    """Folder of the unpacked wheel; the test is skipped where it cannot be had."""
    sys.path.insert(0, str(Path(__file__).parents[2] / "bench"))
    import fetch

    try:
        return fetch.wheel(name)
    except fetch.Unavailable as error:
        pytest.skip(str(error))
    finally:
        sys.path.pop(0)
