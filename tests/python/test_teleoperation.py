# SPDX-License-Identifier: Apache-2.0
"""A person drives a robot in the browser: here a script that presses keys in headless Chromium."""

import json
import re
import subprocess
import sys
import time
import types

import numpy as np
import pytest

pytest.importorskip("viser", reason="viser is not installed")

from devtools import Page, needs_chromium
from program_runs import run_program

import mjsense as mjs
from mjsense.core.rotations import rotation_of
from mjsense.tasks.teleoperation.devices import SpaceMouse, device_of
from mjsense.tasks.teleoperation.page import STEP, TURN
from mjsense.tasks.teleoperation.pose import Pose
from mjsense.tasks.teleoperation.teleoperation import Teleoperation

KEYS = {(0, 1): "I", (0, -1): "K", (1, 1): "J", (1, -1): "L", (2, 1): "U", (2, -1): "M"}
SEED = 3


def test_poses_and_displacements():
    generator = np.random.default_rng(1)
    for _ in range(20):
        base, pose = (Pose(generator.normal(size=3), (q := generator.normal(size=4)) / np.linalg.norm(q)) for _ in range(2))
        back = pose.seen_from(base).carried_by(base)
        np.testing.assert_allclose(back.position, pose.position, atol=1e-12)
        assert abs(back.quaternion @ pose.quaternion) == pytest.approx(1)
    turned = Pose(np.zeros(3), np.array([1.0, 0, 0, 0])).moved(np.zeros(3), np.array([0, 0, np.pi / 2]))
    np.testing.assert_allclose(turned.quaternion, [np.sqrt(0.5), 0, 0, np.sqrt(0.5)])


def test_spacemouse(monkeypatch):
    """A simulated device. Axes: forward is +x of the base, left is +y."""
    state = types.SimpleNamespace(x=0.0, y=1.0, z=0.0, roll=0.0, pitch=0.0, yaw=0.02, buttons=[0, 0])
    monkeypatch.setitem(sys.modules, "pyspacemouse", types.SimpleNamespace(open=lambda: True, read=lambda: state))
    device = device_of("spacemouse")
    motion = device.read(0.1)
    np.testing.assert_allclose(motion.translation, [SpaceMouse.SPEED * 0.1, 0, 0])
    assert not motion.rotation.any() and not motion.toggle_gripper, "0.02 is in the dead zone"
    state.x, state.y, state.roll = -np.inf, 1e9, np.nan
    np.testing.assert_allclose(device.read(0.1).translation, [SpaceMouse.SPEED * 0.1, SpaceMouse.SPEED * 0.1, 0], err_msg="a device that is broken")
    assert not device.read(0.1).rotation.any()
    state.buttons = [1, 0]
    assert device.read(0.1).toggle_gripper and not device.read(0.1).toggle_gripper, "once per press"
    monkeypatch.setitem(sys.modules, "pyspacemouse", types.SimpleNamespace(open=lambda: False))
    with pytest.raises(RuntimeError, match="finds no SpaceMouse"):
        device_of("spacemouse")
    with pytest.raises(ValueError, match="must be keyboard or spacemouse"):
        device_of("gamepad")


def test_commands_are_within_the_bounds():
    policy = Teleoperation("pick")
    policy.action_groups, policy.action_low, policy.action_high = {"arm": slice(0, 2), "gripper": slice(2, 3)}, np.array([-1.0, -2, 0]), np.array([1.0, 2, 0.04])
    np.testing.assert_array_equal(policy._possible("arm", np.array([1e300, -0.5])), [[1, -0.5]])
    np.testing.assert_array_equal(policy._possible("gripper", np.array([-1.0])), [[0]])
    with pytest.raises(ValueError, match="a command of move group 'arm' is not finite"):
        policy._possible("arm", np.array([np.nan, 0]))


def test_errors(tmp_path):
    with pytest.raises(ValueError, match="no move group 'left'; there are arm, gripper"):
        mjs.play("pick", out=tmp_path / "a", arm="left", open_browser=False, cameras=[])
    with pytest.raises(ValueError, match="must be ee_pose"):
        mjs.play("pick", out=tmp_path / "b", arm_controller="ee_delta_pose", open_browser=False, cameras=[])


def presses(page, key, count):
    for _ in range(count):
        name, code, number = {"space": (" ", "Space", 32)}.get(key) or (key.lower(), f"Key{key}", ord(key))
        for kind in ("keyDown", "keyUp"):
            page.call("Input.dispatchKeyEvent", type=kind, key=name, code=code, windowsVirtualKeyCode=number)
        time.sleep(0.02)


@needs_chromium
def test_a_block_is_picked_with_keys(tmp_path, port):
    """The recording verifies and replays."""
    options = {"scene": "table", "cameras": []}
    env = mjs.make_vec("pick", seed=SEED, arm_controller="ee_pose", **options)
    env.reset(seed=SEED)
    target = Pose.of_row(env.rows["actions/ee_pose/arm"][0])
    base = Pose.of_row(env.rows["robot_base_pose"][0])
    block = Pose.of_row(env.rows["obj_start"][0]).seen_from(base)
    env.close()
    away = np.round((block.position - target.position) / STEP).astype(int)
    yaws = [np.arctan2(*rotation_of(pose.quaternion)[1::-1, 0]) for pose in (block, target)]
    turn = round(((yaws[0] - yaws[1] + np.pi / 4) % (np.pi / 2) - np.pi / 4) / TURN)  # of a cube

    words = ["play", "pick", "--scene", options["scene"], "--seed", str(SEED), "--out", str(tmp_path / "out"), "--port", str(port), "--no-open"]
    said = tmp_path / "stdout"
    with said.open("w") as stdout:
        player = subprocess.Popen([sys.executable, "-m", "mjsense", *words], stdout=stdout, stderr=stdout)
    page = None
    try:
        while "Drive the robot at" not in said.read_text():
            assert player.poll() is None, said.read_text()
            time.sleep(0.1)
        page = Page(re.search(r"Drive the robot at (\S+)", said.read_text())[1])
        limit = time.monotonic() + 60
        while not page.run("document.body.innerText.includes('Close gripper')"):
            assert time.monotonic() < limit, "the page shows no controls"
            time.sleep(0.2)
        time.sleep(3)  # the scene is sent
        presses(page, "O" if turn > 0 else "P", abs(turn))
        for axis in (0, 1, 2):
            presses(page, KEYS[axis, 1 if away[axis] > 0 else -1], abs(int(away[axis])))
            time.sleep(1)
        time.sleep(4)  # until the arm is there
        presses(page, "space", 1)
        time.sleep(3)
        presses(page, KEYS[2, 1], 15)
        assert player.wait(timeout=60) == 0, said.read_text()
        # The page may already have tried to connect again to the program, which has ended.
        assert [line for line in page.console if "ERR_CONNECTION_REFUSED" not in line] == []
    finally:
        if page is not None:
            page.close()
        player.kill()
        player.wait()
    verified = run_program("verify", "--json", tmp_path / "out")
    assert verified.returncode == 0, verified.stdout
    episode = mjs.Dataset(tmp_path / "out").episodes[0]
    assert episode.success and json.loads(verified.stdout)
    assert mjs.check_replay(tmp_path / "out").ok
