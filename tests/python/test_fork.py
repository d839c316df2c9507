# SPDX-License-Identifier: Apache-2.0
"""A child of fork() has none of a simulation's threads: calls raise an error instead of waiting forever."""

import os
import pickle
import signal
import warnings

import numpy as np
import pytest
from scenes import ball_scene

import mjsense as mjs


def in_fork(function):
    """What `function` returns, or the exception it raises, in a child that has 20 s."""
    reading, writing = os.pipe()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # Python 3.12 warns of threads, which is the point
        child = os.fork()
    if child == 0:
        signal.alarm(20)
        try:
            value = function()
        except Exception as error:
            value = error
        os.write(writing, pickle.dumps(value))
        os._exit(0)
    os.close(writing)
    with os.fdopen(reading, "rb") as pipe:
        text = pipe.read()
    assert os.waitpid(child, 0)[1] == 0, "the child hung"
    value = pickle.loads(text)
    if isinstance(value, Exception):
        raise value
    return value


@pytest.fixture
def sim():
    sim = mjs.Simulation(ball_scene(mjs.CameraSensorCfg(name="eye", width=16, height=16)), num_worlds=4, threads=2)
    sim.step()
    return sim


@pytest.mark.parametrize("call", ["step", "reset", "forward"])
def test_a_copy_raises(sim, call):
    with pytest.raises(RuntimeError, match=rf"simulation: this process .* was forked from the one that created it \({os.getpid()}\)"):
        in_fork(getattr(sim, call))
    sim.step()  # the original still works


def test_reading_outdated_data_in_a_fork_raises(sim):
    with pytest.raises(RuntimeError, match="was forked"):
        in_fork(lambda: sim.scene["eye"].data)


def test_a_copy_may_be_dropped_and_a_new_one_made():
    sim = mjs.Simulation(ball_scene(), num_worlds=4, threads=2)
    sim.step()
    expected = sim.qpos.copy()
    held = [sim]
    del sim

    def again():
        held.clear()  # does not wait for the missing threads
        other = mjs.Simulation(ball_scene(), num_worlds=4, threads=2)
        other.step()
        return other.qpos.copy()

    np.testing.assert_array_equal(in_fork(again), expected)


def test_an_environment_of_a_task(tmp_path):
    env = mjs.make_vec("pick", num_envs=2, cameras=[])
    env.reset(seed=1)
    with pytest.raises(RuntimeError, match="was forked"):
        in_fork(lambda: env.step(env.action_space.sample()))
    env.close()
