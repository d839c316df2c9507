# SPDX-License-Identifier: Apache-2.0
"""``mjsense record ... --ray ADDRESS``"""

from __future__ import annotations

import argparse
import sys
from typing import NoReturn

from mjsense.cluster.driver import ClusterProgress, record_on_ray
from mjsense.cluster.job import Job


def is_wanted(words: list[str]) -> bool:
    """Whether these arguments of the program ask for a recording on Ray."""
    given = {word.split("=")[0] for word in words}
    return words[:1] == ["record"] and "--ray" in given and not {"-h", "--help"} & given


_REFUSED = ("--shard", "--append", "--overwrite", "--first-attempt", "--num-attempts", "--json", "--config")


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise ValueError(f"{message}; see mjsense record --help")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="mjsense record", add_help=False, allow_abbrev=False)
    parser.add_argument("--ray", required=True)
    parser.add_argument("--shard-attempts", type=int, default=16)
    parser.add_argument("--ray-working-dir")
    parser.add_argument("--ray-pip")
    parser.add_argument("--out", required=True)
    parser.add_argument("--episodes", type=int, default=1)
    parser.add_argument("--max-attempts", type=int, default=0)
    parser.add_argument("--resume", action="store_true")
    parser.add_argument("-q", "--quiet", action="store_true")
    return parser


class _Line:
    """The progress on stderr: one line that is rewritten on a terminal, otherwise a line for each shard that is done."""

    def __init__(self) -> None:
        self._shards = 0
        self._terminal = sys.stderr.isatty()

    def __call__(self, now: ClusterProgress) -> None:
        if not self._terminal and now.shards == self._shards:
            return
        self._shards = now.shards
        attempts = now.succeeded + now.failed
        rate = f"{now.succeeded / attempts:.0%} successful" if attempts else "no attempt yet"
        text = (f"{now.kept}/{now.wanted} episodes  {rate}  {now.shards} shards done  {now.workers} running  "
                f"{now.steps_per_second:.0f} steps/s  {now.seconds:.0f} s")  # fmt: skip
        print(f"\r{text}\033[K" if self._terminal else text, end="" if self._terminal else "\n", file=sys.stderr, flush=True)

    def end(self) -> None:
        if self._terminal:
            print(file=sys.stderr)


def run(words: list[str]) -> int:
    """Runs the command. Returns 0 if all wanted episodes are recorded, 1 if some are not, 2 after an error."""
    try:
        given, others = _parser().parse_known_args(words[1:])
        for option in _REFUSED:
            if any(word.split("=")[0] == option for word in others):
                raise ValueError(f"{option} cannot be combined with --ray")
        environment = {"working_dir": given.ray_working_dir, "pip": given.ray_pip and given.ray_pip.split(",")}
        line = _Line()
        summary = record_on_ray(
            Job(given.out, words=tuple(others)),
            episodes=given.episodes,
            max_attempts=given.max_attempts,
            shard_attempts=given.shard_attempts,
            address=given.ray,
            resume=given.resume,
            runtime_env={name: value for name, value in environment.items() if value} or None,
            progress=None if given.quiet else line,
        )
        line.end()
    except KeyboardInterrupt:
        return 130
    except (ValueError, LookupError, OSError, RuntimeError, ImportError, TypeError) as error:
        print(f"mjsense record: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    if not given.quiet:
        for reason, count in sorted(summary.failures.items(), key=lambda item: -item[1]):
            print(f"  {count} x {reason}", file=sys.stderr)
    return 0 if summary.enough else 1
