# SPDX-License-Identifier: Apache-2.0
"""Recordings that a generator changes: in a valid recording, one or two places get values that no recorder writes.

Places are attributes, datasets and links of the HDF5 files, fields of JSON texts, names of videos, fields of the model, and the members
and the MJCF of the model archive. Checksums are made to fit again, so that readers cannot rely on them. Each change follows from the seed
and the number of the trial (:func:`change`).
"""

from __future__ import annotations

import io
import json
import os
import random
import re
import zipfile
import zlib
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any

import h5py
import numpy as np

# ------------------------------------------------------------------------------------------------------------------ values


def _numbers() -> list[Any]:
    return [0, -1, 1, 7, 2**31 - 1, -(2**31), 2**53, 2**63 - 1, 10**12, 0.5, -0.0, 1e300, -1e300, 1e-300, float("nan"), float("inf"), True]


def _texts(secret: Path) -> list[str]:
    return [
        "", " ", "x", "abc", "..", ".", "/", "../../secret/private.mp4", str(secret / "private.mp4"), str(secret / "photo.png"), str(secret / "part.xml"),
        f"file:{secret}/private.mp4", "http://127.0.0.1:9/x", "a/b", "a\\b", "a\nb", "a\x1b[31mb", "\u202eabc", "\ud7ff\uffff", "Ä" * 300, "x" * 5000,
        "%s%n%n", "{0.__class__}", "{}", "1/0", "1e999999999", "-15", "nan", "inf", "0x10", "9" * 400, "500/33", "null", "[1, 2]", "<b onclick=x>",
        "![x](http://127.0.0.1:9/)", "__class__", "traj_0", "wrist_camera", "success",
    ]  # fmt: skip


def _hostile(rng: random.Random, secret: Path) -> Any:
    """A value of JSON."""
    kind = rng.randrange(8)
    if kind < 3:
        return rng.choice(_numbers())
    if kind < 6:
        return rng.choice(_texts(secret))
    deep: Any = rng.choice(_numbers())
    for _ in range(rng.choice([1, 3, 60, 400])):
        deep = [deep] if rng.random() < 0.5 else {"a": deep}
    return rng.choice([None, [], {}, deep, [0] * rng.choice([1, 3, 100000]), {str(i): i for i in range(rng.choice([1, 2000]))}])


def _array(rng: random.Random, shape: tuple[int, ...]) -> np.ndarray:
    dtype = np.dtype(rng.choice(["u1", "i1", "i4", "i8", "u8", "f2", "f4", "f8", "?", "S3", "V7", "c16", ">f8", ">i4"]))
    length = int(np.prod(shape)) if shape else 1
    if length > 1_000_000:
        shape, length = (3,), 3
    if dtype.kind in "fiu" and rng.random() < 0.7:
        with np.errstate(all="ignore"):
            number = rng.choice([v for v in _numbers() if dtype.kind == "f" or (v == v and abs(v) < 2**62)])
            return np.full(shape, number, np.float64 if dtype.kind == "f" else np.int64).astype(dtype)
    return np.frombuffer(rng.randbytes(length * dtype.itemsize), dtype).reshape(shape)


# ----------------------------------------------------------------------------------------------------------------- changes

_TRAJECTORIES = ("traj_0", "traj_1")
_CHANGES: list[Callable[[Path, random.Random, Path], str]] = []


def _change(function: Callable[[Path, random.Random, Path], str]) -> Callable[[Path, random.Random, Path], str]:
    _CHANGES.append(function)
    return function


def _file(house: Path) -> Path:
    return min(house.glob("trajectories_batch_*.h5"))


def _objects(file: Any) -> list[str]:
    names: list[str] = ["/"]
    file.visit(names.append)
    return sorted(names)


def _restore_checksum(dataset: Any) -> None:
    if "crc32" in dataset.attrs and "bytes" not in dataset.attrs:
        dataset.attrs["crc32"] = f"{zlib.crc32(dataset[...].tobytes()):08x}"


def _replace(file: Any, name: str, **create: Any) -> None:
    """Writes a dataset anew, with the attributes that it had."""
    attributes = dict(file[name].attrs)
    del file[name]
    dataset = file.create_dataset(name, **create)
    for key, value in attributes.items():
        dataset.attrs[key] = value
    if dataset.size and dataset.size < 10**7:
        _restore_checksum(dataset)


@_change
def attribute(house: Path, rng: random.Random, secret: Path) -> str:
    with h5py.File(_file(house), "r+") as file:
        name = rng.choice([n for n in _objects(file) if len(file[n].attrs)])
        key = rng.choice(sorted(file[name].attrs))
        how = rng.randrange(6)
        if how == 0:
            del file[name].attrs[key]
            return f"attribute {key} of {name} removed"
        value: Any = _hostile(rng, secret)
        if how == 1 or isinstance(value, (list, dict, type(None))):
            value = _array(rng, rng.choice([(), (1,), (3,), (40, 40)]))
        elif how == 2:
            value = np.bytes_(rng.randbytes(rng.choice([1, 30, 5000])))
        elif how == 3:
            value = h5py.Empty("f8")
        try:
            file[name].attrs[key] = value
        except (OSError, ValueError, TypeError, OverflowError):  # HDF5 cannot store it
            file[name].attrs[key] = "abc"
        return f"attribute {key} of {name} is {str(value)[:40]!r}"


@_change
def dataset(house: Path, rng: random.Random, secret: Path) -> str:
    with h5py.File(_file(house), "r+") as file:
        name = rng.choice([n for n in _objects(file) if isinstance(file[n], h5py.Dataset)])
        old = file[name]
        how = rng.randrange(9)
        if how == 0:
            del file[name]
            return f"{name} removed"
        if how == 1:
            rows = rng.choice([0, 1, 2, 1000])
            shape = (rows, *old.shape[1:]) if old.ndim else (rows,)
            _replace(file, name, data=_array(rng, shape))
            return f"{name} has the shape {shape}"
        if how == 2:
            shape = rng.choice([(), (0,), (5,), (5, 0), (5, 5, 5), (1,) * 20])
            _replace(file, name, data=_array(rng, shape))
            return f"{name} has the shape {shape}"
        if how == 3:
            shape = rng.choice([(10**11,), (len(old) if old.ndim else 1, 10**9), (10**6, 10**5)])
            _replace(file, name, shape=shape, dtype="f8", chunks=tuple(min(n, 1000) for n in shape), compression="gzip")
            return f"{name} has the shape {shape} without data"
        if how == 4:
            del file[name]
            file[name] = h5py.ExternalLink(str(secret / "other.h5"), "x") if rng.random() < 0.5 else h5py.SoftLink(rng.choice(["/", "/" + name, "/traj_0", "/nothing"]))
            return f"{name} is a link"
        if how == 5:
            rows = len(old) if old.ndim else 1
            _replace(file, name, shape=(rows, 4), dtype="u1", external=[(str(secret / "id_rsa"), 0, 4 * rows)])
            return f"{name} is stored in another file"
        if how == 6 and old.size and old.dtype.kind in "fiu":
            values = old[...].copy()
            flat = values.reshape(-1)
            with np.errstate(all="ignore"):
                choices = [v for v in _numbers() if values.dtype.kind == "f" or (v == v and 0 <= v < 2 ** (8 * values.dtype.itemsize - 1))]
                flat[rng.randrange(flat.size)] = rng.choice(choices)
            _replace(file, name, data=values)
            return f"one number of {name} changed"
        if how == 7:
            text = json.dumps(_hostile(rng, secret))
            rows = len(old) if old.ndim else 1
            _replace(file, name, data=np.tile(np.frombuffer(text.encode(), np.uint8), (min(rows, 100), 1)), compression="gzip")
            file[name].attrs["encoding"] = "json"
            return f"{name} contains JSON {text[:40]}"
        _replace(file, name, data=_array(rng, old.shape))
        return f"{name} has the type {file[name].dtype}"


@_change
def group(house: Path, rng: random.Random, secret: Path) -> str:
    with h5py.File(_file(house), "r+") as file:
        name = rng.choice([n for n in _objects(file) if n != "/"])
        new = rng.choice(["traj_x", "traj_-1", "traj_99999999999999999999", "traj_1", "traj_2", "traj_0/obs/extra/" + rng.choice(["a", ".", "ü", "x" * 2000, "\x1b[31m"]),
                          "traj_0/replay/model/" + rng.choice(["nq", "opt", "__class__", "names", "geom_dataid"])])  # fmt: skip
        try:
            if rng.random() < 0.5:
                file[new] = file[name]  # a hard link: of a group above, a circle
            else:
                file.move(name, new)
        except (ValueError, OSError, KeyError, RuntimeError):
            file.create_group("traj_0/obs/extra/empty")
        return f"{name} is also or instead {new[:60]}"


def _walk(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    found = [path] if path else []
    for key, inner in value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ():
        found += _walk(inner, (*path, key))
    return found


def _change_json(value: Any, rng: random.Random, secret: Path) -> str:
    path = rng.choice(_walk(value))
    inside = value
    for key in path[:-1]:
        inside = inside[key]
    how = rng.randrange(5)
    if how == 0 and isinstance(inside, dict):
        del inside[path[-1]]
        return f"{path} removed"
    if how == 1 and isinstance(inside, dict):
        key = rng.choice(["ffmpeg", "overwrite", "archive", "video", "fps", "model_archive", "settings", "streams", "cameras", "path", "robot", "task", "code", *_texts(secret)])
        inside[key] = _hostile(rng, secret) if key != "ffmpeg" else str(secret.parent / "encode")
        return f"{(*path[:-1], key[:30])} is {str(inside[key])[:40]!r}"
    inside[path[-1]] = _hostile(rng, secret)
    return f"{path} is {str(inside[path[-1]])[:40]!r}"


@_change
def recording_text(house: Path, rng: random.Random, secret: Path) -> str:
    with h5py.File(_file(house), "r+") as file:
        text = file.attrs["recording"]
        about = json.loads(text if isinstance(text, str) else bytes(text).split(b"\0")[0])
        what = _change_json(about, rng, secret)
        file.attrs.create("recording", json.dumps(about), dtype=h5py.string_dtype())
    return f"recording: {what}"


@_change
def scene_text(house: Path, rng: random.Random, secret: Path) -> str:
    with h5py.File(_file(house), "r+") as file:
        place = f"{rng.choice(_TRAJECTORIES)}/obs_scene"
        stored = file[place][()]
        scene = json.loads(stored if isinstance(stored, str) else bytes(stored).split(b"\0")[0])
        what = _change_json(scene, rng, secret)
        attributes = dict(file[place].attrs)
        del file[place]
        text = json.dumps(scene)
        file[place] = text
        for key, value in attributes.items():
            file[place].attrs[key] = f"{zlib.crc32(text.encode()):08x}" if key == "crc32" else value
    return f"{place}: {what}"


@_change
def video_name(house: Path, rng: random.Random, secret: Path) -> str:
    with h5py.File(_file(house), "r+") as file:
        videos = file[f"{rng.choice(_TRAJECTORIES)}/obs/sensor_data"]
        camera = rng.choice(sorted(videos))
        name = rng.choice([*_texts(secret), "pipe.mp4", "link.mp4", "folder.mp4", "list.mp4", _file(house).name])
        attributes = {key: value for key, value in videos[camera].attrs.items() if rng.random() < 0.5 or key not in ("crc32", "bytes")}
        (house / "list.mp4").write_text(rng.choice([f"ffconcat version 1.0\nfile {secret}/private.mp4\n", f"#EXTM3U\n#EXTINF:1,\n{secret}/private.mp4\n"]))
        (house / "folder.mp4").mkdir()
        (house / "link.mp4").symlink_to(secret / "private.mp4")
        os.mkfifo(house / "pipe.mp4")
        del videos[camera]
        videos[camera] = np.frombuffer(name.encode(errors="replace") + b"\0", np.uint8)
        for key, value in attributes.items():
            videos[camera].attrs[key] = value
    return f"the video of {camera} is {name[:40]!r}"


@_change
def model_field(house: Path, rng: random.Random, secret: Path) -> str:
    from mjsense.dataset.closed_model import compile_closed

    with zipfile.ZipFile(next(house.glob("model_*.zip"))) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    # Another change may have given the model so many copies of a body that MuJoCo alone would not come to an end.
    model: Any = compile_closed(files, "the model")
    names = sorted(name for name in dir(model) if not name.startswith("_") and isinstance(getattr(model, name), np.ndarray) and getattr(model, name).size)
    name = rng.choice(names)
    values = np.array(getattr(model, name))
    flat = values.reshape(-1)
    with np.errstate(all="ignore"):
        for _ in range(rng.choice([1, 5])):
            value = rng.choice([v for v in _numbers() if values.dtype.kind == "f" or (v == v and abs(v) < 2**31)])
            flat[rng.randrange(flat.size)] = np.float64(value) if values.dtype.kind == "f" else np.int64(value).astype(values.dtype)
    with h5py.File(_file(house), "r+") as file:
        fields = file[rng.choice(_TRAJECTORIES)].require_group("replay/model")
        if name in fields:
            del fields[name]
        fields[name] = values
    return f"replay/model/{name} changed"


def write_archive(house: Path, files: dict[str, bytes], method: int) -> None:
    old = next(house.glob("model_*.zip"))
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, data in files.items():
            archive.writestr(zipfile.ZipInfo(name), data, method)
    _rename_archive(house, old, buffer.getvalue())


def _rename_archive(house: Path, old: Path, data: bytes) -> None:
    name = f"model_{sha256(data).hexdigest()[: len(old.stem) - len('model_')]}.zip"
    old.unlink()
    (house / name).write_bytes(data)
    with h5py.File(_file(house), "r+") as file:
        text = file.attrs["recording"]
        about = json.loads(text if isinstance(text, str) else bytes(text).split(b"\0")[0])
        file.attrs.create("recording", json.dumps(about | {"model_archive": name}), dtype=h5py.string_dtype())


@_change
def archive_member(house: Path, rng: random.Random, secret: Path) -> str:
    old = next(house.glob("model_*.zip"))
    how = rng.randrange(5)
    if how == 0:
        data = bytearray(old.read_bytes())
        for _ in range(rng.choice([1, 3, 20])):
            data[rng.randrange(len(data))] = rng.randrange(256)
        _rename_archive(house, old, bytes(data))
        return "bytes of the archive changed"
    with zipfile.ZipFile(old) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    method = rng.choice([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
    name = rng.choice(sorted(files))
    if how == 1:
        new = rng.choice(["../x", "/x", "a/../../x", "..\\x", "a\0b", "x" * 3000, "model.xml/", "", ".", "Model.xml", "ü"])
        files[new] = files[name] if rng.random() < 0.5 else files.pop(name)
        what = f"{name} is also or instead {new[:30]!r}"
    elif how == 2:
        files[name] = rng.choice([b"", b"\0" * 100, files[name][: len(files[name]) // 2], rng.randbytes(500), bytes(300 << 20)])
        what = f"{name} has other contents"
    elif how == 3:
        del files[name]
        what = f"{name} removed"
    else:
        files |= {f"more{i}": bytes(rng.choice([0, 1, 100])) for i in range(rng.choice([10, 20000]))}
        what = "many members"
    write_archive(house, files, method)
    return f"archive: {what}"


@_change
def model_text(house: Path, rng: random.Random, secret: Path) -> str:
    with zipfile.ZipFile(next(house.glob("model_*.zip"))) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    text = files["model.xml"].decode()
    if rng.random() < 0.4:
        part, where = rng.choice([
            (f'<include file="{secret}/part.xml"/>', "mujoco"), (f'< include file="{secret}/part.xml"/>', "mujoco"),
            (f'<asset><texture name="t_" type="2d" file="{secret}/photo.png"/></asset>', "mujoco"),
            (f'<asset><texture name="t_" type="cube" fileright="{secret}/photo.png"/></asset>', "mujoco"),
            (f'<asset><texture name="t_" type="2d" builtin="flat" width="4" height="4" file="{secret}/photo.png"/></asset>', "mujoco"),
            (f'<asset><mesh name="m_" file="{secret}/photo.png" content_type="model/stl"/></asset>', "mujoco"),
            (f'<asset><hfield name="h_" file="{secret}/photo.png" size="1 1 1 1"/></asset>', "mujoco"),
            (f'<asset><model name="m_" file="{secret}/part.xml"/></asset>', "mujoco"),
            (f'<compiler meshdir="{secret}" texturedir="{secret}"/><asset><texture name="t_" type="2d" file="photo.png"/></asset>', "mujoco"),
            ('<asset><hfield name="h_" nrow="40000" ncol="40000" size="1 1 1 1"/></asset>', "mujoco"),
            ('<asset><texture name="t_" type="2d" builtin="flat" width="60000" height="60000"/></asset>', "mujoco"),
            ('<size memory="900G"/>', "mujoco"), ('<extension><plugin plugin="evil"/></extension>', "mujoco"),
            ('<replicate count="4000"><replicate count="4000"><geom size=".01"/></replicate></replicate>', "worldbody"),
            (f'<flexcomp name="f_" type="mesh" file="{secret}/photo.png"/>', "worldbody"),
            ('<flexcomp name="f_" type="grid" count="1000 1000 100" spacing=".1 .1 .1"/>', "worldbody"),
            ("<body>" * 5000 + "</body>" * 5000, "worldbody"),
        ])  # fmt: skip
        text = text.replace(f"</{where}>", f"{part}</{where}>", 1)
        what = part[:70]
    else:
        spots = list(re.finditer(r'(\w+)="([^"]*)"', text))
        spot = rng.choice(spots)
        value = str(rng.choice([*_numbers(), *_texts(secret)])).replace('"', "").replace("<", "").replace("&", "")
        text = text[: spot.start(2)] + value + text[spot.end(2) :]
        what = f'{spot[1]}="{value[:40]}"'
    files["model.xml"] = text.encode(errors="replace")
    write_archive(house, files, zipfile.ZIP_DEFLATED)
    return f"model.xml: {what}"


def change(house: Path, secret: Path, seed: int, number: int) -> str:
    """Changes a recording of one house. Returns what was changed, as a sentence."""
    rng = random.Random(f"{seed} {number}")
    chosen = [_CHANGES[number % len(_CHANGES)], *([rng.choice(_CHANGES)] if rng.random() < 0.15 else [])]
    done = []
    for one in chosen:
        try:
            done.append(one(house, rng, secret))
        except (KeyError, ValueError, OSError, StopIteration, IndexError, zipfile.BadZipFile, zlib.error):
            if not done:  # the first change always fits the valid recording
                raise
    return "; ".join(done)
