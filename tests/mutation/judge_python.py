# SPDX-License-Identifier: Apache-2.0
"""Judges mutants of python/mjsense: by the tests that enter the mutated function, the fastest first, then by all tests of their files.

Nothing is built: the package of the copied tree is linked around the compiled module of a package that is given. Which tests enter which
function is recorded once: each mutated function gets a first statement that writes down the running test. Programs that a test starts
record too. Both are kept in build/mutation/entered.json.
"""

import ast
import json
import os
import re
import time
from pathlib import Path

TESTS_S, FILES_S = 60, 240  # seconds of tests, as measured without a mutant, that judge one mutant: those that enter it, whole files
PROBE = '''"""Written by tests/mutation."""
import os

seen = set()


def entered(mutant):
    test = os.environ.get("PYTEST_CURRENT_TEST", " ").rsplit(" ", 1)[0]
    if (mutant, test) not in seen:
        seen.add((mutant, test))
        with open(os.path.join(os.path.dirname(__file__), "entered.txt"), "a") as file:
            file.write(f"{mutant}\\t{test}\\n")
'''


def with_probes(text: str, mutants: list) -> str:
    """The text of a file, in which the innermost function around each mutated line starts with a call of the probe."""
    functions = [node for node in ast.walk(ast.parse(text)) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)]
    lines = text.split("\n")
    places: dict[int, list[str]] = {}
    for mutant in mutants:
        around = [f for f in functions if f.body[0].lineno <= mutant.line <= (f.end_lineno or 0)]
        first = max(around, key=lambda f: f.lineno).body
        documented = isinstance(first[0], ast.Expr) and isinstance(first[0].value, ast.Constant) and len(first) > 1
        places.setdefault(first[documented].lineno, []).append(mutant.id)
    for number in sorted(places, reverse=True):
        indent = re.match(r"\s*", lines[number - 1])[0]
        lines[number - 1 : number - 1] = [f'{indent}__import__("mutation_probe").entered("{id}")' for id in places[number]]
    return "\n".join(lines)


def link_package(tree: Path, folder: Path, module: Path) -> None:
    """Makes the package mjsense in `folder`: links to the tree's Python files, and to what is compiled in the folder `module`."""
    source, target = tree / "python/mjsense", folder / "mjsense"
    links = {target / path.relative_to(source): path for path in source.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    links |= {target / path.name: path for path in module.iterdir() if path.name.startswith(("_core", "_lib"))}
    for link, path in links.items():
        link.parent.mkdir(parents=True, exist_ok=True)
        if not link.exists():
            link.unlink(missing_ok=True)
            link.symlink_to(path)
    (folder / "mutation_probe.py").write_text(PROBE)


class Judge:
    def __init__(self, runner, tree: Path, folder: Path, work: Path, files: list[str]) -> None:
        self.runner, self.tree, self.folder, self.cache, self.files = runner, tree, folder, work / "entered.json", files
        self.pycache = work / "pycache"
        self.known: dict[str, dict] = {}  # pytest file: seconds of its tests that pass, which tests enter each mutant

    def pytest(self, arguments: list[str], limit: float) -> tuple[int, str]:
        path = os.pathsep.join([str(self.folder), *filter(None, [os.environ.get("PYTHONPATH")])])
        words = [str(self.tree / ".venv/bin/python"), "-m", "pytest", "-o", "addopts=", "-p", "no:cacheprovider", *arguments]
        return self.runner.run(words, limit, test=True, PYTHONPATH=path, PYTHONPYCACHEPREFIX=str(self.pycache))

    def record(self, mutants: list) -> None:
        """Finds which tests enter which mutants, in the files where this is not known."""
        self.known = json.loads(self.cache.read_text()) if self.cache.exists() else {}
        texts = {file: (self.tree / file).read_text() for file in {mutant.file for mutant in mutants}}
        entered = self.folder / "entered.txt"
        for number, name in enumerate(self.files):
            asked = sorted(mutant.id for mutant in mutants)
            if set(asked) <= set(self.known.get(name, {}).get("asked", ())):
                continue
            try:
                for file, text in texts.items():
                    (self.tree / file).write_text(with_probes(text, [mutant for mutant in mutants if mutant.file == file]))
                entered.write_text("")
                start = time.time()
                _, out = self.pytest(["-q", "-vv", "--tb=no", "--durations=0", "-rfE", name], 1800)
            finally:
                for file, text in texts.items():
                    (self.tree / file).write_text(text)
            seconds: dict[str, float] = {}
            for number_s, test in re.findall(r"^([\d.]+)s (?:call|setup|teardown) +(\S.*)$", out, re.M):
                seconds[test] = seconds.get(test, 0) + float(number_s)
            failed = re.findall(r"^(?:FAILED|ERROR) (\S.*?)(?: - .*)?$", out, re.M)
            hits: dict[str, list[str]] = {}
            for line in entered.read_text().splitlines():
                mutant, test = line.split("\t")
                if test not in failed:
                    hits.setdefault(mutant, []).append(test)
            self.known[name] = {"asked": asked, "seconds": {t: s for t, s in seconds.items() if t not in failed}, "failed": failed,
                                "entered": hits}
            self.cache.write_text(json.dumps(self.known, indent=1))
            print(f"[{number + 1}/{len(self.files)}] {name}: {len(seconds)} tests, {len(failed)} fail, {len(hits)} mutants entered, "
                  f"{time.time() - start:.0f} s", flush=True)

    def plan(self, id: str) -> tuple[list[str], list[str]]:
        """(tests that enter the mutant, of the files with the fastest first; the files)"""
        by_file = {}
        for name in self.files:
            known = self.known.get(name, {})
            if id in known.get("entered", {}):
                tests = {t for t in known["entered"][id] if t in known["seconds"]}
                by_file[name] = sorted(tests, key=known["seconds"].__getitem__)
        total = {name: sum(self.known[name]["seconds"].values()) for name in by_file}
        order = sorted(by_file, key=lambda name: self.known[name]["seconds"][by_file[name][0]] if by_file[name] else total[name])
        tests, left = [], TESTS_S
        for name in order:
            for test in by_file[name]:
                left -= self.known[name]["seconds"][test]
                if left >= 0 or not tests:
                    tests.append(test)
        files, left = [], FILES_S
        for name in sorted(order, key=total.__getitem__):
            left -= total[name]
            if left >= 0:
                files.append(name)
        return tests, files

    def ask(self, id: str) -> tuple[str, str]:
        """(outcome, test that failed) of the mutant that stands in the tree."""
        tests, files = self.plan(id)
        if not tests and not files:
            return "survived", "no test enters it"
        failing = [word for name in files for test in self.known[name]["failed"] for word in ("--deselect", test)]
        for arguments in ([*tests], [*failing, *files] if files else []):
            if arguments:
                code, out = self.pytest(["-x", "-q", "--tb=line", "-rfE", *arguments], 120 + 20 * TESTS_S)
                if code not in (0, 5):
                    failed = re.findall(r"^(?:FAILED|ERROR) (\S+)", out, re.M)
                    return "noticed", failed[0] if failed else f"pytest (ended with {code}) {out[-300:]}"
        return "survived", f"{len(tests)} tests enter it"


def judge_all(judge: Judge, mutants: list, results_file: Path, tree: Path, again: bool) -> None:
    results = json.loads(results_file.read_text()) if results_file.exists() else {}
    due = [m for m in mutants if (known := results.get(m.id, {})).get("digest") != m.digest or (again and known["outcome"] == "survived")]
    judge.record(due)
    for i, mutant in enumerate(due):
        path, start = tree / mutant.file, time.time()
        original, times = path.read_text(), path.stat()
        path.write_text(mutant.apply(tree))
        os.utime(path, (0, int(mutant.digest[:7], 16)))  # a time of its own: compiled files of Python are found by time and size
        try:
            outcome, test = judge.ask(mutant.id)
        finally:
            path.write_text(original)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
        results[mutant.id] = {"digest": mutant.digest, "room": mutant.room, "outcome": outcome, "test": test, "others": True, "tests": None,
                              "seconds": round(time.time() - start, 1)}
        results_file.write_text(json.dumps(results, indent=1))
        print(f"[{i + 1}/{len(due)}] {mutant.file}:{mutant.line}: {mutant.what}: {outcome} {test}", flush=True)
