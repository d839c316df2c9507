# SPDX-License-Identifier: Apache-2.0
"""Compares simulations with ``backend="warp"`` with those on the CPU, measures their speed, and writes the tables of
docs/warp_comparison.md.

    python tools/gpu_check.py [--device cuda:0] [--worlds 64] [--steps 10] [--long 1000] [--minutes 9] [--write]

First both sides have the same physics, that of the CPU, so that only the arithmetic of the sensors differs: contacts, forces and
derived quantities are copied before the sensors are computed. Then both engines step from the same states with the same controls;
their states are made equal after each step. Forces and accelerations are compared there in worlds in which mujoco_warp finds the
same contacts as MuJoCo; the others are counted.

Every part runs in a process of its own if an earlier one has failed, because an error of CUDA makes its process useless. A part
that fails, or for which no time is left, is reported, and the next one runs. The exit code is 1 if there is such a part, or if a
field differs by more than its bound.
"""

from __future__ import annotations

import argparse
import gc
import multiprocessing
import platform
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import warp_compare
from warp_scenes import SCENES, SceneOfCheck, feet_only, plane

import mjsense as mjs

PAGE = Path(__file__).resolve().parents[1] / "docs" / "warp_comparison.md"
BEGIN, END = "<!-- table of tools/gpu_check.py -->", "<!-- end -->"
FIRST = "quadruped on a plane"
REMEMBERED = ("_time", "_history", "touchdown", "liftoff", "_peak")
"""Ends of the names of the fields in which a contact sensor remembers earlier steps."""


@dataclass
class Part:
    """A call whose result the report contains."""

    name: str
    function: Callable[..., Any]
    arguments: tuple[Any, ...]


def sensors_alone(device: str, worlds: int, count: int, scene: str) -> warp_compare.Fields:
    return warp_compare.run_copied(device, worlds, count, {scene: SCENES[scene]})


def both_engines(device: str, worlds: int, count: int, scene: str) -> warp_compare.Fields:
    return warp_compare.run(device, worlds, count, {scene: SCENES[scene]})


def long_run(device: str, worlds: int, count: int) -> tuple[warp_compare.Fields, str]:
    """Differences of what a contact sensor remembers, over many steps without a reset."""
    found = warp_compare.fields()
    reference, ours = warp_compare.pair(SceneOfCheck(feet_only), worlds, device)
    landings = 0
    past: list[Any] = []
    for step in warp_compare.steps(reference, ours, count):
        warp_compare.compare(found, reference, ours, past, f"long run, step {step}")
        landings += int(reference.scene["feet"].data.touchdown.sum())
    remembered = warp_compare.fields()
    remembered.update({key: entry for key, entry in found.items() if key[1].endswith(REMEMBERED)})
    return remembered, f"{landings:,} touchdowns in {count:,} control steps of {worlds} worlds."


def speed(device: str, worlds: int, count: int = 20) -> list[str]:
    """Control steps of the quadruped with all sensors, which are read after each step."""
    lines = [
        "| backend | device | worlds | control steps of a world per second |",
        "| --- | --- | --- | --- |",
    ]
    reference, ours = warp_compare.pair(SceneOfCheck(plane), worlds, device)
    for name, sim in {"cpu": reference, "warp": ours, "warp, with a recorder": ours}.items():
        sim.reset(key="init_state")
        sensors = [sensor for sensor in sim.scene.sensors.values() if sensor.cfg is not None]
        with tempfile.TemporaryDirectory() as folder:
            recorder = mjs.Recorder(sim, folder, sensors) if name.endswith("recorder") else None
            if recorder:
                recorder.begin_episode(0, 0)
            for step in range(count + 3):
                if step == 3:
                    began = time.perf_counter()
                sim.step()
                for sensor in sensors:
                    sensor.data
                if recorder:
                    recorder.append()  # the rows of all worlds
                if step in (2, count + 2) and sim is ours:
                    wait(device)
            rate = count * worlds / (time.perf_counter() - began)
        lines.append(f"| {name} | {device if sim is ours else f'{sim.threads} threads'} | {worlds:,} | {rate:,.0f} |")
    return lines


def wait(device: str) -> None:
    import warp as wp

    wp.synchronize_device(device)


def memory(device: str, counts: tuple[int, ...]) -> list[str]:
    """Device memory of simulations with all sensors, by number of worlds."""
    names = (FIRST, "table with a Franka", "kitchen")
    lines = [f"| worlds | {' | '.join(names)} |", "| --- | --- | --- | --- |"]
    for worlds in counts:
        row = [f"{memory_of(SCENES[name], worlds, device) / 2**20:,.0f} MiB" for name in names]
        lines.append(f"| {worlds:,} | {' | '.join(row)} |")
    return lines


def memory_of(scene: SceneOfCheck, worlds: int, device: str) -> int:
    before = bytes_on(device)
    ours = warp_compare.pair(scene, worlds, device, reference=False)[1]
    for sensor in ours.scene.sensors.values():
        sensor.data  # allocates what is needed to compute it
    return bytes_on(device) - before


def bytes_on(device: str) -> int:
    """Bytes that Warp has allocated on a device."""
    import warp as wp

    gc.collect()
    if wp.get_device(device).is_cuda:
        wp.synchronize_device(device)
        return wp.get_mempool_used_mem_current(device)
    found = (thing for thing in gc.get_objects() if type(thing) is wp.array)
    return sum(array.capacity for array in found if array.ptr and array.deleter is not None)


# ------------------------------------------------------------------------------------------------------------- parts


def serve(connection: Any) -> None:
    """Runs the parts that it receives; ends after one that fails."""
    import warp as wp

    wp.config.quiet = True
    while True:
        part = connection.recv()
        try:
            connection.send(("done", part.function(*part.arguments)))
        except BaseException:  # a failed assertion, an error of CUDA, an interrupt of the user
            connection.send(("failed", traceback.format_exc()))
            return


def run_parts(parts: list[Part], seconds: float, longest: float = 240.0) -> tuple[dict[str, Any], dict[str, str]]:
    """Results of parts, and why the others have none.

    Args:
        seconds: Time for all parts; those for which none is left are not begun.
        longest: Time after which a part is ended, s.
    """
    context = multiprocessing.get_context("spawn")
    end = time.monotonic() + seconds
    results: dict[str, Any] = {}
    failed: dict[str, str] = {}
    process: Any = None
    for part in parts:
        began = time.monotonic()
        if began >= end:
            failed[part.name] = "no time was left"
            continue
        if process is None:
            connection, theirs = context.Pipe()
            process = context.Process(target=serve, args=(theirs,), daemon=True)
            process.start()
            theirs.close()
        limit = min(longest, end - began)
        try:
            connection.send(part)
            state, result = connection.recv() if connection.poll(limit) else ("failed", f"ended after {limit:.0f} s")
        except (EOFError, OSError) as error:
            process.join(10)
            state, result = "failed", f"the process ended with code {process.exitcode} ({error!r})"
        if state == "done":
            results[part.name] = result
        else:
            failed[part.name] = result
            process.kill()
            process = None
        print(f"{part.name}: {state}, {time.monotonic() - began:.0f} s", file=sys.stderr, flush=True)
    if process is not None:
        process.kill()
    return results, failed


def merged(results: dict[str, Any], beginning: str) -> warp_compare.Fields:
    found = warp_compare.fields()
    for name, fields in results.items():
        if name.startswith(beginning):
            for key, entry in fields.items():
                found[key].merge(entry)
    return found


ALONE, ENGINES, LONG, MEMORY, SPEED = "sensors alone: ", "both engines: ", "long run", "memory", "speed"


def parts_of(arguments: argparse.Namespace, device: str) -> list[Part]:
    """The most important ones first."""
    scenes = sorted((name for name in SCENES if arguments.only in (None, name)), key=lambda name: name != FIRST)
    size = (device, arguments.worlds, arguments.steps)
    compared = [
        Part(title + scene, function, (*size, scene))
        for scene in scenes
        for title, function in ((ALONE, sensors_alone), (ENGINES, both_engines))
    ]
    others = [
        Part(SPEED, speed, (device, arguments.speed_worlds or (64 if device == "cpu" else 4096))),
        Part(MEMORY, memory, (device, tuple(arguments.memory_worlds))),
    ]
    if arguments.long:
        others.insert(1, Part(LONG, long_run, (device, min(arguments.worlds, 16), arguments.long)))
    return compared[:2] + others + compared[2:]


def report(results: dict[str, Any], failed: dict[str, str], title: str) -> list[str]:
    alone, engines = merged(results, ALONE), merged(results, ENGINES)
    lines = [title, "", "Sensors alone, with the physics of the CPU:", "", *warp_compare.table(alone)]
    lines += ["", "Both engines:", "", *warp_compare.table(engines), "", "Where a difference is larger than the bound:", ""]
    lines += warp_compare.furthest(engines) or ["- nowhere"]
    if LONG in results:
        remembered, landings = results[LONG]
        lines += ["", "What contact sensors remember over many steps:", "", *warp_compare.table(remembered), "", landings]
    for name, heading in ((MEMORY, "Memory of the device:"), (SPEED, "Speed:")):
        if name in results:
            lines += ["", heading, "", *results[name]]
    if failed:
        lines += ["", "Parts without a result:", ""]
        lines += [f"- {name}: {reason.strip().splitlines()[-1]}" for name, reason in failed.items()]
    return lines


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", help="cpu, cuda:0 and so on; by default the first CUDA device, or the CPU without one.")
    parser.add_argument("--worlds", type=int, default=64, help="Number of worlds.")
    parser.add_argument("--steps", type=int, default=10, help="Number of control steps for each scene.")
    parser.add_argument(
        "--long", type=int, default=1000, help="Number of control steps of the comparison of air times and history; 0: none."
    )
    parser.add_argument(
        "--speed-worlds", type=int, help="Number of worlds for the speed; by default 64 on the CPU and 4096 on CUDA devices."
    )
    parser.add_argument(
        "--memory-worlds", type=int, nargs="*", default=(64, 256, 1024), help="Numbers of worlds for the table of memory."
    )
    parser.add_argument(
        "--minutes", type=float, help="Time for all parts; by default 9 on CUDA devices, and without limit on the CPU."
    )
    parser.add_argument("--only", choices=list(SCENES), help="Name of the only scene to compare.")
    parser.add_argument("--write", action="store_true", help="Write the tables into docs/warp_comparison.md.")
    arguments = parser.parse_args()
    import mujoco
    import mujoco_warp as mjw
    import warp as wp

    wp.config.quiet = True
    device = arguments.device or ("cuda:0" if wp.is_cuda_available() else "cpu")
    name = platform.processor() or platform.machine() if device == "cpu" else wp.get_device(device).name
    on_cpu = device == "cpu"
    minutes = arguments.minutes if arguments.minutes is not None else 1e6 if on_cpu else 9.0
    results, failed = run_parts(parts_of(arguments, device), 60 * minutes, longest=3600.0 if on_cpu else 240.0)
    versions = f"mujoco_warp {mjw.__version__}, Warp {wp.__version__}, MuJoCo {mujoco.__version__}"
    scenes = sum(key.startswith(ALONE) for key in results)
    lines = report(
        results,
        failed,
        f"Device `{device}` ({name}), {versions}: {arguments.worlds} worlds, {arguments.steps} control steps in "
        f"each of {scenes} scenes.",
    )
    print("\n".join(lines))
    if arguments.write:
        page = PAGE.read_text()
        before, after = page.split(BEGIN)[0], page.split(END)[1]
        PAGE.write_text(before + BEGIN + "\n" + "\n".join(lines) + "\n" + END + after)
    wrong = [*warp_compare.beyond(merged(results, ALONE)), *warp_compare.beyond(merged(results, ENGINES))]
    if LONG in results:
        wrong += warp_compare.beyond(results[LONG][0])
    print("\n".join([*(f"{key}:\n{reason}" for key, reason in failed.items()), *wrong]), file=sys.stderr)
    return bool(wrong or failed)


if __name__ == "__main__":
    sys.exit(main())
