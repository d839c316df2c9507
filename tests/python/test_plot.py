# SPDX-License-Identifier: Apache-2.0
"""Plots of streams, progress on stderr, and what notebooks show."""

import io
import subprocess
import sys

import numpy as np
import pytest
from scenes import ball_scene, feet_cfg

import mjsense as mjs
from mjsense.core import progress_line, representations
from mjsense.viewer.plots import _expand


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    out = tmp_path_factory.mktemp("pick")
    mjs.record("pick", out=out, horizon=20, episodes=2, num_worlds=2, keep_failures=True, width=48, height=32, depth=True)
    return out


# ----------------------------------------------------------------------------------------------------------------------- plots


def test_names_of_streams():
    known = ["obs/extra/tcp_pose", "obs/agent/qpos/arm", "obs/agent/qpos/gripper", "actions/joint_pos/arm"]
    assert _expand(["tcp_pose"], known) == known[:1]
    assert _expand(["obs/agent/qpos", "tcp_pose"], known) == [known[1], known[2], known[0]]
    assert _expand(["*/arm"], known) == [known[1], known[3]]
    assert _expand(["arm"], known) == [known[1], known[3]]
    with pytest.raises(mjs.UnknownNameError, match="no stream 'tcp_pos'; did you mean 'obs/extra/tcp_pose'"):
        _expand(["tcp_pos"], known)
    with pytest.raises(mjs.UnknownNameError, match=r"no stream 'qpos'; did you mean 'obs/agent/qpos'\?"):  # a group
        _expand(["qpos"], known)
    with pytest.raises(mjs.UnknownNameError, match="there are obs/extra/tcp_pose, "):
        _expand(["zzz"], known)


def test_plot_of_a_recording(recording, tmp_path):
    pytest.importorskip("matplotlib")
    figure = mjs.plot(recording, ["tcp_pose", "obj_start", "qpos/arm", "wrist_camera", "wrist_camera_depth"], episodes=[0, 1], out=tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes().startswith(b"\x89PNG")
    poses, joints, rgb, depth = figure.axes  # the two streams of poses share an axis
    assert poses.get_ylabel() == "[m, wxyz]" and joints.get_title(loc="left") == "obs/agent/qpos/arm"
    assert poses.get_legend_handles_labels()[1][3:10:3] == ["tcp_pose qw", "tcp_pose qz", "obj_start z"]
    marks = [line for line in joints.lines if line.get_linestyle() == "--"]
    dataset = mjs.Dataset(recording)
    assert [mark.get_xdata()[0] for mark in marks] == [0, pytest.approx(21 / float(dataset.fps))]
    values = joints.lines[0].get_ydata()
    expected = [dataset.episodes[k]["obs/agent/qpos/arm"][:, 0] for k in range(2)]
    np.testing.assert_array_equal(values, [*expected[0], np.nan, *expected[1]])
    assert len(rgb.images) == len(depth.images) == 8
    np.testing.assert_array_equal(rgb.images[0].get_array(), dataset.episodes[0].video("wrist_camera")[0])


def test_plot_of_a_live_task():
    pytest.importorskip("matplotlib")
    figure = mjs.plot("pick", ["tcp_pose", "default_view/rgb"], seconds=0.5, width=32, height=24)
    curves, film = figure.axes
    assert len(curves.lines[0].get_xdata()) == 8 and len(film.images) == 8
    with pytest.raises(mjs.UnknownNameError, match="no stream 'tcppose'; did you mean 'tcp_pose'"):
        mjs.plot("pick", ["tcppose"])


def test_program(recording, tmp_path):
    pytest.importorskip("matplotlib")
    command = [sys.executable, "-m", "mjsense", "plot", str(recording), "--stream"]
    run = {"cwd": tmp_path, "capture_output": True, "text": True}
    done = subprocess.run([*command, "tcp_pose", "--out", "a.svg"], **run)
    assert (done.returncode, done.stdout, done.stderr) == (0, "Wrote a.svg.\n", "") and (tmp_path / "a.svg").exists()
    wrong = subprocess.run([*command, "tcp_pose", "--episode", "2"], **run)
    assert wrong.returncode == 2 and "episode 2: must be in [0, 2)" in wrong.stderr


# -------------------------------------------------------------------------------------------------------------------- progress


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_of_recordings(tmp_path, monkeypatch):
    small = dict(out=tmp_path, horizon=3, keep_failures=True, cameras=[], num_worlds=1)
    monkeypatch.setattr(sys, "stderr", Terminal())
    mjs.record("pick", **small)
    lines = sys.stderr.getvalue()
    assert lines.startswith("\r0/1 episodes") and lines.count("\n") == 1 and "1/1 episodes  0 % success" in lines.rsplit("\r", 1)[1]
    monkeypatch.setattr(sys, "stderr", Terminal())
    assert mjs.check_replay(tmp_path).ok
    assert sys.stderr.getvalue() == "\r1/1 checks\n"
    monkeypatch.setattr(sys, "stderr", Terminal())
    mjs.record("pick", progress=False, house=1, **small)
    mjs.check_replay(tmp_path, progress=False)
    assert sys.stderr.getvalue() == ""
    monkeypatch.setattr(sys, "stderr", io.StringIO())
    mjs.record("pick", house=2, **small)
    assert sys.stderr.getvalue() == ""  # no terminal
    mjs.record("pick", house=3, progress=True, **small)
    assert sys.stderr.getvalue().endswith("steps/s\n") and "\r" not in sys.stderr.getvalue()


def test_an_interrupted_count_ends_its_line(monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    with pytest.raises(ZeroDivisionError):
        for k in progress_line.tracked(range(3), 3, "files"):
            1 / (1 - k)
    assert sys.stderr.getvalue().endswith("1/3 files              \n") or sys.stderr.getvalue().rstrip(" \n").endswith("1/3 files")
    assert [progress_line.clock(s) for s in (7, 65, 9067)] == ["0:07", "1:05", "2:31:07"]


# ------------------------------------------------------------------------------------------------------------------- notebooks


def test_depth_has_a_colour_map():
    depth = np.array([[[1.0], [2.0], [0.0]]], np.float32)
    near, far, none = representations.coloured(depth)[0]
    assert tuple(near) == (253, 231, 37) and tuple(far) == (68, 1, 84) and tuple(none) == (0, 0, 0)
    assert representations.is_image((4, 5, 1), "float32") and not representations.is_image((4, 4), "float32") and representations.coloured(np.zeros((2, 2, 2))) is None


def test_notebooks(recording, tmp_path):
    scene = ball_scene(feet_cfg(fields=("found", "force")))
    sim = mjs.Simulation(scene, num_worlds=3)
    text = scene._repr_html_()
    configured, folded = text.split("<details>")
    assert "&#x27;touch&#x27;" in configured and "ball/acc" in folded  # those of the model's XML are folded
    assert "1 body, 1 joint" in repr(scene["ball"]) and "<td style='text-align:left'>body</td>" in scene["ball"]._repr_html_()
    assert "<td style='text-align:left'>3</td>" in sim._repr_html_() and text in sim._repr_html_()
    sim.close()
    assert "closed" in sim._repr_html_()
    dataset = mjs.Dataset(recording)
    text = dataset._repr_html_()
    assert text.count("<img") == 12 and "obs/extra/tcp_pose" in text.split("<details>")[1]
    assert "wrist_camera_depth, step 10" in dataset.episodes[0]._repr_html_()
    summary = mjs.record("pick", out=tmp_path, horizon=2, keep_failures=True, cameras=[])
    assert "1 of 1" in summary._repr_html_() and "horizon reached" in summary._repr_html_()
