# SPDX-License-Identifier: Apache-2.0
import importlib
import os

import pytest

from mjsense import _core
from mjsense.core import installed_files


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A gymnasium_robotics that holds a mesh and must not be imported."""
    folder = tmp_path / "gymnasium_robotics/envs/assets/kitchen_franka/franka_assets/meshes/visual"
    folder.mkdir(parents=True)
    for link in range(8):
        (folder / f"link{link}.stl").touch()
    (tmp_path / "gymnasium_robotics/__init__.py").write_text("raise ImportError")
    monkeypatch.syspath_prepend(tmp_path)
    importlib.invalidate_caches()
    return folder


def test_meshes_are_found_without_import(package):
    texts = map(_core.robot_text, _core.robot_names())
    assert installed_files.installed_meshes(texts) == {"MJSENSE_FRANKA_MESHES": package}
    assert installed_files.installed_meshes(["model = 'x.xml'"]) == {}


def test_environment_variable_of_the_user_has_priority(package, monkeypatch):
    monkeypatch.setenv("MJSENSE_FRANKA_MESHES", "")
    installed_files.use_installed_meshes()
    assert os.environ["MJSENSE_FRANKA_MESHES"] == ""
    monkeypatch.delenv("MJSENSE_FRANKA_MESHES")
    installed_files.use_installed_meshes()
    assert os.environ["MJSENSE_FRANKA_MESHES"] == str(package)
    monkeypatch.delenv("MJSENSE_FRANKA_MESHES")


def test_package_folders_are_exported(monkeypatch, tmp_path):
    folder = tmp_path / "site-packages"
    monkeypatch.syspath_prepend(folder)
    monkeypatch.delenv("MJSENSE_PACKAGES", raising=False)
    installed_files.name_package_folders()
    assert os.environ["MJSENSE_PACKAGES"].split(os.pathsep)[0] == str(folder)
    monkeypatch.setenv("MJSENSE_PACKAGES", "")
    installed_files.name_package_folders()
    assert os.environ["MJSENSE_PACKAGES"] == ""
