# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest

import mjsense as mjs

XML = """
<mujoco><worldbody><body name="b" pos="0 0 1"><geom size=".1"/><site name="imu" euler="90 0 0"/></body></worldbody></mujoco>
"""


def scene(**kwargs):
    cfg = mjs.ImuSensorCfg(name="imu", site=mjs.ObjRef("site", "imu", "robot"), **kwargs)
    return mjs.Scene(mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model=XML)}, sensors=(cfg,)))


def test_specific_force_in_site_axes():
    s = scene(orientation=True)
    sim = mjs.Simulation(s, num_worlds=2)
    sim.step()
    np.testing.assert_allclose(s["imu"].data.acc, [[0, 9.81, 0]] * 2, atol=1e-5)
    np.testing.assert_allclose(s["imu"].data.quat, [[0.5**0.5, 0.5**0.5, 0, 0]] * 2, atol=1e-6)


def test_presets_user_defined_models_and_the_clean_value():
    own = mjs.sensors.ImuModel(gyroscope=mjs.sensors.ImuAxis(noise_density=0.01))
    for kwargs in ({"preset": "mpu6050"}, {"preset": "", "model": own}):
        s = scene(**kwargs)
        sim = mjs.Simulation(s, num_worlds=64)
        sim.step()
        assert np.std(s["imu"].data.gyro) > 0
        assert np.std(s["imu_gyro"].data) == 0


def test_unknown_preset():
    with pytest.raises(ValueError, match="did you mean 'mpu6050'"):
        scene(preset="mpu6500")
