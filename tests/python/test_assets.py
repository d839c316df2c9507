# SPDX-License-Identifier: Apache-2.0
import base64
import importlib
import json
import os

import numpy as np
import pytest

import mjsense as mjs
from mjsense import _core
from mjsense.commands.start import main
from mjsense.core import installed_files
from mjsense.core.png import png_of


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


# mjsense.scene.convert_assets


@pytest.fixture
def ball(tmp_path):
    """A .glb of a red metallic ball with maps, 0.2 m above a flat sheet; y is up."""
    trimesh = pytest.importorskip("trimesh")
    image = pytest.importorskip("PIL.Image")
    scene = trimesh.Scene()
    sphere = trimesh.creation.uv_sphere(0.1, count=[12, 12])
    uv = np.stack([np.arctan2(*sphere.vertices[:, :2].T) / 6.3 + 0.5, sphere.vertices[:, 2] * 5 + 0.5], -1)

    def picture(*rgb):
        return image.fromarray(np.full((4, 4, len(rgb)), rgb, np.uint8))

    sphere.visual = trimesh.visual.TextureVisuals(
        uv,
        material=trimesh.visual.material.PBRMaterial(
            baseColorTexture=picture(255, 0, 0),
            baseColorFactor=[255, 255, 255, 255],
            metallicFactor=0.75,
            roughnessFactor=0.5,
            metallicRoughnessTexture=picture(10, 200, 100),
            occlusionTexture=picture(50, 50, 50),
            normalTexture=picture(128, 128, 255),
            emissiveFactor=[0.0, 0.5, 0.0],
        ),
    )
    scene.add_geometry(sphere, transform=trimesh.transformations.translation_matrix((0, 0.2, 0)))
    sheet = trimesh.Trimesh([[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1]], [[0, 2, 1], [0, 3, 2]])
    sheet.visual.vertex_colors = np.full((4, 4), (0, 255, 0, 255), np.uint8)
    scene.add_geometry(sheet)
    path = tmp_path / "a ball.glb"
    scene.export(path)
    return path


def test_converted_assets_have_materials_and_texture_roles(ball, tmp_path):
    mujoco = pytest.importorskip("mujoco")
    made = mjs.scene.convert_assets(ball, tmp_path / "out")
    assert made == tmp_path / "out/a_ball.xml"
    m = mujoco.MjModel.from_xml_path(str(made))
    data = mujoco.MjData(m)
    mujoco.mj_forward(m, data)
    drawn = [i for i in range(m.ngeom) if m.geom_group[i] == 2]
    touched = [i for i in range(m.ngeom) if m.geom_group[i] == 3]
    assert len(drawn) == 2
    assert len(touched) == 1  # the sheet has no volume
    assert not m.geom_contype[drawn].any()
    np.testing.assert_allclose(data.geom_xpos[touched[0]], (0, 0, 0.2), atol=1e-3)  # z is up
    material = m.geom_matid[next(i for i in drawn if m.geom_matid[i] >= 0)]
    np.testing.assert_allclose((m.mat_metallic[material], m.mat_roughness[material], m.mat_emission[material]), (0.75, 0.5, 0.5), atol=1e-3)

    def texel(role):
        texture = m.mat_texid[material, getattr(mujoco.mjtTextureRole, f"mjTEXROLE_{role}")]
        assert texture >= 0, role
        return tuple(int(x) for x in m.tex_data[m.tex_adr[texture] : m.tex_adr[texture] + 3])

    assert {role: texel(role) for role in ("RGB", "ORM", "NORMAL", "EMISSIVE")} == {
        "RGB": (255, 0, 0),
        "ORM": (50, 200, 100),
        "NORMAL": (128, 128, 255),
        "EMISSIVE": (0, 255, 0),
    }
    for suffix in ("obj", "glb"):  # from the program, and of another format
        out = tmp_path / suffix
        source = ball
        if suffix == "obj":
            source = tmp_path / "box.obj"
            source.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
        assert main(["assets", "convert", str(source), str(out), "--scale", "0.5", "--no-contacts"]) == 0
        small = mujoco.MjModel.from_xml_path(str(next(out.glob("*.xml"))))
        assert not small.geom_contype.any()
        if suffix == "obj":
            apart = small.mesh_vert[:, None] - small.mesh_vert  # MuJoCo has turned the mesh
            assert np.linalg.norm(apart, axis=-1).max() == pytest.approx(0.5 * 2**0.5)


def triangle(indices=(0, 1, 2), metallic=1, colours=b""):
    """A glTF file."""

    def uri(content):
        return f"data:application/octet-stream;base64,{base64.b64encode(content).decode()}"

    content = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes() + np.array(indices, "<u2").tobytes()
    colour = {"baseColorTexture": {"index": 0}} if colours else {}
    table = {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"metallicFactor": metallic, **colour}}],
        "buffers": [{"byteLength": len(content), "uri": uri(content)}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 0, "byteOffset": 36, "byteLength": 6}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}, {"bufferView": 1, "componentType": 5123, "count": 3, "type": "SCALAR"}],
    }  # fmt: skip
    if colours:
        table |= {"images": [{"uri": uri(colours)}], "textures": [{"source": 0}]}
    return json.dumps(table).encode()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("x.stl", b"", r"x.stl: assets are read from files of type .glb, .gltf, .obj, not '.stl'"),
        ("x.glb", None, r"x.glb: no such file"),
        ("x.glb", b"glTF" + bytes(40), r"x.glb: cannot be read: "),
        ("x.obj", b"v 0 0 0\n", r"x.obj: (has no triangles|cannot be read)"),
        ("x.gltf", triangle(indices=(0, 1, 900)), r"x.gltf: cannot be read: IndexError: index 900 is out of bounds"),
        ("x.gltf", triangle(metallic="x"), r"x.gltf: cannot be read: "),
        ("x.gltf", triangle(colours=png_of(np.zeros((8, 8, 3), np.uint8))[:-20]), r"x.gltf: cannot be read: OSError"),
        ("x.obj", b"v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", r"x.obj: .*(not finite|cannot be read)"),
    ],
)
def test_bad_assets_are_one_error(tmp_path, name, content, message):
    pytest.importorskip("trimesh")
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        mjs.scene.convert_assets(tmp_path / name, tmp_path / "out")
    assert not (tmp_path / "out").exists()
