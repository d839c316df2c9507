# SPDX-License-Identifier: Apache-2.0
"""A pytest plugin that judges mutants of python/mjsense: after the fixtures of a test are made, child processes run it.

The first child runs the test as it is and records which mutants it enters. Each further child runs it with one of these mutants, whose
code replaces that of the function; programs that the test starts find the mutant in the file. The last child runs the test as it is again:
if it fails, a mutant has damaged what the tests share, and the test judges nothing. $MUTATION_JOB is a file with the mutants, and
$MUTATION_RESULTS gets a line for each result.
"""

import contextlib
import functools
import gc
import importlib
import json
import os
import resource
import shutil
import signal
import sys
import threading
import time
import types
from pathlib import Path

import pytest
from _pytest.runner import runtestprotocol

WALL_S = 240  # of a child; one that waits for a thread that fork() has not copied never ends
MOST_TESTS = 30  # that judge one mutant


EARLY = bool(os.environ.get("MUTATION_EARLY"))  # fork before the fixtures are made, because a simulation cannot be used after fork()


def run(item) -> None:
    """Runs a test whose fixtures are made or, if none are, the test with its fixtures."""
    if not EARLY:
        item.obj(**{name: item.funcargs[name] for name in item._fixtureinfo.argnames})
        return
    for report in runtestprotocol(item, log=False, nextitem=None):
        if report.failed:
            raise AssertionError(report.longreprtext[-300:])
        if report.skipped:
            pytest.skip("")


def inner(code: types.CodeType, line: int) -> types.CodeType | None:
    """The innermost code object with instructions of a line."""
    for const in code.co_consts:
        if isinstance(const, types.CodeType) and (found := inner(const, line)):
            return found
    return code if any(number == line for _, _, number in code.co_lines()) else None


def named(code: types.CodeType, wanted: types.CodeType) -> types.CodeType | None:
    """The code object of a function in another version of its file."""
    if (code.co_qualname, code.co_firstlineno) == (wanted.co_qualname, wanted.co_firstlineno):
        return code
    return next((found for const in code.co_consts if isinstance(const, types.CodeType) and (found := named(const, wanted))), None)


class Judge:
    def __init__(self) -> None:
        job = json.loads(Path(os.environ["MUTATION_JOB"]).read_text())
        self.is_child = False
        self.results = Path(os.environ["MUTATION_RESULTS"])
        self.left = {mutant["id"]: mutant for mutant in job}
        self.asked = dict.fromkeys(self.left, 0)
        self.functions: dict[str, types.FunctionType] = {}  # mutant: the function or method that contains it
        self.inner: dict[types.CodeType, list[str]] = {}
        for mutant in self.left.values():
            try:
                importlib.import_module(mutant["module"])
            except Exception as error:
                self.say(mutant["id"], "not loaded", repr(error))
        for function in [f for f in gc.get_objects() if isinstance(f, types.FunctionType)]:
            for id, mutant in self.left.items():
                if function.__code__.co_filename.endswith("/" + mutant["path"]) and (code := inner(function.__code__, mutant["line"])):
                    self.functions[id] = function
                    self.inner.setdefault(code, []).append(id)

    def say(self, *words: object) -> None:
        with self.results.open("a") as file:
            file.write("\t".join(" ".join(str(word).split()) for word in words) + "\n")

    def child(self, item, mutant: dict | None, trace: bool, limit_s: float) -> tuple[bool, list[str]]:
        """(the test passes, mutants that it has entered)"""
        if not EARLY and "tmp_path" in item.funcargs:
            folder = item.funcargs["tmp_path"]
            shutil.rmtree(folder)
            shutil.copytree(f"{folder}.saved", folder, symlinks=True)
        function = self.functions[mutant["id"]] if mutant else None
        changed = None
        if mutant and function:
            changed = named(compile(mutant["text"], function.__code__.co_filename, "exec", dont_inherit=True), function.__code__)
            if changed is None or changed.co_freevars != function.__code__.co_freevars:
                raise LookupError("the function is not found in the changed file")  # no result
        file = Path(mutant["file"]) if mutant else None
        saved = (file.read_bytes(), file.stat()) if file else None
        if file:
            file.write_text(mutant["text"])
            os.utime(file, (0, int(mutant["digest"][:7], 16)))  # compiled files of Python are found by time and size
        read, write = os.pipe()
        pid = os.fork()
        if pid == 0:
            code = 1
            try:
                self.is_child = True
                os.setsid()
                resource.setrlimit(resource.RLIMIT_CPU, (int(limit_s), int(limit_s) + 1))
                entered: set[types.CodeType] = set()
                if function and changed:
                    function.__code__ = changed
                for cached in [o for o in gc.get_objects() if isinstance(o, functools._lru_cache_wrapper)]:
                    if getattr(cached, "__module__", "").startswith("mjsense"):
                        cached.cache_clear()
                if trace:
                    def call(frame, event, argument):
                        if frame.f_code in self.inner:
                            entered.add(frame.f_code)
                    threading.settrace(call)
                    sys.settrace(call)
                try:
                    run(item)
                    code = 0
                except pytest.skip.Exception:
                    code = 77
                finally:
                    sys.settrace(None)
                os.write(write, json.dumps([id for one in entered for id in self.inner[one]]).encode())
            except BaseException as error:
                os.write(write, repr(error).encode()[:300])
            finally:
                os._exit(code)
        os.close(write)
        start = time.time()
        while not (ended := os.waitpid(pid, os.WNOHANG))[0]:
            if time.time() - start > WALL_S:
                os.killpg(pid, signal.SIGKILL)
            time.sleep(0.01)
        with contextlib.suppress(ProcessLookupError):
            os.killpg(pid, signal.SIGKILL)  # programs that the test has left behind
        with os.fdopen(read) as pipe:
            text = pipe.read()
        if file:
            file.write_bytes(saved[0])
            os.utime(file, ns=(saved[1].st_atime_ns, saved[1].st_mtime_ns))
        code = os.waitstatus_to_exitcode(ended[1])
        return code == 0, json.loads(text) if code == 0 and text else [text or f"ended with {code}"]

    @pytest.hookimpl(tryfirst=True)
    def pytest_pyfunc_call(self, pyfuncitem) -> bool | None:
        return None if EARLY else self.judge(pyfuncitem)

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtest_protocol(self, item, nextitem) -> bool | None:
        return self.judge(item) if EARLY and not self.is_child else None

    def judge(self, item) -> bool:
        name = item.nodeid
        if not EARLY and "tmp_path" in item.funcargs:
            folder = item.funcargs["tmp_path"]
            shutil.copytree(folder, f"{folder}.saved", symlinks=True)
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.time()
        passes, entered = self.child(item, None, True, 300)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        if not passes:
            self.say("", "control fails", name, entered)
            return True
        self.say("", "test", name, round(seconds, 2), round(time.time() - start, 2), len(entered))
        noticed = {}
        for id in entered:
            self.say(id, "entered", name)
            if id in self.left and self.asked[id] < MOST_TESTS:
                self.asked[id] += 1
                try:
                    passed, text = self.child(item, self.left[id], False, 20 + 10 * seconds)
                except Exception as error:
                    self.say(id, "no result", name, repr(error))
                    continue
                if not passed:
                    noticed[id] = text
        if noticed:
            passed, text = self.child(item, None, False, 300)
            if not passed:
                self.say("", "control fails afterwards", name, text)
                return True
        for id, text in noticed.items():
            self.say(id, "noticed", name, *text)
            del self.left[id]
        return True


def pytest_configure(config) -> None:
    config.pluginmanager.register(Judge())
