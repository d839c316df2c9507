# SPDX-License-Identifier: Apache-2.0
"""The kinds of faults, one function each, which runs trials and returns the numbers of lost, unnoticed, crashed and hung ones."""

from __future__ import annotations

import functools
import os
import random
import re
import resource
import shutil
import signal
import subprocess
import time
from dataclasses import dataclass, field
from pathlib import Path

import crafted
import h5py

SECONDS, MEMORY = 20, 1 << 30  # limits of CPU seconds and bytes for reading a hostile file
NO_END = 600  # seconds after which a program counts as hung; long, because the machine may be busy


@dataclass
class Row:
    """A line of the table. All numbers except `trials` must be 0."""

    kind: str
    trials: int = 0
    lost: int = 0
    unnoticed: int = 0
    crashed: int = 0
    hung: int = 0
    notes: list[str] = field(default_factory=list)

    def wrong(self, what: str, note: str):
        setattr(self, what, getattr(self, what) + 1)
        self.notes.append(f"{self.kind}: {what}: {note}")

    @property
    def clean(self) -> bool:
        return self.trials > 0 and not (self.lost or self.unnoticed or self.crashed or self.hung)


@dataclass
class Lab:
    """The program that records without physics, and the folder in which the trials run."""

    program: Path
    folder: Path

    def run(self, *arguments, seconds=NO_END, **kwargs):
        return subprocess.run(
            [self.program, *map(str, arguments)], capture_output=True, text=True, errors="replace", timeout=seconds, **kwargs
        )

    def fresh(self, name) -> Path:
        path = self.folder / name
        shutil.rmtree(path, ignore_errors=True)
        path.mkdir(parents=True)
        return path

    @functools.cached_property
    def sound(self) -> Path:
        """A complete recording of two files with both kinds of videos."""
        out = self.fresh("sound")
        done = self.run(out, "--episodes", 4, "--batches", 2, "--worlds", 2, "--steps", 10, "--width", 32, "--height", 24)
        assert done.returncode == 0, done.stderr
        return out

    @functools.cached_property
    def carried(self) -> Path:
        """A file of a recording with more cameras, whose data other recordings carry over, as `mjsense render` does."""
        out = self.fresh("carried")
        done = self.run(out, "--episodes", 1, "--worlds", 1, "--steps", 8, "--cameras", 3, "--no-video")
        assert done.returncode == 0, done.stderr
        return next(out.rglob("*.h5"))

    def copy(self, name="copy") -> Path:
        out = self.fresh(name)
        shutil.copytree(self.sound, out, dirs_exist_ok=True)
        return out


def limit_memory():
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def sanitisers_words(said: str) -> str:
    """The first error that ASan or UBSan found outside the HDF5 library. Errors inside it are expected: it runs in a separate
    process for this reason."""
    for report in re.split(r"^(?===\d+==ERROR: |\S+: runtime error: )", said, flags=re.MULTILINE)[1:]:
        lines = [line for line in report.splitlines() if "libsanitizer" not in line]
        frames = re.findall(r"^\s+#\d+ \S+ in (\S+)", "\n".join(lines), re.MULTILINE)
        own = [f for f in frames if not f.startswith(("__interceptor", "__asan", "__sanitizer", "mem", "str", "malloc", "calloc", "realloc"))]
        if "runtime error" in report.splitlines()[0] or not own or not own[0].startswith("H5"):
            return report[:1500]
    return ""


def look(lab: Lab, row: Row, what: str, command: str, path: Path, *more):
    """Runs a command on a hostile or damaged recording and checks its exit code, time and memory. None if it crashed or hung."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    try:
        done = lab.run(command, path, *more, preexec_fn=limit_memory)
    except subprocess.TimeoutExpired:
        row.wrong("hung", f"{command} of {what}")
        return None
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    if done.returncode not in (0, 1, 2):
        row.wrong("crashed", f"{command} of {what}: {done.returncode} {done.stderr[-300:]}")
        return None
    if words := sanitisers_words(done.stderr):
        row.wrong("crashed", f"{command} of {what}: {words}")
    if seconds > SECONDS + 5:
        row.wrong("hung", f"{command} of {what}: {seconds:.0f} s of processor time")
    if after.ru_maxrss > before.ru_maxrss and after.ru_maxrss * 1024 > MEMORY + (200 << 20):
        row.wrong("crashed", f"{command} of {what}: {after.ru_maxrss // 1024} MiB of memory")
    return done


def snapshot(folder: Path) -> dict:
    return {str(p.relative_to(folder)): (p.read_bytes() if p.is_file() and not p.is_symlink() else None) for p in folder.rglob("*")}


def hostile(lab: Lab, names=None) -> Row:
    """Crafted files: no command may crash, hang or access files outside, and verify must not report any of them as intact."""
    row = Row("crafted files, read by verify, inspect, repair and the contact sheet")
    for name, craft in crafted.CASES.items():
        if names is not None and name not in names:
            continue
        out = lab.copy("hostile/data")
        secret = out.parent / crafted.SECRET
        shutil.rmtree(secret, ignore_errors=True)
        secret.mkdir()
        (secret / "keep.txt").write_text("mine")
        craft(out / "house_0")
        before = snapshot(secret)
        row.trials += 1
        done = look(lab, row, name, "verify", out)
        if done and done.returncode == 0:
            row.wrong("unnoticed", f"{name}: {done.stdout[-200:]}")
        if done and "\x1b" in done.stdout + done.stderr:
            row.wrong("crashed", f"{name}: control characters reach the terminal")
        look(lab, row, name, "inspect", out)
        look(lab, row, name, "sheet", out, lab.folder / "sheet.png")
        look(lab, row, name, "repair", out)
        if snapshot(secret) != before:
            row.wrong("lost", f"{name}: a file outside was changed")
    return row


def damaged_files(lab: Lab):
    return [p for p in sorted(lab.sound.rglob("*")) if p.is_file()]


def flips(lab: Lab, trials: int, seed=0) -> Row:
    """Flips one bit of one file; all kinds of files take turns."""
    row = Row("flipped bits in HDF5, MP4 and Matroska files")
    rng = random.Random(seed)
    kinds = {}
    for path in damaged_files(lab):
        kinds.setdefault(path.suffix, []).append(path)
    out = lab.copy("flips")
    for n in range(trials):
        path = rng.choice(kinds[sorted(kinds)[n % len(kinds)]])
        victim = out / path.relative_to(lab.sound)
        data = bytearray(path.read_bytes())
        at, bit = rng.randrange(len(data)), rng.randrange(8)
        data[at] ^= 1 << bit
        victim.write_bytes(data)
        row.trials += 1
        done = look(lab, row, f"bit {bit} of byte {at} of {path.name}", "verify", out)
        if done and done.returncode == 0:
            row.wrong("unnoticed", f"bit {bit} of byte {at} of {path.name}: {done.stdout[-200:]}")
        victim.write_bytes(path.read_bytes())
    done = lab.run("verify", out)
    if done.returncode != 0 or "note" in done.stdout:
        row.wrong("unnoticed", f"false alarm: {done.stdout}")
    return row


def truncations(lab: Lab, trials: int, seed=1) -> Row:
    row = Row("truncated files")
    rng = random.Random(seed)
    paths = damaged_files(lab)
    out = lab.copy("cuts")
    for n in range(trials):
        path = paths[n % len(paths)]
        victim = out / path.relative_to(lab.sound)
        data = path.read_bytes()
        size = rng.choice([rng.randrange(len(data)), len(data) - 1 - rng.randrange(min(100, len(data)))])
        victim.write_bytes(data[:size])
        row.trials += 1
        done = look(lab, row, f"{path.name} cut to {size}", "verify", out)
        # If only the last line is cut off, the data are unchanged, and a note reports the missing line.
        if done and done.returncode == 0 and "was changed since it was recorded" not in done.stdout:
            row.wrong("unnoticed", f"{path.name} cut to {size}")
        victim.write_bytes(data)
    return row


def mutate(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.randrange(1, 20)):
        at = rng.randrange(len(out))
        kind = rng.randrange(4)
        if kind == 0:
            out[at] = rng.randrange(256)
        elif kind == 1:
            out[at : at + 4] = rng.choice([b"\xff\xff\xff\xff", b"\0\0\0\0", b"\x7f\xff\xff\xff", b"\0\0\0\x80"])
        elif kind == 2:
            length = rng.randrange(1, 64)
            out[at : at + length] = out[rng.randrange(len(out)) :][:length]
        else:
            out[at : at + 1] = bytes([out[at] ^ 1 << rng.randrange(8)])
    return bytes(out)


def mutations(lab: Lab, trials: int, seed=2) -> Row:
    """Makes many changes in one file and removes its checksum, so that the changes reach the readers."""
    row = Row("mutated HDF5, MP4 and Matroska files without checksums")
    rng = random.Random(seed)
    bare = lab.copy("bare")
    for path in bare.rglob("*.h5"):
        with h5py.File(path, "r+") as f:
            remove_checksums(f)
    paths = [p for p in sorted(bare.rglob("*")) if p.is_file()]
    for n in range(trials):
        path = paths[n % len(paths)]
        data = path.read_bytes()
        path.write_bytes(mutate(data, rng))
        row.trials += 1
        command = ["verify", "verify", "inspect", "repair"][n % 4]
        kept = snapshot(bare) if command == "repair" else None
        look(lab, row, f"mutant {n} of {path.name}", command, bare)
        path.write_bytes(data)
        if kept is not None:
            for p in paths:
                if p.read_bytes() != kept[str(p.relative_to(bare))]:
                    p.write_bytes(kept[str(p.relative_to(bare))] if p != path else data)
    return row


def remove_checksums(f: h5py.File):
    f.visititems(lambda name, item: [item.attrs.pop(a) for a in ("crc32", "bytes") if a in item.attrs] and None)


def contents(out: Path) -> dict:
    return {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*") if p.is_file()}


KILLED = ["--episodes", "7", "--batches", "3", "--worlds", "3", "--steps", "8", "--discard", "4", "--print"]


def kills(lab: Lab, trials: int, seed=3) -> Row:
    """kill -9 at a random time, then --resume: every finished episode is kept, and the final files are equal byte for byte."""
    row = Row("kill -9 of the program, then --resume")
    rng = random.Random(seed)
    whole, options = lab.fresh("whole"), [*KILLED, "--carry", lab.carried]
    assert lab.run(whole, *options).returncode == 0
    expected = contents(whole)
    while row.trials < trials:
        out, finished = lab.fresh("killed"), []
        for _ in range(12):
            process = subprocess.Popen(
                [lab.program, out, *options, "--resume", "--step-ms", "3"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
            )
            time.sleep(rng.uniform(0.02, 0.8))
            process.send_signal(signal.SIGKILL)
            said = process.communicate()
            finished += [line.split()[1] for line in said[0].splitlines() if line.startswith("finished")]
            if process.returncode == 0:
                break
            row.trials += 1
            if process.returncode != -signal.SIGKILL:
                row.wrong("crashed", f"{process.returncode} {said[1]}")
        done = lab.run(out, *options, "--resume")
        if done.returncode != 0:
            row.wrong("crashed", done.stderr)
        if contents(out) != expected or len(set(finished)) != len(finished):
            row.wrong("lost", f"after {row.trials} kills: {sorted(set(expected) ^ set(contents(out)))}")
    return row


def killed_changes(lab: Lab, trials: int) -> Row:
    """kill -9 before each change of the file system in turn (tests/record/kill_at.cc), then --resume: the final files are
    equal."""
    row = Row("kill -9 before each change of the file system, then --resume")
    # More episodes are played than requested; the surplus is dropped.
    options = ["--episodes", "5", "--batches", "2", "--worlds", "3", "--steps", "4", "--discard", "4", "--no-depth", "--cameras", "1",
               "--carry", lab.carried]  # fmt: skip
    whole = lab.fresh("whole")
    counted = lab.run(whole, *options, env=os.environ | {"MJSENSE_COUNT_CHANGES": "1"})
    changes, expected = int(counted.stderr.split("changes ")[1]), contents(whole)
    for trial in range(trials):
        at, out = 1 + trial * changes // trials, lab.fresh("killed")
        killed = lab.run(out, *options, env=os.environ | {"MJSENSE_KILL_AT": str(at)})
        if killed.returncode == 0:
            continue  # with other thread timing there were fewer changes
        row.trials += 1
        done = lab.run(out, *options, "--resume")
        if killed.returncode != -signal.SIGKILL or done.returncode != 0:
            row.wrong("crashed", f"{killed.returncode} {killed.stderr} {done.stderr}")
        if contents(out) != expected:
            row.wrong("lost", f"before change {at}: {sorted(set(expected) ^ set(contents(out)))}")
    return row


def full_disks(lab: Lab, trials: int) -> Row:
    """Records on a full disk, which is a few hundred kilobytes larger in each trial: a clear error, finished episodes are kept,
    and --resume on a larger disk publishes them."""
    row = Row("full disks")
    options = ["--episodes", "7", "--batches", "3", "--worlds", "2", "--steps", "8", "--width", "32", "--height", "24"]
    for n in range(trials):
        size = 40_960 + n * (1_600_000 // trials) // 4096 * 4096
        disk = lab.fresh("disk")
        script = f"mount -t tmpfs -o size={size} none {disk} && {lab.program} {disk}/out {' '.join(options)} --print; rc=$?; " \
                 f"{lab.program} verify {disk}/out >&2; cp -r {disk}/out {disk}.kept 2>/dev/null; exit $rc"  # fmt: skip
        shutil.rmtree(f"{disk}.kept", ignore_errors=True)
        try:
            done = subprocess.run(["unshare", "-m", "sh", "-c", script], capture_output=True, text=True, timeout=NO_END)
        except subprocess.TimeoutExpired:
            row.trials += 1
            row.wrong("hung", f"disk of {size}")
            continue
        row.trials += 1
        if done.returncode not in (0, 2):
            row.wrong("crashed", f"disk of {size}: {done.returncode} {done.stderr[-300:]}")
        finished = {line.split()[1] for line in done.stdout.splitlines() if line.startswith("finished")}
        kept = Path(f"{disk}.kept")
        if kept.exists():
            resumed = lab.run(kept, *options, "--resume")
            if resumed.returncode != 0 or lab.run("verify", kept).returncode != 0:
                row.wrong("lost", f"disk of {size}: {resumed.stderr} {lab.run('verify', kept).stdout[-400:]}")
        elif finished:
            row.wrong("lost", f"disk of {size}: {finished}")
    return row


def full_disk_repairs(lab: Lab, trials: int) -> Row:
    """Repairs an unfinished recording on a full disk, which has more space in each trial: one error and an unchanged recording, which
    can be resumed on a larger disk, or all finished episodes are published."""
    row = Row("full disks during repair, then --resume")
    options = ["--episodes", "8", "--batches", "3", "--worlds", "2", "--steps", "8", "--width", "32", "--height", "24"]
    whole, unfinished = lab.fresh("whole_repair"), lab.fresh("unfinished")
    assert lab.run(whole, *options).returncode == 0
    assert lab.run(unfinished, *options, "--stop-after", 5).returncode == 0
    expected, before = contents(whole), contents(unfinished)
    for n in range(trials):
        space = n * (1_000_000 // trials)
        disk = lab.fresh("disk")
        kept = Path(f"{disk}.kept")
        shutil.rmtree(kept, ignore_errors=True)
        script = f"mount -t tmpfs -o size=8m none {disk} && cp -r {unfinished} {disk}/out && " \
                 f"head -c $(($(df -B1 --output=avail {disk} | tail -1) - {space})) /dev/zero > {disk}/rest; " \
                 f"{lab.program} repair {disk}/out; rc=$?; cp -r {disk}/out {kept}; exit $rc"  # fmt: skip
        done = subprocess.run(["unshare", "-m", "sh", "-c", script], capture_output=True, text=True, timeout=NO_END)
        row.trials += 1
        if done.returncode not in (0, 1, 2):
            row.wrong("crashed", f"space of {space}: {done.returncode} {done.stderr[-300:]}")
        elif "published 2 finished episodes" in done.stdout:
            if lab.run("verify", kept).returncode != 0:
                row.wrong("lost", f"space of {space}: {lab.run('verify', kept).stdout}")
        elif len(done.stdout.splitlines()) != 1 or "No space left on device" not in done.stdout:
            row.wrong("unnoticed", f"space of {space}: {done.stdout} {done.stderr}")
        elif contents(kept) != before:
            row.wrong("lost", f"space of {space}: repair changed {sorted(set(contents(kept)) ^ set(before))}")
        elif lab.run(kept, *options, "--resume").returncode != 0 or contents(kept) != expected:
            row.wrong("lost", f"space of {space}: {sorted(set(contents(kept)) ^ set(expected))}")
    return row


def file_limits(lab: Lab, trials: int) -> Row:
    """Records with a limit on file sizes, which grows with each trial: one clear error, no incomplete files, and the same final
    files after --resume without the limit."""
    row = Row("limits on the size of files (ulimit -f)")
    options = ["--episodes", "5", "--batches", "2", "--worlds", "2", "--steps", "8", "--width", "32", "--height", "24"]
    whole = lab.fresh("whole_limit")
    assert lab.run(whole, *options).returncode == 0
    expected = contents(whole)
    largest = max(map(len, expected.values())) * 3 // 2  # the recorder reserves space in advance
    for n in range(trials):
        limit, out = n * largest // trials, lab.fresh("limited")
        row.trials += 1
        try:
            done = lab.run(out, *options, preexec_fn=functools.partial(resource.setrlimit, resource.RLIMIT_FSIZE, (limit, limit)))
        except subprocess.TimeoutExpired:
            row.wrong("hung", f"limit of {limit} bytes")
            continue
        clear = done.stderr.count("\n") == 1 and ("File too large" in done.stderr or "ulimit -f" in done.stderr)
        if done.returncode != (2 if done.stderr else 0) or not (clear or done.returncode == 0):
            row.wrong("crashed", f"limit of {limit} bytes: {done.returncode} {done.stderr[-300:]}")
        left = {k: v for k, v in contents(out).items() if "/.recording/" not in k}
        if any(expected.get(k) != v for k, v in left.items()) or list(out.rglob("*.part*")):
            row.wrong("lost", f"limit of {limit} bytes: left {sorted(contents(out))}")
        resumed = lab.run(out, *options, "--resume")
        if resumed.returncode != 0 or contents(out) != expected:
            row.wrong("lost", f"limit of {limit} bytes: {resumed.stderr}")
    return row


def staged(lab: Lab) -> Row:
    """Damages an episode in .recording: the other episodes are kept, and the damaged one is set aside and recorded again."""
    row = Row("damage to an unfinished recording, then repair or --resume")
    options = ["--episodes", "4", "--batches", "1", "--worlds", "1", "--steps", "8", "--width", "32", "--height", "24"]
    whole = lab.fresh("whole_staged")
    assert lab.run(whole, *options).returncode == 0
    expected = contents(whole)
    victims = {
        "description removed": lambda s: (s / "recording.json").unlink(),
        "description emptied": lambda s: (s / "recording.json").write_text(""),
        "description broken": lambda s: (s / "recording.json").write_text("{nonsense"),
        "description changed": lambda s: (s / "recording.json").write_text(
            (s / "recording.json").read_text().replace('"episodes":4', '"episodes":5')
        ),
        "file removed": lambda s: (s / "episode_00000001/traj.h5").unlink(),
        "file cut": lambda s: cut(s / "episode_00000001/traj.h5"),
        "file emptied": lambda s: (s / "episode_00000001/traj.h5").write_bytes(b""),
        "video removed": lambda s: min((s / "episode_00000001").glob("*.mp4")).unlink(),
        "video cut": lambda s: cut(min((s / "episode_00000001").glob("*.mp4"))),
        "depth cut": lambda s: cut(min((s / "episode_00000001").glob("*.mkv"))),
        "video flipped": lambda s: flip(min((s / "episode_00000001").glob("*.mp4"))),
        "video is a link": lambda s: link(min((s / "episode_00000001").glob("*.mp4")), s),
        "episode is a link": lambda s: link(s / "episode_00000001", s),
        "part is a link": lambda s: (s / "batch.part").symlink_to(s.parents[2] / crafted.SECRET / "keep.txt"),
    }
    for command in ("repair", "resume"):
        for name, damage in victims.items():
            out = lab.fresh("staged/data")
            secret = out.parent / crafted.SECRET
            shutil.rmtree(secret, ignore_errors=True)
            secret.mkdir()
            (secret / "keep.txt").write_text("mine")
            lab.run(out, *options, "--stop-after", 3)
            damage(out / "house_0/.recording")
            row.trials += 1
            whole_after = 3 if name.startswith(("description", "part")) else 2
            if command == "repair":
                done = look(lab, row, name, "repair", out)
                check = look(lab, row, name, "verify", out)
                if not done or not check or check.returncode != 0 or f"{whole_after} episodes" not in check.stdout:
                    row.wrong("lost", f"{name}: repair: {done and done.stdout + done.stderr} {check and check.stdout}")
            else:
                done = lab.run(out, *options, "--resume")
                found = {k: v for k, v in contents(out).items() if "/damaged/" not in k}
                if done.returncode != 0 or found != expected:
                    row.wrong("lost", f"{name}: resume: {done.stderr}")
            if (secret / "keep.txt").read_text() != "mine":
                row.wrong("lost", f"{name}: a file outside was changed")
    return row


def cut(path: Path):
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def flip(path: Path):
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)


def link(path: Path, staging: Path):
    moved = staging.parents[2] / crafted.SECRET / path.name
    path.rename(moved)
    path.symlink_to(moved)


# Faulty replacements of ffmpeg. $out is the output file, "$@" are the arguments.
ENCODERS = {
    "garbage": "cat > /dev/null; echo garbage > $out",
    "nothing": "cat > /dev/null",
    "an empty file": "cat > /dev/null; : > $out",
    "fewer frames": 'head -c 9000 | "$real" "$@" -frames:v 3',
    "a cut file": '"$real" "$@"; head -c 700 $out > $out.x; mv $out.x $out',
    "dies": "head -c 2000 > /dev/null; kill -9 $$",
    "stops": "kill -STOP $$",
    "never reads": "sleep 1000",
    "never ends": 'cat > /dev/null; sleep 1000',
    "floods stderr": "head -c 50000000 /dev/zero >&2; stat -L -c %F /dev/stderr > $0.kind; sleep 1000",
    "leaves a process": "cat > /dev/null; sleep 1000 & exit 3",
    "waits for a process": "sleep 1000 & wait",
    "opens files": "cat > /dev/null; exec python3 -c 'all = [open(\"/dev/null\") for _ in range(2000)]'",
    "takes memory": "cat > /dev/null; exec python3 -c 'x = bytearray(3 << 30)'",
}


def processes_with(name: str, value: str) -> list[int]:
    """Processes that have an environment variable with this value."""
    found = []
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            if f"{name}={value}" in (folder / "environ").read_text(errors="replace").split("\0"):
                found.append(int(folder.name))
        except OSError:  # it has ended, or belongs to another user
            continue
    return found


def encoders(lab: Lab, names=None) -> Row:
    """Records with faulty replacements of ffmpeg: the program ends with an error message and publishes no broken video."""
    row = Row("ffmpeg that lies, dies, hangs or floods")
    real = shutil.which("ffmpeg")
    for name, body in ENCODERS.items():
        if names is not None and name not in names:
            continue
        tools, out = lab.fresh("tools"), lab.fresh("encoded")
        script = tools / "ffmpeg"
        script.write_text(
            f'#!/bin/sh\nreal={real}\ncase "$*" in *-encoders*) exec "$real" "$@";; esac\nfor out; do :; done\n'
            f'out="${{out#file:}}"\n{body}\n'
        )
        script.chmod(0o755)
        row.trials += 1
        options = ["--episodes", 2, "--worlds", 1, "--steps", 400, "--no-depth", "--timeout", 2]
        try:
            done = lab.run(out, *options, env={**os.environ, "MJSENSE_FFMPEG": str(script)})
        except subprocess.TimeoutExpired:
            row.wrong("hung", name)
            continue
        if done.returncode == 0:
            row.wrong("unnoticed", name)
        elif done.returncode != 2 or "ffmpeg" not in done.stderr or len(done.stderr) > 2000:
            row.wrong("crashed", f"{name}: {done.returncode} {done.stderr}")
        end = time.monotonic() + 10
        while (left := processes_with("MJSENSE_FFMPEG", str(script))) and time.monotonic() < end:
            time.sleep(0.05)  # they were killed, but may not have run since
        if left:
            row.wrong("hung", f"{name}: processes {left} are left")
        kind = script.with_name("ffmpeg.kind")
        if kind.exists() and kind.read_text() != "fifo\n":
            row.wrong("crashed", f"{name}: all of stderr is kept in a {kind.read_text()}")
        if list(out.rglob("*.mp4")) and any(".part." not in str(p) for p in out.rglob("*.mp4")):
            row.wrong("lost", f"{name}: published {list(out.rglob('*.mp4'))}")
    script = lab.fresh("tools") / "ffmpeg"
    script.write_text("#!/bin/sh\nsleep 1000\n")
    script.chmod(0o755)
    row.trials += 1
    try:
        done = lab.run(lab.fresh("encoded"), "--timeout", 2, env={**os.environ, "MJSENSE_FFMPEG": str(script)})
        if done.returncode != 2 or "printed nothing for" not in done.stderr:
            row.wrong("crashed", f"-encoders hangs: {done.returncode} {done.stderr}")
    except subprocess.TimeoutExpired:
        row.wrong("hung", "-encoders hangs")
    return row


def generated(lab: Lab, trials: int) -> Row:
    """Changes a valid recording at one or two places, and runs all readers of the Python package."""
    import generated
    import reader_trials

    def change(number: int) -> reader_trials.Change:
        return lambda house, secret: f"change {number} ({generated.change(house, secret, seed=1, number=number)})"

    row = Row("generated changes, read by verify, Dataset, replay, render, export, inspect and repair", trials)
    for column, note in reader_trials.trials(lab.fresh("generated"), {number: change(number) for number in range(trials)}):
        row.wrong(column, note)
    return row


def crafted_readers(lab: Lab, trials: int) -> Row:
    """The crafted files, or so many of them at equal distances in their list, and all readers of the Python package."""
    import reader_trials

    def change(name: str) -> reader_trials.Change:
        def apply(house: Path, secret: Path) -> str:
            (house.parent.parent / crafted.SECRET).mkdir()
            crafted.CASES[name](house)
            return name

        return apply

    names = list(crafted.CASES)
    changes = {number: change(names[number]) for number in range(0, len(names), max(1, len(names) // trials))}
    row = Row("crafted files, read by verify, Dataset, replay, render, export, inspect and repair", len(changes))
    for column, note in reader_trials.trials(lab.fresh("crafted_readers"), changes, always_refused=True):
        row.wrong(column, note)
    return row
