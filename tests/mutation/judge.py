# SPDX-License-Identifier: Apache-2.0
"""Judges the mutants of C++ that draw.py makes: the tests of the mutant's room, then those of the rooms that use it.

All mutants are first judged by the fast tests of their own room, a few seconds each: the tests of the mutated file, then the rest. Those
that survive are then judged by the slow tests of the room, and by the fast tests of the rooms that use it, of which those that include the
mutated header come first. Results are kept after each mutant: a run that was stopped continues, and a later one judges the survivors of
rooms with new tests again.
"""

import hashlib
import json
import re
import time
from pathlib import Path

SLOW_S = 2  # a test that takes longer is slow
# Seconds of tests, as measured without a mutant, that judge one mutant: slow ones of its own room, fast ones of other rooms.
SLOW_OWN_S, OTHERS_S = 20, 30
PYTHON_S = 120  # seconds of the clock after which no further pytest file judges a mutant of the bindings
MODULE = "python/mjsense/_core.abi3.so"
OUTCOMES = ["noticed", "survived", "same program", "not compiled"]


def within(limit: float, tests: list[str], seconds: dict[str, float]) -> list[str]:
    """The first tests that together take no longer."""
    chosen = []
    for test in tests:
        limit -= seconds[test]
        if limit >= 0:
            chosen.append(test)
    return chosen


class Judge:
    def __init__(self, runner, root: Path, build: Path, rooms: list[str], pytests: dict[str, list[str]]) -> None:
        self.runner, self.root, self.build, self.pytests = runner, root, build, pytests
        folders = {room: folder for room in rooms for folder in (root / "src").glob(f"*/{room}")}
        self.rooms = [room for room in folders if any(folders[room].rglob("*_test.cc"))]
        self.original: dict[str, str] = {}  # hash of each program without a mutant
        self.seconds: dict[str, dict[str, float]] = {}  # program: test: seconds
        self.tests: dict[str, dict[str, str]] = {}  # room: suite: text of the file with its tests
        self.uses: dict[str, set[str]] = {}  # room: what its files include, code and tests
        self.version: dict[str, str] = {}  # room: hash of its tests
        for room in self.rooms:
            texts = {f: f.read_text() for f in folders[room].rglob("*") if f.suffix in (".h", ".cc")}
            self.uses[room] = {name for text in texts.values() for name in re.findall(r'^#include "mjsense\w*/([^"]+)"', text, re.M)}
            self.tests[room] = {suite: f"{f.parent.relative_to(root)}\n{text}" for f, text in texts.items() if f.name.endswith("_test.cc")
                                for suite in re.findall(r"^(?:TYPED_)?TEST(?:_[FP])?\((\w+),", text, re.M)}

            self.version[room] = hashlib.sha256("".join(self.tests[room][s] for s in sorted(self.tests[room])).encode()).hexdigest()[:8]

    def digest(self, program: str) -> str:
        return hashlib.sha256((self.build / program).read_bytes()).hexdigest()

    def baseline(self, cache: Path) -> None:
        """The time of each test without a mutant. Tests that fail so are left out."""
        known = json.loads(cache.read_text()) if cache.exists() else {}
        self.runner.build([*(f"{room}_test" for room in self.rooms), "golden_test", "record_fake", "mjsense_python"])
        for program in [*(f"{room}_test" for room in self.rooms), "golden_test", MODULE]:
            self.original[program] = self.digest(program)
        for room in self.rooms:
            program = f"{room}_test"
            if known.get(program, {}).get("digest") != self.original[program]:
                print(f"running {program} without a mutant", flush=True)
                report = self.build / f"{program}.json"
                self.runner.run([str(self.build / program), f"--gtest_output=json:{report}"], 1800)
                tests = [(f"{s['name']}.{t['name']}", t) for s in json.loads(report.read_text())["testsuites"] for t in s["testsuite"]]
                known[program] = {"digest": self.original[program],
                                  "seconds": {name: float(t["time"][:-1]) for name, t in tests
                                              if "failures" not in t and t["result"] == "COMPLETED"}}
                cache.write_text(json.dumps(known))
            self.seconds[program] = known[program]["seconds"]

    def users(self, file: str) -> list[str]:
        """Rooms that use a file's room: those that include its header first, then in the order of the rooms."""
        room, header = file.split("/")[2], re.sub(r"\.cc$", ".h", file.split("/", 2)[2])
        users = [r for r in self.rooms if r != room and any(name.startswith(f"{room}/") for name in self.uses[r])]
        return sorted(users, key=lambda r: header not in self.uses[r])

    def split(self, room: str, file: str) -> tuple[list[str], list[str]]:
        """Tests of a room: those in files that include the mutated file's header or, without such, stand in its folder; the others."""
        header = re.sub(r"\.cc$", ".h", file.removeprefix("src/"))
        texts, names = self.tests[room], list(self.seconds[f"{room}_test"])
        suites = {s for s, text in texts.items() if f'"{header}"' in text}
        suites = suites or {s for s, text in texts.items() if text.startswith(f"{Path(file).parent}\n")}
        near = [n for n in names if n.split(".")[0].split("/")[-1] in suites]
        return near, [n for n in names if n not in set(near)]

    def stages(self, file: str, others: bool):
        """(program, tests), the likeliest to notice first."""
        own = file.split("/")[2]
        if own in self.rooms:
            seconds = self.seconds[f"{own}_test"]
            if not others:
                for tests in self.split(own, file):
                    yield f"{own}_test", [t for t in tests if seconds[t] <= SLOW_S]
                return
            slow = sorted((t for tests in self.split(own, file) for t in tests if seconds[t] > SLOW_S), key=seconds.__getitem__)
            yield f"{own}_test", within(SLOW_OWN_S, slow, seconds)
        if others:
            left = OTHERS_S
            users = {room: self.split(room, file) for room in self.users(file)}
            for room, tests in [*((r, near) for r, (near, _) in users.items()), *((r, rest) for r, (_, rest) in users.items())]:
                seconds = self.seconds[f"{room}_test"]
                chosen = within(left, [t for t in tests if seconds[t] <= SLOW_S], seconds)
                left -= sum(seconds[t] for t in chosen)
                yield f"{room}_test", chosen

    def ask(self, file: str, others: bool) -> tuple[str, str]:
        """(outcome, test that failed) of the mutant that stands in the tree."""
        if file.startswith("python/"):
            return self.ask_bindings(file)
        same, built = True, set()
        for program, tests in self.stages(file, others):
            if not tests:
                continue
            if program not in built:
                self.runner.build([program])
                built.add(program)
            if self.digest(program) == self.original[program]:
                continue
            same = False
            expected = sum(self.seconds[program][t] for t in tests)
            if failed := self.runner.program(program, tests, 20 + 10 * expected):
                return "noticed", f"{program}: {failed}"
        if others:
            if file.split("/")[2] in ("scene", "worlds", "rays", "render", "sim", "sensors"):
                self.runner.build(["golden_test"])
                if self.digest("golden_test") != self.original["golden_test"]:
                    same = False
                    if failed := self.runner.golden():
                        return "noticed", failed
            self.runner.build(["mjsense_python"])
            same = same and self.digest(MODULE) == self.original[MODULE]
            if not same and (paths := self.pytests.get(file.split("/")[2])):
                self.runner.build(["record_fake"])
                if failed := self.runner.pytest(paths):
                    return "noticed", failed
        elif not built:
            self.runner.build(["mjsense_python"])  # a room without fast tests
        return "same program" if others and same else "survived", ""

    def ask_bindings(self, file: str) -> tuple[str, str]:
        """The pytest files that name the bound classes and functions of the mutated file most often."""
        self.runner.build(["mjsense_python"])
        text = (self.root / file).read_text()
        names = set(re.findall(r"m\.def\(\"(\w+)|nb::class_<.*\"(\w+)\"", text, re.M))
        words = {w for group in names for w in group if w} | {Path(file).stem.strip("_")}
        pattern = re.compile(r"\b(?:" + "|".join(map(re.escape, sorted(words))) + r")\b")
        found = {f: len(pattern.findall(f.read_text())) / f.stat().st_size for f in (self.root / "tests/python").glob("test_*.py")}
        start = time.time()
        for path in sorted(found, key=lambda f: -found[f]):
            if time.time() - start > PYTHON_S:
                break
            if failed := self.runner.pytest([str(path.relative_to(self.root))]):
                return "noticed", failed
        return "survived", ""


def judge_all(judge: Judge, mutants: list, results_file: Path, tree: Path, failure: type[Exception]) -> dict[str, dict]:
    results = json.loads(results_file.read_text()) if results_file.exists() else {}

    def is_due(mutant, others: bool) -> bool:
        known = results.get(mutant.id)
        if not known or known["digest"] != mutant.digest:
            return True
        if known["outcome"] != "survived" or mutant.room == "bindings":
            return False
        return not known["others"] if others else known["tests"] != judge.version.get(mutant.room)

    for others in (False, True):
        due = [m for m in mutants if is_due(m, others)]
        for i, mutant in enumerate(due):
            path, start = tree / mutant.file, time.time()
            original = path.read_text()
            path.write_text(mutant.apply(tree))
            try:
                outcome, test = judge.ask(mutant.file, others)
            except failure:
                outcome, test = "not compiled", ""
            finally:
                path.write_text(original)
            known = results.get(mutant.id, {})
            results[mutant.id] = {"digest": mutant.digest, "room": mutant.room, "outcome": outcome, "test": test,
                                  "others": others or (known.get("digest") == mutant.digest and known["others"]),
                                  "tests": judge.version.get(mutant.room), "seconds": round(time.time() - start, 1)}
            results_file.write_text(json.dumps(results, indent=1))
            print(f"[{i + 1}/{len(due)}] {mutant.file}:{mutant.line}: {mutant.what}: {outcome} {test}", flush=True)
    return results


def report(mutants: list, results: dict[str, dict], rooms: list[str]) -> str:
    mine = [(m, results[m.id]) for m in mutants if m.id in results]
    lines = ["| room | " + " | ".join(OUTCOMES) + " |", "|" + " --- |" * (len(OUTCOMES) + 1)]
    for room in [*[r for r in rooms if any(m.room == r for m, _ in mine)], ""]:
        counts = [sum(r["outcome"] == o and room in ("", m.room) for m, r in mine) for o in OUTCOMES]
        lines.append(f"| {room or 'all'} | " + " | ".join(map(str, counts)) + " |")
    lines += [f"survived: {m.file}:{m.line}: {m.what}\n  - {m.old.strip()}\n  + {m.new.strip()}" for m, r in mine if r["outcome"] == "survived"]
    return "\n".join(lines)
