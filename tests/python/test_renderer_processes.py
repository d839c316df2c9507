# SPDX-License-Identifier: Apache-2.0
"""mjsense.Renderer in threads and processes, and its memory."""

import concurrent.futures
import gc
import multiprocessing
import os
import resource

import numpy as np
import pytest
from renderer_scenes import SHAPES, image_of, load
from test_fork import in_fork

import mjsense as mjs


def test_threads():
    model, data = load(SHAPES)
    expected = image_of(model, data, "view")
    with concurrent.futures.ThreadPoolExecutor(4) as pool:
        for image in pool.map(lambda _: image_of(model, data, "view"), range(12)):
            np.testing.assert_array_equal(image, expected)


def child_image():
    return image_of(*load(SHAPES), "view")


def test_processes():
    model, data = load(SHAPES)
    renderer = mjs.Renderer(model, 60, 80)
    renderer.update_scene(data, "view")
    expected = renderer.render()
    renderer.render_batch([data, data], "view")
    np.testing.assert_array_equal(in_fork(renderer.render), expected)
    np.testing.assert_array_equal(in_fork(lambda: renderer.render_batch([data], "view"))[0], expected)
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        np.testing.assert_array_equal(pool.apply(child_image), expected)


class Images:
    """A data set whose workers draw its images."""

    def __len__(self):
        return 4

    def __getitem__(self, index):
        return child_image()


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_dataloader_workers(context):
    data = pytest.importorskip("torch.utils.data")
    expected = child_image()
    loader = data.DataLoader(Images(), batch_size=2, num_workers=2, multiprocessing_context=context)
    for batch in loader:
        for image in batch.numpy():
            np.testing.assert_array_equal(image, expected)


def test_renderers_leak_nothing():
    model, data = load(SHAPES)

    def use():
        with mjs.Renderer(model, 16, 16, max_geom=100) as renderer:
            renderer.update_scene(data, "view")
            renderer.render()

    for _ in range(100):
        use()
    gc.collect()
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    files = len(os.listdir("/proc/self/fd"))
    for _ in range(1000):
        use()
    gc.collect()
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 8000  # KiB
    assert len(os.listdir("/proc/self/fd")) == files


def cheetah():
    for needed in ("glfw", "imageio"):  # which Gymnasium's renderer imports
        pytest.importorskip(needed)
    gymnasium = pytest.importorskip("gymnasium")
    from mjsense.compat.gymnasium import use

    return use(gymnasium.make("HalfCheetah-v5", render_mode="rgb_array", width=32, height=32))


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_gymnasium_subprocesses(context):
    for needed in ("glfw", "imageio"):
        pytest.importorskip(needed)
    vector = pytest.importorskip("gymnasium.vector")
    envs = vector.AsyncVectorEnv([cheetah, cheetah], context=context)
    try:
        envs.reset(seed=3)
        images = envs.render()
    finally:
        envs.close()
    env = cheetah()
    env.reset(seed=3)
    np.testing.assert_array_equal(images[0], env.render())
    assert images[1].shape == (32, 32, 3)


@pytest.mark.parametrize("context", ["fork", "spawn"])
def test_stable_baselines3_subprocesses(context):
    pytest.importorskip("glfw")
    vector = pytest.importorskip("stable_baselines3.common.vec_env")
    envs = vector.SubprocVecEnv([cheetah, cheetah], start_method=context)
    try:
        envs.seed(3)
        envs.reset()
        images = envs.get_images()
    finally:
        envs.close()
    env = cheetah()
    env.reset(seed=3)
    np.testing.assert_array_equal(images[0], env.render())


def test_gymnasium_environments_without_mujoco_are_refused():
    for needed in ("glfw", "imageio"):  # which Gymnasium's renderer imports
        pytest.importorskip(needed)
    gymnasium = pytest.importorskip("gymnasium")
    from mjsense.compat.gymnasium import use

    with pytest.raises(TypeError, match=r"expected an environment with a mujoco_renderer .*, got .*CartPole"):
        use(gymnasium.make("CartPole-v1"))
    with pytest.raises(TypeError, match=r"expected an environment .*, got 'HalfCheetah-v5'"):
        use("HalfCheetah-v5")
