# SPDX-License-Identifier: Apache-2.0
"""What type checkers and completion know of the API. basedpyright checks the assert_type() calls; at run time they do nothing."""

from typing import assert_type

import numpy as np
import pytest
from numpy.typing import NDArray
from scenes import ball_scene, feet_cfg

import mjsense as mjs

CAMERA = mjs.CameraSensorCfg(name="front", parent_body="ball/ball", width=8, height=8)


def test_typed_access_to_sensors():
    scene = ball_scene(feet_cfg(fields=("found",)), CAMERA)
    sim = mjs.Simulation(scene, 2)
    assert_type(scene.camera("front"), mjs.sensors.CameraSensor)
    assert_type(scene.camera("front").data, mjs.sensors.CameraData)
    assert_type(scene.contact("touch").data, mjs.sensors.ContactData)
    assert_type(scene.entity("ball"), mjs.scene.Entity)
    assert_type(sim.qpos, NDArray[np.float64])
    assert_type(sim.ctrl, NDArray[np.float64])
    sim.qpos = 0.5
    assert (sim.qpos == 0.5).all() and sim.qpos.dtype == np.float64 and "float64" in str(mjs.Simulation.qpos.__doc__)
    assert scene.camera("front") is scene["front"] and scene.contact("touch") is scene["touch"] and scene.entity("ball") is scene["ball"]
    with pytest.raises(TypeError, match="'touch' is a ContactSensor, not a CameraSensor"):
        scene.camera("touch")
    with pytest.raises(TypeError, match="'ball' is an entity, not a ImuSensor"):
        scene.imu("ball")
    with pytest.raises(TypeError, match="'touch' is a sensor, not an entity"):
        scene.entity("touch")
    with pytest.raises(KeyError, match="scene: no sensor or entity named 'fornt'; did you mean 'front'"):
        scene.camera("fornt")


class Height(mjs.Sensor[NDArray[np.float32]]):
    def compute(self, sim: mjs.Simulation) -> NDArray[np.float32]:
        return sim.qpos[:, 2:3].astype(np.float32)


def test_user_defined_sensor():
    sensor = Height("height")
    sim = mjs.Simulation(ball_scene(sensor), 2)
    assert_type(sensor.data, NDArray[np.float32])
    assert sensor.data.shape == (sim.num_worlds, 1)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("scene.camera('front').", {"data", "debug_shapes", "fields", "specs"}),
        ("scene.camera('front').data.", {"rgb", "depth", "segmentation"}),
        ("scene.contact('touch').data.", {"found", "force", "current_air_time"}),
        ("sim.qpos.", {"shape", "dtype", "mean"}),
        ("mjs.make('pick').", {"reset", "step", "expert_action", "sim"}),
    ],
)
def test_completion(text, names):
    """Of jedi, as IPython has it."""
    jedi = pytest.importorskip("jedi")
    setup = "import mjsense as mjs\nscene = mjs.Scene(mjs.SceneCfg())\nsim = mjs.Simulation(scene)\n"
    found = {completion.name for completion in jedi.Script(setup + text).complete(4, len(text))}
    assert names <= found
