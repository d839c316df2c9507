# SPDX-License-Identifier: Apache-2.0
"""Judges mutants of python/mjsense without building anything: the package of the copied tree is linked around a compiled module.

forked.py runs each test file once for all mutants. Tests whose fixtures cannot be used in a child process, for example a simulation with
threads, make their fixtures in each child. The results are lines of build/mutation/python.tsv; a file whose tests have changed judges the
survivors again.
"""

import hashlib
import json
import os
import signal
import subprocess
from pathlib import Path

FILE_S = 3600  # limit of one test file with all its mutants


def link_package(tree: Path, folder: Path, module: Path) -> None:
    """Makes the package mjsense in `folder`: links to the tree's Python files, and to what is compiled in the package `module`."""
    source, target = tree / "python/mjsense", folder / "mjsense"
    links = {target / path.relative_to(source): path for path in source.rglob("*") if path.is_file() and "__pycache__" not in path.parts}
    links |= {target / path.name: path for path in module.iterdir() if path.name.startswith(("_core", "_lib"))}
    for link in [path for path in target.rglob("*") if path.is_symlink() and path not in links]:
        link.unlink()
    for link, path in links.items():
        link.parent.mkdir(parents=True, exist_ok=True)
        if not link.exists():
            link.symlink_to(path)


class Judge:
    def __init__(self, prefix: list[str], tree: Path, package: Path, work: Path) -> None:
        self.prefix, self.tree, self.package, self.work = prefix, tree, package, work
        self.results = work / "python.tsv"

    def lines(self) -> list[list[str]]:
        return [line.split("\t") for line in self.results.read_text().splitlines()] if self.results.exists() else []

    def run(self, mutants: list, tests: list[str], early: bool) -> None:
        """Runs tests with forked.py."""
        job = self.work / "job.json"
        paths = [mutant.file.removeprefix("python/") for mutant in mutants]
        job.write_text(json.dumps([
            {"id": mutant.id, "file": str(self.tree / mutant.file), "path": path, "line": mutant.line, "digest": mutant.digest,
             "text": mutant.apply(self.tree), "module": path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")}
            for mutant, path in zip(mutants, paths)]))  # fmt: skip
        search = [str(self.package), str(self.tree / "tests/mutation"), *filter(None, [os.environ.get("PYTHONPATH")])]
        variables = {"MUTATION_JOB": str(job), "MUTATION_RESULTS": str(self.results), "MUTATION_EARLY": "1" * early, "MUJOCO_GL": "egl",
                     "PYTHONPATH": os.pathsep.join(search), "PYTHONPYCACHEPREFIX": str(self.work / "pycache")}  # fmt: skip
        words = [str(self.tree / ".venv/bin/python"), "-m", "pytest", "-o", "addopts=", "-p", "no:cacheprovider", "-p", "forked", "-q"]
        process = subprocess.Popen([*self.prefix, *words, *tests], cwd=self.tree, env={**os.environ, **variables}, stdout=subprocess.DEVNULL,
                                   stderr=subprocess.STDOUT, start_new_session=True)  # fmt: skip
        try:
            process.wait(FILE_S)
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)

    def judge(self, mutants: list, files: list[str]) -> dict[str, dict]:
        """Results by mutant, in the form of judge.py."""
        for number, name in enumerate(files):
            digest = hashlib.sha256((self.tree / name).read_bytes()).hexdigest()[:8]
            known = self.lines()
            noticed = {line[0] for line in known if line[1] == "noticed"}
            judged = {id for line in known if line[1:4] == ["finished", name, digest] for id in line[4].split(" ")}
            due = [mutant for mutant in mutants if mutant.id not in noticed | judged]
            if not due:
                continue
            self.run(due, [name], early=False)
            new = self.lines()[len(known) :]
            if unusable := [line[2] for line in new if line[1].startswith("control fails")]:
                self.run(due, unusable, early=True)
                new = self.lines()[len(known) :]
            with self.results.open("a") as file:
                file.write(f"\tfinished\t{name}\t{digest}\t{' '.join(mutant.id for mutant in due)}\n")
            found = [line for line in new if line[1] == "noticed"]
            print(f"[{number + 1}/{len(files)}] {name}: {len(found)} of {len(due)} mutants noticed", flush=True)
        lines, out = self.lines(), {}
        for mutant in mutants:
            mine = [line[1:] for line in lines if line[0] == mutant.id]
            by = [line[1] for line in mine if line[0] == "noticed"]
            entered = len({line[1] for line in mine if line[0] == "entered"})
            out[mutant.id] = {"digest": mutant.digest, "room": mutant.room, "outcome": "noticed" if by else "survived",
                              "test": by[0] if by else f"{entered} tests enter it"}  # fmt: skip
        return out
