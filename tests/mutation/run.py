# SPDX-License-Identifier: Apache-2.0
"""Do the tests notice? Makes one small wrong change at a time in a copy of the tree and runs the tests.

    python tests/mutation/run.py                  every mutant of mutants.toml that has no result yet
    python tests/mutation/run.py --survivors      those that survived, again
    python tests/mutation/run.py worlds png       rooms, or parts of ids
    python tests/mutation/run.py --judge pytest scan-in-world    ask this judge alone
    python tests/mutation/run.py --check          only whether every mutant still applies
    python tests/mutation/run.py --report         the figures so far, and who survived
    python tests/mutation/run.py --draw 60 --seed 1 [ROOMS]    mutants that draw.py makes, judged by drawn.py

The copy is build/mutation/tree with a build folder of its own; results are kept in build/mutation/results.json. A mutant is
noticed by the first judge that fails: its room's test program, then the golden hashes, then the other rooms' programs, those that
build on it first, then the Python tests that could know. --prefix puts a command before every build and test, as "nice -n 10".
"""

import argparse
import dataclasses
import hashlib
import importlib.util
import json
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
WORK = ROOT / "build/mutation"
TREE, RESULTS = WORK / "tree", WORK / "results.json"
BUILD = TREE / "build/dev"

# In the order of docs/architecture.md: dependencies point up this list, so a mistake shows in a room or in one below.
ROOMS = [*re.findall(r"^\| `(\w+)/", (ROOT / "docs/architecture.md").read_text(), re.M), "python"]
# Rooms with a test program: those with x_test.cc files, as in cmake/Tests.cmake.
PROGRAMS = [room for room in ROOMS if any((ROOT / "src").glob(f"*/{room}/**/*_test.cc"))]
PYTESTS = {
    "hdf5": ["tests/record"],
    "record": ["tests/record", "tests/program", "tests/faults"],
    "rollout": ["tests/program", "tests/python"],
    "replay": ["tests/record", "tests/program", "tests/faults"],
    "app": ["tests/program"],
    "python": ["tests/python", "tests/conformance"],
}
LIMIT_S = 600  # a judge that takes longer has noticed: nothing takes a tenth of this
MEMORY = 64 << 30  # bytes of address space of a test: a mutant may allocate without end; two thousand worlds take half of it
DRAWN = WORK / "drawn.json"
# Of PYTESTS, those of seconds: for drawn mutants that the C++ tests have not noticed.
QUICK_PYTESTS = {
    "hdf5": ["tests/record/test_files.py"],
    "record": ["tests/record/test_files.py"],
    "rollout": ["tests/program/test_record.py"],
    "replay": ["tests/record/test_files.py", "tests/program/test_usage.py"],
    "app": ["tests/program/test_usage.py", "tests/program/test_streams.py", "tests/program/test_scan.py"],
}


class Failure(Exception):
    """There is no result: the mutant does not apply or does not compile, or the tests fail without it."""


@dataclasses.dataclass
class Mutant:
    id: str
    file: str
    what: str
    old: str
    new: str
    line: int = 0  # where `old` is that whole line; 0: `old` stands once in the file
    tested_in: str = ""  # the room whose tests know it, if not its own: interfaces are tested where something implements them

    @property
    def room(self) -> str:
        parts = Path(self.file).parts
        if parts[0] == "python":
            return "python"
        if parts[0] == "models":
            return "robots" if parts[1] == "robots" else "scenes"
        return parts[2]

    @property
    def judged_in(self) -> str:
        return self.tested_in or self.room

    @property
    def digest(self) -> str:
        return hashlib.sha256(f"{self.file}\0{self.old}\0{self.new}".encode()).hexdigest()[:16]

    def apply(self, root: Path) -> str:
        """The file's text with the change."""
        path = root / self.file
        if not path.is_file():
            raise Failure(f"{self.id}: there is no {self.file}")
        text = path.read_text()
        if self.line:
            lines = text.split("\n")
            if lines[self.line - 1] != self.old:
                raise Failure(f"{self.id}: line {self.line} of {self.file} is another one")
            lines[self.line - 1] = self.new
            return "\n".join(lines)
        found = text.count(self.old)
        if found != 1:
            raise Failure(f"{self.id}: its text stands {found} times in {self.file}, expected once:\n{self.old}")
        return text.replace(self.old, self.new)


def load(path: Path = HERE / "mutants.toml") -> list[Mutant]:
    mutants = [Mutant(**m) for m in tomllib.loads(path.read_text())["mutant"]]
    ids = [m.id for m in mutants]
    for twice in {i for i in ids if ids.count(i) > 1}:
        raise Failure(f"{twice}: two mutants have this id")
    return mutants


def check(mutants: list[Mutant]) -> list[str]:
    errors = []
    for mutant in mutants:
        try:
            if mutant.room not in ROOMS:
                raise Failure(f"{mutant.id}: {mutant.file} stands in no room of docs/architecture.md")
            if mutant.apply(ROOT) == (ROOT / mutant.file).read_text():
                raise Failure(f"{mutant.id}: changes nothing")
        except Failure as error:
            errors.append(str(error))
    return errors


def copy_tree() -> None:
    """Brings TREE to what stands in the working tree; only files that differ are touched, so that little is built."""
    names = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, check=True, capture_output=True, text=True)
    wanted = [name for name in names.stdout.split("\n") if name and (ROOT / name).is_file()]
    for name in wanted:
        source, target = ROOT / name, TREE / name
        if target.is_file() and target.read_bytes() == source.read_bytes():
            continue
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(source, target)
    keep = {TREE / name for name in wanted}
    for folder in ("src", "python", "tests", "models"):
        for path in (TREE / folder).rglob("*"):
            if path.is_file() and path not in keep and "__pycache__" not in path.parts:
                path.unlink()
    venv = TREE / ".venv"
    if not venv.exists():
        venv.symlink_to((ROOT / ".venv").resolve())


def limit_memory() -> None:
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    Path("/proc/self/oom_score_adj").write_text("1000")  # where memory ends, it ends first


class Runner:
    def __init__(self, prefix: list[str], jobs: int, limit: float = LIMIT_S) -> None:
        self.prefix, self.jobs, self.limit = prefix, jobs, limit

    def run(self, command: list[str], limit: float = 0, test: bool = False, **env: str) -> tuple[int, str]:
        """Exit status (-SIGKILL: took too long) and output. The memory of a test is limited; without a limit of its own it is a test."""
        process = subprocess.Popen([*self.prefix, *command], cwd=TREE, env={**os.environ, **env}, stdout=subprocess.PIPE,
                                   stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True,
                                   preexec_fn=None if limit and not test else limit_memory)
        try:
            out = process.communicate(timeout=limit or self.limit)[0]
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return -signal.SIGKILL, process.communicate()[0]
        return process.returncode, out

    def build(self, targets: list[str]) -> None:
        code, out = self.run(["ninja", "-C", str(BUILD), f"-j{self.jobs}", *targets], 3600)
        if code != 0:
            errors = [line for line in out.splitlines() if "error" in line]
            raise Failure("does not compile:\n" + "\n".join(errors[:5] or [out[-500:]]))

    def program(self, name: str, tests: list[str] = [], limit: float = 0) -> str:  # noqa: B006
        """"" or the test that failed; all tests if none are named."""
        only = ["--gtest_filter=" + ":".join(tests)] if tests else []
        code, out = self.run([str(BUILD / name), "--gtest_fail_fast", *only], limit, test=True)
        if code == 0:
            return ""
        failed = re.findall(r"^\[  FAILED  \] ([\w/]+\.[\w/]+)", out, re.M)
        running = re.findall(r"^\[ RUN      \] (\S+)", out, re.M)
        return failed[0] if failed else f"{running[-1] if running else name} (ended with {code})"

    def golden(self) -> str:
        code, out = self.run([str(BUILD / "golden_test")])
        found = re.search(r"^golden: .*", out, re.M)
        return "" if code == 0 else found[0] if found else f"golden_test (ended with {code})"

    def pytest(self, paths: list[str]) -> str:
        code, out = self.run([str(TREE / ".venv/bin/python"), "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *paths],
                             PYTHONPATH=str(BUILD / "python"), PYTHONDONTWRITEBYTECODE="1")
        failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", out, re.M)
        return "" if code in (0, 5) else failed[0] if failed else f"pytest (ended with {code})"

    def judges(self, room: str):
        """(name, targets to build, call): the nearest first."""
        at = PROGRAMS.index(room) if room in PROGRAMS else 0
        nearest = PROGRAMS[at:] + PROGRAMS[:at][::-1] if room in PROGRAMS else []
        for i, r in enumerate(nearest):
            yield f"{r}_test", [f"{r}_test"] if i == 0 else [f"{x}_test" for x in nearest], lambda r=r: self.program(f"{r}_test")
            if i == 0:
                yield "golden", ["golden_test"], self.golden
        paths = PYTESTS.get(room, ["tests/conformance", "tests/python"])
        yield "pytest", ["mjsense_program", "record_fake", "mjsense_python"], lambda: self.pytest(paths)

    def configure(self) -> None:
        if not (BUILD / "build.ninja").exists():
            # Without debug information, which has the columns of the source, a mutant that changes nothing gives the same program.
            link = "-Wl,-S" + " -fuse-ld=lld" * bool(shutil.which("ld.lld"))
            flags = [f"-DCMAKE_{kind}_LINKER_FLAGS={link}" for kind in ("EXE", "MODULE")]
            flags.append("-DCMAKE_COMPILE_WARNING_AS_ERROR=OFF")  # a mutant may leave a variable unused
            code, out = self.run(["cmake", "--preset", "dev", "-Wno-dev", *flags], 600)
            if code != 0:
                raise Failure(out[-2000:])

    def baseline(self, rooms: set[str], own: bool) -> None:
        """Without a mutant nothing may fail."""
        self.build([t for room in sorted(rooms) for t in next(self.judges(room))[1]] if own else ["all"])
        passed = set()
        for room in sorted(rooms, key=ROOMS.index):
            for i, (name, _, judge) in enumerate(self.judges(room)):
                if own and i > 0:
                    break
                if name == "pytest":
                    name += " ".join(PYTESTS.get(room, []))
                if name in passed:
                    continue
                if wrong := judge():
                    raise Failure(f"{name} fails without any mutant: {wrong}")
                passed.add(name)

    def ask(self, mutant: Mutant, own: bool, only: str) -> dict:
        path = TREE / mutant.file
        original = path.read_text()
        start, built = time.time(), None
        path.write_text(mutant.apply(TREE))
        try:
            for i, (name, targets, judge) in enumerate(self.judges(mutant.judged_in)):
                if only and name != only:
                    continue
                if own and i > 0:
                    return {"noticed": False, "own": True, "seconds": round(time.time() - start, 1)}
                if targets != built:
                    self.build(targets)
                    built = targets
                if test := judge():
                    return {"noticed": True, "judge": name, "test": test, "seconds": round(time.time() - start, 1)}
            return {"noticed": False, **({"own": True} if only else {}), "seconds": round(time.time() - start, 1)}
        finally:
            path.write_text(original)


def module(name: str):
    """Loads a module of this folder under a unique name, because other folders of tests have a run.py too."""
    spec = importlib.util.spec_from_file_location(f"mutation_{name}", HERE / f"{name}.py")
    loaded = sys.modules[f"mutation_{name}"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(loaded)
    return loaded


def drawn(rooms: list[str], count: int, seed: int) -> list[Mutant]:
    found = []
    for _, site in module("draw").draw(ROOT, rooms, count, seed):
        file = str(site.file.relative_to(ROOT))
        old = site.file.read_text().split("\n")[site.line - 1]
        name = hashlib.sha256(f"{file}\0{old}\0{site.new}".encode()).hexdigest()[:8]
        found.append(Mutant(f"{Path(file).name}:{site.line}:{name}", file, site.what, old, site.new, site.line))
    return found


def report(mutants: list[Mutant], results: dict) -> str:
    lines, survivors, total, noticed, own = [], [], 0, 0, 0
    for room in ROOMS:
        known = [(m, results[m.id]) for m in mutants if m.room == room and results.get(m.id, {}).get("digest") == m.digest]
        if not known:
            continue
        seen = sum(r["noticed"] for _, r in known)
        here = sum(r["noticed"] and (r["judge"] == f"{m.judged_in}_test" or m.judged_in not in PROGRAMS) for m, r in known)
        lines.append(f"{room:10} {seen:3} of {len(known):3} noticed, {here:3} by the room's own tests")
        survivors += [f"  {m.id}: {m.what}" for m, r in known if not r["noticed"]]
        total, noticed, own = total + len(known), noticed + seen, own + here
    if total:
        share = 100 * noticed / total
        lines.append(f"{'all':10} {noticed:3} of {total:3} noticed ({share:.0f} %), {own:3} by the room's own tests")
    return "\n".join(lines + (["survivors:", *survivors] if survivors else []))


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("which", nargs="*", help="rooms, or parts of ids; all if not given")
    parser.add_argument("--check", action="store_true", help="only whether every mutant applies")
    parser.add_argument("--report", action="store_true", help="only the figures so far")
    parser.add_argument("--again", action="store_true", help="also mutants that have a result")
    parser.add_argument("--survivors", action="store_true", help="those that survived, again")
    parser.add_argument("--own", action="store_true", help="ask the room's own tests only; a run without it asks the others")
    parser.add_argument("--judge", default="", help="ask this one only: pytest, golden, sensors_test ...")
    parser.add_argument("--no-baseline", action="store_true", help="trust that the tests pass without a mutant")
    parser.add_argument("--prefix", default="nice -n 10", help="before every build and test (%(default)s)")
    parser.add_argument("--draw", type=int, default=0, help="so many mutants made by draw.py, spread over the rooms")
    parser.add_argument("--part", default="1/1", help="of --draw: the first half is 1/2; each part is run in a checkout of its own")
    parser.add_argument("--seed", type=int, default=0, help="of --draw")
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="seconds for a judge; one that takes longer has noticed (%(default)s)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="of a build (%(default)s)")
    options = parser.parse_args()
    mutants = load()
    if errors := check(mutants):
        print("\n".join(errors), file=sys.stderr)
        return 2
    if options.check:
        print(f"all {len(mutants)} mutants apply")
        return 0
    results = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    if options.report and not options.draw:
        print(report(mutants, results))
        return 0
    if options.draw:
        if unknown := set(options.which) - set(ROOMS):
            raise Failure(f"no such room: {', '.join(sorted(unknown))}; there are {', '.join(ROOMS)}")
        judging, mutants = module("drawn"), drawn(options.which or ROOMS, options.draw, options.seed)
        if options.report:
            print(judging.report(mutants, json.loads(DRAWN.read_text()), ROOMS))
            return 0
        WORK.mkdir(parents=True, exist_ok=True)
        copy_tree()
        runner = Runner(options.prefix.split(), options.jobs, options.limit)
        runner.configure()
        judge = judging.Judge(runner, ROOT, BUILD, ROOMS, QUICK_PYTESTS)
        judge.baseline(WORK / "times.json")
        part, parts = map(int, options.part.split("/"))
        judging.judge_all(judge, mutants[part - 1 :: parts], DRAWN, TREE, Failure)
        print(judging.report(mutants, json.loads(DRAWN.read_text()), ROOMS))
        return 0
    chosen = [m for m in mutants if not options.which or any(w == m.room if w in ROOMS else w in m.id for w in options.which)]

    def due(m: Mutant) -> bool:
        result = results.get(m.id)
        if options.again or result is None or result["digest"] != m.digest:
            return True
        return not result["noticed"] and (options.survivors or ("own" in result and not options.own))

    chosen = [m for m in chosen if due(m)]
    WORK.mkdir(parents=True, exist_ok=True)
    copy_tree()
    runner = Runner(options.prefix.split(), options.jobs, options.limit)
    runner.configure()
    if not options.no_baseline:
        runner.baseline({m.judged_in for m in chosen}, options.own)
    broken = 0
    # A mutant of each room in turn, so that a run that is cut short says something of all.
    turn = {m.id: sum(other.room == m.room for other in chosen[:i]) for i, m in enumerate(chosen)}
    for i, mutant in enumerate(sorted(chosen, key=lambda m: (turn[m.id], ROOMS.index(m.room)))):
        try:
            result = runner.ask(mutant, options.own, options.judge)
        except Failure as error:
            print(f"[{i + 1}/{len(chosen)}] {mutant.id}: ERROR {error}", flush=True)
            broken += 1
            continue
        results[mutant.id] = {**result, "digest": mutant.digest}
        RESULTS.write_text(json.dumps(results, indent=1))
        said = f"noticed by {result['judge']}: {result['test']}" if result["noticed"] else "SURVIVED"
        print(f"[{i + 1}/{len(chosen)}] {mutant.id}: {said} ({result['seconds']} s)", flush=True)
    print(report(mutants, results))
    return 2 if broken else 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failure as error:
        sys.exit(f"mutation: {error}")
