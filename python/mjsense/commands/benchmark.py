# SPDX-License-Identifier: Apache-2.0
"""``mjsense benchmark``"""

from __future__ import annotations

import argparse

from mjsense.commands.parser import Parser, add_name, add_no_terminate, field_values
from mjsense.core.counted import counted

EXAMPLES = [
    (
        "mjsense benchmark create pick --episodes 200 --split test --out bench",
        "Fix 200 episodes of the task pick, so that other users can play the same.",
    ),
    ("mjsense benchmark check bench", "Check that the episodes of a benchmark start as when it was made."),
    ("mjsense benchmark export benchmark:pick --out theirs", "Write a benchmark as MolmoSpaces' benchmark.json."),
]
_NOT_FIXED = tuple(
    """
    policy threads noise resume append overwrite house batches gzip ffmpeg crf preset tune keyint molmospaces_depth
    max_attempts num_attempts first_attempt attempts shard keep_failures replay videos terminate_upon_success worlds
    """.split()
)


def add_arguments(parser: Parser) -> None:
    parser.add_argument(
        "action",
        choices=("create", "check", "export"),
        help="create: write a benchmark. check: compare its starts with the stored ones. export: write it as MolmoSpaces' "
        "benchmark.json.",
    )
    add_name(parser, "task", "tasks", "create: name of the task. check and export: a benchmark.", metavar="TASK")
    add_no_terminate(parser)
    parser.add_fields("RecordJobCfg", ("task",), _NOT_FIXED)
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")


def run(arguments: argparse.Namespace) -> int:
    from mjsense.evaluation.benchmarks import Benchmark, create_benchmark

    options = field_values(arguments, "RecordJobCfg")
    del options["task"]  # an argument
    allowed = {"create": set(options), "export": {"out"}}.get(arguments.action, set())
    if given := options.keys() - allowed:
        raise ValueError(f"benchmark {arguments.action}: --{min(given).replace('_', '-')} is an option of create")
    if arguments.action == "check":
        found = Benchmark(arguments.task)
        found.check_starts()
        if not arguments.quiet:
            print(f"All {len(found.episodes)} episodes start as when the benchmark was made.")
        return 0
    if not options.get("out"):
        raise ValueError("benchmark: the output directory is missing: pass --out DIR")
    if arguments.action == "export":
        from mjsense.evaluation.molmospaces_export import export_molmospaces

        count = export_molmospaces(arguments.task, options["out"])
        if not arguments.quiet:
            print(f"{counted(count, 'episode')} in {options['out']}/benchmark.json")
        return 0
    found = create_benchmark(arguments.task, progress=False if arguments.quiet else None, **options)
    if not arguments.quiet:
        print(f"{counted(len(found.episodes), 'episode')} of {found.name} in {found.folder}, {found.checksum}")
    return 0
