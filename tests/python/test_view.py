# SPDX-License-Identifier: Apache-2.0
"""The viewer: its triangles, and what it sends. test_view_page.py tests its page."""

import html
import importlib.util
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest
from scenes import BALL

import mjsense as mjs
from mjsense.core.rotations import rotation_of
from mjsense.viewer import curves, geometry, layer, soft, surfaces
from mjsense.viewer.poses import PoseStream

needs_viser = pytest.mark.skipif(importlib.util.find_spec("viser") is None, reason="viser is not installed: pip install 'mjsense[view]'")


@pytest.fixture
def live(port):
    """A viewer of a simulation with two worlds, which the test updates."""
    pytest.importorskip("viser")
    scene = mjs.Scene(mjs.SceneCfg(entities={"ball": mjs.EntityCfg(model=BALL)}, terrain=mjs.TerrainCfg(), sensors=(
        mjs.CameraSensorCfg(name="eye", width=32, height=24, data_types=("rgb", "depth")),
        mjs.RayCastSensorCfg(name="scan", frame=mjs.ObjRef("body", "ball", "ball")))))  # fmt: skip
    sim = mjs.Simulation(scene, num_worlds=2)
    with mjs.view(sim, port=port, block=False, open_browser=False) as viewer:
        viewer.sim = sim
        yield viewer


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    out = tmp_path_factory.mktemp("pick")
    mjs.record("pick", out=out, horizon=30, episodes=2, num_worlds=2, keep_failures=True, width=48, height=32, depth=True)
    return out


# ------------------------------------------------------------------------------------------------------------------ triangles


def shape_of(kind, size):
    model = mujoco.MjModel.from_xml_string(f"<mujoco><worldbody><geom type='{kind}' size='{size}'/></worldbody></mujoco>")
    return geometry.of_geom(model, 0, 1.0)


@pytest.mark.parametrize("kind, size, volume", [
    ("sphere", ".2", 4 / 3 * np.pi * 0.2**3), ("ellipsoid", ".1 .2 .3", 4 / 3 * np.pi * 0.006), ("box", ".1 .2 .3", 8 * 0.006),
    ("cylinder", ".1 .3", np.pi * 0.01 * 0.6), ("capsule", ".1 .3", np.pi * 0.01 * 0.6 + 4 / 3 * np.pi * 0.001)])  # fmt: skip
def test_primitives_are_closed_and_face_outwards(kind, size, volume):
    shape = shape_of(kind, size)
    a, b, c = (shape.vertices[shape.faces[:, k]].astype(np.float64) for k in range(3))
    assert np.einsum("ij,ij->", a, np.cross(b, c)) / 6 == pytest.approx(volume, rel=0.015)
    across = np.cross(b - a, c - a)
    assert (np.einsum("ij,ij->i", across, shape.normals[shape.faces].mean(1)) > -1e-9).all()
    assert shape.uv.min() >= -1e-6 and shape.uv.max() <= 1 + 1e-6
    welded = geometry.welded(shape)
    assert len(welded.vertices) <= len(shape.vertices) and (welded.vertices[welded.faces].round(4) == shape.vertices[shape.faces].round(4)).all()


def test_height_fields_and_meshes_are_those_of_the_model():
    scene = mjs.Scene(mjs.SceneCfg(terrain=mjs.TerrainCfg(terrain_type="generator", levels=2)))
    model = scene.model
    field = next(g for g in range(model.ngeom) if model.geom_type[g] == mujoco.mjtGeom.mjGEOM_HFIELD)
    shape = geometry.of_geom(model, field, 1.0)
    rx, ry, top, base = model.hfield_size[model.geom_dataid[field]]
    assert np.abs(shape.vertices).max(0)[:2] == pytest.approx((rx, ry)) and shape.vertices[:, 2].min() == pytest.approx(-base)
    assert shape.vertices[:, 2].max() == pytest.approx(model.hfield_data.max() * top)
    model = mujoco.MjModel.from_xml_string("""<mujoco><asset><mesh name="m" vertex="0 0 0 1 0 0 0 1 0 0 0 1"/></asset>
        <worldbody><geom type="mesh" mesh="m"/></worldbody></mujoco>""")
    shape = geometry.of_geom(model, 0, 1.0)
    assert len(shape.faces) == 4 and set(map(tuple, shape.vertices)) == set(map(tuple, model.mesh_vert))


@needs_viser
def test_textures_of_boxes():
    """A cube texture with one colour for each face: every triangle of a box reads the texels of its face."""
    faces = {"right": (1, 0, 0), "left": (-1, 0, 0), "up": (0, 1, 0), "down": (0, -1, 0), "front": (0, 0, 1), "back": (0, 0, -1)}
    model = mujoco.MjModel.from_xml_string("""<mujoco><asset><texture name="t" type="cube" builtin="flat" width="16" height="16" mark="edge"
        markrgb="1 1 1" rgb1="1 0 0" rgb2="0 0 1"/><material name="m" texture="t"/></asset>
        <worldbody><geom type="box" size=".1 .2 .3" material="m"/></worldbody></mujoco>""")
    surface = surfaces.of_geom(model, 0, 1.0)
    assert surface.glb.startswith(b"glTF") and surface.texture.shape == (96, 16, 3)
    rows = (surface.shape.uv[surface.shape.faces][..., 1].mean(1) * 6).astype(int)
    normals = surface.shape.normals[surface.shape.faces].mean(1)
    expected = [list(faces.values()).index(tuple(map(int, n.round()))) for n in normals]
    assert rows.tolist() == expected


def test_a_texture_with_zero_repetitions_is_shown_once():
    """As in MuJoCo's images."""
    def shown(repeat):
        model = mujoco.MjModel.from_xml_string(f"""<mujoco><asset><texture name="t" type="2d" builtin="checker" width="8" height="8"/>
            <material name="m" texture="t" texrepeat="{repeat}"/></asset>
            <worldbody><geom type="plane" size="1 2 1" material="m"/></worldbody></mujoco>""")
        return surfaces.of_geom(model, 0, 1.0).shape.uv

    np.testing.assert_array_equal(shown("0 0"), shown("1 1"))
    np.testing.assert_array_equal(shown("3 0"), shown("3 1"))


@pytest.mark.parametrize("repeat", ["1 1", "2 3", "2.5 0"])
@pytest.mark.parametrize("uniform", ["false", "true"])
@pytest.mark.parametrize("kind", ["hfield", "mesh"])
def test_textures_from_above_are_those_of_images(kind, uniform, repeat):
    """The colours of a luminous surface are the texels at the coordinates that the page gets."""
    corners = " ".join(f"{x} {y} {z}" for x in (-1, 1) for y in (-0.9, 0.9) for z in (-3, 0))  # the frame of a tall mesh has the z axis of the world
    model = mujoco.MjModel.from_xml_string(f"""<mujoco><visual><headlight active="0"/></visual>
        <asset><texture name="t" type="2d" builtin="flat" width="64" height="64"/><hfield name="hfield" nrow="5" ncol="5" size="1 .9 .1 .1"/>
        <mesh name="mesh" vertex="{corners}"/>
        <material name="m" texture="t" texrepeat="{repeat}" texuniform="{uniform}" emission="1" specular="0"/></asset>
        <worldbody><geom type="{kind}" {kind}="{kind}" material="m"/><camera name="c" pos="0 0 3" projection="orthographic" fovy="2"/></worldbody></mujoco>""")
    texels = np.zeros((64, 64, 3), np.uint8)
    texels[..., 0], texels[..., 1] = 4 * np.arange(64), 4 * np.arange(64)[:, None]
    model.tex_data[:] = texels.ravel()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with mjs.Renderer(model, 64, 64) as renderer:
        renderer.update_scene(data, "c")
        image = renderer.render().astype(int)
    shape = surfaces.of_geom(model, 0, 1.0).shape
    local = np.linalg.lstsq(np.c_[shape.vertices[:, :2], np.ones(len(shape.vertices))], shape.uv, rcond=None)[0]
    compared = 0
    for x, y in np.random.default_rng(0).uniform(-0.8, 0.8, (40, 2)).round(1) + 1 / 64:  # centres of pixels
        place = (np.array([x, y, 0]) - data.geom_xpos[0]) @ data.geom_xmat[0].reshape(3, 3)
        texel = (np.array([*place[:2], 1]) @ local) % 1 * 64
        if (np.abs(texel - 32) < 30).all():  # not where the texture begins anew
            np.testing.assert_allclose(image[int((1 - y) * 32), int((x + 1) * 32), :2], 4 * texel - 2, atol=8)
            compared += 1
    assert compared > 10


def test_poses_in_frames_of_bodies():
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body name='b' pos='1 2 3' euler='0 0 90'><geom size='.1'/></body></worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    shapes = mjs.sensors.DebugShapes()
    PoseStream("p", "body b").draw(shapes, np.array([1.0, 0, 0, 1, 0, 0, 0]), model, data.xpos, data.xmat)
    np.testing.assert_allclose(shapes.positions[0], (1, 3, 3), atol=1e-9)
    np.testing.assert_allclose(shapes.vectors[0] / np.linalg.norm(shapes.vectors[0]), (0, 1, 0), atol=1e-9)
    PoseStream("p", "world").draw(shapes, np.full((2, 7), np.nan), model, data.xpos, data.xmat)
    assert len(shapes) == 3


# --------------------------------------------------------------------------------------------------------------------- server


def messages(viewer):
    return dict(viewer._server._websock_server._broadcast_buffer.message_from_id)


@needs_viser
def test_only_what_has_changed_is_sent(live):
    before = {m.name for m in messages(live).values() if type(m).__name__ in ("MeshMessage", "GlbMessage")}
    assert any("ball" in name for name in before)
    assert live._stage.set_poses(*(live._source.field(name, 0) for name in ("xpos", "xquat"))) == 0
    live.sim.step()
    assert live._stage.set_poses(*(live._source.field(name, 0) for name in ("xpos", "xquat"))) == 1
    ball = next(i for i in range(live.sim.model.ngeom) if live.sim.model.geom(i).name.startswith("ball/"))
    colours = np.tile(live.sim.model.geom_rgba, (2, 1, 1))
    colours[1, ball] = 0.2, 0.4, 0.6, 1
    live.sim.randomize("geom_rgba", colours)
    old = set(messages(live))
    live._world_box.value = 1
    live._change_world()
    new = [m for key, m in messages(live).items() if key not in old and type(m).__name__ == "MeshMessage"]
    assert [m.props.color for m in new] == [(51, 102, 153)]


@needs_viser
def test_hidden_groups(tmp_path, port):
    """A geom that is shown later is where its body is."""
    (tmp_path / "model.xml").write_text("<mujoco><worldbody><body name='b' pos='1 2 3'><geom name='g' size='.1' group='3'/></body></worldbody></mujoco>")
    with mjs.view(tmp_path / "model.xml", port=port, block=False, open_browser=False) as viewer:
        assert not viewer._stage._frames
        assert any(getattr(getattr(m, "props", None), "_markdown", "") == "There are no images." for m in messages(viewer).values())
        viewer._stage.show_groups({3})
        assert np.array_equal(viewer._stage._frames[1].position, (1, 2, 3)) and viewer._stage._solids["geom", 0][0] is not None
        viewer._stage.show_groups({0})
        assert viewer._stage._solids["geom", 0][0] is None


SOFT = """<mujoco><worldbody>
  <body name='hinged' pos='0 0 1'><joint axis='0 1 0'/><geom size='.05'/><site name='tip' type='box' size='.02 .03 .04' pos='.1 0 0'/></body>
  <site name='top' pos='0 0 2'/>
  <flexcomp name='cloth' type='grid' count='4 4 1' spacing='.1 .1 .1' pos='1 0 1' dim='2' radius='.01' mass='.1'><edge equality='true'/></flexcomp>
  <flexcomp name='block' type='grid' count='3 3 3' spacing='.1 .1 .1' pos='2 0 1' dim='3' radius='.01' mass='.1'><edge equality='true'/></flexcomp>
  </worldbody>
  <deformable><skin name='skin' vertex='1 0 0 0 1 0 0 0 1' face='0 1 2'>
    <bone body='hinged' bindpos='0 0 1' bindquat='1 0 0 0' vertid='0 1 2' vertweight='1 1 1'/></skin></deformable>
  <tendon><spatial name='rope' width='.01'><site site='tip'/><site site='top'/></spatial></tendon></mujoco>"""


@needs_viser
def test_flexes_skins_tendons_and_sites(tmp_path, port):
    """Vertices and paths are those of MuJoCo, before and after a motion."""
    (tmp_path / "model.xml").write_text(SOFT)
    with mjs.view(tmp_path / "model.xml", port=port, block=False, open_browser=False) as viewer:
        sim = viewer._source.sim
        handles = {surface.name: handle for surface, handle, _ in viewer._stage._soft._drawn}
        assert set(handles) == {"/flexes/0", "/flexes/1", "/skins/0"}
        assert len(handles["/flexes/0"].faces) == 18 and len(handles["/flexes/1"].faces) == 6 * 8
        sim.qvel[0, 0] = 2.0
        for _ in range(20):
            sim.step()
        viewer.update()
        points = sim.data.flexvert_xpos[0]
        np.testing.assert_allclose(np.concatenate([handles["/flexes/0"].vertices, handles["/flexes/1"].vertices]), points, atol=1e-5)
        turn, place = sim.data.xmat[0, 1].reshape(3, 3), sim.data.xpos[0, 1]
        np.testing.assert_allclose(handles["/skins/0"].vertices, (np.eye(3) - [0, 0, 1]) @ turn.T + place, atol=1e-5)
        assert not np.allclose(turn, np.eye(3), atol=0.01)
        (rope,) = viewer._stage._soft._tendons._nodes
        ends = sim.data.site_xpos[0]
        np.testing.assert_allclose(rope.batched_positions, [ends.mean(0)], atol=1e-5)
        assert rope.batched_scales[0, 2] * 2 == pytest.approx(np.linalg.norm(ends[1] - ends[0]), abs=1e-5)
        assert viewer._stage._solids["site", 0][0] is None
        viewer._stage.show_groups({0}, sites=True)
        assert viewer._stage._solids["site", 0][0] is not None
        viewer._stage.show_groups({1})
        viewer.update()
        assert not viewer._stage._soft._drawn and not viewer._stage._soft._tendons._nodes


def test_a_tendon_over_a_pulley_has_a_gap():
    model = mujoco.MjModel.from_xml_string("""<mujoco><worldbody><site name='a'/><site name='b' pos='0 0 1'/><site name='c' pos='1 0 1'/></worldbody>
        <tendon><spatial width='.01'><site site='a'/><site site='b'/><pulley divisor='2'/><site site='b'/><site site='c'/></spatial></tendon></mujoco>""")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    shapes = soft._tendons(model, {0}, lambda name: getattr(data, name))
    np.testing.assert_array_equal(shapes.positions, [[0, 0, 0], [0, 0, 1]])
    np.testing.assert_array_equal(shapes.vectors, [[0, 0, 1], [1, 0, 0]])


@needs_viser
def test_a_taken_port_and_the_address(live, capsys):
    assert re.fullmatch(rf"http://127\.0\.0\.1:{live.port}/[\w-]{{32}}", live.url)
    with mjs.view(live._source, port=live.port, block=False, open_browser=False) as other:
        assert other.port != live.port
    assert f"Port {live.port} is taken: the viewer uses port {other.port}." in capsys.readouterr().out


@needs_viser
def test_controls_shapes_and_curves(live):
    live._curves.choose("scan/hit_pos_w" if "scan/hit_pos_w" in live._source.streams() else "qpos")
    for box in live._shape_boxes.values():
        box.value = True
    live._draw_shapes()
    for _ in range(5):
        live.sim.step()
        live.update()
    assert len(live._curves._history["qpos"]) >= 5
    names = {m.name for m in messages(live).values() if hasattr(m, "name")}
    assert {"/shapes/sphere", "/shapes/arrow"} <= names
    balls = next(m.props for m in messages(live).values() if getattr(m, "name", "") == "/shapes/sphere")
    assert not balls.cast_shadow and not balls.receive_shadow
    live._source.set_joint(0, 0, 0.1) if live._source.joints() else None


def test_a_cylinder_lies_along_its_vector():
    for vector in ((0, 0, 2), (0, 0, -2), (1, 0, 0), (0.3, -0.4, 1.2)):
        turned = rotation_of(layer._turn(np.array(vector, float)))[:, 2]
        np.testing.assert_allclose(turned, np.array(vector) / np.linalg.norm(vector), atol=1e-9)
    np.testing.assert_array_equal(layer._turn(np.zeros(3)), (1, 0, 0, 0))


@needs_viser
def test_an_environment_that_the_user_steps(port, monkeypatch, capsys):
    """Opening a viewer changes nothing, and update() shows the new episode with its sizes and colours."""
    env = mjs.make("pick", cameras=[])
    env.reset(seed=0)
    before = env.sim.state.copy()
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    with mjs.view(env, port=port, block=False) as viewer:
        assert f"There is no browser here: open {viewer.url} in one." in capsys.readouterr().out
        assert np.array_equal(env.sim.state, before) and viewer._source.policy is None

        def shown():
            model = env.sim.model_of(0)
            return [g for (kind, g), (_, key) in viewer._stage._solids.items() if kind == "geom" and key and key != surfaces.key_of(model, g)]  # () is a hidden geom

        assert shown() == []
        env.reset(seed=1)
        viewer.update()
        assert shown() == [] and not np.array_equal(env.sim.state, before)
        np.testing.assert_allclose(viewer._stage._sent[:, :3], env.sim.data.xpos[0], atol=2e-6)
    env.close()


@needs_viser
def test_cost_of_a_frame(tmp_path, port):
    """100 bodies that all move. 4 ms of CPU; the limit leaves room for slow machines."""
    bodies = "".join(f"<body pos='{i % 10} {i // 10} 1'><freejoint/><geom size='.1'/></body>" for i in range(100))
    (tmp_path / "model.xml").write_text(f"<mujoco><worldbody>{bodies}</worldbody></mujoco>")
    with mjs.view(tmp_path / "model.xml", port=port, block=False, open_browser=False) as viewer:
        positions, turns = (np.array(viewer._source.field(name, 0)) for name in ("xpos", "xquat"))
        costs = []
        for _ in range(30):
            positions += 0.01
            began = time.thread_time()
            assert viewer._stage.set_poses(positions, turns) == 100
            costs.append(time.thread_time() - began)
    assert np.median(costs) < 0.02


class Height(mjs.Sensor):
    """Values, an image and shapes of a user-defined sensor."""

    uuid, unit = "height", "m"
    observation_space = gymnasium.spaces.Dict({"z": gymnasium.spaces.Box(-9, 9, (1,), np.float32), "image": gymnasium.spaces.Box(0, 255, (4, 6, 3), np.uint8)})

    def compute(self, sim):
        return {"z": sim.data.xpos[:, 1:2, 2].astype(np.float32), "image": np.full((sim.num_worlds, 4, 6, 3), 7, np.uint8)}

    def debug_vis(self, visualizer):
        visualizer.add_cylinder((0, 0, 0), (0, 0, 1), 0.01, (1, 0, 0, 1), "height")


@needs_viser
def test_user_defined_sensors_come_first(port):
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(entities={"ball": mjs.EntityCfg(model=BALL)}, terrain=mjs.TerrainCfg())))
    sim.add(Height())
    with mjs.view(sim, port=port, block=False, open_browser=False) as viewer:
        source = viewer._source
        assert next(iter(source.streams())) == "height/z" and source.streams()["height/z"] == ("m", 1)
        assert source.pictures() == ["height/image"] and source.shape_names()[0] == "height"
        sim.step()
        viewer.update()
        assert source.value("height/z", 0) == pytest.approx(sim.data.xpos[0, 1, 2]) and (source.picture("height/image", 0) == 7).all()
        viewer._shape_boxes["height"].value = True
        viewer._draw_shapes()
        assert [node.name for node in viewer._layer._nodes] == ["/shapes/cylinder"]


def test_numbers_that_are_missing_in_curves():
    values = np.array([[np.nan, 1, 2], [3, np.nan, np.inf], [np.nan, 5, np.nan]])
    np.testing.assert_array_equal(curves._filled(values), [[0, 1, 2], [3, 1, 2], [3, 5, 2]])
    assert curves._range(values.T) == (pytest.approx(0.8), pytest.approx(5.2)) and curves._range([np.full(3, np.nan)]) == (-1, 1)


@needs_viser
def test_memory_stays_bounded(live):
    """The number of messages that a browser receives when it connects does not grow with time."""

    def run(steps):
        for k in range(steps):
            live.sim.step()
            live.update()
            if k % 10 == 0:
                live._reset()
        live._server._run_garbage_collector(force=True)
        return len(messages(live))

    for box in live._shape_boxes.values():
        box.value = True
    live._draw_shapes()
    live._curves.choose("qpos")
    first = run(40)
    assert run(200) <= first + 10


@needs_viser
def test_wrong_things_are_named(live, tmp_path):
    with pytest.raises(ValueError, match=r"world 2: must be in \[0, 2\)"):
        mjs.view(live._source, world=2, block=False, open_browser=False)
    with pytest.raises(mjs.UnknownNameError, match="'pikc' is neither a file nor the name of a task"):
        mjs.view("pikc")
    with pytest.raises(ValueError, match="'rby1' is a robot: name a task"):
        mjs.view("rby1")
    with pytest.raises(FileNotFoundError, match=r"no\.xml does not exist"):
        mjs.view(tmp_path / "no.xml")


@needs_viser
def test_recordings(recording, port):
    with mjs.view(recording, port=port, block=False, open_browser=False) as viewer:
        assert html.escape(viewer._dataset.episodes[0].task) in viewer._about.content and viewer._time.max == 30
        for t in (30, 3, 17, 8, 25, 0):
            viewer.seek(t)
        viewer.update()
        plain = viewer._pictures._panels["exo_camera_1"].image
        viewer._pictures._points_box.value = True
        viewer._show()
        viewer.update()
        marked = viewer._pictures._panels["exo_camera_1"].image
        points = viewer._image_points("exo_camera_1")
        x, y = (points[np.isfinite(points).all(1)][0] * (48, 32)).astype(int)
        assert points.shape == (20, 2) and tuple(marked[y, x]) == (255, 0, 255) and not np.array_equal(plain, marked)
        model, data = viewer._model, mujoco.MjData(viewer._model)
        viewer.seek(20)
        viewer._episode.set_state(model, data, 20)
        np.testing.assert_allclose(viewer._stage._sent[:, :3], data.xpos, atol=2e-6)
        viewer._choice.value = viewer._choice.options[1]
        viewer._choose()
        assert viewer._episode.index == 1
        viewer._curves.choose("obs/extra/tcp_pose")
        viewer.seek(9)
        viewer.update()
        times, *values, now = viewer._curves._charts[0][1].data
        assert len(values) == 7 and times[9] == pytest.approx(9 * 0.066) and np.flatnonzero(np.isfinite(now)).tolist() == [9] and now[9] == values[0][9]
        viewer._text.value = "no such instruction"
        viewer._filter()
        assert viewer._choice.options == ("no episode matches",)


@needs_viser
def test_a_recording_without_replay_data(tmp_path, port, capsys):
    mjs.record("pick", out=tmp_path, horizon=5, keep_failures=True, width=32, height=24, replay=False)
    with mjs.view(tmp_path, port=port, block=False, open_browser=False) as viewer:
        assert "There is no 3D scene, only videos and curves" in viewer._about.content
        viewer.seek(3)
        viewer.update()
        assert viewer._pictures._panels
    assert "has no data for replay" in capsys.readouterr().out


@needs_viser
def test_a_missing_video(tmp_path, port):
    """It is named in the page; everything else can be seen."""
    mjs.record("pick", out=tmp_path, horizon=5, keep_failures=True, width=32, height=24)
    next(tmp_path.glob("house_0/*exo_camera_1*.mp4")).unlink()
    with mjs.view(tmp_path, port=port, block=False, open_browser=False) as viewer:
        viewer.update()
        assert list(viewer._pictures._panels) == ["wrist_camera"] and not viewer._pictures._boxes["exo_camera_1"].value
        assert any("exo_camera_1: " in getattr(getattr(m, "props", None), "content", "") for m in messages(viewer).values())


@needs_viser
def test_ctrl_c_ends_the_program(port):
    command = [sys.executable, "-m", "mjsense", "view", "pick", "--port", str(port), "--no-open"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=os.environ) as process:
        try:
            assert re.fullmatch(rf"Viewer: http://127\.0\.0\.1:{port}/\S+ \(Ctrl-C ends it\)\n", process.stdout.readline())
            process.send_signal(signal.SIGINT)
            out, errors = process.communicate(timeout=30)
        finally:
            process.kill()
    assert (process.returncode, out, errors) == (0, "", "")


@needs_viser
def test_export(recording, tmp_path):
    run = [sys.executable, "-m", "mjsense", "view"]
    done = subprocess.run([*run, str(recording), "--export", "a.viser", "-q"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (tmp_path / "a.viser").stat().st_size > 20_000
    wrong = subprocess.run([*run, "pick", "--export", "a.mp4"], cwd=tmp_path, capture_output=True, text=True)
    assert wrong.returncode == 2 and "ends in neither .viser nor .rrd" in wrong.stderr
    wrong = subprocess.run([*run, str(recording), "--export", "no/a.viser"], cwd=tmp_path, capture_output=True, text=True)
    assert (wrong.returncode, wrong.stderr) == (2, "mjsense: cannot write 'no/a.viser': there is no directory 'no'\n")


@needs_viser
def test_export_to_rerun(recording, tmp_path):
    pytest.importorskip("rerun")
    command = [sys.executable, "-m", "mjsense", "view", str(recording), "--episode", "1", "--export", "a.rrd"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "Wrote a.rrd.\n"), done.stderr
    written = (tmp_path / "a.rrd").read_bytes()
    assert written.startswith(b"RRF") and len(written) > 100_000
    live = [*command[:4], "pick", "--seconds", "0.2", "--export", "b.rrd"]
    assert subprocess.run(live, cwd=tmp_path, capture_output=True).returncode == 0
    program = Path(pytest.importorskip("rerun_cli").__file__).parent / "rerun"
    for name, features in (("a.rrd", ("actions/joint_pos/arm", "obs/agent/qpos/arm")), ("b.rrd", ("reward", "success"))):
        shown = subprocess.run([program, "rrd", "print", name], cwd=tmp_path, capture_output=True, text=True, env={**os.environ, "HOME": str(tmp_path)}).stdout
        entities = {word for line in shown.splitlines() for word in line.split() if word.startswith("/")}
        assert {f"/features/{feature}" for feature in features} <= entities, entities
        assert "/world/cameras/wrist_camera/colour" in entities and any(one.startswith("/world/scene/") for one in entities), entities


@needs_viser
def test_results_and_warnings_of_a_task(port):
    with mjs.view("pick", port=port, block=False, open_browser=False, cameras=[]) as viewer:
        source = viewer._source
        assert {"reward", "success"} <= source.streams().keys() and source.notes(0) == []
        while not source.value("success", 0)[0]:
            source.step()
            assert source.time(0) < 20
        assert source.value("reward", 0)[0] > 0
        viewer._policy.value = False
        viewer._switch_policy()
        viewer._sliders[0].handles[0].value = 0.5
        viewer._sliders[0].apply(0)
        for _ in range(30):
            source.step()
        assert abs(source.value("qpos/arm", 0)[0] - 0.5) < 0.05


@needs_viser
def test_the_plan_is_where_the_tool_goes(port):
    with mjs.view("pick", port=port, block=False, open_browser=False, cameras=[], seed=2) as viewer:
        source = viewer._source
        parts = source._env.planned_paths(0)
        assert len(parts) > 3 and "grasp" in " ".join(phase for phase, _ in parts)
        points = np.concatenate([points for _, points in parts])
        assert np.abs(np.diff(points, axis=0)).max() < 0.1  # parts begin where the one before ends
        assert np.linalg.norm(points - source._env.rows["grasp_pose"][0, :3], axis=1).min() < 1e-3
        source.step()
        base = source._env.rows["robot_base_pose"][0]
        while not source.value("success", 0)[0]:
            source.step()
            tool = base[:3] + rotation_of(base[3:]) @ source._env.rows["tcp_pose"][0, :3]
            assert np.linalg.norm(points - tool, axis=1).min() < 0.06
            assert source.time(0) < 20
        assert source.value("policy_num_retries", 0)[0] == 0
        assert len(source.shapes(0, ["plan"]).of("line")) > 10
    with pytest.raises(ValueError, match=r"world 1: must be in \[0, 1\)"):
        mjs.make_vec("pick", num_envs=1, policy="planner", cameras=[]).planned_paths(1)
