# SPDX-License-Identifier: Apache-2.0
"""The catalogue of objects, and the command that installs those of other packages."""

import json
import tomllib
from pathlib import Path

import pytest
from wheels import wheel

import mjsense as mjs
from mjsense import _core, assets, commands

MODELS = Path(__file__).parents[2] / "models"
BUILT_IN = [
    entry["name"] for entry in tomllib.loads((MODELS / "objects/catalogue.toml").read_text())["objects"] if "source" not in entry
]
SCENE = """
name = "things"
extends = "table"
catalogue = {names}
entities = []
objects = []
"""


def listed():
    return {one["name"]: one for one in json.loads(_core.objects_json())}


def test_the_catalogue_has_every_built_in_model():
    assert sorted(BUILT_IN) == sorted(path.stem for path in (MODELS / "objects").glob("*.xml"))
    kinds = {one["kind"] for one in listed().values() if one["source"] == "mjsense"}
    assert len(BUILT_IN) >= 40 and len(kinds) >= 25
    assert all(listed()[name]["installed"] for name in BUILT_IN)
    assert all(one["license"] and one["url"] for one in listed().values())


def test_scenes_name_objects_by_name_and_pattern(tmp_path):
    (tmp_path / "scene.toml").write_text(SCENE.format(names='["toy_.*", "mug"]'))
    env = mjs.make_vec(
        "pick", "franka", scene=str(tmp_path / "scene.toml"), num_envs=1, cameras=[], policy=None, observations=["qpos"]
    )
    env.reset(seed=0)
    names = (
        set(env.scene.entities)
        if hasattr(env.scene, "entities")
        else {env.sim.model.body(b).name.split("/")[0] for b in range(1, env.sim.model.nbody)}
    )
    assert {"toy_bone", "toy_car", "mug"} <= names and "hammer" not in names
    env.close()
    (tmp_path / "scene.toml").write_text(SCENE.format(names='["hamer"]'))
    with pytest.raises(KeyError, match="did you mean 'hammer'"):
        mjs.make_vec("pick", "franka", scene=str(tmp_path / "scene.toml"), num_envs=1, cameras=[], policy=None)


def test_houses_have_other_objects():
    found = []
    for house in (0, 1, 0):
        env = mjs.make_vec(
            "pick", "franka", scene=f"assorted:{house}", num_envs=1, cameras=[], policy=None, observations=["qpos"]
        )
        model = env.sim.model
        found.append(
            {
                model.body(b).name
                for b in range(1, model.nbody)
                if model.body_jntnum[b] == 1 and model.jnt_type[model.body_jntadr[b]] == 0
            }
        )
        env.close()
    assert found[0] == found[2] != found[1] and len(found[0]) == 12 + 4


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setenv("MJSENSE_PACKAGES", "/nowhere")
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)
    monkeypatch.delenv("CONDA_PREFIX", raising=False)
    assert not listed()["robosuite_can"]["installed"]
    with pytest.raises(ValueError, match="pip install robosuite"):
        mjs.make_vec("pick", "franka", scene="robosuite/objects", num_envs=1, cameras=[], policy=None)


def test_masses_and_friction_are_those_of_the_table(monkeypatch):
    monkeypatch.setenv("MJSENSE_PACKAGES", str(wheel("robosuite")))
    env = mjs.make_vec("pick", "franka", scene="robosuite/objects", num_envs=1, cameras=[], policy=None, observations=["qpos"])
    model = env.sim.model
    body = model.body("robosuite_can/robosuite_can").id
    assert model.body_subtreemass[body] == pytest.approx(0.10)
    geoms = [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] == body]
    assert [list(model.geom_friction[g]) for g in geoms] == [[0.9, 0.01, 0.0005]] * len(geoms)
    env.close()


def test_install_runs_pip_once_and_says_what_was_added(monkeypatch, capsys):
    """Pip is replaced by a function that adds the files."""
    monkeypatch.setenv("MJSENSE_PACKAGES", "/nowhere")
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)
    folder, calls = wheel("robosuite"), []

    class Done:
        returncode = 0

    def pip(command, **_):
        calls.append(command)
        monkeypatch.setenv("MJSENSE_PACKAGES", str(folder))
        return Done

    monkeypatch.setattr(assets.subprocess, "run", pip)
    assert commands.run(["assets", "install", "robosuite"]) == 0
    assert calls[0][1:5] == ["-m", "pip", "install", "--no-deps"] and calls[0][-1] == "robosuite==1.5.2"
    assert "robosuite: 8 objects added: robosuite_bottle" in capsys.readouterr().out
    assert commands.run(["assets", "install", "robosuite"]) == 0 and len(calls) == 1
    assert commands.run(["assets", "install", "robosuit"]) == commands.WRONG_INPUT
    assert "robosuit" in capsys.readouterr().err
