# SPDX-License-Identifier: Apache-2.0
"""CPU time of record --format lerobot: of the whole recording, and of the thread that converts it.

./dev python bench/record_lerobot.py [WIDTHxHEIGHT ...]
"""

import resource
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import mjsense as mjs
from mjsense.exporting import record_lerobot

ARGUMENTS: dict[str, Any] = dict(
    task="pick", horizon=80, keep_failures=True, num_worlds=2, threads=1, seed=5, format="lerobot", progress=False
)
used = 0.0
run = record_lerobot._Conversion.run


def timed(self: record_lerobot._Conversion) -> None:
    global used
    run(self)
    used = time.thread_time()


def cpu() -> float:
    return sum(sum(resource.getrusage(who)[:2]) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))


if __name__ == "__main__":
    record_lerobot._Conversion.run = timed
    for size in sys.argv[1:] or ["320x184", "640x368"]:
        width, height = map(int, size.split("x"))
        with tempfile.TemporaryDirectory() as folder:
            mjs.record(**ARGUMENTS, width=width, height=height, episodes=1, max_attempts=1, out=Path(folder) / "warm")
            before = cpu()
            mjs.record(**ARGUMENTS, width=width, height=height, episodes=8, max_attempts=8, out=Path(folder) / "data")
            total = cpu() - before
        print(f"{size}: {total:.2f} s of CPU time, of which the conversion {used:.2f} s: {used / (total - used):+.1%}")
