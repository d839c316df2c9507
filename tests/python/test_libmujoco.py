# SPDX-License-Identifier: Apache-2.0
"""Which MuJoCo library is loaded, and the errors for one that is incompatible."""

import importlib.metadata
import os
import re
import subprocess
import sys

import mujoco
import pytest

from mjsense import _core, _libmujoco


def test_structs_equal_the_headers():
    assert _core.mujoco_layout_difference() == ""
    _libmujoco.check(_core)


def test_extension_does_not_link_libmujoco():
    needed = subprocess.run(["readelf", "-d", _core.__file__], capture_output=True, text=True, check=True).stdout
    assert "libc.so" in needed
    assert "libmujoco" not in needed


def installed(monkeypatch, **versions):
    def version(name):
        if name.replace("-", "_") in versions:
            return versions[name.replace("-", "_")]
        raise importlib.metadata.PackageNotFoundError(name)

    monkeypatch.setattr(importlib.metadata, "version", version)


@pytest.mark.parametrize(
    ("versions", "mend"),
    [
        ({}, "pip install 'mujoco-core>=4.0,<4.1'"),
        ({"mujoco_core": "4.1.0"}, "pip install --force-reinstall --no-deps 'mujoco-core>=4.0,<4.1'"),
        ({"mujoco_core": "4.0.1", "mujoco": "4.0.0"}, "pip install --force-reinstall --no-deps 'mujoco-core==4.0.0'"),
        (
            {"mujoco_core": "4.0.1", "mujoco": "3.17.0"},
            "pip uninstall -y mujoco && pip install --force-reinstall --no-deps 'mujoco-core>=4.0,<4.1'",
        ),
        ({"mujoco": "3.17.0"}, "pip uninstall -y mujoco && pip install 'mujoco-core>=4.0,<4.1'"),
    ],
)
def test_other_mujoco_series_is_an_error_with_a_remedy(monkeypatch, versions, mend):
    monkeypatch.setattr(mujoco, "mj_versionString", lambda: "4.1.0")
    installed(monkeypatch, **versions)
    with pytest.raises(ImportError, match=r"needs MuJoCo 4\.0 .*; found 4\.1\.0 in ") as error:
        _libmujoco.load()
    have = ", ".join(f"{name.replace('_', '-')} {version}" for name, version in versions.items())
    assert f"installed: {have or 'neither mujoco-core nor mujoco'}. Mend it with: {mend}" in str(error.value)
    assert str(error.value).endswith(mend)


@pytest.mark.parametrize(
    ("init", "found"),
    [
        ("raise ImportError('Version mismatch between its parts')", "`import mujoco` failed: Version mismatch between its parts"),
        ("", "`import mujoco` failed: module 'mujoco' has no attribute 'mj_versionString'"),
        ("def mj_versionString(): return '3.17.0'", "found 3.17.0 in "),
        ("def mj_versionString(): return '4.0.9'", "found 4.0.9, but no libmujoco in "),
    ],
)
def test_in_a_new_interpreter(tmp_path, init, found):
    (tmp_path / "mujoco").mkdir()
    (tmp_path / "mujoco/__init__.py").write_text(init)
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    run = subprocess.run([sys.executable, "-c", "import mjsense"], env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True)
    assert re.search(rf"ImportError: mjsense needs MuJoCo 4\.0 .*{re.escape(found)}", run.stderr), run.stderr


def test_another_libmujoco_in_the_process_is_an_error():
    class Other:
        mujoco_version = staticmethod(lambda: "4.0.7")

    with pytest.raises(ImportError, match=r"another libmujoco, 4\.0\.7, was loaded into this process"):
        _libmujoco.check(Other)


def test_other_structs_are_an_error():
    class Other:
        mujoco_version = staticmethod(mujoco.mj_versionString)
        mujoco_layout_difference = staticmethod(lambda: "mjOption has 400 bytes, expected 392")
        mujoco_headers = 4000001

    with pytest.raises(ImportError, match=r"not laid out as the 4\.0\.1 that mjsense was compiled with: mjOption has 400 bytes"):
        _libmujoco.check(Other)
