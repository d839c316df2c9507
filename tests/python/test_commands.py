# SPDX-License-Identifier: Apache-2.0
"""The program: help, completion, errors, experiment files and signals of all commands."""

import os
import subprocess
import sys

import pytest
from program_runs import run_program

from mjsense import commands
from mjsense.commands import output, parser, start
from mjsense.commands.fields import Field
from mjsense.commands.parser import episodes_of


def run(*words, **env):
    return run_program(*words, env=env)


@pytest.mark.parametrize("name", commands.COMMANDS)
@pytest.mark.parametrize("columns", (60, 200))
def test_help_is_wrapped_and_shows_two_examples(name, columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(columns))
    monkeypatch.setattr(os, "get_terminal_size", lambda descriptor: os.terminal_size((0, 0)))
    of_name = commands.parser_of(name)
    description, examples = of_name.format_help().split("Examples:\n")
    assert max(map(len, description.splitlines())) <= max(60, min(columns, 100))
    assert sum(f"mjsense {name}" in line for line in examples.splitlines()) >= 2
    assert not any(line.endswith(" ") for line in [*description.splitlines(), *examples.splitlines()])
    assert all(action.help and action.help.endswith((".", ".)", "]")) for action in of_name._actions if action.dest != "help")


def test_help_lists_the_commands():
    text = run("--help").stdout
    assert all(f"  {name} " in text for name in commands.COMMANDS)


@pytest.mark.parametrize("words", (["--help"], ["record", "--help"], ["complete", "--", "record", "--ro"], ["record", "--robt", "x"]))
def test_help_completion_and_wrong_usage_need_no_library(words):
    """Imports that took most of a second are not made: the program answers in less than 0.3 s of CPU."""
    done = subprocess.run([sys.executable, "-X", "importtime", "-m", "mjsense", *words], capture_output=True, text=True)
    loaded = {line.rsplit("|", 1)[1].strip() for line in done.stderr.splitlines() if line.startswith("import time:")}
    assert "mjsense.commands.start" in loaded
    assert not loaded & {"numpy", "mujoco", "gymnasium", "mjsense._core"}, loaded
    before = os.times()
    run("--help")
    after = os.times()
    assert after.children_user + after.children_system - before.children_user - before.children_system < 0.3


def test_a_closed_pipe_is_no_error():
    code = ("import types, sys; from mjsense import commands; from mjsense.commands import start; start.prepare_process(); "
            "start.module_of = lambda _: types.SimpleNamespace(run=lambda _: print('x' * 1000000)); "
            "raise SystemExit(commands.run(['quality', 'x']))")  # fmt: skip
    with subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        process.stdout.close()
        assert (process.stderr.read(), process.wait()) == ("", 141)


def test_errors_are_one_line(tmp_path):
    unknown = run("replai")
    assert unknown.returncode == 2 and "did you mean 'replay'" in unknown.stderr
    option = run("replay", "--epsodes", "1", "x")
    assert option.returncode == 2 and "no option named '--epsodes'; did you mean '--episodes'?" in option.stderr
    missing = run("replay", str(tmp_path / "nothing"))
    assert missing.returncode == 2 and missing.stderr.startswith("mjsense: ") and missing.stderr.count("\n") == 1


def test_an_error_of_the_system_names_the_file():
    assert start.message_of(PermissionError(13, "Permission denied", "out.lock")) == "out.lock: Permission denied"
    assert start.message_of(OSError("no network")) == "no network"


@pytest.mark.parametrize("words, hint", ((["render", "data", "out"], "; continue with --resume"), (["export", "zarr", "data", "out"], "")))
def test_an_interruption_is_reported(words, hint, monkeypatch, capsys):
    def interrupted(arguments):
        raise KeyboardInterrupt

    monkeypatch.setattr(f"mjsense.commands.{words[0]}.run", interrupted)
    assert commands.run(words) == 130
    assert capsys.readouterr().err == f"mjsense: interrupted{hint}\n"


@pytest.mark.parametrize("words, expected", ((["repl"], ["replay"]), (["replay", "--ep"], ["--episodes"]), (["replay", "--from", ""], ["actions", "states"])))
def test_completion(words, expected):
    assert run("complete", "--", *words).stdout.split() == expected


# Every key of an experiment file sets the option of its name and no other.


def settings(folder, text, command="record", words=()):
    """The parsed arguments of a command with an experiment file, those only that differ from the defaults."""
    (folder / "job.toml").write_text(text)
    given = vars(start.parsed([command, *words, "--config", str(folder / "job.toml")]))
    defaults = vars(start.parsed([command, *words]))
    return {name: value for name, value in given.items() if name != "config" and (name not in defaults or value != defaults[name])}


@pytest.mark.parametrize("text, expected", (
    ("task = 'pour'", {"task": "pour"}), ("robot = 'rum'", {"robot": "rum"}), ("policy = 'mine'", {"policy": "mine"}),
    ("episodes = 71", {"episodes": 71}), ("max_attempts = 72", {"max_attempts": 72}), ("worlds = 73", {"worlds": 73}),
    ("threads = 74", {"threads": 74}), ("seed = 75", {"seed": 75}), ("out = 'there'", {"out": "there"}),
    ("cameras = ['a', 'b']", {"cameras": ["a", "b"]}), ("cameras = 'c,d'", {"cameras": ["c", "d"]}), ("cameras = 'none'", {"cameras": []}),
    ("depth = true", {"depth": True}), ("samples = 5", {"samples": 5}), ("no_shadows = true", {"shadows": False}),
    ("shadows = false", {"shadows": False}), ("no_shadows = false", {"shadows": True}), ("horizon = 76", {"horizon": 76}),
    ("no_noise = true", {"action_noise": False}), ("keep_failures = true", {"keep_failures": True}), ("house = 77", {"house": 77}),
    ("batches = 3", {"batches": 3}), ("gzip = 8", {"gzip": 8}), ("crf = 31", {"crf": 31}), ("preset = 'slow'", {"preset": "slow"}),
    ("ffmpeg = '/bin/f'", {"ffmpeg": "/bin/f"}), ("molmospaces_depth = true", {"molmospaces_depth": True}), ("perturb = 1", {"perturb": 1}),
    ("queue_frames = 7", {"queue_frames": 7}), ("size = '64x48'", {"size": "64x48"}), ("", {}),
    ("ray = 'local'\nray_pip = 'a,b'", {"ray": "local", "ray_pip": "a,b"}), ("format = 'lerobot'\nmap = 'm.toml'", {"format": "lerobot", "map": "m.toml"}),
    ("trim_idle = false", {"trim_idle": False}), ("no_trim_idle = true", {"trim_idle": False}), ("no_sheet = true", {"sheet": False}),
    ("quiet = true\njson = true", {"quiet": True, "json": True}),
    ("seed = 1\nepisodes = 2\nno_noise = true\n", {"seed": 1, "episodes": 2, "action_noise": False}),
))  # fmt: skip
def test_each_key_sets_its_option_only(text, expected, tmp_path):
    assert settings(tmp_path, text) == expected


@pytest.mark.parametrize("command, words, text, expected", (
    ("verify", (), "path = 'data'\ndecode = true", {"path": "data", "decode": True}),
    ("render", ("a", "b"), "width = 64\nno_copy = true\nepisodes = [0, 3]\nadd_camera = ['top=pos=0,0,1']",
     {"width": 64, "copy": False, "episodes": [[0], [3]], "add_camera": [("top", {"pos": [0.0, 0.0, 1.0]})]}),
    ("export", (), "format = 'zarr'\npath = 'data'\nout = 'x'", {"format": "zarr", "path": "data", "out": "x"}),
    ("scan", (), "scene = 's.xml'\nframe = 'site:a'\nout = 'x.ply'\nchannels = 4\nno_exclude_parent_body = true\nsteps = 3",
     {"scene": "s.xml", "frame": "site:a", "out": "x.ply", "channels": 4, "exclude_parent_body": False, "steps": 3}),
    ("plot", ("data",), "stream = ['a', 'b']\nseconds = 2", {"stream": ["a", "b"], "seconds": 2}),
))  # fmt: skip
def test_every_command_reads_experiment_files(command, words, text, expected, tmp_path):
    (tmp_path / "job.toml").write_text(text)
    given = vars(start.parsed([command, *words, "--config", str(tmp_path / "job.toml")]))
    assert {name: given[name] for name in expected} == expected


def test_the_command_line_has_priority(tmp_path):
    (tmp_path / "job.toml").write_text("task = 'pour'\nseed = 1\nepisodes = 2")
    given = start.parsed(["record", "pick", "--seed", "3", f"--config={tmp_path / 'job.toml'}"])
    assert (given.task, given.seed, given.episodes) == ("pick", 3, 2)


@pytest.mark.parametrize("text, message", (
    *((wrong, "has the wrong type") for wrong in (
        "episodes = 1.5", "depth = 1", "task = true", "cameras = [1]", "cameras = 3", "size = 64", "no_noise = 'yes'", "json = 'x'", "ray = 3")),
    ("seed = 1\nsamles = 2\n", ":2: no key named 'samles'; did you mean 'samples'?"),
    ("seed = 1\ncameras = 'a,,b'", ":2: cameras is 'a,,b': must be a list"),
    ("format = 'lerobt'", ":1: format is 'lerobt': must be one of mjsense, lerobot; did you mean 'lerobot'?"),
    ("[options]\nseed = 1", ":1: no key named 'options'"),
    ("seed = 1\nworlds = 0", ":2: worlds is 0: must be at least 1"),
    ("seed = 1\nseed = 2", ":2: Cannot overwrite a value"),
))  # fmt: skip
def test_wrong_keys_and_types_name_the_line(text, message, tmp_path):
    with pytest.raises(ValueError, match=r"job\.toml:") as error:
        settings(tmp_path, text)
    assert message in str(error.value)


def test_files_that_are_no_text(tmp_path):
    (tmp_path / "latin.toml").write_bytes(b"seed = 1\ntask = '\xff'")
    with pytest.raises(ValueError, match=r"latin\.toml:2: is not UTF-8"):
        start.parsed(["record", "--config", str(tmp_path / "latin.toml")])


def test_an_experiment_file_with_a_format_or_ray_is_no_conflict(tmp_path):
    """They were handled by other parsers, which refused --config."""
    (tmp_path / "job.toml").write_text(f"format = 'lerobot'\nshard = '0/2'\nnum_attempts = 2\nout = '{tmp_path / 'out'}'")
    assert run("record", "--config", tmp_path / "job.toml").stderr == "mjsense: --shard cannot be combined with --format lerobot\n"


# Texts of the command line.

SEED = Field("seed", "seed", "seed", "unsigned", "")
STEPS = Field("steps", "steps", "steps", "int", "", low=1, high=9)


@pytest.mark.parametrize("field, text, value", (
    (STEPS, "4", 4), (SEED, "18446744073709551615", 2**64 - 1), (Field("on", "on", "on", "bool", ""), "false", False),
    (Field("x", "x", "x", "number", ""), "1e-05", 1e-5), (Field("m", "m", "m", "text", "", is_list=True), "b,a", ["b", "a"]),
    (Field("m", "m", "m", "text", "", is_list=True), "none", []), (Field("m", "m", "m", "number", "", is_list=True), "1,-2.5", [1.0, -2.5]),
    (Field("s", "s", "s", "text", "", words=("left", "right")), "left", "left"),
))  # fmt: skip
def test_texts_are_read(field, text, value):
    assert field.of_text(text, "--x") == value


@pytest.mark.parametrize("field, text, message", (
    (STEPS, "4.5", "--x is '4.5': must be an int of 32 bits"), (STEPS, "99999999999", "--x is '99999999999': must be an int of 32 bits"),
    (STEPS, "0", "--x is 0: must be between 1 and 9"), (STEPS, "1_0", "--x is '1_0': must be an int of 32 bits"), (STEPS, " 4", "--x is ' 4': must be an int of 32 bits"),
    (SEED, "-1", "--x is '-1': must be an int of 64 bits from 0 on"), (Field("on", "on", "on", "bool", ""), "1", "--x is '1': must be a bool"),
    (Field("m", "m", "m", "text", "", is_list=True), "a,,b", "--x is 'a,,b': must be a list, each a str, separated by commas, or none"),
    (Field("x", "x", "x", "number", "", low=0, above_low=True), "nan", "--x is nan: must be above 0"),
    (Field("s", "s", "s", "text", "", words=("left", "right")), "rihgt", "--x is 'rihgt': must be one of left, right; did you mean 'right'?"),
))  # fmt: skip
def test_wrong_texts_are_errors(field, text, message):
    with pytest.raises(ValueError) as error:
        field.of_text(text, "--x")
    assert str(error.value) == message


# What is printed.


@pytest.mark.parametrize("words, expected", (
    (["--episodes", "3", "0-2,7"], [3, 0, 1, 2, 7]), (["--episodes=4-4"], [4]), ([], None),
))  # fmt: skip
def test_positions_of_episodes(words, expected):
    for command in (["replay", "in"], ["render", "in", "out"], ["export", "rlds", "in", "out"], ["dataset", "delete", "in", "out"]):
        assert episodes_of(start.parsed([*command, *words])) == expected


def test_positions_of_episodes_in_experiment_files(tmp_path):
    (tmp_path / "job.toml").write_text("episodes = [3, 17]")
    assert episodes_of(start.parsed(["replay", "in", "--config", str(tmp_path / "job.toml")])) == [3, 17]


def test_sizes():
    assert [output.bytes_text(size) for size in (999, 1000, 1.5e6, 123456789)] == ["999 B", "1.0 kB", "1.5 MB", "123 MB"]


def test_names_do_not_control_the_terminal(capsys):
    assert output.table(("name", "unit"), [("a\x1b[31m", "m"), ("b\nc", "s")]) == "name    unit\na?[31m  m\nb?c     s"
    output.tell("mjsense: geom '\x1b[2Jx'\nnext")
    assert capsys.readouterr().err == "mjsense: geom '?[2Jx'\nnext\n"


def test_text_is_broken_at_spaces():
    assert parser.wrapped("one two three", 7) == ["one two", "three"]
    assert parser.wrapped("a extraordinary b", 4) == ["a", "extraordinary", "b"]
    assert parser.wrapped("éé éé", 5) == ["éé éé"]
    assert parser.wrapped("", 10) == [""]


def test_a_tree_lists_folders_and_sizes(tmp_path):
    (tmp_path / "b").mkdir()
    (tmp_path / "b/c").write_bytes(b"1234")
    (tmp_path / "a").touch()
    assert output.tree(str(tmp_path)) == f"{tmp_path}\n├── a  0 B\n└── b/\n    └── c  4 B"
    assert output.tree(str(tmp_path), 1).endswith("└── ... 2 more")


def test_names_that_are_not_utf8(tmp_path):
    """A recording may be in a folder with any name, but none is made there."""
    folder = os.fsencode(tmp_path) + b"/\xff"

    def mjsense(*words):
        done = subprocess.run([sys.executable, "-m", "mjsense", *words], capture_output=True)
        return done.returncode, done.stderr.replace(os.fsencode(tmp_path), b"")

    record = ["record", "pick", "--cameras", "none", "--horizon", "2", "--keep-failures", "-q", "--out"]
    assert mjsense(*record, folder) == (2, b"mjsense: recording: the output directory '/?' contains control characters\n")
    assert mjsense(*record, tmp_path / "data") == (0, b"")
    (tmp_path / "data").rename(os.fsdecode(folder))
    for command in ("inspect", "verify", "repair"):
        assert mjsense(command, folder) == (0, b"")
    assert mjsense("verify", folder + b"x") == (2, b"mjsense: /?x: no such file or directory\n")
