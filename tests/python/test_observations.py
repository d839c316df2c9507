# SPDX-License-Identifier: Apache-2.0
from types import SimpleNamespace

import numpy as np
import pytest
from scenes import ball_scene

import mjsense as mjs


def frames(n, worlds=2):
    return [np.array([[t + 10 * w] for w in range(worlds)], np.float32) for t in range(n)]


def test_order_of_the_pipeline():
    pipeline = mjs.sensors.ObservationPipeline(1, bias=1.0, clip=(0, 2), scale=10.0)
    assert pipeline([[0.5]]).tolist() == [[15.0]]
    assert pipeline([[7.0]]).tolist() == [[20.0]]


def test_delay_and_partial_reset():
    pipeline = mjs.sensors.ObservationPipeline(2, delay_min_lag=2, delay_max_lag=2)
    out = [pipeline(f)[:, 0].tolist() for f in frames(3)]
    assert out == [[0, 10], [0, 10], [0, 10]]
    pipeline.reset([])  # no world
    pipeline.reset([1])
    assert pipeline(frames(4)[3])[:, 0].tolist() == [1, 13]


def test_reset_with_none_resets_all():
    pipeline = mjs.sensors.ObservationPipeline(2, delay_min_lag=2, delay_max_lag=2)
    for f in frames(3):
        pipeline(f)
    pipeline.reset()
    assert pipeline(frames(4)[3])[:, 0].tolist() == [3, 13]


def test_history_is_oldest_first_and_backfilled():
    pipeline = mjs.sensors.ObservationPipeline(2, history_length=3)
    out = [pipeline(f).tolist() for f in frames(3)]
    assert out == [[[0, 0, 0], [10, 10, 10]], [[0, 0, 1], [10, 10, 11]], [[0, 1, 2], [10, 11, 12]]]
    pipeline.reset([0])
    assert pipeline(frames(4)[3]).tolist() == [[3, 3, 3], [11, 12, 13]]


def test_noise_is_seeded():
    a, b = (mjs.sensors.ObservationPipeline(2, noise=mjs.effects.Gaussian(1.0), seed=3) for _ in range(2))
    assert np.array_equal(a(frames(1)[0]), b(frames(1)[0]))
    with pytest.raises(ValueError, match="operation"):
        mjs.sensors.ObservationPipeline(1, operation="mul")


def test_biases_and_disabling_them():
    settings = dict(noise=0.25, bias=1.0, episode_bias=mjs.effects.EpisodeBias(mjs.effects.Constant(10.0)))
    assert mjs.sensors.ObservationPipeline(1, **settings)([[0.5, 1.5]]).tolist() == [[11.75, 12.75]]
    assert mjs.sensors.ObservationPipeline(1, enable_corruption=False, **settings)([[0.5, 1.5]]).tolist() == [[0.5, 1.5]]


def test_pipeline_errors():
    with pytest.raises(ValueError, match=r"shape \(3, 1\): expected \(2, D\)"):
        mjs.sensors.ObservationPipeline(2)(np.zeros((3, 1)))
    for wrong, text in [
        (dict(clip=(1, 0)), "low 1 is above high 0"),
        (dict(clip=(0, 1, 2)), "clip must be 2 numbers"),
        (dict(operation="mul"), "ObservationPipeline: operation is 'mul': must be one of add, scale, abs"),
        (dict(nan_policy="sanitise"), "did you mean 'sanitize'"),
        (dict(delay_min_lag=2, delay_max_lag=1), "must satisfy 0 <= min_lag <= max_lag"),
        (dict(delay_hold_prob=2.0), "delay_hold_prob is 2: must be between 0 and 1"),
        (dict(history_length=-1), "history_length is -1"),
        (dict(noise="much"), "noise must be"),
    ]:
        with pytest.raises((ValueError, TypeError), match=text):
            mjs.sensors.ObservationPipeline(1, **wrong)
    pipeline = mjs.sensors.ObservationPipeline(1)
    pipeline([[0.0]])
    with pytest.raises(ValueError, match=r"shape \(1, 2\): expected \(1, 1\)"):
        pipeline([[0.0, 0.0]])
    with pytest.raises(RuntimeError):
        mjs.sensors.ObservationPipeline(1, nan_policy="error")([[float("nan")]])
    assert mjs.sensors.ObservationPipeline(1, nan_policy="sanitize")([[float("nan")]]).tolist() == [[0.0]]


def test_height_scan():
    rays = dict(frame=mjs.ObjRef("body", "ball", "ball"), pattern=mjs.GridPatternCfg(size=(0.4, 0), resolution=0.2))
    scene = ball_scene(
        mjs.RayCastSensorCfg(name="scan", max_distance=5.0, **rays), mjs.RayCastSensorCfg(name="short", max_distance=0.5, **rays)
    )
    env = SimpleNamespace(scene=scene, sim=mjs.Simulation(scene, num_worlds=2))
    np.testing.assert_allclose(mjs.observations.height_scan(env, "scan"), np.ones((2, 3)), atol=1e-6)
    np.testing.assert_allclose(mjs.observations.height_scan(env, "scan", offset=0.25), np.full((2, 3), 0.75), atol=1e-6)
    assert (mjs.observations.height_scan(env, "short") == 0.5).all()
    assert (mjs.observations.height_scan(env, "short", miss_value=9.0) == 9.0).all()


def test_contact_forces_keep_their_sign():
    force = np.array([[[0.0, 1.0, -1.0], [np.e - 1, 1 - np.e, 0.0]]])
    env = SimpleNamespace(scene={"touch": SimpleNamespace(data=SimpleNamespace(force=force))})
    np.testing.assert_allclose(mjs.observations.foot_contact_forces(env, "touch"), [[0, np.log(2), -np.log(2), 1, -1, 0]])
