# SPDX-License-Identifier: Apache-2.0
import pydoc
import types

import mujoco

import mjsense as mjs
from mjsense import _core


def test_everything_public_is_exported():
    public = {
        name
        for name, value in vars(mjs).items()
        if not name.startswith("_") and not isinstance(value, types.ModuleType)
    }
    assert public | {"effects", "observations", "__version__"} == set(mjs.__all__)


def test_every_public_class_and_function_says_what_it_is():
    for name in mjs.__all__:
        value = getattr(mjs, name)
        if isinstance(value, (type, types.FunctionType)):
            assert value.__doc__, name


def test_one_mujoco():
    assert _core.mujoco_version() == mujoco.mj_versionString()
    with open("/proc/self/maps") as maps:
        assert len({line.split()[-1] for line in maps if "libmujoco.so" in line}) == 1


def test_registries():
    assert "pick" in mjs.task_names() and "franka" in mjs.robot_names() and "planner" in mjs.policy_names()
    assert any(name.endswith(".xml") for name in mjs.embedded_models())
    scene = mjs.Scene(mjs.SceneCfg(entities={"robot": mjs.Robot("franka").entity()}))
    assert scene["robot"].joint_names


def test_help_shows_every_field():
    text = pydoc.plain(pydoc.render_doc(mjs.LidarSensorCfg))
    assert "Each ray leaves from where the frame was at its own moment of the sweep." in text  # its own
    assert "Hits farther away are misses. [m]" in text  # inherited
    assert "uint8 [B, H, W, 3]" in pydoc.plain(pydoc.render_doc(mjs.CameraData))
