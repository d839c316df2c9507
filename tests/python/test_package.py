# SPDX-License-Identifier: Apache-2.0
import dataclasses
import importlib
import inspect
import pydoc
import subprocess
import sys
import types

import mujoco
import pytest

import mjsense as mjs
from mjsense import _core
from mjsense.core.old_names import ROOMS


def test_everything_public_is_exported():
    public = {
        name
        for name, value in vars(mjs).items()
        if not name.startswith("_") and not isinstance(value, types.ModuleType)
    }
    assert public | {"effects", "observations", "__version__"} == set(mjs.__all__) and len(mjs.__all__) <= 75


@pytest.mark.parametrize("room", ["mjsense", *ROOMS])
def test_every_public_class_and_function_has_a_docstring(room):
    module = importlib.import_module(room)
    for name in module.__all__:
        value = getattr(module, name)
        if isinstance(value, (type, types.FunctionType)):
            assert value.__doc__, name


@pytest.mark.parametrize("room", ROOMS)
def test_names_that_were_at_the_top_are_in_their_room(room):
    module = importlib.import_module(room)
    for name in set(module.__all__) - set(mjs.__all__):
        with pytest.warns(DeprecationWarning, match=rf"^mjsense\.{name} is now mjsense\.\w+\.{name}$") as caught:
            assert getattr(mjs, name) is getattr(module, name)
        assert caught[0].filename == __file__
    with pytest.raises(AttributeError, match=r"^module 'mjsense' has no attribute 'Simulaton'; did you mean 'Simulation'\?$"):
        _ = mjs.Simulaton


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
    assert "Emit each ray from the pose that the frame had at that ray's moment of the sweep." in text  # its own
    assert "Maximum distance; more distant hits are misses. [m]" in text  # inherited
    assert "uint8 [B, H, W, 3]" in pydoc.plain(pydoc.render_doc(mjs.sensors.CameraData))


def test_import_loads_nothing_heavy():
    """Packages that are slow to import are imported on first use. Tests the names, because times depend on the machine."""
    program = "import sys, mjsense; print(*sys.modules)"
    loaded = set(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split())
    heavy = {"h5py", "torch", "jax", "scipy", "matplotlib", "PIL", "pandas", "imageio_ffmpeg", "gymnasium_robotics", "rerun", "viser", "pyarrow",
             "tomllib", "numpy.testing", "unittest", "mjsense.tasks.rl", "mjsense.compat"}  # fmt: skip
    assert "mjsense.sensors.configs" in loaded and not heavy & loaded, heavy & loaded


def test_methods_of_configurations_are_created_on_first_use():
    program = """
import mjsense as mjs
from mjsense.core.lazy_dataclass import _Method
classes = [c for m in (mjs.sensors.configs, mjs.effects) for c in vars(m).values() if isinstance(c, type) and issubclass(c, mjs.sensors.SensorCfg)]
assert len(classes) > 5 and all(isinstance(vars(c)["__init__"], _Method) for c in classes), classes
mjs.CameraSensorCfg(name="a")
assert not any(isinstance(m, _Method) for m in vars(mjs.CameraSensorCfg).values())
"""
    subprocess.run([sys.executable, "-c", program], check=True)


def test_configurations_are_dataclasses():
    """As those of Python, whose methods are written at once."""
    cfg = mjs.GridPatternCfg(size=(1.0, 2.0))
    assert dataclasses.is_dataclass(cfg) and repr(cfg).startswith("GridPatternCfg(size=(1.0, 2.0), ")
    assert cfg == mjs.GridPatternCfg(size=(1.0, 2.0)) != mjs.GridPatternCfg()
    assert hash(cfg) == hash(mjs.GridPatternCfg(size=(1.0, 2.0))) and len({cfg, mjs.GridPatternCfg()}) == 2  # a frozen one
    with pytest.raises(dataclasses.FrozenInstanceError):
        cfg.size = (1.0, 1.0)
    with pytest.raises(TypeError, match="unhashable type: 'SceneCfg'"):
        hash(mjs.SceneCfg())
    assert list(inspect.signature(mjs.ObjRef).parameters) == [f.name for f in dataclasses.fields(mjs.ObjRef)]
    with pytest.raises(TypeError, match=r"ObjRef\(\) got an unexpected keyword argument 'nam'; did you mean 'name'"):
        mjs.ObjRef(nam="x")

    @dataclasses.dataclass
    class Own(mjs.CameraSensorCfg):
        gain: float = 1.0

    own = Own(name="a", gain=2.0)
    assert own.gain == 2 and own.name == "a" and own != Own(name="a") and dataclasses.replace(own, gain=1.0) == Own(name="a")
