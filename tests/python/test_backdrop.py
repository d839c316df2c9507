# SPDX-License-Identifier: Apache-2.0
"""Surroundings that are only seen: in scenes and recordings, and files that cannot be such surroundings."""

from pathlib import Path

import numpy as np
import pytest

import mjsense as mjs


@pytest.fixture
def room(tmp_path: Path) -> Path:
    """A .glb of a red wall, 1 m high and 0.2 m thick, whose front is at y = 1; in the file y is up."""
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("PIL")
    wall = trimesh.creation.box((4, 1, 0.2), trimesh.transformations.translation_matrix((0, 0.5, -1.1)))
    wall.visual = trimesh.visual.TextureVisuals(
        material=trimesh.visual.material.PBRMaterial(baseColorFactor=[255, 0, 0, 255], metallicFactor=0.0, roughnessFactor=0.9)
    )
    path = tmp_path / "room.glb"
    trimesh.Scene(wall).export(path)
    return path


MODEL = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <body name="ball" pos="0 .9 .3"><freejoint/><geom size=".1"/></body>
    <camera name="view" pos="0 -1 .5" xyaxes="1 0 0 0 0 1"/>
  </worldbody>
</mujoco>
"""


def scene_with(backdrop: object, model: str = MODEL) -> mjs.Scene:
    camera = mjs.CameraSensorCfg(name="cam", camera_name="w/view", data_types=("rgb", "depth", "segmentation"), shading="pbr")
    return mjs.Scene(mjs.SceneCfg(entities={"w": mjs.EntityCfg(model=model)}, sensors=[camera], backdrop=backdrop))


def test_a_backdrop_is_seen_and_not_touched(room: Path) -> None:
    scene, plain = scene_with(str(room)), scene_with(None)
    model = scene.model
    walls = [i for i in range(model.ngeom) if model.geom(i).name.startswith("backdrop/")]
    assert len(walls) == 1
    assert not model.geom_contype[walls].any()
    assert not model.geom_conaffinity[walls].any()
    assert (model.nq, model.nv, model.nu, model.nsensor) == (plain.model.nq, plain.model.nv, plain.model.nu, plain.model.nsensor)
    assert scene.entities.keys() - plain.entities.keys() == {"backdrop"}
    sims = [mjs.Simulation(each, num_worlds=1) for each in (scene, plain)]
    for sim in sims:
        sim.qvel[0, 1] = 2  # the ball flies through the wall
        for _ in range(100):
            sim.step()
    np.testing.assert_array_equal(sims[0].qpos, sims[1].qpos)
    assert sims[0].qpos[0, 1] > 1.2
    data = scene["cam"].data
    seen = data.segmentation[0, ..., 0] == walls[0]
    assert 0.3 < seen.mean() < 0.7
    np.testing.assert_allclose(data.depth[0][seen], 2, atol=1e-3)
    colours = data.rgb[0][seen].mean(0)
    assert colours[0] > 2 * colours[1:].max()


def test_an_mjcf_backdrop_shows_no_hulls_for_contacts(room: Path, tmp_path: Path) -> None:
    made = mjs.scene.convert_assets(room, tmp_path / "room")
    model = scene_with(str(made)).model
    assert [model.geom_group[i] for i in range(model.ngeom) if model.geom(i).name.startswith("backdrop/")] == [2]


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("x.stl", b"", "backdrop '.*x.stl': only files of type .xml, .glb, .gltf and .obj are read as surroundings"),
        ("x.glb", None, "x.glb: no such file"),
        ("x.glb", b"glTF" + bytes(40), "x.glb: cannot be read"),
        ("x.xml", None, "backdrop '.*x.xml'"),
        ("x.xml", b"<mujoco", "backdrop '.*x.xml'"),
        (
            "x.xml",
            b"<mujoco><worldbody><body><freejoint/><geom size='1'/></body></worldbody></mujoco>",
            "backdrop '.*x.xml': its model has 1 element of type joint: surroundings that are only seen have geoms and lights only",
        ),
        ("x.xml", b"<mujoco><worldbody><geom size='1' group='3'/></worldbody></mujoco>", "has no geom that cameras show"),
    ],
)
def test_bad_backdrops_are_one_error(tmp_path: Path, name: str, content: bytes | None, message: str) -> None:
    pytest.importorskip("trimesh")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        scene_with(str(tmp_path / name))


def test_the_name_of_a_backdrop_is_taken_once(room: Path) -> None:
    with pytest.raises(ValueError, match="entity 'backdrop': two entities have this name"):
        mjs.Scene(mjs.SceneCfg(entities={"backdrop": mjs.EntityCfg(model=MODEL)}, backdrop=str(room)))


def test_recordings_with_a_backdrop(room: Path, tmp_path: Path) -> None:
    """The same episodes in other surroundings; the archived model has them, and another file cannot continue the recording."""
    options = {"episodes": 1, "num_worlds": 1, "width": 64, "progress": False, "horizon": 20, "keep_failures": True, "max_attempts": 1}
    mjs.record("pick", out=tmp_path / "plain", **options)
    mjs.record("pick", out=tmp_path / "data", backdrop=str(room), **options)
    plain, data = (mjs.Dataset(tmp_path / name).episodes[0] for name in ("plain", "data"))
    moving = 1 + plain.model().nq + plain.model().nv  # the time, positions and velocities
    np.testing.assert_array_equal(data.states[:, :moving], plain.states[:, :moving])
    seen, without = data.video("wrist_camera")[0], plain.video("wrist_camera")[0]
    assert (seen != without).any()
    model = data.model()
    assert any(model.geom(i).name.startswith("backdrop/") for i in range(model.ngeom))
    room.write_bytes(room.read_bytes() + b" ")
    with pytest.raises(ValueError, match="backdrop_file"):
        mjs.record("pick", out=tmp_path / "data", backdrop=str(room), resume=True, **options)
    room.unlink()  # the recording does not need it
    mjs.render(tmp_path / "data", tmp_path / "again", copy=False, progress=False)
    np.testing.assert_array_equal(mjs.Dataset(tmp_path / "again").episodes[0].video("wrist_camera")[0], seen)
