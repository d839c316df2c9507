# SPDX-License-Identifier: Apache-2.0
"""Makes small wrong changes, one at a time, in a copy of the tree, and reports which of them the tests detect.

    python tests/mutation/run.py --count 100 --seed 1 [ROOMS]    draws 100 changes and judges them
    python tests/mutation/run.py --count 100 --seed 1 --report   the figures so far, and what survived

draw.py makes the changes; judge.py chooses the tests of C++, judge_python.py those of Python, which needs no build. The copy is build/mutation/tree with a build folder of its own; results are kept in
build/mutation/drawn.json, so that a run that was stopped continues. --prefix is put before every build and test, as "nice -n 10".
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
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
WORK = ROOT / "build/mutation"
TREE, RESULTS = WORK / "tree", WORK / "drawn.json"
BUILD = TREE / "build/dev"

# The rooms of C++, in the order of docs/architecture.md, and those of Python: "python/dataset".
IN_ORDER = re.findall(r"^\| `(\w+)/", (ROOT / "docs/architecture.md").read_text().split("## Rooms", 1)[1].split("\n## ", 1)[0], re.M)
PYTHON = sorted(f"python/{path.parent.name}" for path in (ROOT / "python/mjsense").glob("*/__init__.py"))
ROOMS = [*IN_ORDER, "bindings", *PYTHON]
LIMIT_S = 600  # a judge that takes longer has noticed: nothing takes a tenth of this
MEMORY = 64 << 30  # bytes of address space of a test: a mutant may allocate without end; two thousand worlds take half of it
# Python tests that take seconds, for mutants that the C++ tests have not noticed.
QUICK_PYTESTS = {
    "hdf5": ["tests/record/test_files.py"],
    "record": ["tests/record/test_files.py"],
    "rollout": ["tests/program/test_record.py"],
    "replay": ["tests/record/test_files.py", "tests/program/test_usage.py"],
}


class Failure(Exception):
    """There is no result: the mutant does not compile, or the tests fail without it."""


@dataclasses.dataclass
class Mutant:
    id: str
    file: str
    what: str
    line: int
    old: str  # the whole line
    new: str

    @property
    def room(self) -> str:
        parts = Path(self.file).parts
        return f"python/{parts[2]}" if self.file.startswith("python/mjsense/") else "bindings" if parts[0] == "python" else parts[2]

    @property
    def digest(self) -> str:
        return hashlib.sha256(f"{self.file}\0{self.old}\0{self.new}".encode()).hexdigest()[:16]

    def apply(self, root: Path) -> str:
        """The file's text with the change."""
        lines = (root / self.file).read_text().split("\n")
        if lines[self.line - 1] != self.old:
            raise Failure(f"{self.id}: line {self.line} of {self.file} has changed")
        lines[self.line - 1] = self.new
        return "\n".join(lines)


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
        code, out = self.run([str(BUILD / "golden_test")], test=True)
        found = re.search(r"^golden: .*", out, re.M)
        return "" if code == 0 else found[0] if found else f"golden_test (ended with {code})"

    def pytest(self, paths: list[str]) -> str:
        code, out = self.run([str(TREE / ".venv/bin/python"), "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *paths],
                             PYTHONPATH=str(BUILD / "python"), PYTHONDONTWRITEBYTECODE="1")
        failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", out, re.M)
        return "" if code in (0, 5) else failed[0] if failed else f"pytest (ended with {code})"

    def configure(self) -> None:
        if not (BUILD / "build.ninja").exists():
            # Without debug information, which has the columns of the source, a mutant that changes nothing gives the same program.
            link = "-Wl,-S" + " -fuse-ld=lld" * bool(shutil.which("ld.lld"))
            flags = [f"-DCMAKE_{kind}_LINKER_FLAGS={link}" for kind in ("EXE", "MODULE")]
            flags.append("-DCMAKE_COMPILE_WARNING_AS_ERROR=OFF")  # a mutant may leave a variable unused
            code, out = self.run(["cmake", "--preset", "dev", "-Wno-dev", *flags], 600)
            if code != 0:
                raise Failure(out[-2000:])


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
        found.append(Mutant(f"{Path(file).name}:{site.line}:{name}", file, site.what, site.line, old, site.new))
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", nargs="*", help="all if not given")
    parser.add_argument("--count", type=int, default=60, help="number of mutants, spread over the rooms (%(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the draw (%(default)s)")
    parser.add_argument("--part", default="1/1", help="1/2 is every second mutant; each part is run in a checkout of its own")
    parser.add_argument("--report", action="store_true", help="only the figures so far")
    parser.add_argument("--package", type=Path, default=ROOT / "build/dev/python/mjsense",
                        help="package with the compiled module, for mutants of Python (%(default)s)")
    parser.add_argument("--pytests", nargs="+", help="test files that judge mutants of Python, in this order; all if not given")
    parser.add_argument("--prefix", default="nice -n 10", help="before every build and test (%(default)s)")
    parser.add_argument("--limit", type=float, default=LIMIT_S, help="seconds of a test program; one that takes longer has noticed (%(default)s)")
    parser.add_argument("--jobs", type=int, default=os.cpu_count(), help="of a build (%(default)s)")
    options = parser.parse_args()
    if unknown := set(options.rooms) - set(ROOMS):
        raise Failure(f"no such room: {', '.join(sorted(unknown))}; there are {', '.join(ROOMS)}")
    judging, mutants = module("judge"), drawn(options.rooms or ROOMS, options.count, options.seed)
    if not options.report:
        WORK.mkdir(parents=True, exist_ok=True)
        copy_tree()
        runner = Runner(options.prefix.split(), options.jobs, options.limit)
        part, parts = map(int, options.part.split("/"))
        mine = mutants[part - 1 :: parts]
        if python := [mutant for mutant in mine if mutant.room in PYTHON]:
            judging_python = module("judge_python")
            judging_python.link_package(TREE, WORK / "package", options.package.resolve())
            files = options.pytests or [str(f.relative_to(ROOT)) for f in sorted((ROOT / "tests/python").glob("test_*.py"))]
            found = judging_python.Judge(options.prefix.split(), TREE, WORK / "package", WORK).judge(python, files)
            known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
            RESULTS.write_text(json.dumps(known | found, indent=1))
        if others := [mutant for mutant in mine if mutant.room not in PYTHON]:
            runner.configure()
            judge = judging.Judge(runner, ROOT, BUILD, ROOMS, QUICK_PYTESTS)
            judge.baseline(WORK / "times.json")
            judging.judge_all(judge, others, RESULTS, TREE, Failure)
    print(judging.report(mutants, json.loads(RESULTS.read_text()) if RESULTS.exists() else {}, ROOMS))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failure as error:
        sys.exit(f"mutation: {error}")
