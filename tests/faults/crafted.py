# SPDX-License-Identifier: Apache-2.0
"""Crafted malicious recordings: each case modifies a valid house (a folder of a recording) so that its contents are inconsistent.

A case is a function of the house's folder or, if its parameter is named `f`, of the opened file of the first batch; `CASES` maps
names to cases. With any of them, no command may crash, hang, use excessive memory or access a file outside the folder, and `verify`
must not report the recording as intact.
"""

import inspect
import json
import os
import struct
import subprocess
import zlib
from pathlib import Path

import h5py
import numpy as np

CASES = {}
SECRET = "secret"  # a folder next to the house, which no command may access


def of_house(function):
    """The case as a function of the house."""
    if next(iter(inspect.signature(function).parameters)) == "house":
        return function

    def call(house, *values):
        with change(house) as f:
            function(f, *values)

    return call


def case(function):
    CASES[function.__name__] = of_house(function)
    return function


def variants(name, values):
    """Adds one case for each value; the function takes the house, or its file, and the value."""

    def add(function):
        for key, value in values.items():
            CASES[f"{name}_{key}"] = lambda house, value=value: of_house(function)(house, value)
        return function

    return add


def first_file(house: Path) -> Path:
    return min(house.glob("trajectories_batch_*.h5"))


def change(house):
    return h5py.File(first_file(house), "r+")


def replace(group, name, **create):
    del group[name]
    return group.create_dataset(name, **create)


# ---- attributes with an unexpected type, shape or size

ATTRIBUTES = {
    "many_numbers": np.arange(1000, dtype=np.int64),
    "text": "six",
    "float": 6.5,
    "table": np.zeros((40, 40)),
    "compound": np.zeros(1, dtype=[("a", "i8"), ("b", "f8")]),
    "fixed_text": np.bytes_(b"x" * 30000),
    "empty": h5py.Empty("i8"),
    "many_texts": np.array(["x" * 50] * 500, dtype=h5py.string_dtype()),
}


@variants("width_is", ATTRIBUTES)
def _(f, value):
    f["traj_0/obs/sensor_data/wrist_camera"].attrs["width"] = value


@variants("crc32_is", ATTRIBUTES)
def _(f, value):
    f["traj_0/rewards"].attrs["crc32"] = value


@variants("outcome_is", {k: v for k, v in ATTRIBUTES.items() if k not in ("text", "fixed_text")})
def _(f, value):
    f["traj_0"].attrs["outcome"] = value


@variants("encoding_is", {k: v for k, v in ATTRIBUTES.items() if k not in ("text", "fixed_text")})
def _(f, value):
    f["traj_0/obs/agent/qpos"].attrs["encoding"] = value


# ---- data sets with an unexpected type, shape or layout

SHAPES = {
    "table": dict(data=np.zeros((50, 50), np.uint8)),
    "long": dict(data=np.zeros(8000, np.uint8)),
    "float": dict(data=np.zeros(100)),
    "text": dict(data="wrist_camera.mp4"),
    "texts": dict(data=np.array(["x"] * 99, dtype=h5py.string_dtype())),
    "endless": dict(shape=(10**13,), dtype="u1", chunks=(1000,)),
    "scalar": dict(data=np.uint8(3)),
    "empty": dict(data=h5py.Empty("u1")),
    "compound": dict(data=np.zeros(20, dtype=[("a", "i8"), ("b", "f8")])),
    "opaque": dict(data=np.zeros(20, dtype="V40")),
    "deep": dict(data=np.zeros((1,) * 32, np.uint8)),
}


@variants("video_name_is", SHAPES)
def _(f, create):
    replace(f["traj_0/obs/sensor_data"], "wrist_camera", **create)


@variants("success_is", SHAPES)
def _(f, create):
    replace(f["traj_0"], "success", **create)


@variants("obs_scene_is", {k: v for k, v in SHAPES.items() if k != "text"})
def _(f, create):
    replace(f["traj_0"], "obs_scene", **create)


@variants("rows_are", SHAPES)
def _(f, create):
    replace(f["traj_0/obs/agent"], "qpos", **create)


# Types and layouts that no recorder writes, with the correct number of rows.
OF_STEPS = {
    "lists": lambda n: dict(shape=(n,), dtype=h5py.vlen_dtype(np.float64)),
    "references": lambda n: dict(shape=(n,), dtype=h5py.ref_dtype),
    "long_doubles": lambda n: dict(data=np.zeros((n, 3), np.longdouble)),
    "packed_bits": lambda n: dict(data=np.zeros((n, 3), np.int32), scaleoffset=3, chunks=(1, 3)),
    "two_packings": lambda n: dict(shape=(n, 7), dtype="f8", chunks=(1, 7), compression="gzip", shuffle=True, fletcher32=True),
}


@variants("rows_of", OF_STEPS)
def _(f, create):
    replace(f["traj_0/obs/agent"], "qpos", **create(len(f["traj_0/success"])))
    if f["traj_0/obs/agent/qpos"].shuffle:
        f["traj_0/obs/agent/qpos"].id.write_direct_chunk((0, 0), b"\0\0")


@variants("success_of", {"nan": np.nan, "two_columns": [0, 0], "many_words": 7})
def _(f, value):
    rows = np.array([value] * len(f["traj_0/success"]))
    words = h5py.enum_dtype({f"v{i}": i for i in range(256)}, basetype="u1")
    replace(f["traj_0"], "success", data=rows, dtype=words if np.all(rows == 7) else rows.dtype)


@variants("model_archive_is", {"outside": f"../../{SECRET}/keep.txt", "other": "model_00000000.zip", "number": 3, "escapes": "\x1b]0;x\x07"})
def _(f, value):
    f.attrs["recording"] = json.dumps(json.loads(f.attrs["recording"]) | {"model_archive": value})


def archive_of(house):
    return next(house.glob("model_*.zip"))


@case
def model_archive_is_missing(house):
    archive_of(house).unlink()


@case
def model_archive_is_a_link(house):
    archive = archive_of(house)
    archive.rename(house.parent / "archive.zip")
    archive.symlink_to(house.parent / "archive.zip")


@case
def model_archive_is_a_pipe(house):
    archive = archive_of(house)
    archive.unlink()
    os.mkfifo(archive)


@variants("recording_is", {"deep": "[" * 100_000, "words": "pick", "number": "3", "escapes": "\x1b]0;x\x07"})
def _(f, text):
    del f.attrs["recording"]
    f.attrs.create("recording", text[:60_000])


@case
def bool_of_eight_bytes(f):
    rows = len(f["traj_0/success"])
    wide = h5py.enum_dtype({"FALSE": 0, "TRUE": 1}, basetype="i8")
    replace(f["traj_0"], "success", data=np.zeros(rows, "i8"), dtype=wide)


@case
def chunk_of_four_gigabytes(f):
    rows = len(f["traj_0/success"])
    replace(f["traj_0/obs/agent"], "qpos", shape=(rows, 10**9), dtype="u1", chunks=(1, 10**9))


def bomb(group, name, rows, width, packed):
    """A data set that is huge when decompressed: one small compressed chunk, repeated for all rows."""
    chunk = 512
    dataset = replace(group, name, shape=(rows, width), dtype="u1", chunks=(chunk, width), compression="gzip")
    for first in range(0, rows, chunk):
        dataset.id.write_direct_chunk((first, 0), packed)


@case
def gzip_bomb(f):
    bomb(f["traj_0/obs/agent"], "qpos", 4_000_000, 2000, zlib.compress(bytes(512 * 2000), 9))


@case
def json_bomb(f):
    row = b"[" * 40 + b"1," * 800 + b"1" + b"]" * 40
    bomb(f["traj_0/obs/agent"], "qpos", 1_000_000, 2000, zlib.compress(row.ljust(2000, b"\0") * 512, 9))


@case
def chunk_that_is_no_gzip(f):
    f["traj_0/obs/agent/qpos"].id.write_direct_chunk((0, 0), b"not packed at all")


@case
def chunk_that_is_not_packed_and_short(f):
    rows = len(f["traj_0/success"])
    dataset = replace(f["traj_0/obs/agent"], "qpos", shape=(rows, 100), dtype="f8", chunks=(rows, 100))
    dataset.id.write_direct_chunk((0, 0), b"fifteen letters")


@case
def chunk_that_is_not_packed_and_long(f):
    rows = len(f["traj_0/success"])
    dataset = replace(f["traj_0/obs/agent"], "qpos", shape=(rows, 1), dtype="f8", chunks=(rows, 1))
    dataset.id.write_direct_chunk((0, 0), b"x" * 4_000_000)


# ---- links


@case
def soft_cycle(f):
    f["traj_0/obs/agent/again"] = h5py.SoftLink("/traj_0/obs")


@case
def soft_link_to_itself(f):
    f["traj_0/obs/agent/again"] = h5py.SoftLink("/traj_0/obs/agent/again")


@case
def hard_cycle(f):
    f["traj_0/obs/agent/again"] = f["traj_0/obs"]


@case
def dangling(f):
    f["traj_0/obs/agent/nowhere"] = h5py.SoftLink("/no/such/place")


def secret_file(house):
    path = house.parent.parent / SECRET / "data.h5"
    if not path.exists():
        with h5py.File(path, "w") as f:
            f["x"] = np.full(1000, 1234.5)
    return path


@case
def external_link(house):
    with change(house) as f:
        f["traj_0/obs/extra/stolen"] = h5py.ExternalLink(str(secret_file(house)), "/x")


@case
def external_trajectory(house):
    with change(house) as f:
        f["traj_9"] = h5py.ExternalLink(str(secret_file(house)), "/")


@case
def external_storage(f):
    f["traj_0/obs/extra"].create_dataset("stolen", (100,), "u1", external=[("/etc/passwd", 0, 100)])


@case
def virtual_storage(house):
    layout = h5py.VirtualLayout(shape=(1000,), dtype="f8")
    layout[:] = h5py.VirtualSource(str(secret_file(house)), "x", shape=(1000,))
    with change(house) as f:
        f["traj_0/obs/extra"].create_virtual_dataset("stolen", layout)


@case
def deep_groups(f):
    group = f["traj_0/obs/extra"].id
    for _ in range(20_000):
        group = h5py.h5g.create(group, b"g")


@case
def named_type(f):
    f["traj_0/obs/extra/type"] = np.dtype("f8")


# ---- names of videos

NAMES = {
    "above": b"../../secret/data.h5",
    "absolute": b"/etc/passwd",
    "through": b"x/../../../secret/data.h5",
    "dot": b".",
    "two_dots": b"..",
    "nothing": b"",
    "address": b"http://127.0.0.1:9/x.mp4",
    "concat": b"concat:/etc/passwd|/etc/hostname",
    "newline": b"x\ny.mp4",
    "escape": b"\x1b[31mred\x1b[0m.mp4",
    "inner_nul": b"x\0/../y.mp4",
    "no_utf8": b"\xff\xfe.mp4",
    "option": b"-i",
    "full": b"x" * 100,
    "link": b"link.mp4",
    "pipe": b"pipe.mp4",
    "folder": b"folder.mp4",
    "device": b"device.mp4",
}


@variants("video_named", NAMES)
def _(house, name):
    (house / "link.mp4").symlink_to("/etc/passwd")
    os.mkfifo(house / "pipe.mp4")
    (house / "folder.mp4").mkdir()
    (house / "device.mp4").symlink_to("/dev/zero")
    with change(house) as f:
        f["traj_0/obs/sensor_data/wrist_camera"][:] = np.frombuffer(name.ljust(100, b"\0"), np.uint8)


@case
def key_of_escapes(f):
    f["traj_0/obs/sensor_data"].move("wrist_camera", "\x1b]0;title\x07")
    f["traj_0/obs/extra"][b"\xff\xfe"] = np.zeros(3)


@case
def trajectory_of_a_far_number(f):
    f.move("traj_0", "traj_99999999999999999999")


# ---- the file itself


def keep(house, change_bytes):
    path = first_file(house)
    path.write_bytes(change_bytes(path.read_bytes()))


@variants(
    "file_is",
    {
        "empty": lambda b: b"",
        "one_byte": lambda b: b"\x89",
        "signature": lambda b: b[:8],
        "half": lambda b: b[: len(b) // 2],
        "cut": lambda b: b[:-30],
        "unsealed_and_longer": lambda b: b[:-61] + bytes(1000),
        "noise": lambda b: b[:2048] + os.urandom(len(b) - 2048),
    },
)
def _(house, change_bytes):
    keep(house, change_bytes)


@case
def file_is_a_link(house):
    path = first_file(house)
    path.unlink()
    path.symlink_to(secret_file(house))


@case
def file_is_a_pipe(house):
    path = first_file(house)
    path.unlink()
    os.mkfifo(path)


@case
def folders_without_end(house):
    inner = os.open(house, os.O_RDONLY)
    for _ in range(30):
        os.mkdir("d" * 200, dir_fd=inner)
        outer, inner = inner, os.open("d" * 200, os.O_RDONLY, dir_fd=inner)
        os.close(outer)
    os.close(inner)


@case
def staging_is_a_link(house):
    (house / ".recording").symlink_to(house.parent.parent / SECRET)


@case
def video_is_cut(house):
    path = min(house.glob("*.mp4"))
    path.write_bytes(path.read_bytes()[:-400])


@case
def video_claims_more(house):
    path = min(house.glob("*.mp4"))
    data = bytearray(path.read_bytes())
    at = data.index(b"stsz") + 12
    data[at : at + 4] = b"\xff\xff\xff\xff"
    path.write_bytes(data)


def longer_by_holes(path, header):
    with open(path, "ab") as f:
        f.write(header)
        f.truncate(f.tell() + 10**12)


@variants("holes_behind", {"mp4": struct.pack(">I4sQ", 1, b"free", 10**12 + 16), "mkv": b"\xec\x01" + struct.pack(">Q", 10**12)[1:], "h5": b""})
def _(house, header):
    longer_by_holes(min(house.glob("*.h5" if not header else "*.mp4" if b"free" in header else "*.mkv")), header)


@case
def many_large_pictures(house):
    """Videos of a few kilobytes that take minutes and gigabytes to decode."""
    path = min(house.glob("*.mp4"))
    source = ["-f", "lavfi", "-i", "color=gray:size=8192x8192:rate=10", "-frames:v", "3"]
    subprocess.run(["ffmpeg", "-y", "-loglevel", "error", *source, "-c:v", "libx264", "-preset", "ultrafast", path], check=True)


@case
def video_is_a_playlist(house):
    min(house.glob("*.mp4")).write_bytes(b"#EXTM3U\n#EXTINF:1,\nfile:///etc/passwd\n#EXT-X-ENDLIST\n")


@case
def matroska_of_endless_elements(house):
    path = min(house.glob("*.mkv"))
    data = path.read_bytes()
    path.write_bytes(data[:60] + b"\xec\x80" * 500_000)
