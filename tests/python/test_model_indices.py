# SPDX-License-Identifier: Apache-2.0
"""Values that a recording or a program writes into a model are checked against what they index, before MuJoCo or mjsense read it."""

import re
import shutil

import h5py
import mujoco
import numpy as np
import pytest

import mjsense as mjs
from mjsense.dataset.episode_worlds import EpisodeWorlds
from mjsense.dataset.playback import check_episode

SCENE = """<mujoco><asset><texture name="t" type="2d" builtin="checker" width="64" height="64"/><texture name="c" type="cube" builtin="gradient" width="32" height="32"/>
<material name="m" texture="t"/><material name="mc" texture="c"/><mesh name="tet" vertex="0 0 0 .3 0 0 0 .3 0 0 0 .3"/><hfield name="h" nrow="8" ncol="8" size="1 1 .2 .1"/></asset>
<worldbody><light pos="0 0 3"/><geom type="plane" size="2 2 .1" material="m"/><geom type="hfield" hfield="h" pos="1 1 0"/><body name="b" pos="0 0 1"><freejoint/>
<geom type="box" size=".1 .2 .3" material="m"/><geom type="mesh" mesh="tet" pos=".4 0 0"/><site name="s"/><camera name="cam" pos="0 -1 .3" euler="80 0 0"/></body></worldbody></mujoco>"""
INDICES = (
    "mesh_vertadr", "mesh_vertnum", "mesh_faceadr", "mesh_facenum", "mesh_normaladr", "mesh_normalnum", "mesh_texcoordnum",
    "mesh_graphadr", "mesh_face", "mesh_facenormal", "mesh_graph", "hfield_adr", "hfield_nrow", "hfield_ncol", "tex_adr", "tex_type", "tex_width",
    "tex_height", "tex_nchannel", "mat_texid", "geom_dataid", "geom_matid", "geom_type", "geom_bodyid", "cam_bodyid", "light_bodyid", "light_type",
    "body_geomadr", "site_matid", "body_parentid",
)  # fmt: skip
UNUSED = {"mesh_texcoordnum"}  # of a mesh without texture coordinates
LAZY = {"mesh_face", "mesh_facenormal", "mesh_graph"}  # read again only after reload()


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    out = tmp_path_factory.mktemp("recorded")
    mjs.record("pick", out=out, num_worlds=1, episodes=1, keep_failures=True, horizon=4, cameras=[], seed=3)
    return out


@pytest.fixture(scope="module")
def worlds(recorded):
    """A simulation of the archived model, as render and the viewer use it."""
    return EpisodeWorlds(mjs.Dataset(recorded).episodes[0], 1)


def edited(recorded, folder, edit):
    """A copy of the recording, whose group `replay` was edited; and its only episode."""
    shutil.copytree(recorded, folder)
    with h5py.File(next(folder.glob("house_0/*.h5")), "r+") as file:
        edit(file["traj_0/replay"])
    return mjs.Dataset(folder).episodes[0]


def put(name, value):
    def edit(group):
        if name in group:
            del group[name]
        group[name] = value

    return edit


def refuses(worlds, episode, message):
    """All readers of the model refuse the episode with the same line."""
    place = r"^episode 0 \(trajectories_batch_1_of_1\.h5, traj_0\): "
    for call in (episode.model, lambda: check_episode(episode), lambda: worlds.begin(0, episode)):
        with pytest.raises(ValueError, match=place + message) as error:
            call()
        assert "\n" not in str(error.value)


def test_integers_are_refused(recorded, worlds, tmp_path):
    model = mjs.Dataset(recorded).episodes[0].model()
    for i, name in enumerate(("geom_bodyid", "body_parentid", "jnt_qposadr", "mesh_face", "tex_adr", "M_colind", "name_bodyadr", "sensor_adr")):
        episode = edited(recorded, tmp_path / str(i), put(f"model/{name}", np.full_like(getattr(model, name), 9999999)))
        refuses(worlds, episode, f"replay/model/{name}: no field of a model that may differ between episodes")


@pytest.mark.parametrize("name, index, value, message", [
    ("geom_dataid", 0, 9999999, "ids of meshes, 0 to "), ("geom_matid", 3, 9999999, "ids from .* to 9999999; the model's are 0 to"),
    ("geom_matid", 3, -7, "ids from -7"), ("mat_texid", (0, 0), 9999999, "the model's are 0 to"), ("geom_type", 0, 99, r"\[99\] cannot be given here"),
    ("geom_condim", 1, 77, "values must be 1, 3, 4 or 6"), ("light_type", 0, 9, "cannot be given here"),
    ("geom_size", (0, 1), np.inf, r"\[0, 1\]: is inf, expected a number of at most 1e\+10"), ("geom_pos", (2, 0), 1e300, r"\[2, 0\]: is 1e\+300, expected"),
    ("geom_size", (1, 0), -1.0, "values must be at least 0; .* is -1.0"), ("body_quat", (1, slice(None)), 0.0, "values must be quaternions"),
    ("bvh_aabb", (0, 4), -1.0, r"\[0, 4\]: is -1.0, expected a size of at least 0"),
    ("jnt_range", (0, 1), -9.0, r"\[0\]: is limited to \[-?[\d.]+, -9.0\], expected a range"), ("actuator_actlimited", 0, 1, r"\[0\]: is limited to \[0.0, 0.0\]"),
], ids=str)  # fmt: skip
def test_values_are_refused(recorded, worlds, tmp_path, name, index, value, message):
    values = np.array(getattr(mjs.Dataset(recorded).episodes[0].model(), name))
    values[index] = value
    refuses(worlds, edited(recorded, tmp_path / "data", put(f"model/{name}", values)), f"replay/model/{name}.*{message}")


@pytest.mark.parametrize("name, value, message", [
    ("__class__", np.zeros(3), "no field of a model"), ("nq", np.int32(5), "no field of a model"), ("opt", np.zeros(3), "no field of a model"),
    ("names", np.zeros(10, np.uint8), "no field of a model"), ("geom_size", np.zeros((2, 3)), r"is float64 \[2, 3\], expected float64 \["),
    ("geom_size", np.zeros((1, 1), "S5"), r"is \|S5 \[1, 1\], expected float64"), ("geom_matid", np.zeros(3), r"is float64 \[3\], expected int32"),
], ids=str)  # fmt: skip
def test_other_fields_are_refused(recorded, worlds, tmp_path, name, value, message):
    refuses(worlds, edited(recorded, tmp_path / "data", put(f"model/{name}", value)), f"replay/model/{name}: {message}")


def test_other_numbers_of_columns_are_refused(recorded, worlds, tmp_path):
    model = mjs.Dataset(recorded).episodes[0].model()
    for name, value in (("geom_size", np.zeros(model.ngeom)), ("body_mass", np.zeros((model.nbody, 2)))):
        shapes = rf"is float64 \[{', '.join(map(str, value.shape))}\], expected float64 \[{', '.join(map(str, getattr(model, name).shape))}\]"
        refuses(worlds, edited(recorded, tmp_path / name, put(f"model/{name}", value)), f"replay/model/{name}: {shapes}")


@pytest.mark.parametrize("name, value, message", [
    ("held", np.array([10**8, -5], np.int32), r"replay/held\[0\]: is 100000000, expected the id of a free joint"),
    ("held", np.array([0], np.int32), r"replay/held\[0\]: is 0, expected the id of a free joint"),
    ("held", np.zeros(2), "replay/held: is float64"),
    ("ctrl", lambda model: np.zeros((5, 0, model.nu)), "replay/ctrl has 0 control ticks"),
    ("ctrl", lambda model: np.zeros((5, 1000, model.nu)), "replay/ctrl has 1000 control ticks, expected a divisor"),
    ("ctrl", np.zeros((5, 1, 5000)), "replay/ctrl has 5000 controls, expected"),
    ("ctrl", np.zeros((4, 1, 8)), r"replay/ctrl: is float64 \[4, 1, 8\], expected float64 with 3 dimensions and 5 rows"),
    ("state", lambda model: np.full((5, 10), 1e300), r"replay/state\[0, 0\]: is 1e\+300, expected a number of at most 1e\+15"),
    ("state", lambda model: np.full((5, 10), np.nan), r"replay/state\[0, 0\]: is nan"),
    ("state", np.zeros((2, 10)), r"replay/state: is float64 \[2, 10\], expected float64 with 2 dimensions and 5 rows"),
    ("written", np.zeros((5, 3)), r"replay/written has the shape \[5, 3\], expected"),
])  # fmt: skip
def test_inputs_are_refused(recorded, worlds, tmp_path, name, value, message):
    value = value(mjs.Dataset(recorded).episodes[0].model()) if callable(value) else value
    refuses(worlds, edited(recorded, tmp_path / "data", put(name, value)), message)


# ---------------------------------------------------------------------------------------------- models of programs


def made():
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


@pytest.mark.parametrize("when", ["before", "after"])
@pytest.mark.parametrize("name", INDICES)
def test_renderer(name, when):
    model, data = made()
    renderer = mjs.Renderer(model, 48, 64) if when == "after" else None
    if renderer:
        renderer.update_scene(data, "cam")
        renderer.render()
    getattr(model, name)[...] = 1000000
    try:
        renderer = renderer or mjs.Renderer(model, 48, 64)
        renderer.update_scene(data, "cam")
        renderer.render()
        renderer.reload()
        renderer.render()
    except ValueError as error:
        assert re.search(rf"the model's ({name}|tex_\w+|hfield_\w+)\[\d+\] is \d+, expected ", str(error))
    else:
        assert name in UNUSED


def test_renderer_works_again_after_the_value_is_put_back():
    model, data = made()
    renderer = mjs.Renderer(model, 48, 64)
    renderer.update_scene(data, "cam")
    image = renderer.render()
    before, model.geom_matid[0] = int(model.geom_matid[0]), 9999
    with pytest.raises(ValueError, match=r"the model's geom_matid\[0\] is 9999, expected -1 to 1"):
        renderer.update_scene(data, "cam")
    model.geom_matid[0] = before
    renderer.update_scene(data, "cam")
    np.testing.assert_array_equal(renderer.render(), image)


@pytest.mark.parametrize("name", ["geom_matid", "geom_dataid", "mat_texid", "body_parentid", "jnt_dofadr", "geom_condim", "site_matid", "mesh_face"])
def test_attach(name):
    sensors = [mjs.CameraSensorCfg("look", camera_name="cam", width=16, height=12)]
    model, data = made()
    attached = mjs.attach(model, data, sensors)
    image = np.array(attached["look"].data.rgb)
    before = np.array(getattr(model, name))
    getattr(model, name)[...] = 9999
    with pytest.raises(ValueError, match=rf"reload\(\): {name}\[0\] is 9999, expected"):
        attached.reload()
    getattr(model, name)[...] = before
    attached.reload()
    np.testing.assert_array_equal(attached["look"].data.rgb, image)
    getattr(model, name)[...] = -9
    with pytest.raises(ValueError, match=rf"{name}\[0\] is -9, expected"):
        mjs.attach(model, data, sensors)


def test_randomize():
    simulation = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=SCENE)), 2)
    for name in ("geom_matid", "site_matid", "mat_texid"):
        for wrong in (9999, -7):
            with pytest.raises(ValueError, match=f"{name}: ids from {wrong} to {wrong}; the model's are 0 to 1, -1 is none"):
                simulation.randomize(name, wrong)
    simulation.model_field("site_matid")[1] = 9999
    with pytest.raises(ValueError, match=r"site_matid\[0\] is 9999, expected -1 to 1"):
        simulation.randomize("geom_rgba", 0.5)
