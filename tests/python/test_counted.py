# SPDX-License-Identifier: Apache-2.0
"""Numbers of things in texts."""

from mjsense.core.counted import counted


def test_one_thing_is_singular():
    assert [counted(n, "episode") for n in (0, 1, 2)] == ["0 episodes", "1 episode", "2 episodes"]
    assert counted(1, "body") == "1 body" and counted(2, "body") == "2 bodies" and counted(0, "success") == "0 successes"
