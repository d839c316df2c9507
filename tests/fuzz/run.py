#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs each fuzz target of build/fuzz, and each Python reader of untrusted_readers.py, for a number of seconds: ./dev fuzz [SECONDS] [NAME ...]

This script creates the seeds of the C++ targets. Inputs that reach new code are stored in build/fuzz/corpus/NAME for the next run. Inputs that cause
a failure are written to build/fuzz/found/: add a test with such an input next to the code, then fix the code. Inputs of the Python readers
come from hypothesis, which prints the smallest one that fails.
"""

from __future__ import annotations

import io
import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
BUILD = ROOT / "build/fuzz"
SECONDS = 60
PYTHON = "python_"
"""Prefix of the names of Python readers."""
MOST_BYTES = {"video": 6000, "recording": 2000}


def npy_seeds():
    for array in (np.zeros((3, 2)), np.zeros((3, 2), np.float32), np.zeros((2, 3)), np.zeros((3, 2), order="F"), np.float64(1)):
        out = io.BytesIO()
        np.save(out, array)
        yield out.getvalue()


def json_seeds():
    row = {"arm": [0.1, -2e-9, float("nan")], "nested": {"deep": {"é": [True, None, "\\u00e9\n"]}}, "empty": {}, "list": [[], [[1]]]}
    recording = {"batches": 1, "episodes": 4, "settings": {"task": "pick", "seed": 0}, "streams": [{"place": "rewards"}]}
    return [json.dumps(value).encode() for value in (row, recording, {**recording, "episodes": 5}, [1, 2.5, float("inf")], "x", 0)]


def toml_seeds():
    """The experiment files in the documentation, and one with every type of value."""
    for page in sorted((ROOT / "docs").glob("*.md")):
        yield from (block.encode() for block in re.findall(r"```toml[^\n]*\n(.*?)```", page.read_text(), re.DOTALL))
    yield b'task = "pick"\nepisodes = 4\nworlds = 2\nseed = 3\ncameras = ["wrist_camera"]\nsize = "64x48"\naction_noise = 0.5\nkeep_failures = true\n'


def video_seeds():
    """Small videos, encoded like those of recordings."""
    with tempfile.TemporaryDirectory() as folder:
        for name, pixels, codec in (("a.mp4", "yuv420p", ["libx264"]), ("a.mkv", "gray16le", ["ffv1", "-level", "3", "-slicecrc", "1"])):
            source = ["-f", "lavfi", "-i", "color=gray:size=16x16:rate=10", "-frames:v", "3", "-pix_fmt", pixels]
            path = Path(folder) / name
            done = subprocess.run(["ffmpeg", "-loglevel", "error", *source, "-c:v", *codec, "-fflags", "+bitexact", path])
            if done.returncode == 0:
                yield path.read_bytes()


def recording_seeds():
    """Different byte strings; the target turns any bytes into a recording."""
    return [bytes((7 * i * i + k * i) % 256 for i in range(400)) for k in range(20)]


SEEDS = {
    "toml": toml_seeds,
    "json": json_seeds,
    "npy": npy_seeds,
    "recording": recording_seeds,
    "video": video_seeds,
}


def words(name: str) -> list[str]:
    """The dictionary of a target: keys of TOML files, names of MP4 boxes and similar."""
    if name == "toml":
        fields = (ROOT / "python/mjsense/sensors/configs.py").read_text()
        return sorted(set(re.findall(r"^    (\w+):", fields, re.MULTILINE))) + ["true", "false", "inf", "nan", "0x", "'''", '"""', "[[", "no_"]
    if name == "npy":
        return ["\\x93NUMPY\\x01\\x00", "'descr': ", "'fortran_order': ", "'shape': (", "'<f8'", "'<f4'", "False", "9223372036854775807"]
    if name == "video":
        return ["ftyp", "moov", "mdat", "trak", "mdia", "hdlr", "minf", "stbl", "stsd", "stsz", "vide", "moof", "\\x1a\\x45\\xdf\\xa3", "\\x18\\x53\\x80\\x67"]  # fmt: skip
    return ["NaN", "Infinity", "-Infinity", "null", "true", "false", "\\\\u0000", "1e999", "settings", "streams"]


def run_python(name: str, seconds: int) -> bool:
    done = subprocess.run([sys.executable, ROOT / "tests/fuzz/untrusted_readers.py", name, str(seconds)], env={"PYTHONPATH": str(ROOT / "build/dev/python"), **os.environ})
    return done.returncode == 0


def run(name: str, seconds: int) -> bool:
    if name.startswith(PYTHON):
        return run_python(name.removeprefix(PYTHON), seconds)
    corpus, found, seeds = BUILD / "corpus" / name, BUILD / "found" / f"{name}_", BUILD / "seeds" / name
    for folder in (corpus, found.parent, seeds):
        folder.mkdir(parents=True, exist_ok=True)
    for i, seed in enumerate(SEEDS[name]()):
        (seeds / str(i)).write_bytes(seed)
    dictionary = BUILD / f"{name}.dict"
    dictionary.write_text("".join('"' + word.replace('"', '\\"') + '"\n' for word in words(name)))
    limits = [f"-max_total_time={seconds}", f"-max_len={MOST_BYTES.get(name, 4096)}", "-timeout=20", "-rss_limit_mb=1500"]
    command = [BUILD / f"{name}_fuzz", *limits, f"-dict={dictionary}", f"-artifact_prefix={found}", "-print_final_stats=1", corpus, seeds]
    environment = {"ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1", "UBSAN_OPTIONS": "print_stacktrace=1", **os.environ}
    done = subprocess.run(command, capture_output=True, text=True, errors="replace", env=environment)
    runs = re.search(r"number_of_executed_units: (\d+)", done.stderr)
    covered = re.findall(r"cov: (\d+)", done.stderr)
    print(f"{name}: {runs[1] if runs else '?'} inputs, {covered[-1] if covered else '?'} code locations reached", flush=True)
    if done.returncode != 0:
        print(done.stderr[-6000:], file=sys.stderr)
    return done.returncode == 0


def main(arguments: list[str]) -> int:
    seconds = int(arguments.pop(0)) if arguments and arguments[0].isdigit() else SECONDS
    names = [*SEEDS, *(PYTHON + name for name in re.findall(r"^def read_(\w+)", (ROOT / "tests/fuzz/untrusted_readers.py").read_text(), re.MULTILINE))]
    unknown = sorted(set(arguments) - set(names))
    if unknown:
        print(f"no target named {', '.join(unknown)}; there are {', '.join(names)}", file=sys.stderr)
        return 2
    sound = [run(name, seconds) for name in arguments or names]
    return 0 if all(sound) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
