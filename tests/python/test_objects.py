# SPDX-License-Identifier: Apache-2.0
"""The catalogue of objects, and the command that installs those of other packages."""

import contextlib
import itertools
import json
import os
import tomllib
import zipfile
from pathlib import Path

import mujoco
import numpy as np
import pytest
from wheels import wheel

import mjsense as mjs
from mjsense import _core, commands
from mjsense.tasks import assets, synthesized_objects

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
    for source in ("robosuite", "libero", "metaworld", "rgb", "scene_synthesizer", "ycb"):
        with pytest.raises(ValueError, match=f"mjsense assets install {source} "):
            mjs.make_vec("pick", "franka", scene=f"{source}/objects", num_envs=1, cameras=[], policy=None)


def test_masses_and_friction_are_those_of_the_table(monkeypatch):
    monkeypatch.setenv("MJSENSE_PACKAGES", str(wheel("robosuite")))
    env = mjs.make_vec("pick", "franka", scene="robosuite/objects", num_envs=1, cameras=[], policy=None, observations=["qpos"])
    model = env.sim.model
    body = model.body("robosuite_can/robosuite_can").id
    assert model.body_subtreemass[body] == pytest.approx(0.10)
    geoms = [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] == body]
    assert [list(model.geom_friction[g]) for g in geoms] == [[0.9, 0.01, 0.0005]] * len(geoms)
    env.close()


CORNERS = np.array(list(itertools.product((-1, 1), repeat=3)), "<f4")
FACES = [
    (0, 1, 3),
    (0, 3, 2),
    (4, 6, 7),
    (4, 7, 5),
    (0, 4, 5),
    (0, 5, 1),
    (2, 3, 7),
    (2, 7, 6),
    (0, 2, 6),
    (0, 6, 4),
    (1, 5, 7),
    (1, 7, 3),
]


def box_stl(half):
    """A box as a binary STL."""
    facets = b"".join(
        bytes(12) + (CORNERS[list(face)] * np.array(half, "<f4")).astype("<f4").tobytes() + bytes(2) for face in FACES
    )
    return bytes(80) + len(FACES).to_bytes(4, "little") + facets


def test_objects_of_several_meshes(tmp_path, monkeypatch):
    """The package is replaced by boxes in the files of its meshes."""
    packages = tmp_path / "it's a <folder> & more"
    monkeypatch.setenv("MJSENSE_PACKAGES", str(packages))
    for one in listed().values():
        if one["source"] == "metaworld":
            assert not one["installed"] and one["meshes"]
            for mesh in one["meshes"]:
                file = packages / mesh.removeprefix("package:")
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(box_stl((0.01, 0.02, 0.03)))
    assert listed()["metaworld_golf_club"]["installed"]
    (tmp_path / "scene.toml").write_text(SCENE.format(names='["metaworld_golf_club", "metaworld_hammer"]'))
    env = mjs.make_vec("pick", scene=str(tmp_path / "scene.toml"), cameras=[], policy=None, observations=["qpos"])
    model = env.sim.model
    body = model.body("metaworld_golf_club/metaworld_golf_club").id
    geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body]
    assert len(geoms) == len(listed()["metaworld_golf_club"]["meshes"]) == 3
    assert model.body_mass[body] == pytest.approx(0.12)
    assert all(model.geom_contype[g] for g in geoms)
    assert np.allclose(model.geom_pos[geoms], [[0.03, 0, 0.032], [-0.045, 0, -0.06], [0.03, 0, 0.032]], atol=1e-6)
    env.close()


def test_a_disc_touches_with_a_cylinder(tmp_path, monkeypatch):
    """The hull of Meta-World's puck had one contact with the table and sank in by 4.5 mm."""
    monkeypatch.setenv("MJSENSE_PACKAGES", str(tmp_path))
    mesh = tmp_path / "metaworld/assets/objects/meshes/puck/puck.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes(box_stl((0.05, 0.05, 0.015)))
    (tmp_path / "scene.toml").write_text(SCENE.format(names='["metaworld_puck"]'))
    with contextlib.closing(
        mjs.make_vec("pick", scene=str(tmp_path / "scene.toml"), policy="planner", cameras=[], observations=["qpos"])
    ) as env:
        env.reset(seed=0)
        model, data = env.sim.model, env.sim.data
        body = model.body("metaworld_puck/metaworld_puck").id
        shown, touched = (g for g in range(model.ngeom) if model.geom_bodyid[g] == body)
        assert not model.geom_contype[shown] and not model.geom_conaffinity[shown] and model.geom_contype[touched]
        assert model.geom_type[touched] == mujoco.mjtGeom.mjGEOM_CYLINDER
        assert list(model.geom_size[touched][:2]) == [0.05, 0.015]
        assert model.body_mass[body] == pytest.approx(0.12)
        start = data.xpos[0, body, 2]
        for _ in range(15):
            env.step(env.expert_action(), done=env.expert_done)
        assert abs(data.xpos[0, body, 2] - start) < 5e-4


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


def test_install_of_generated_objects_leaves_only_their_files(tmp_path, monkeypatch, capsys):
    """Pip and the generator are replaced."""
    packages, temporary = tmp_path / "packages", []
    monkeypatch.setenv("MJSENSE_PACKAGES", str(packages))
    monkeypatch.delenv("VIRTUAL_ENV", raising=False)
    monkeypatch.delenv("CONDA_PREFIX", raising=False)

    class Done:
        returncode = 0

    def run(command, env=None, **_):
        if "--target" in command:
            temporary.append(Path(command[command.index("--target") + 1]))
            assert "--no-deps" in command and "scene-synthesizer==1.15.0" in command
        elif env is not None:
            assert env["PYTHONPATH"].split(os.pathsep)[0] == str(temporary[0])
            assert command[1:3] == ["-m", "mjsense.tasks.synthesized_objects"]
            folder = Path(command[3])
            folder.mkdir()
            for name in synthesized_objects.OBJECTS:
                (folder / f"{name}.xml").write_text("<mujoco/>")
        else:
            with zipfile.ZipFile(command[-1]) as archive:
                archive.extractall(packages)
        return Done

    monkeypatch.setattr(assets.subprocess, "run", run)
    assert commands.run(["assets", "install", "scene_synthesizer"]) == 0
    assert f"scene_synthesizer: {len(synthesized_objects.OBJECTS)} objects added" in capsys.readouterr().out
    assert {path.name for path in packages.iterdir()} == {
        "mjsense_scene_synthesizer",
        "mjsense_scene_synthesizer-1.15.0.dist-info",
    }
    assert not temporary[0].parent.exists()


def extent(model, data, contacts):
    """Lowest and highest corner of the geoms with contacts, or of those without."""
    points = []
    for geom in np.flatnonzero((model.geom_contype > 0) == contacts):
        if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_MESH:
            mesh = model.geom_dataid[geom]
            own = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]]
        elif model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER:
            own = CORNERS * model.geom_size[geom][[0, 0, 1]]
        else:
            own = CORNERS * model.geom_size[geom]
        points.append(own @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom])
    return np.concatenate([np.concatenate(points).min(0), np.concatenate(points).max(0)])


def test_objects_of_scene_synthesizer(tmp_path, monkeypatch):
    """Generates them: contacts are as large as the meshes that pictures show."""
    if "scene_synthesizer" not in os.environ.get("MJSENSE_TEST_ADAPTERS", "").split(","):
        pytest.skip("downloads 50 MB: MJSENSE_TEST_ADAPTERS=scene_synthesizer ./dev test -k test_objects")
    monkeypatch.setenv("MJSENSE_PACKAGES", str(tmp_path))
    pip = assets._pip_install
    monkeypatch.setattr(
        assets,
        "_pip_install",
        lambda source, *what: pip(source, *(what if "--target" in what else ("--target", str(tmp_path), *what))),
    )
    assert len(assets.install_objects("scene_synthesizer")) == len(synthesized_objects.OBJECTS)
    for name in synthesized_objects.OBJECTS:
        model = mujoco.MjModel.from_xml_path(str(tmp_path / f"mjsense_scene_synthesizer/{name}.xml"))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        assert np.allclose(extent(model, data, True), extent(model, data, False), atol=0.0025), name
    table = tomllib.loads((MODELS / "objects/scene_synthesizer.toml").read_text())["objects"]
    assert [one["name"] for one in table] == [f"scene_synthesizer_{name}" for name in synthesized_objects.OBJECTS]
    (tmp_path / "scene.toml").write_text(SCENE.format(names='["scene_synthesizer_.*"]'))
    env = mjs.make_vec("pick", scene=str(tmp_path / "scene.toml"), cameras=[], policy=None, observations=["qpos"])
    masses = {one["name"]: env.sim.model.body(f"{one['name']}/{one['name']}").subtreemass[0] for one in table}
    assert masses == pytest.approx({one["name"]: one["mass"] for one in table})
    env.close()
