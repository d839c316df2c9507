# SPDX-License-Identifier: Apache-2.0
"""The viewer's page in headless Chromium."""

import os
import re
import signal
import subprocess
import sys
import threading
import time

import devtools
import mujoco
import numpy as np
import pytest

import mjsense as mjs

pytest.importorskip("viser", reason="viser is not installed: pip install 'mjsense[view]'")
pytestmark = devtools.needs_chromium
ROBOTS = ("quadruped", "bimanual_yam/stand", "floating_rum/rum", "franka/fr3", "franka_hand/hand", "i2rt_yam/yam", "mobile_franka/base", "rby1/rby1")


class Running:
    """A viewer that runs in a thread, and its page."""

    def __init__(self, viewer):
        self.viewer = viewer
        self._thread = threading.Thread(target=viewer.run, args=(False,))
        self._thread.start()
        self.page = devtools.Page(viewer.url)
        while not viewer.watched:
            self.page.run("1")
            assert time.monotonic() - self.page.opened < 60
            time.sleep(0.02)

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self.viewer.close()
        self._thread.join()
        self.page.close()


def silhouette(viewer, position, target, size):
    """Where the browser draws something, bool [H, W]."""
    (client,) = viewer._server.get_clients().values()
    back = (position - target) / np.linalg.norm(position - target)
    right = np.cross((0, 0, 1), back)
    right /= np.linalg.norm(right)
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.stack([right, -np.cross(back, right), -back], 1).ravel())  # viser's cameras: x right, y down, z forward
    image = client.get_render(*size, wxyz=quaternion, position=position, fov=np.radians(45), transport_format="png")
    return image[..., 3] > 127


def own_silhouette(model, data, position, target, size):
    camera = mujoco.MjvCamera()
    offset = target - position
    camera.lookat, camera.distance = target, np.linalg.norm(offset)
    camera.azimuth, camera.elevation = np.degrees(np.arctan2(offset[1], offset[0])), np.degrees(np.arcsin(offset[2] / camera.distance))
    model.vis.global_.fovy = 45
    renderer = mjs.Renderer(model, *size)
    renderer.enable_segmentation_rendering()
    option = mujoco.MjvOption()
    option.sitegroup[:] = 0
    renderer.update_scene(data, camera, option)
    return renderer.render()[..., 0] >= 0


def eventually(condition, seconds=30):
    """Waits until the browser, which draws by software here, has caught up."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "the page did not change in time"
        time.sleep(0.05)


def test_silhouettes_equal_those_of_the_renderer(port):
    size = 240, 320
    models = [mjs.Scene(mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model=f"embedded:robots/{robot}.xml")})) for robot in ROBOTS]
    sims = [mjs.Simulation(scene) for scene in models]
    with Running(mjs.view(sims[0], port=port, block=False, open_browser=False)) as running:
        for robot, sim in zip(ROBOTS, sims):
            model, data = sim.model_of(0), sim.env.mj_datas[0]
            running.viewer._stage.set_model(model)
            running.viewer._stage.set_poses(data.xpos, data.xquat)
            target = np.array(model.stat.center)
            position = target + 1.4 * model.stat.extent * np.array([0.8, -0.5, 0.4])
            expected = own_silhouette(model, data, position, target, size)
            overlaps = []

            def similar():
                seen = silhouette(running.viewer, position, target, size)
                overlaps.append((seen & expected).sum() / (seen | expected).sum())
                return overlaps[-1] >= 0.97

            assert expected.sum() > 2000, robot
            try:
                eventually(similar, 15)
            except AssertionError:
                raise AssertionError(f"{robot}: intersection over union {max(overlaps):.3f}") from None
        assert not running.page.console


def test_the_page_of_a_task(port):
    with Running(mjs.view("pick", port=port, block=False, open_browser=False)) as running:
        viewer, page = running.viewer, running.page
        page.click("button", "Step")
        eventually(lambda: viewer._source.time(0) > 0)
        assert viewer._source.time(0) == pytest.approx(viewer._source.period)
        page.click("[role=tab]", "Cameras")
        eventually(lambda: page.run("[...document.querySelectorAll('img')].some((image) => image.naturalWidth == 320)"))
        page.click("[role=tab]", "Play")
        page.click("button", "Play")
        eventually(lambda: viewer._playing and viewer._source.time(0) > 0.5)
        page.click("button", "Pause")
        eventually(lambda: not viewer._playing)
        # A chart that was made before there was a value has a time axis.
        page.click("[role=tab]", "Curves")
        viewer._events[2] = lambda: viewer._curves.choose("tcp_pose")
        eventually(lambda: (page.run("document.querySelector('.uplot canvas')?.width") or 0) > 100)
        for k in range(3):
            viewer._events[3 + k] = viewer._step_once
        eventually(lambda: page.run("Object.values(__viserTestpoints.uplots)[0].chart.scales.x.max") == pytest.approx(viewer._source.time(0)))
        assert not page.console


def test_ctrl_c_while_a_page_plays(port):
    command = [sys.executable, "-m", "mjsense", "view", "pick", "--port", str(port), "--no-open", "--world", "1"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ) as process:
        try:
            with devtools.Page(process.stdout.readline().split()[1]) as page:
                page.click("button", "Play")
                eventually(lambda: re.search(r"World 1 of 2, t = (0\.[1-9]|[1-9])", page.run("document.body.textContent")), 90)
                process.send_signal(signal.SIGINT)
                out, errors = process.communicate(timeout=30)
        finally:
            process.kill()
    assert (process.returncode, out, errors) == (0, "", "")


def test_the_page_of_a_recording(tmp_path, port):
    mjs.record("pick", out=tmp_path, horizon=30, episodes=2, num_worlds=2, keep_failures=True, width=48, height=32, depth=True)
    with Running(mjs.view(tmp_path, port=port, block=False, open_browser=False)) as running:
        viewer, page = running.viewer, running.page
        viewer._events[1] = lambda: viewer.seek(12)
        page.click("[role=tab]", "Videos")
        eventually(lambda: page.run("[...document.querySelectorAll('img')].filter((image) => image.naturalWidth == 48).length") == 2)
        assert viewer._shown == 12
        page.click("[role=tab]", "Curves")
        viewer._events[2] = lambda: viewer._curves.choose("obs/extra/tcp_pose")
        eventually(lambda: (page.run("document.querySelector('.uplot canvas')?.width") or 0) > 100)
        assert not page.console
