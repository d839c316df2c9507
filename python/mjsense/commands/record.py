# SPDX-License-Identifier: Apache-2.0
"""``mjsense record``"""

from __future__ import annotations

import argparse
import os
import signal
import sys
from typing import TYPE_CHECKING, Any

from mjsense.commands._ray import add_ray, ray_options
from mjsense.commands.output import bytes_below, bytes_text, tell, tree
from mjsense.commands.parser import Parser, add_name, field_values
from mjsense.core.counted import counted
from mjsense.exporting.formats import FORMATS

if TYPE_CHECKING:
    from mjsense.cluster import ClusterProgress

EXAMPLES = [
    ("mjsense record pick --episodes 8 --worlds 4 --out data", "Record eight episodes of the task pick, four at a time."),
    (
        "mjsense record open --scene kitchen:7 --robot rby1 --depth --out data",
        "Open something in kitchen number 7 with RB-Y1, and record depth too.",
    ),
]
ENDS_AT_CTRL_C = True  # before the recording, which catches the signal
_NOT_ON_RAY = ("shard", "append", "overwrite", "first_attempt", "num_attempts", "attempts")
_NOT_WITH_FORMAT = ("shard", "append", "overwrite")


def add_arguments(parser: Parser) -> None:
    add_name(parser, "task", "tasks", "Name of the task.", nargs="?", default="pick", metavar="TASK")
    parser.add_fields("RecordJobCfg", ("task",))
    parser.add_set_options()
    parser.add_argument("--no-sheet", dest="sheet", action="store_false", help="Do not write a contact sheet.")
    add_ray(parser, "Record")
    parser.add_argument(
        "--shard-attempts", type=int, metavar="N", help="With --ray: attempts of one task of the cluster; default 16."
    )
    parser.add_argument(
        "--format",
        choices=("mjsense", *(name for name, format in FORMATS.items() if format.while_recording)),
        default="mjsense",
        metavar="FORMAT",
        help="lerobot: write a LeRobot data set (v3.0) instead of HDF5.",
    )
    parser.add_argument("--map", metavar="FILE", help="With --format: TOML file that chooses features and cameras.")
    parser.add_argument(
        "--trim-idle",
        action=argparse.BooleanOptionalAction,
        help="With --format: leave out the steps in which nothing moves; by default in episodes whose task places an object.",
    )
    parser.add_argument("--keep-recording", action="store_true", help="With --format: keep the recording itself too.")
    parser.add_argument("--json", action="store_true", help="Print the summary as JSON.")
    parser.add_argument("-q", "--quiet", action="store_true", help="Print nothing but errors.")


def run(arguments: argparse.Namespace) -> int:
    options = field_values(arguments, "RecordJobCfg")
    if not options.get("out"):
        raise ValueError("record: the output directory is missing: pass --out DIR")
    for_ray = [name for name in ("shard_attempts", "ray_working_dir", "ray_pip") if getattr(arguments, name) is not None]
    if for_ray and not arguments.ray:
        raise ValueError(f"--{for_ray[0].replace('_', '-')} needs --ray")
    for_format = [name for name in ("map", "trim_idle", "keep_recording") if getattr(arguments, name) not in (None, False)]
    if for_format and arguments.format == "mjsense":
        raise ValueError(f"--{for_format[0].replace('_', '-')} needs --format")
    if arguments.ray:
        _refuse(
            [
                *(name for name in _NOT_ON_RAY if options.get(name)),
                *(["json"] if arguments.json else []),
                *(["format"] if arguments.format != "mjsense" else []),
            ],
            "--ray",
        )
        return _record_on_ray(arguments, options)
    if arguments.format != "mjsense":
        _refuse([name for name in _NOT_WITH_FORMAT if options.get(name)], f"--format {arguments.format}")
        return _record_lerobot(arguments, options)
    return _record(arguments, options, sheet=arguments.sheet, shows_tree=True)


def _refuse(names: list[str], other: str) -> None:
    if names:
        raise ValueError(f"--{names[0].replace('_', '-')} cannot be combined with {other}")


def _record(arguments: argparse.Namespace, options: dict[str, Any], *, sheet: bool, shows_tree: bool) -> int:
    """Records on this machine, and prints the summary. Returns 0 if all wanted episodes are on disk, otherwise 1."""
    from mjsense import _core
    from mjsense.core.progress_line import ProgressLine
    from mjsense.tasks.record_job import RecordProgress, job_result, of_recording

    title, out = _title(options)
    line = None if arguments.quiet else ProgressLine()
    titles = [] if arguments.quiet else [title]  # printed when the recording has begun, so that an error is printed alone

    def show(now: dict[str, Any], signals: int) -> None:
        if titles:
            tell(titles.pop())
        text = of_recording(RecordProgress(**now))
        if signals and now["running"]:
            text += f"  stopping: {now['running']} running; Ctrl-C discards them"
        if line is not None:
            line.show(text, now["succeeded"] + now["failed"])

    try:
        made = job_result(dict(options), (), show, stop_on_signals=True)
    finally:
        if line is not None:
            line.end()
    path, shown = "", ""
    if sheet and made["kept"] and made["frames"] and not made["interrupted"]:
        path = os.path.join(out, "contact_sheet.png")
        shown = _core.contact_sheet(made["path"], path, options.get("ffmpeg", ""))
    if arguments.json:
        print(_summary_json(made, path))
    elif not arguments.quiet:
        print(_summary_text(made))
        if shows_tree and os.path.exists(made["path"]):
            print(f"\n{tree(str(made['path']))}\n{bytes_text(bytes_below(made['path']))} in total")
        if path:
            print(f"\ncontact sheet, every camera over time ({shown}): {path}")
    for damage in made["work"]["damage"]:
        tell(f"mjsense: {damage}")
    if made["interrupted"] and not made["kept"]:
        tell("interrupted: no episode is finished yet. Continue with --resume.")
    elif made["interrupted"]:
        tell(
            "interrupted: the finished episodes are safe. Continue with --resume, or finish with `mjsense repair "
            f"{made['path']}`."
        )
    elif not made["enough"]:
        tell(f"stopped after {counted(made['succeeded'] + made['failed'], 'attempt')}; --max-attempts allows more")
    return 0 if made["enough"] else 1


def _title(options: dict[str, Any]) -> tuple[str, str]:
    """``pick with franka (the task's robot) in table: 8 episodes into data``, and the output directory."""
    from mjsense import _core

    task, robot, scene, attempts, out = _core.resolved_job(options)
    text = task
    if robot:
        text += f" with {robot}" + ("" if robot == options.get("robot") else " (the task's robot)")
    count = counted(attempts, "attempt") if attempts else counted(options.get("episodes", 1), "episode")
    return f"{text}{f' in {scene}' if scene else ''}: {count} into {out}", str(out)


def _time_split(made: dict[str, Any]) -> dict[str, float]:
    """Wall time (s) by stage; the last entry is the remainder."""
    times = made["times"]
    split = {
        "policy": times["policy"] + times["reset"],
        **{name: times[name] for name in ("physics", "sensing", "rendering", "recording")},
    }
    return {**split, "rest": max(0.0, made["seconds"] - sum(split.values()))}


def _summary_text(made: dict[str, Any]) -> str:
    ended, lines = made["succeeded"] + made["failed"], []
    share = f"{made['succeeded']} of {ended} attempts succeeded ({100 * made['succeeded'] / ended:.0f} %); " if ended else ""
    lines.append(f"{share}{made['kept']} of {made['wanted']} episodes are on disk")
    lines += [f"  {count} x {why}" for why, count in made["failures"].items()]
    if made["steps"]:
        rate = 1 / max(made["seconds"], 1e-9)
        lines.append(
            f"{counted(made['steps'], 'step')} in {made['seconds']:.1f} s: {made['steps'] * rate:.1f} steps/s, "
            f"{made['physics_steps'] * rate:.0f} physics steps/s, {made['frames'] * rate:.1f} frames/s"
        )
        split = "".join(f"  {name} {100 * seconds * rate:.0f} %" for name, seconds in _time_split(made).items())
        lines.append(
            f"time:{split}  (in parallel: encoders {made['work']['encode_cpu_s']:.1f} s, files {made['work']['write_s']:.1f} s)"
        )
    return "\n".join(lines)


def _summary_json(made: dict[str, Any], sheet: str) -> str:
    import json

    same = ("kept", "wanted", "succeeded", "failed", "failures", "interrupted", "steps", "physics_steps", "frames", "seconds")
    work = {name: made["work"][name] for name in ("encode_cpu_s", "write_s", "raw_bytes")}
    out = {
        **{name: made[name] for name in same},
        **work,
        "attempts": made["succeeded"] + made["failed"],
        "observations": made["lengths"],
        "path": str(made["path"]),
        "contact_sheet": sheet or None,
    }
    if made["seconds"]:
        out["time"] = _time_split(made)
    return json.dumps(out, indent=2, sort_keys=True, ensure_ascii=False)


def _record_lerobot(arguments: argparse.Namespace, options: dict[str, Any]) -> int:
    """Records, and converts the recording to a LeRobot data set meanwhile."""
    from mjsense.exporting.record_lerobot import CompleteError, converted

    out = options["out"]
    try:
        with converted(
            out,
            format=arguments.format,
            resume=options.get("resume", False),
            map=arguments.map,
            trim_idle=arguments.trim_idle,
            keep_recording=arguments.keep_recording,
            quiet=arguments.quiet,
        ) as folder:
            code = _record(arguments, {**options, "out": str(folder)}, sheet=False, shows_tree=False)
            sys.stdout.flush()
    except CompleteError as error:
        print(error)
        return 0
    if not arguments.quiet and not arguments.json:
        for path in (out, str(folder)):  # the recording is there if it is unfinished or kept
            if os.path.exists(path):
                print(f"\n{tree(path)}", flush=True)
    if not arguments.quiet and os.path.exists(out):
        tell(f"The {FORMATS[arguments.format].about} data set is in {out}.")
    return code


def _record_on_ray(arguments: argparse.Namespace, options: dict[str, Any]) -> int:
    from mjsense.cluster import Job, record_on_ray
    from mjsense.core.progress_line import ProgressLine

    if signal.getsignal(signal.SIGINT) == signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)  # the cluster of this machine ends with the recording
    line = None if arguments.quiet else ProgressLine()

    def show(now: ClusterProgress) -> None:
        attempts = now.succeeded + now.failed
        rate = f"{now.succeeded / attempts:.0%} successful" if attempts else "no attempt yet"
        if line is not None:
            line.show(
                f"{now.kept}/{now.wanted} episodes  {rate}  {now.shards} shards done  {now.workers} running  "
                f"{now.steps_per_second:.0f} steps/s  {now.seconds:.0f} s",
                now.shards,
            )

    own = {name: options.pop(name, default) for name, default in (("episodes", 1), ("max_attempts", 0), ("resume", False))}
    summary = record_on_ray(
        Job(options.pop("out"), options),
        **own,
        shard_attempts=arguments.shard_attempts or 16,
        progress=show,
        **ray_options(arguments),
    )
    if line is not None:
        line.end()
        for reason, count in sorted(summary.failures.items(), key=lambda item: -item[1]):
            tell(f"  {count} x {reason}")
    return 0 if summary.enough else 1
