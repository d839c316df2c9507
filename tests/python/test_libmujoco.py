# SPDX-License-Identifier: Apache-2.0
"""Which MuJoCo library the extension uses, and the errors if it cannot be loaded."""

import os
import re
import subprocess
import sys
from pathlib import Path

import mujoco
import pytest

import mjsense
from mjsense import _core
from mjsense.core import libmujoco

PACKAGE = Path(mjsense.__file__).parent
LIB = PACKAGE / "_lib"


def python(code, path=(), **environment):
    """Runs it in an interpreter of its own, with these folders first in its path."""
    paths = os.pathsep.join([*map(str, path), str(PACKAGE.parent), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": paths, **environment}, capture_output=True, text=True)


def dynamic(file):
    return subprocess.run(["readelf", "-d", file], capture_output=True, text=True, check=True).stdout


def test_mujoco_is_shared_here():
    assert libmujoco.shared is mujoco
    assert _core.mujoco_version() == mujoco.mj_versionString()
    assert _core.mujoco_layout_difference() == ""


def test_names_of_the_libraries():
    needed = re.findall(r"\(NEEDED\).*\[(.*)\]", dynamic(_core.__file__))
    assert "libmj_mjsense.so" in needed and not any(name.startswith("libmujoco") for name in needed)
    for file in (LIB / "libmj_mjsense.so", LIB / "shared/libmj_mjsense.so"):
        assert "[libmj_mjsense.so]" in dynamic(file)
    assert {file.name for file in (LIB / "plugin").iterdir()} == {"libactuator.so", "libsdf_plugin.so", "libsensor.so"}
    for file in (LIB / "plugin").iterdir():
        assert "[libmj_mjsense.so]" in dynamic(file) and "libmujoco" not in dynamic(file)
    assert {file.name for file in LIB.glob("LICENSE*")} == {"LICENSE.mujoco", "LICENSES_THIRD_PARTY.mujoco.md"}


STEP = """
import mjsense as mjs
from mjsense import _core
from mjsense.core import libmujoco
sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(entities={"robot": mjs.EntityCfg(model="embedded:robots/quadruped.xml")})))
sim.step()
print(libmujoco.shared is not None, _core.mujoco_version(), type(sim.model).__name__, libmujoco.why_not_shared)
"""


@pytest.mark.parametrize("order", ["import mujoco", ""])
def test_a_private_libmujoco_by_choice(order):
    found = python(f"{order}{STEP}import mujoco\nprint(mujoco.mj_versionString())", MJSENSE_MUJOCO="private")
    built = "4.0.1" if _core.mujoco_headers == 4000001 else ""
    assert f"False {built}" in found.stdout and "MjModelView the environment variable MJSENSE_MUJOCO is 'private'" in found.stdout, found.stderr


@pytest.mark.parametrize(
    ("init", "library", "why"),
    [
        ("raise ImportError('Version mismatch between its parts')", "", "`import mujoco` failed: Version mismatch between its parts"),
        ("import ctypes; ctypes.CDLL('libmujoco.so.3.17.0')", "", "`import mujoco` failed: libmujoco.so.3.17.0: cannot open shared object"),
        ("", "", "`import mujoco` failed: module 'mujoco' has no attribute 'mj_versionString'"),
        ("def mj_versionString(): return '3.17.0'", "", "the installed mujoco is 3.17.0"),
        ("def mj_versionString(): return '4.0.9'", "", "mujoco 4.0.9 has no libmujoco.so.4.0.9 in "),
        ("def mj_versionString(): return '4.0.9'", "libmujoco.so.4.0.9", "libmujoco.so.4.0.9: file too short"),
        ("raise SystemError('is not imported')", "libmujoco.so.3.8.1", "the installed mujoco is 3.8.1"),
    ],
)
def test_any_other_mujoco_is_left_alone(tmp_path, init, library, why):
    (tmp_path / "mujoco").mkdir()
    (tmp_path / "mujoco/__init__.py").write_text(init)
    if library:
        (tmp_path / "mujoco" / library).touch()
    found = python(STEP, [tmp_path])
    assert re.match(r"False 4\.0\.\d+ MjModelView ", found.stdout), found.stderr
    assert why in found.stdout


def test_symbols_of_another_libmujoco_in_the_global_scope(tmp_path):
    """As in a program that is linked with it, or loads mujoco with RTLD_GLOBAL."""
    source = "const char* mj_versionString() { return \"3.0.0\"; }\nint mj_version() { return 3000000; }\nvoid mj_step() { __builtin_trap(); }\n"
    (tmp_path / "old.c").write_text(source)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", tmp_path / "libold.so", tmp_path / "old.c"], check=True)
    found = python(f"import ctypes; ctypes.CDLL('{tmp_path}/libold.so', mode=ctypes.RTLD_GLOBAL){STEP}", MJSENSE_MUJOCO="private")
    assert re.match(r"False 4\.0\.\d+ ", found.stdout), found.stderr


def test_the_extension_does_not_become_global():
    found = python(f"import ctypes, os, sys; sys.setdlopenflags(os.RTLD_NOW | os.RTLD_GLOBAL){STEP}"
                   "print(hasattr(ctypes.CDLL(None), 'mj_version'), sys.getdlopenflags() & os.RTLD_GLOBAL != 0)", MJSENSE_MUJOCO="private")  # fmt: skip
    assert found.stdout.endswith("False True\n"), found.stderr


PLUGIN = """
import mjsense as mjs
model = '''<mujoco><extension><plugin plugin="mujoco.pid"><instance name="pid"><config key="kp" value="2"/></instance></plugin></extension>
  <worldbody><body><joint name="j"/><geom size=".1"/></body></worldbody>
  <actuator><plugin name="a" joint="j" plugin="mujoco.pid" instance="pid"/></actuator></mujoco>'''
sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(entities={"e": mjs.EntityCfg(model=model)})))
sim.ctrl[:] = 1
sim.step()
print(sim.model.nplugin, sim.data.actuator_force)
"""


def test_mujocos_plugins_work_in_both():
    found = {python(PLUGIN, MJSENSE_MUJOCO=choice).stdout for choice in ("", "private")}
    assert len(found) == 1 and found.pop().startswith("1 [[1.99")


def test_a_missing_library_is_an_error_that_says_how_to_mend_it(tmp_path):
    (tmp_path / "mjsense").mkdir()
    for file in PACKAGE.iterdir():
        if file.name != "_lib":
            (tmp_path / "mjsense" / file.name).symlink_to(file)
    found = python("import mjsense", [tmp_path])
    assert re.search(r"ImportError: mjsense cannot be loaded: libmj_mjsense\.so: .*; installed: mujoco-core 4\.0\.\d+.*\. "
                     r"Repair it with: pip install --force-reinstall mjsense$", found.stderr.strip()), found.stderr  # fmt: skip


def test_another_libmujoco_is_an_error():
    class Other:
        mujoco_headers = 4000001
        mujoco_version = staticmethod(lambda: "4.0.7")

    with pytest.raises(ImportError, match=r"another libmujoco, 4\.0\.7, instead of 4\.0.*installed: mujoco-core.*Repair it with: pip install --force"):
        libmujoco.check(Other)


def test_other_structs_are_an_error(monkeypatch):
    class Other:
        mujoco_version = staticmethod(mujoco.mj_versionString)
        mujoco_layout_difference = staticmethod(lambda: "mjOption has 400 bytes, expected 392")
        mujoco_headers = 4000001

    with pytest.raises(ImportError, match=r"not laid out as the 4\.0\.1 that mjsense was compiled with: mjOption has 400 bytes.*mujoco-core==4\.0\.1"):
        libmujoco.check(Other)
    monkeypatch.setattr(libmujoco, "shared", None)
    Other.mujoco_version = staticmethod(lambda: "4.0.1")
    with pytest.raises(ImportError, match="Repair it with: pip install --force-reinstall --no-deps mjsense"):
        libmujoco.check(Other)
