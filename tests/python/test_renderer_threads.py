# SPDX-License-Identifier: Apache-2.0
"""A renderer that several threads use: every call succeeds with the right image, or says that another thread is using it."""

import os
import re
import signal
import sys
import threading
import time

import numpy as np
import pytest
from renderer_scenes import BALL, SHAPES, load
from test_fork import in_fork

import mjsense as mjs

mujoco = pytest.importorskip("mujoco")

BUSY = "Renderer: another thread is using it; use one renderer per thread"
CLOSED = "Renderer: used after close(); make a new one"


def run_all(*works):
    """Runs these functions in threads until one has failed or all have ended; returns the messages of RuntimeErrors."""
    messages, others = set(), []

    def run(work):
        try:
            work()
        except RuntimeError as error:
            messages.add(str(error))
        except Exception as error:
            others.append(error)

    threads = [threading.Thread(target=run, args=(work,)) for work in works]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not others
    return messages


CALLS = {
    "update_scene": lambda renderer, data: renderer.update_scene(data, "view"),
    "render": lambda renderer, data: renderer.render(),
    "render_images": lambda renderer, data: renderer.render_images(),
    "reload": lambda renderer, data: renderer.reload(),
    "depth": lambda renderer, data: (renderer.enable_depth_rendering(), renderer.disable_depth_rendering()),
    "segmentation": lambda renderer, data: (renderer.enable_segmentation_rendering(), renderer.disable_segmentation_rendering()),
}


@pytest.fixture
def renderer():
    model, data = load(SHAPES)
    with mjs.Renderer(model, 600, 800) as renderer:
        renderer.update_scene(data, "view")
        yield renderer


@pytest.mark.parametrize("name", CALLS)
def test_a_call_during_a_render_of_another_thread_raises(renderer, name):
    data = mujoco.MjData(renderer.model)
    mujoco.mj_forward(renderer.model, data)
    expected, ended, images = renderer.render(), threading.Event(), []

    def render():
        try:
            for _ in range(20):
                images.append(renderer.render())
        finally:
            ended.set()

    caught = set()

    def call():
        while not ended.is_set():
            try:
                CALLS[name](renderer, data)
            except RuntimeError as error:
                caught.add(str(error))

    assert run_all(render, call) <= {BUSY}
    assert caught <= {BUSY}
    for image in images:
        np.testing.assert_array_equal(image, expected)
    renderer.render()  # works again


@pytest.mark.parametrize("name", CALLS)
def test_every_call_has_the_guard(renderer, name):
    data = mujoco.MjData(renderer.model)
    mujoco.mj_forward(renderer.model, data)
    with renderer._guard:
        assert run_all(lambda: CALLS[name](renderer, data)) == {BUSY}
        CALLS[name](renderer, data)  # of the same thread


def test_close_waits_for_a_render(renderer):
    before = renderer.render()
    started, images = threading.Event(), []

    def render():
        while True:
            images.append(renderer.render())
            started.set()

    def close():
        started.wait()
        renderer.close()

    messages = run_all(render, close)
    assert messages in ({CLOSED}, {BUSY})  # BUSY: during close()
    for image in images:
        np.testing.assert_array_equal(image, before)


def test_render_batch_of_several_threads(renderer):
    datas = [mujoco.MjData(renderer.model) for _ in range(3)]
    for k, data in enumerate(datas):
        data.qpos[0] = 0.1 * k
        mujoco.mj_forward(renderer.model, data)
    small = mjs.Renderer(renderer.model, 60, 80)
    expected = small.render_batch(datas, "view")

    def batches():
        for _ in range(10):
            np.testing.assert_array_equal(small.render_batch(datas, "view"), expected)

    assert run_all(batches, batches, batches) == set()

    def until_closed():
        while True:
            np.testing.assert_array_equal(small.render_batch(datas, "view"), expected)

    def close():
        time.sleep(0.2)
        small.close()

    assert run_all(until_closed, until_closed, close) == {CLOSED}


def test_a_child_can_use_a_renderer_that_a_thread_was_using(renderer):
    expected = renderer.render()
    stop = threading.Event()

    def render():
        while not stop.is_set():
            renderer.render()

    thread = threading.Thread(target=render)
    thread.start()
    try:
        images = [in_fork(lambda: (renderer.render(), renderer.close())[0]) for _ in range(3)]
    finally:
        stop.set()
        thread.join()
    for image in images:
        np.testing.assert_array_equal(image, expected)


def test_close_in_a_signal_handler(renderer):
    def handle(*_):
        renderer.close()

    before = signal.signal(signal.SIGUSR1, handle)
    timer = threading.Timer(0.2, lambda: os.kill(os.getpid(), signal.SIGUSR1))
    timer.start()
    try:
        with pytest.raises(RuntimeError, match=re.escape(CLOSED)):
            while True:
                renderer.render()
    finally:
        timer.join()
        signal.signal(signal.SIGUSR1, before)


def test_an_interrupted_batch_leaves_no_image_for_later(monkeypatch):
    model, data = load(BALL)
    submitted = []

    def interrupted(running):
        submitted.extend(running)
        raise KeyboardInterrupt

    with mjs.Renderer(model, 240, 320) as renderer:
        monkeypatch.setattr(sys.modules["mjsense.sim.renderer"], "wait", interrupted)
        with pytest.raises(KeyboardInterrupt):
            renderer.render_batch([data] * 100, "front")
        assert len(submitted) == 100 and all(one.running() or one.done() for one in submitted)
