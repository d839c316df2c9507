# SPDX-License-Identifier: Apache-2.0
"""Tests of the other commands of mjsense, and of invalid input: one line of error, exit code 2, and no incomplete files."""

import json
import os
import shlex
import subprocess

import pytest

from mjsense.commands import start

SCENE = """<mujoco><worldbody><body name="ball"><freejoint/><geom size=".1"/><site name="s"/></body></worldbody>
<sensor><gyro name="turn" site="s"/></sensor></mujoco>"""


@pytest.mark.parametrize("args, line", [
    ("record pik --out x", "no task named 'pik'; did you mean 'pick'?"),
    ("record pick --out x --robot frnka", "no robot named 'frnka'; did you mean 'franka'?"),
    ("record pick --out x --policy planer", "no policy named 'planer'; did you mean 'planner'?"),
    ("record pick --out x --cameras exo_camera_2", "no camera named 'exo_camera_2'; did you mean 'exo_camera_1'"),
    ("record pick", "the output directory is missing: pass --out DIR"),
    ("record pick --out x --episodes 0", "episodes is 0: must be at least 1"),
    ("record pick --out x --episodes many", "--episodes"),
    ("record pick --out x --worlds -1", "worlds is -1: must be at least 1"),
    ("record pick --out x --threads -1", "threads is -1"),
    ("record pick --out x --size 640", "size '640': expected WIDTHxHEIGHT"),
    ("record pick --out x --size 0x10", "size '0x10'"),
    ("record pick --out x --samples 0", "samples"),
    ("record pick --out x --bogus", "--bogus"),
    ("record pick --out /proc/x", "/proc/x"),
    ("record pick --out x --ffmpeg /no/ffmpeg", "/no/ffmpeg"),
    ("record pick --config missing.toml --out x", "missing.toml: no such file"),
    ("record pick --config typo.toml --out x", "typo.toml:2: no key named 'episods'; did you mean 'episodes'?"),
    ("record pick --config type.toml --out x", "type.toml:1: the value of 'episodes' has the wrong type"),
    ("record pick --config broken.toml --out x", "broken.toml:1"),
    ("recrd", "no command 'recrd'; did you mean 'record'?"),
    ("sensors missing.xml", "missing.xml: no such file"),
    ("sensors broken.xml", "broken.xml"),
    ("sensors embedded:robots/quadrupd.xml", "did you mean 'robots/quadruped.xml'?"),
    ("sensors pik", "did you mean 'pick'?"),
    ("inspect missing", "missing: no such file or directory"),
    ("verify missing", "missing: no such file or directory"),
    ("repair missing", "missing: no such file or directory"),
    ("--bogus", "no option '--bogus'"),
    ("tasks extra", "extra"),
    ("robots --bogus", "--bogus"),
    ("scenes --jsn", "--jsn"),
    ("schema extra", "extra"),
    ("inspect broken.xml", "cannot open 'broken.xml'"),
    ("inspect broken.xml --sheet x.png", "cannot open 'broken.xml'"),
    ("inspect folder", "'folder' contains no recording"),
    ("inspect pipe", "'pipe' is neither a file nor a folder"),
    ("inspect link.h5", "'link.h5' is a symbolic link, which is not followed"),
    ("inspect folder extra", "extra"),
    ("verify", "argument 'path' is missing: A recording"),
    ("verify folder", "'folder' contains no recording"),
    ("verify /dev/null", "'/dev/null' is neither a file nor a folder"),
    ("verify pipe", "'pipe' is neither a file nor a folder"),
    ("repair folder", "'folder' contains no recording"),
    ("repair pipe", "'pipe' is neither a file nor a folder"),
    ("repair broken.xml", "'broken.xml' is not named trajectories_batch_*_of_*.h5"),
    ("sensors", "argument 'SCENE.xml|TASK' is missing"),
    ("sensors folder", "folder: is not a file; expected an MJCF file or the name of a task"),
    ("sensors pipe", "pipe: is not a file"),
    ("sensors scene.xml --robot franka", "--robot applies to tasks only, and scene.xml is a scene"),
    ("sensors scene.xml --steps -1", "--steps"),
    ("sensors pick --scene tabel", "no scene named 'tabel'; did you mean 'table'?"),
    ("sensors pick --set foo=1", "no field named 'foo'"),
    ("scan scene.xml --frame site:s", "option --out is missing"),
    ("scan missing.xml --frame site:s --out x.ply", "missing.xml"),
    ("scan folder --frame site:s --out x.ply", "folder"),
    ("scan pipe --frame site:s --out x.ply", "pipe"),
    ("scan scene --frame site:s --out x.ply", "'scene': no such file"),
    ("scan embedded:robots/quadrupd.xml --frame site:s --out x.ply", "did you mean 'robots/quadruped.xml'?"),
    ("scan broken.xml --frame site:s --out x.ply", "broken.xml"),
    ("scan scene.xml --frame here --out x.ply", "--frame here: expected a type and a name"),
    ("scan scene.xml --frame site:t --out x.ply", "no site named 't'; did you mean 's'?"),
    ("scan scene.xml --frame site:s --out x.txt", "the name must end in .ply or .pcd"),
    ("scan scene.xml --frame site:s --out no/x.ply", "cannot write 'no/x.ply'"),
    ("scan scene.xml --frame site:s --out x.ply --table broken.xml", "'broken.xml': is not a .npy file"),
    ("scan scene.xml --frame site:s --out x.ply --steps 99999999999", "--steps"),
    ("record pick --out file", "cannot create the directory 'file/house_0'"),
    ("record pick --out x --seed -1", "--seed is '-1': must be an int of 64 bits from 0 on"),
    ("record pick --out x --episodes 4294967297", "--episodes is '4294967297': must be an int"),
    ("record pick --out x --worlds 4294967297", "--worlds is '4294967297': must be an int"),
    ("record pick --out x --threads 5000", "threads is 5000: must be 0 (all) to 4096"),
    ("record pick --out x --perturb nan", "perturb is nan"),
    ("record pick --out x --scene tabel", "no scene named 'tabel'"),
    ("record pick --out x --set foo", "--set foo: expected NAME=VALUE"),
    ("record pick --out x --ffmpeg /bin/true", "'/bin/true' has no encoder"),
    ("record pick --out x --config folder", "folder: is a folder, expected a file"),
    ("record pick --out x --config pipe", "pipe: is a pipe, expected a file"),
    ("record nav_to_obj --out x --robot franka", "needs a mobile base"),
    ("record packing --out x --scene table", "scene 'table' has no receptacle"),
    ("record pick --out x --cameras none extra", "extra"),
])
def test_invalid_input_is_a_one_line_error(mjsense, args, line):
    (mjsense.folder / "scene.xml").write_text(SCENE)
    (mjsense.folder / "file").write_text("mine")
    (mjsense.folder / "folder").mkdir()
    (mjsense.folder / "link.h5").symlink_to("file")
    os.mkfifo(mjsense.folder / "pipe")
    (mjsense.folder / "typo.toml").write_text('task = "pick"\nepisods = 3\n')
    (mjsense.folder / "type.toml").write_text('episodes = "three"\n')
    (mjsense.folder / "broken.toml").write_text("episodes = = 3\n")
    (mjsense.folder / "broken.xml").write_text("<mujoco><worldbody>\n")
    before = sorted(mjsense.folder.iterdir())
    done = mjsense(*args.split(), rc=2)
    assert line in done.stderr
    assert done.stderr.startswith("mjsense: ") and done.stderr.count("\n") == 1, done.stderr
    assert done.stdout == ""
    assert sorted(mjsense.folder.iterdir()) == before


def numbers_of_record(mjsense):
    """(name, kind, whether it is a list) of every numeric option of `record`."""
    fields = json.loads(mjsense("schema").stdout)["structs"]["RecordJobCfg"]["fields"]
    kinds = [(f["option"], f["type"].get("element", f["type"])["kind"], f["type"]["kind"] == "list") for f in fields]
    return [(name, kind, several) for name, kind, several in kinds if kind in ("int", "unsigned", "number")]


def test_numbers_out_of_range_are_rejected_everywhere(mjsense, capsys, monkeypatch):
    """Integers beyond 32 bits are rejected, not truncated (4294967297 would become 1), and so is NaN: in experiment files, as
    options, by --set."""
    wrong = {"int": (2**32 + 1, 1 - 2**32, 2**31, 2**64 + 1, -1, "2.0", '"2"'), "unsigned": (-1, 2**64 + 1, "1.5"), "number": ("nan", "-inf")}
    numbers = numbers_of_record(mjsense)
    assert len(numbers) > 15
    monkeypatch.chdir(mjsense.folder)
    for name, kind, several in numbers:
        for value in wrong[kind]:
            if several and value == '"2"':  # a text is a list of what it contains
                continue
            (mjsense.folder / "e.toml").write_text(f"{name} = {value}\n")
            ways = [["--config", "e.toml"]]
            if value in (wrong[kind][0], wrong[kind][1]):
                ways += [[f"--{name.replace('_', '-')}={value}"], ["--set", f"{name}={value}"]]
            for way in ways:
                # In this process: starting 300 programs takes minutes.
                assert start.main(["record", "pick", "--out", "x", *way]) == 2
                out, err = capsys.readouterr()
                assert err.startswith("mjsense: ") and err.count("\n") == 1 and not out, (name, value, way)
                assert name.replace("_", "-") in err.replace("_", "-") or "64 bits" in err, (name, value, way, err)
    assert [p.name for p in mjsense.folder.iterdir()] == ["e.toml"]


@pytest.mark.parametrize("args", ("''", "inspect ''", "verify ''", "repair ''", "sensors ''", "scan '' --frame site:s --out x.ply",
                                  "record '' --out x", "record pick --out ''", "record pick --out x --config ''"))  # fmt: skip
def test_empty_argument_is_one_clear_line(mjsense, args):
    done = mjsense(*shlex.split(args), rc=2)
    assert done.stderr.startswith("mjsense: ") and done.stderr.count("\n") == 1 and not done.stdout
    assert not list(mjsense.folder.iterdir())


WORDS = ("tasks", "robots", "scenes", "schema", "--help", "--version", "record --help", "inspect data", "verify data", "repair data",
         "verify data --json", "inspect data --json", "sensors scene.xml", "scan scene.xml --frame site:s --out cloud.ply",
         "record pick --out more --cameras none --horizon 2 --keep-failures -q --json")  # fmt: skip


def test_unwritable_stdout_is_an_error_of_every_command(mjsense):
    (mjsense.folder / "scene.xml").write_text(SCENE)
    mjsense("record", "pick", "--cameras", "none", "--horizon", 2, "--keep-failures", "-q", "--out", "data")
    for word in WORDS:
        with open("/dev/full", "w") as full:
            done = subprocess.run([*mjsense.program, *word.split()], cwd=mjsense.folder, stdout=full, stderr=subprocess.PIPE, text=True)
        assert (done.returncode, done.stderr) == (2, "mjsense: cannot write to stdout: No space left on device\n"), word


def test_no_command_lists_the_commands(mjsense):
    done = mjsense(rc=2)
    assert "record" in done.stderr and "verify" in done.stderr


def test_output_folder_that_cannot_be_created(mjsense):
    (mjsense.folder / "file").write_text("")
    done = mjsense("record", "pick", "--cameras", "none", "--out", "file", rc=2)
    assert "file" in done.stderr and done.stderr.count("\n") == 1


@pytest.mark.parametrize("name", ("file:a:b", "-y", "a b%d", "tcp://x"))
def test_folder_names_are_never_options_or_addresses(mjsense, name):
    """ffmpeg must not interpret any part of the folder's name as an option or a protocol."""
    mjsense("record", "pick", "--size", "32x24", "--horizon", 2, "--keep-failures", "-q", f"--out={name}")
    assert "intact: 1 file, 1 episode, " in mjsense("verify", "--", name).stdout
    assert sorted(p.name for p in (mjsense.folder / name).iterdir()) == ["contact_sheet.png", "house_0"]


def test_another_recording_is_not_overwritten(mjsense):
    quick = ["record", "pick", "--cameras", "none", "--horizon", 3, "--keep-failures", "-q", "--out", "data"]
    mjsense(*quick)
    before = (mjsense.folder / "data/house_0/trajectories_batch_1_of_1.h5").read_bytes()
    mjsense(*quick, rc=2)
    mjsense(*quick, "--seed", 1, rc=2)
    assert (mjsense.folder / "data/house_0/trajectories_batch_1_of_1.h5").read_bytes() == before
    mjsense(*quick, "--house", 1)


def test_help_and_version(mjsense):
    assert mjsense("--version").stdout.startswith("mjsense ")
    for word in ("record", "sensors", "inspect", "verify", "repair"):
        assert "Usage" in mjsense(word, "--help").stdout


def test_unknown_commands_run_programs_from_path(mjsense):
    tool = mjsense.folder / "bin/mjsense-hello"
    tool.parent.mkdir()
    tool.write_text('#!/bin/sh\necho "hello $*"\nexit 7\n')
    tool.chmod(0o755)
    path = {"PATH": f"{tool.parent}:{os.environ['PATH']}"}
    assert mjsense("hello", "you", "--there", rc=7, env=path).stdout == "hello you --there\n"
    assert "did you mean 'hello'?" in mjsense("helo", rc=2, env=path).stderr


def test_sensors_of_a_scene(mjsense):
    (mjsense.folder / "scene.xml").write_text(SCENE)
    out = mjsense("sensors", "scene.xml").stdout
    assert "turn" in out and "rad/s" in out
    table = json.loads(mjsense("sensors", "scene.xml", "--json").stdout)
    turn = next(s for s in table if s["name"] == "turn")
    assert turn["shape"] == [3] and turn["bytes"] == 12 and turn["microseconds"] > 0


def test_sensors_of_a_task(mjsense):
    table = json.loads(mjsense("sensors", "pick", "--json", "--size", "64x48", "--steps", 2).stdout)
    names = ["/".join(s["name"].split("/")[: 2 if s["name"].startswith("actions/") else 1]) for s in table]
    assert list(dict.fromkeys(names)) == [
        "sensor_param_wrist_camera", "wrist_camera", "sensor_param_exo_camera_1", "exo_camera_1", "qpos", "qvel",
        "robot_base_pose", "env_states", "task_info", "actions/commanded_action", "actions/joint_pos",
        "actions/joint_pos_rel", "actions/ee_twist", "actions/ee_pose", "object_image_points", "obj_start",
        "grasp_state_pickup_obj", "obj_end", "tcp_pose", "policy_phase", "policy_num_retries", "grasp_pose"]


def test_verify_inspect_repair(mjsense):
    mjsense("record", "pick", "--size", "64x48", "--horizon", 4, "--keep-failures", "-q", "--out", "data")
    assert json.loads(mjsense("verify", "data", "--json").stdout)
    inspected = json.loads(mjsense("inspect", "data", "--json", "--sheet", "sheet.png").stdout)
    numbers = [stream for stream in inspected["streams"] if stream["count"]]
    assert len(numbers) > 10 and any(stream["min"] < stream["mean"] < stream["max"] for stream in numbers)
    for stream in numbers:
        slack = 1e-9 * max(1, abs(stream["mean"]))
        assert stream["min"] <= stream["mean"] + slack and stream["mean"] <= stream["max"] + slack, stream
    assert (mjsense.folder / "sheet.png").read_bytes().startswith(b"\x89PNG")
    mjsense("repair", "data")
    for wrong in (["--sheet", "no/x.png"], ["--sheet", "data"], ["--sheet", ""], ["--sheet", "x.png", "--ffmpeg", "/no/ffmpeg"],
                  ["--sheet", "x.png", "--ffmpeg", "/bin/true"]):  # fmt: skip
        done = mjsense("inspect", "data", *wrong, rc=2)
        assert done.stderr.startswith("mjsense: ") and done.stderr.count("\n") == 1 and not done.stdout
    assert sorted(p.name for p in mjsense.folder.iterdir()) == ["data", "sheet.png"]
    video = next((mjsense.folder / "data/house_0").glob("*.mp4"))
    video.unlink()
    done = mjsense("verify", "data", rc=1)
    assert video.name in done.stdout


def unwrapped(text):
    return " ".join(text.split())


def test_help_names_tasks_robots_and_policies(mjsense):
    import mjsense as package

    text = unwrapped(mjsense("record", "--help").stdout)
    for names in (package.task_names(), package.robot_names(), package.policy_names()):
        assert f"One of: {', '.join(names)}." in text
    assert ", ".join(package.task_names()) in unwrapped(mjsense("sensors", "--help").stdout)


def test_help_describes_flags(mjsense):
    text = unwrapped(mjsense("record", "--help").stdout)
    assert "--no-shadows Do not draw shadows." in text
    assert "--meshes auto|shapes|real" in text


@pytest.mark.parametrize("words, expected", (
    (["re"], ["record", "repair", "replay", "render", "results"]),
    (["record", "door"], ["door_opening"]),
    (["serve", "net.py:Net", "--task", "pi"], ["pick", "pick_and_place", "pick_and_place_next_to", "pick_and_place_color"]),
    (["evaluate", "--adapter", ""], ["droid", "features", "streams"]),
    (["record", "--robot", "fra"], ["franka", "franka_hand"]),
    (["record", "--meshes", ""], ["auto", "shapes", "real"]),
    (["scan", "--ray-alignment", ""], ["base", "yaw", "world"]),
    (["record", "pick", "--term"], ["--terminate-upon-success"]),
    (["record", "--out", ""], []),  # the shell completes file names
    (["inspect", ""], []),
    (["nothing", ""], []),
))  # fmt: skip
def test_completion(mjsense, words, expected):
    assert mjsense("complete", "--", *words).stdout.split() == expected


@pytest.mark.parametrize("command", ("tasks", "robots", "scenes", "objects"))
def test_lists_are_text_or_json(mjsense, command):
    text, listed = mjsense(command).stdout, json.loads(mjsense(command, "--json").stdout)
    assert len(listed) > 1 and not text.startswith("[")
    for one in listed:
        assert one["name"] in text and (command == "objects" or one["description"].split()[0] in text)


def test_completion_in_bash(mjsense):
    """Completes like bash: sources the script, calls the function with COMP_WORDS, and reads the candidates from COMPREPLY."""
    installed = mjsense.folder / "bin/mjsense"
    installed.parent.mkdir()
    installed.write_text(f'#!/bin/sh\nexec {shlex.join(mjsense.program)} "$@"\n')
    installed.chmod(0o755)
    script = '''source <("$1/mjsense" completion bash); PATH="$1:$PATH"; COMP_WORDS=(mjsense record --policy p); COMP_CWORD=3; _mjsense
    printf '%s\n' "${COMPREPLY[@]}"'''
    done = subprocess.run(["bash", "-c", script, "bash", installed.parent], capture_output=True, text=True)
    assert done.stdout.split() == ["planner"], done.stderr


def test_completion_of_another_shell_is_an_error(mjsense):
    assert "did you mean 'fish'?" in mjsense("completion", "fisch", rc=2).stderr
    for shell in ("bash", "zsh", "fish"):
        assert "mjsense complete -- " in mjsense("completion", shell).stdout


BALL = """<mujoco><option timestep="{timestep}"/><worldbody><geom type="plane" size="1 1 1"/>
<body name="ball" pos="{x} 0 .09"><freejoint/><geom size=".1"/><site name="imu"/></body></worldbody>
<sensor><accelerometer name="acc" site="imu"/></sensor></mujoco>"""


@pytest.mark.parametrize("command", (["sensors"], ["scan", "--frame", "site:imu", "--out", "x.ply"]))
def test_invalid_scenes_are_reported(mjsense, command):
    def run(rc, **values):
        (mjsense.folder / "ball.xml").write_text(BALL.format(**{"timestep": 0.002, "x": 0, **values}))
        return mjsense(command[0], "ball.xml", *command[1:], rc=rc)

    done = run(2, x="nan")
    assert "body_pos of body 'ball' is nan: must be finite" in done.stderr and not done.stdout
    assert "timestep is 0" in run(2, timestep=0).stderr
    assert "a timestep of 10 s is long" in run(0, timestep=10).stderr
    assert not run(0).stderr


def test_physics_that_fails_prints_no_table(mjsense):
    stiff = BALL.format(timestep=0.002, x=0).replace("<freejoint/>", '<joint type="slide" stiffness="-1e13"/><joint damping="-1e6"/>')
    (mjsense.folder / "ball.xml").write_text(stiff)
    done = mjsense("sensors", "ball.xml", rc=2)
    assert "ball.xml: the physics failed: " in done.stderr and not done.stdout
    assert [p.name for p in mjsense.folder.iterdir()] == ["ball.xml"]  # without MuJoCo's log file


def test_quiet_prints_nothing_but_errors(mjsense):
    done = mjsense("record", "pick", "--cameras", "none", "--horizon", 2, "--keep-failures", "-q", "--out", "data")
    assert (done.stdout, done.stderr) == ("", "")
    done = mjsense("verify", "-q", "data")
    assert (done.stdout, done.stderr) == ("", "")
    (mjsense.folder / "data/house_0/trajectories_batch_1_of_1.h5").write_bytes(b"damaged")
    assert "NOT intact" in mjsense("verify", "-q", "data", rc=1).stdout


def test_record_reports_the_contact_sheet(mjsense):
    text = mjsense("record", "pick", "--episodes", 5, "--horizon", 2, "--keep-failures", "--size", "32x24", "--out", "d").stdout
    assert "contact sheet, every camera over time (4 of 5 episodes): d/contact_sheet.png" in text
