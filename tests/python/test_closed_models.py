# SPDX-License-Identifier: Apache-2.0
"""Untrusted model archives are bounded before they are decompressed, and compiled without any other file."""

import io
import struct
import tracemalloc
import zipfile
import zlib

import mujoco
import numpy as np
import pytest

import mjsense as mjs
from mjsense.core.png import png_of
from mjsense.dataset import archive
from mjsense.dataset.closed_model import check_archive, closed_model, compile_closed
from mjsense.dataset.model_sizes import MAX_PIXELS

MODEL = "<mujoco><asset>{}</asset><worldbody><body name='b'><joint/><geom size='.1'/>{}</body></worldbody></mujoco>"
OBJ = b"v 0 0 0\nv .1 0 0\nv 0 .1 0\nv 0 0 .1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"


def written(path, files, method=zipfile.ZIP_DEFLATED):
    with zipfile.ZipFile(path, "w", method) as file:
        for name, content in files.items():
            file.writestr(name if isinstance(name, zipfile.ZipInfo) else zipfile.ZipInfo(name), content, method)
    return path


def info(name, mode):
    made = zipfile.ZipInfo(name)
    made.external_attr = mode << 16
    return made


def test_files_of_an_archive(tmp_path):
    files = {"model.xml": MODEL.format("", "").encode(), "assets/0.obj": OBJ}
    assert archive.read_archive(written(tmp_path / "a.zip", files)) == files
    assert archive.read_archive(written(tmp_path / "b.zip", files, zipfile.ZIP_STORED)) == files
    check_archive(tmp_path / "a.zip")


@pytest.mark.parametrize("files, why", [
    ({"../x": b""}, "not the name of a file inside"), ({"/x": b""}, "not the name of a file inside"), ({"a/./b": b""}, "not the name of a file inside"),
    ({"..\\x": b""}, "a character that"), ({"C:x": b""}, "a character that"), ({"a\nb": b""}, "a character that"), ({"d/": b""}, "not the name of a file"),
    ({"x" * 300: b""}, "has 300 characters"), ({info("l", 0o120777): b"/etc"}, "is a link"), ({info("f", 0o010644): b""}, "is a link, a folder or a device"),
    ({"a": b"", "a/b": b""}, "'a' is both a file and a folder"), ({"zeros": bytes(65 << 20)}, "would grow from .* the limit is a factor of 100"),
    ({f"z{i}": bytes(13 << 20) for i in range(5)}, "would grow from .* the limit is a factor of 100"),
])  # fmt: skip
def test_refused_members(tmp_path, files, why):
    with pytest.raises(ValueError, match=f"^the model archive .*a.zip cannot be read: .*{why}") as error:
        archive.read_archive(written(tmp_path / "a.zip", {"model.xml": b"<mujoco/>", **files}))
    assert "\n" not in str(error.value)


def test_refused_archives(tmp_path):
    def refuses(content, why):
        (tmp_path / "a.zip").write_bytes(content)
        with pytest.raises(ValueError, match=f"^the model archive .*a.zip cannot be read: .*{why}"):
            archive.read_archive(tmp_path / "a.zip")

    good = written(tmp_path / "good.zip", {"model.xml": b"<mujoco/>" * 50}).read_bytes()
    refuses(b"", "is not a ZIP file")
    refuses(good[:-5], "does not end as a ZIP file")
    refuses(good + b"x", "does not end as a ZIP file")
    refuses(good[:20] + b"\xff" * 8 + good[28:], "copy it from the original")
    refuses(good[:-12] + struct.pack("<HLLH", 65535, 10, 10, 0), "65535 files|states")
    encrypted = bytearray(good)
    encrypted[6] |= 1
    encrypted[good.index(b"PK\1\2") + 8] |= 1
    refuses(bytes(encrypted), "is encrypted")
    for method, number in ((zipfile.ZIP_LZMA, 14), (zipfile.ZIP_BZIP2, 12)):
        refuses(written(tmp_path / "m.zip", {"model.xml": b"<mujoco/>" * 50}, method).read_bytes(), f"compressed with method {number}")
    refuses(written(tmp_path / "m.zip", {"other.xml": b"<mujoco/>"}).read_bytes(), "contains no model.xml")
    with pytest.warns(UserWarning, match="Duplicate"):
        refuses(written(tmp_path / "m.zip", _Twice()).read_bytes(), "'model.xml' is in it twice")
    (tmp_path / "link.zip").symlink_to(tmp_path / "good.zip")
    with pytest.raises(OSError, match="is a symbolic link, which is not followed"):
        archive.read_archive(tmp_path / "link.zip")
    with pytest.raises(IsADirectoryError):
        archive.read_archive(tmp_path)


@pytest.mark.parametrize("stated", (0, 1 << 16))
def test_a_file_that_unpacks_to_more_than_it_states(tmp_path, stated):
    """The bytes of 32 MB of zeros, whose directory states fewer: not more than those are unpacked."""
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    packed = b"".join(packer.compress(bytes(1 << 20)) for _ in range(32)) + packer.flush()
    good = written(tmp_path / "a.zip", {"model.xml": b""}).read_bytes()
    at, end = good.index(b"PK\1\2"), good.index(b"PK\5\6")
    sizes = struct.pack("<LLL", zlib.crc32(bytes(stated)), len(packed), stated)
    head = good[:14] + sizes + good[26:39]
    entry = good[at : at + 16] + sizes + good[at + 28 : end]
    (tmp_path / "a.zip").write_bytes(head + packed + entry + good[end : end + 16] + struct.pack("<LH", len(head + packed), 0))
    tracemalloc.start()
    with pytest.raises(ValueError, match=r"^the model archive .*a\.zip cannot be read: 'model.xml' does not unpack to the \d+ bytes that it states|Bad CRC-32"):
        archive.read_archive(tmp_path / "a.zip")
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < 2e6


class _Twice:
    def items(self):
        return [("model.xml", b"<mujoco/>"), ("model.xml", b"<mujoco model='x'/>")]


def closed(asset="", body="", members=None, text=None):
    return closed_model(text or MODEL.format(asset, body), members or {}, "a.zip: model.xml")


def test_no_file_outside_of_the_archive_is_read(tmp_path):
    (tmp_path / "part.xml").write_text("<mujoco><worldbody><geom name='secret' size='.1'/></worldbody></mujoco>")
    (tmp_path / "secret.obj").write_bytes(OBJ)
    (tmp_path / "secret.png").write_bytes(png_of(np.zeros((4, 4, 3), np.uint8)))
    include = f"<mujoco><include file='{tmp_path}/part.xml'/></mujoco>"
    mesh = f"<mesh name='m' file='{tmp_path}/secret.obj'/>"
    assert mujoco.MjModel.from_xml_string(include).ngeom == 1  # MuJoCo alone reads them
    assert mujoco.MjModel.from_xml_string(MODEL.format(mesh, "<geom type='mesh' mesh='m'/>")).nmesh == 1
    cases = [
        (dict(text=include), "'include' reads other files"),
        (dict(text=include.replace("<include", "< include")), "not valid XML"),
        (dict(text=f"<mujoco><![CDATA[<a>]]><x><include\n file='{tmp_path}/part.xml'/></x></mujoco>"), "'include' reads other files"),
        (dict(text=f"<!DOCTYPE m [<!ENTITY a SYSTEM '{tmp_path}/part.xml'>]><mujoco>&a;</mujoco>"), "a document type"),
        (dict(asset=f"<model name='m' file='{tmp_path}/part.xml'/>"), "'model' reads other files"),
        (dict(body="<attach model='m' prefix='p'/>"), "'attach' reads other files"),
        (dict(body=f"<flexcomp name='f' type='mesh' file='{tmp_path}/secret.obj'/>"), "names a file"),
        (dict(asset=mesh), "secret.obj', which is not in the archive"),
        (dict(asset="<mesh name='m' file='../secret.obj'/>", members={"../secret.obj": OBJ}), "not the name of a file inside"),
        (dict(asset=f"<texture name='t' type='2d' file='{tmp_path}/secret.png'/>"), "which is not in the archive"),
        (dict(asset="<texture name='t' type='cube' fileup='secret.png'/>"), "which is not in the archive"),
        (dict(asset="<hfield name='h' size='1 1 1 1' file='secret.png'/>"), "which is not in the archive"),
        (dict(asset="<skin name='s' file='secret.skn'/>"), "which is not in the archive"),
        (dict(asset="<mesh name='m' file='a.usd'/>", members={"a.usd": b""}), "expected one of .stl, .obj, .msh"),
        (dict(asset="<mesh name='m' content_type='model/usd' file='a.obj'/>", members={"a.obj": OBJ}), "content_type 'model/usd'"),
        (dict(body="<plugin plugin='evil.plugin'/>"), "not one of MuJoCo's own"),
        (dict(body="<geom size='.1' class='%s%n'/>"), "a format of printf"),
        (dict(body="<geom size='.1 -NaN'/>"), "size of 'geom' is '.1 -NaN', expected finite numbers"),
        (dict(text="<robot name='x'/>"), "expected 'mujoco'"),
        (dict(text="<a>" * 500 + "</a>" * 500), "nested elements"),
    ]
    for given, why in cases:
        with pytest.raises(ValueError, match=why) as error:
            closed(**given)
        assert str(error.value).startswith("a.zip: model.xml: ") and "\n" not in str(error.value)


def test_nan_may_be_a_name():
    text = closed(body="<body name='nan'><geom size='.1'/></body><site name='s'/><camera name='c' mode='targetbody' target='nan'/>")
    assert mujoco.MjModel.from_xml_string(text).body("nan").name == "nan"


def test_folders_of_the_compiler(tmp_path):
    text = MODEL.format("<mesh file='A.obj'/><texture name='t' type='2d' builtin='flat' width='4' height='4' file='/etc/passwd'/>", "<geom type='mesh' mesh='A'/>")
    text = text.replace("<asset>", "<compiler meshdir='parts/' texturedir='/etc'/><asset>")
    files = {"model.xml": text.encode(), "parts/A.obj": OBJ, "A.obj": OBJ.replace(b".1", b".2")}
    model = compile_closed(files, "a.zip")
    distances = np.linalg.norm(model.mesh_vert[:, None] - model.mesh_vert[None], axis=-1)
    assert model.mesh(0).name == "A" and abs(distances.max() - 0.1 * 2**0.5) < 1e-6
    assert "passwd" not in closed_model(text, files, "a")


@pytest.mark.parametrize("given, why", [
    (dict(text="<mujoco><size memory='900G'/></mujoco>"), "memory of 'size' is 900G, the limit is 2147483648 bytes"),
    (dict(text="<mujoco><size memory='x'/></mujoco>"), "expected|limit is a whole number"),
    (dict(text="<mujoco><size nkey='1000000000'/></mujoco>"), "nkey of 'size'"),
    (dict(body="<replicate count='4000'><replicate count='4000'><geom size='.1'/></replicate></replicate>"), "number of copies by replicate is 16000000, the limit is 4000"),
    (dict(body="<composite type='cable' count='1000000 1 1'/>"), "number of elements after replicate"),
    (dict(asset="<hfield name='h' nrow='40000' ncol='40000' size='1 1 1 1'/>"), f"6400000000 bytes, the limit is {MAX_PIXELS}"),
    (dict(asset="<texture name='h' type='2d' builtin='flat' width='60000' height='60000'/>"), f"10800000000 bytes, the limit is {MAX_PIXELS}"),
    (dict(asset="<texture name='h' type='cube' builtin='flat' width='30000'/>"), f"the limit is {MAX_PIXELS}"),
    (dict(asset="<texture name='h' type='2d' file='a.png'/>", members={"a.png": b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR" + struct.pack(">II", 60000, 60000)}), "10800000000 bytes"),
    (dict(asset="<mesh name='m' builtin='sphere' params='12'/>"), "params of the mesh 'm'"),
    (dict(text="<mujoco><default><texture width='60000' height='60000'/></default><asset><texture name='t' builtin='flat' type='2d'/></asset></mujoco>"), "the limit is"),
    (dict(text="<mujoco><custom><numeric name='n' size='1000000000'/></custom></mujoco>"), "size of 'numeric'"),
    (dict(text="<mujoco><worldbody><replicate count='40'><geom size='.1'/></replicate></worldbody><sensor><clock/></sensor></mujoco>"), "is 40, the limit is 8 with sensors"),
    (dict(text="<mujoco><actuator>" + "<muscle joint='j'/>" * 5000 + "</actuator></mujoco>"), "length ranges of muscles"),
    (dict(text="<mujoco><option iterations='2000000000'/></mujoco>"), "iterations of 'option'"),
    (dict(text="<mujoco><compiler><lengthrange inttotal='1e9'/></compiler></mujoco>"), "inttotal / timestep"),
    (dict(asset="<mesh name='m' file='m.obj'/>", members={"m.obj": OBJ + b"f" + b" 1" * 5000}), "the longest line of the mesh 'm.obj' is 10001, the limit is 8192 bytes"),
    (dict(body="<camera name='c' resolution='9999999 2'/>"), "resolution of 'camera'"),
    (dict(body="<body>" * 300 + "<joint/>" * 1 + "</body>" * 300 + "".join("<body>" + "<joint/>" * 9000 + "</body>")), "inertia matrix"),
], ids=range(19))  # fmt: skip
def test_sizes_are_refused_before_they_are_allocated(given, why):
    with pytest.raises(ValueError, match=why) as error:
        closed(**given)
    assert str(error.value).startswith("a.zip: model.xml: ")


def png(width, height, depth, colours, pixels, chunks=()):
    head = (b"IHDR", struct.pack(">IIBBBBB", width, height, depth, colours, 0, 0, 0))
    parts = (head, *chunks, (b"IDAT", pixels), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    )


ZEROS = zlib.compress(bytes(1 << 22), 9)


@pytest.mark.parametrize("asset", ("<texture name='t' type='2d' file='a.png'/>", "<hfield name='t' file='a.png' size='1 1 1 1'/>", "<texture name='t' type='cube' fileup='a.png'/>"))
@pytest.mark.parametrize("content, why", [
    (png(4, 4, 8, 2, ZEROS), "pixels unpack to more than the 4 x 4 pixels that it states"),
    (png(64, 64, 8, 2, b"\x08\x1d" + ZEROS[2:]), "pixels unpack to more than the 64 x 64 pixels that it states"),  # states a window of 256 bytes
    (png(64, 64, 8, 2, b"x\x9c" + b"\xff" * 2000), "pixels are damaged"),
    (png(4, 4, 8, 2, zlib.compress(bytes(4 * 13)), [(b"zTXt", b"a\0\0" + ZEROS * 5)] * 70), f"the limit is {MAX_PIXELS}"),
], ids=("pixels", "window", "damaged", "texts"))  # fmt: skip
def test_an_image_that_unpacks_to_more_than_it_states(asset, content, why):
    """MuJoCo unpacked 1.5 MB to 1.5 GB before it compared them with the size of the image."""
    with pytest.raises(ValueError, match=f"^a.zip: model.xml: .*{why}"):
        closed(asset, members={"a.png": content})


@pytest.mark.parametrize("interlaced", (False, True))
@pytest.mark.parametrize("mode", ("1", "L", "P", "RGB", "RGBA", "LA", "I;16"))
@pytest.mark.parametrize("width, height", ((1, 1), (5, 3), (300, 1), (1, 300), (400, 300)))
def test_images_of_all_kinds_are_read(mode, width, height, interlaced):
    """Also those of one colour, which are packed most."""
    image = pytest.importorskip("PIL.Image").new(mode, (width, height))
    file = io.BytesIO()
    image.save(file, "png", optimize=True)
    content = file.getvalue()
    if interlaced:  # Pillow writes none: all passes of zeros
        bits = content[24] * {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}[content[25]]
        passes = ((0, 8, 0, 8), (4, 8, 0, 8), (0, 4, 4, 8), (2, 4, 0, 4), (0, 2, 2, 4), (1, 2, 0, 2), (0, 1, 1, 2))
        sizes = ((len(range(x, width, dx)), len(range(y, height, dy))) for x, dx, y, dy in passes)
        size = sum(h * (1 + (w * bits + 7) // 8) for w, h in sizes if w)
        palette = [(b"PLTE", bytes(3))] if content[25] == 3 else []
        made = png(width, height, content[24], content[25], zlib.compress(bytes(size), 9), palette)
        head = made[12:28] + b"\1"
        content = made[:12] + head + struct.pack(">I", zlib.crc32(head)) + made[33:]
    model = compile_closed({"model.xml": MODEL.format("<texture name='t' type='2d' file='a.png'/>", "").encode(), "a.png": content}, "a.zip")
    assert (model.tex_width[0], model.tex_height[0]) == (width, height)


def test_compiled_models_are_those_of_mujoco(tmp_path):
    mjs.record("pick", out=tmp_path, num_worlds=1, episodes=1, keep_failures=True, horizon=2, cameras=[], seed=3)
    path = next(tmp_path.glob("house_0/model_*.zip"))
    files = archive.read_archive(path)
    ours = compile_closed(files, str(path))
    with zipfile.ZipFile(io.BytesIO(path.read_bytes())) as file:
        theirs = {name: file.read(name) for name in file.namelist()}
    plain = mujoco.MjModel.from_xml_string(theirs.pop("model.xml").decode(), theirs)
    for model, name in ((ours, "a.mjb"), (plain, "b.mjb")):
        mujoco.mj_saveModel(model, str(tmp_path / name))
    assert (tmp_path / "a.mjb").read_bytes() == (tmp_path / "b.mjb").read_bytes()


def test_errors_of_the_compiler_have_one_line():
    with pytest.raises(ValueError, match=r"^a.zip: MuJoCo cannot compile the model: ") as error:
        compile_closed({"model.xml": b"<mujoco><worldbody><geom size='1' material='none'/></worldbody></mujoco>"}, "a.zip")
    assert "\n" not in str(error.value)
    with pytest.raises(ValueError, match=r"a.zip: the timestep of the model is"):
        compile_closed({"model.xml": b"<mujoco><option timestep='1e-300'/></mujoco>"}, "a.zip")
