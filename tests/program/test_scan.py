# SPDX-License-Identifier: Apache-2.0
"""Tests of `mjsense scan`, which writes a lidar scan of a scene as a point cloud."""

import resource
import subprocess

import numpy as np
import pytest

ROOM = """<mujoco><worldbody>
  <geom type="plane" size="0 0 .1"/><geom type="box" size=".5 20 20" pos="3.5 0 0"/>
  <body name="mast" pos="0 0 1"><geom size=".05"/><site name="head"/></body>
</worldbody></mujoco>"""


@pytest.fixture
def room(tmp_path):
    (tmp_path / "room.xml").write_text(ROOM)
    return "room.xml"


def points(path):
    header, body = path.read_bytes().split(b"end_header\n", 1)
    cloud = np.frombuffer(body, np.float32).reshape(-1, 4)
    assert f"element vertex {len(cloud)}\n".encode() in header
    return cloud


def test_point_cloud_of_a_wall_and_a_floor(mjsense, room):
    done = mjsense("scan", room, "--frame", "site:head", "--out", "cloud.ply")
    cloud = points(mjsense.folder / "cloud.ply")
    assert f"{len(cloud)} of 5760 rays returned" in done.stdout
    on_wall, on_floor = np.abs(cloud[:, 0] - 3) < 1e-4, np.abs(cloud[:, 2] + 1) < 1e-4
    assert (on_wall | on_floor).all() and on_wall.any() and on_floor.any()
    mjsense("scan", room, "--frame", "site:head", "--out", "world.ply", "--world")
    shift = points(mjsense.folder / "world.ply")[:, :3] - cloud[:, :3]
    assert np.abs(shift - [0, 0, 1]).max() < 1e-4


def test_embedded_model(mjsense):
    done = mjsense("scan", "embedded:scenes/table/room.xml", "--frame", "geom:table_top", "--out", "cloud.ply")
    cloud = points(mjsense.folder / "cloud.ply")
    assert f"{len(cloud)} of 5760 rays returned" in done.stdout
    on_floor = np.abs(cloud[:, 2] + 0.585) < 1e-4  # m, height of the table top
    on_wall = np.abs(cloud[:, 0] - 1.65) < 1e-4
    assert on_floor.sum() > 100 and on_wall.sum() > 100
    assert "imu" in mjsense("sensors", "embedded:robots/quadruped.xml").stdout


def test_table_of_angles(mjsense, room):
    np.save(mjsense.folder / "ahead.npy", np.array([[0.0, 0.0], [np.pi, 0.0]], np.float32))
    done = mjsense("scan", room, "--frame", "site:head", "--table", "ahead.npy", "--out", "cloud.ply")
    assert "1 of 2 rays returned" in done.stdout
    done = mjsense("scan", room, "--frame", "site:head", "--table", "ahead.npy", "--rays", "1", "--out", "cloud.ply")
    assert "1 of 1 rays returned" in done.stdout
    done = mjsense("scan", room, "--frame", "site:head", "--table", "ahead.npy", "--channels", "4", "--out", "cloud.ply", rc=2)
    assert "--table excludes --channels" in done.stderr


def few_bytes():
    resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))


def test_limit_on_the_size_of_files(mjsense, room):
    """With a file size limit (ulimit -f), the program fails as with a full disk and leaves no file; likewise if it writes to
    stdout."""
    done = mjsense("scan", room, "--frame", "site:head", "--out", "cloud.ply", rc=2, preexec_fn=few_bytes)
    assert done.stderr == "mjsense: cannot write 'cloud.ply': File too large\n"
    assert [p.name for p in mjsense.folder.iterdir()] == ["room.xml"]
    with open(mjsense.folder / "schema.json", "w") as out:
        done = subprocess.run([*mjsense.program, "schema"], stdout=out, stderr=subprocess.PIPE, text=True, preexec_fn=few_bytes)
    assert (done.returncode, done.stderr) == (2, "mjsense: cannot write to stdout: File too large\n")


def test_negative_steps(mjsense, room):
    done = mjsense("scan", room, "--frame", "site:head", "--out", "cloud.ply", "--steps", "-5", rc=2)
    assert "Value -5 not in range" in done.stderr and len(done.stderr) < 200


@pytest.mark.parametrize("frame, out, message", [
    ("site:heat", "a.ply", "did you mean 'head'"),
    ("head", "a.ply", "site:head"),
    ("site:head", "a.xyz", ".ply or .pcd"),
])
def test_wrong_input(mjsense, room, frame, out, message):
    assert message in mjsense("scan", room, "--frame", frame, "--out", out, rc=2).stderr
