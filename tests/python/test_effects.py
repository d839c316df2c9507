# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from scenes import ball_scene

import mjsense as mjs
from mjsense.sensors import effects


def simulation(*chain, worlds=3, decimation=5, **kwargs):
    cfg = mjs.EffectSensorCfg(name="acc", sensor="ball/height", effects=chain, **kwargs)
    height = mjs.BuiltinSensorCfg(name="height", sensor_type="framepos", obj=mjs.ObjRef("site", "imu", "ball"))
    return mjs.Simulation(ball_scene(height, cfg), num_worlds=worlds, decimation=decimation)


def test_scale_and_clip_keep_the_clean_value():
    sim = simulation(effects.Scale((1, 1, 10)), effects.Clip(high=5.0))
    assert sim.scene["acc"].data[:, 2].tolist() == [5] * 3
    assert sim.scene["ball/height"].data[:, 2].tolist() == [1] * 3


def test_delay_in_seconds():
    sim = simulation(effects.Delay(0.02))  # two control steps of 0.01 s
    heights = []
    for _ in range(6):
        sim.step()
        heights.append((sim.scene["ball/height"].data[0, 2], sim.scene["acc"].data[0, 2]))
    clean, late = np.array(heights).T
    np.testing.assert_array_equal(late[2:], clean[:-2])


def test_noise_depends_on_seed_and_world_alone():
    def rows(worlds, seed):
        sim = simulation(effects.Noise(effects.Gaussian(0.1)), worlds=worlds)
        sim.reset(seed=seed)
        sim.step(3)
        return sim.scene["acc"].data.copy()

    np.testing.assert_array_equal(rows(2, 1), rows(5, 1)[:2])
    assert not np.array_equal(rows(2, 1), rows(2, 2))


def test_history_of_a_sensor():
    sim = simulation(history_length=2, flatten_history=False)
    sim.step(2)
    assert sim.scene["acc"].data.shape == (3, 2, 3)


@pytest.mark.parametrize(
    "effect, text",
    [
        (lambda: effects.Delay(-1), "delay"),
        (lambda: effects.Dropout(2.0), "probability"),
        (lambda: effects.Dropout(0.1, "drop"), "hold"),
        (lambda: effects.Noise(operation="mul"), "scale"),
        (lambda: effects.Scale((1, 2)), "factor"),
        (lambda: "noise", "effects must be one of"),
    ],
)
def test_errors(effect, text):
    with pytest.raises((ValueError, TypeError), match=text):
        simulation(effect())


def test_unknown_sensor():
    with pytest.raises((ValueError, KeyError), match="nothing"):
        mjs.Simulation(ball_scene(mjs.EffectSensorCfg(name="x", sensor="nothing")))
