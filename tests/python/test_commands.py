# SPDX-License-Identifier: Apache-2.0
"""The commands of the program that are written in Python: help, completion and errors."""

import os
import subprocess
import sys

import pytest

from mjsense import commands


def run(*words, **env):
    return subprocess.run(
        [sys.executable, "-m", "mjsense", *words], capture_output=True, text=True, env={**os.environ, **env}, timeout=120
    )


@pytest.mark.parametrize("name", commands.COMMANDS)
@pytest.mark.parametrize("columns", (60, 200))
def test_help_is_wrapped_and_shows_two_examples(name, columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    parser = commands.parser_of(name)
    description, examples = parser.format_help().split("Examples:\n")
    assert max(map(len, description.splitlines())) <= max(60, min(columns, 100))
    assert sum(f"mjsense {name}" in line for line in examples.splitlines()) >= 2
    assert all(action.help and action.help.endswith((".", ".)")) for action in parser._actions if action.dest != "help")


def test_help_lists_the_commands():
    text = run("--help").stdout
    assert all(f"  {name} " in text for name in ("record", *commands.COMMANDS))


def test_a_closed_pipe_is_no_error():
    code = ("import types; from mjsense import commands; "
            "commands._module = lambda _: types.SimpleNamespace(run=lambda _: print('x' * 1000000), add_arguments=lambda _: None, EXAMPLES=[]); "
            "raise SystemExit(commands.run(['quality']))")  # fmt: skip
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        assert (process.stderr.read(), process.wait()) == ("", 141)


def test_errors_are_one_line(tmp_path):
    unknown = run("replai")
    assert unknown.returncode == 2 and "did you mean 'replay'" in unknown.stderr
    option = run("replay", "--epsodes", "1", "x")
    assert option.returncode == 2 and "no option named '--epsodes'; did you mean '--episodes'?" in option.stderr
    missing = run("replay", str(tmp_path / "nothing"))
    assert missing.returncode == 2 and missing.stderr.startswith("mjsense replay: ") and missing.stderr.count("\n") == 1


def test_an_error_of_the_system_names_the_file():
    assert commands.message_of(PermissionError(13, "Permission denied", "out.lock")) == "out.lock: Permission denied"
    assert commands.message_of(OSError("no network")) == "no network"


@pytest.mark.parametrize("words, hint", ((["render", "data", "out"], "; continue with --resume"), (["export", "zarr", "data", "out"], "")))
def test_an_interruption_is_reported(words, hint, monkeypatch, capsys):
    def interrupted(arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"mjsense.commands.{words[0]}.run", interrupted)
    assert commands.run(words) == 130
    assert capsys.readouterr().err == f"mjsense {words[0]}: interrupted{hint}\n"


@pytest.mark.parametrize("words, expected", ((["repl"], ["replay"]), (["replay", "--ep"], ["--episodes"])))
def test_completion(words, expected):
    assert run("complete", "--", *words).stdout.split() == expected
