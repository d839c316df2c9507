#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The readers of untrusted files in Python, and inputs for them: valid ones of which some places are changed, and any bytes.

A reader returns a value, or raises an error of one line. ``python tests/fuzz/untrusted_readers.py NAME SECONDS`` runs one of them with new inputs
until the time has passed; test_readers.py runs all of them with a few inputs that are always the same.
"""

from __future__ import annotations

import copy
import io
import json
import math
import sys
import tempfile
import time
import warnings
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import h5py
import hypothesis
import numpy as np
from hypothesis import strategies as st

import mjsense as mjs
from mjsense.core.errors import UnknownNameError
from mjsense.dataset import archive, bounded_json, closed_model, index, json_rows, lerobot_reader
from mjsense.dataset.description import Description
from mjsense.dataset.hdf5 import Group, open_h5
from mjsense.evaluation.remote import messages

SECONDS = 5  # of CPU time for one input
_CLEAR = (ValueError, UnknownNameError, OSError, RuntimeError)

# ------------------------------------------------------------------------------------------------------------------ values

_TEXTS = ["..", "/etc/passwd", "../x", "a/b", "a\\b", "a\nb", "\x1b[31m", "%s%n", "{}", "1/0", "1e999999999", "-15", "nan", "500/33", "traj_0", "house_0", "\ud800", "x" * 300]
_NUMBERS = [0, -1, 1, 2**31, -(2**31), 2**53, 2**63, -(2**63), 2**64, 10**400, 0.5, 1e300, -1e300, 1e-300, math.nan, math.inf]
_SCALARS = st.none() | st.booleans() | st.sampled_from(_NUMBERS) | st.sampled_from(_TEXTS) | st.integers() | st.floats() | st.text(max_size=10)
VALUES = st.recursive(_SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner, max_size=4), max_leaves=8)
_DEEP = st.integers(1, 5000).map(lambda depth: "[" * depth + "]" * depth)


def _places(value: Any) -> Iterator[tuple[Any, Any]]:
    """Every container of a JSON value with each of its keys."""
    for key, inner in list(value.items()) if isinstance(value, dict) else list(enumerate(value)) if isinstance(value, list) else []:
        yield value, key
        yield from _places(inner)


@st.composite
def changed(draw: Any, valid: Any) -> Any:
    """A JSON value of which up to three places are replaced, removed or added."""
    value = copy.deepcopy(valid)
    for _ in range(draw(st.integers(0, 3))):
        if not (places := list(_places(value))):
            break
        container, key = draw(st.sampled_from(places))
        how = draw(st.integers(0, 3))
        if how == 0 and isinstance(container, dict):
            del container[key]
        elif how == 1 and isinstance(container, dict):
            container[draw(st.sampled_from(_TEXTS) | st.text(max_size=8))] = draw(VALUES)
        else:
            container[key] = draw(VALUES)
    return value


@st.composite
def changed_bytes(draw: Any, valid: bytes) -> bytes:
    """Bytes with some of them replaced, inserted or cut off."""
    data = bytearray(valid)
    for _ in range(draw(st.integers(0, 5))):
        at = draw(st.integers(0, max(0, len(data) - 1)))
        new = draw(st.binary(min_size=1, max_size=8))
        how = draw(st.integers(0, 3))
        if how == 0:
            data[at:at] = new
        elif how == 1:
            del data[at:]
        else:
            data[at : at + len(new)] = new
    return bytes(data)


def _json(value: Any) -> bytes:
    return json.dumps(value).encode()


# ----------------------------------------------------------------------------------------------------------------- readers

READERS: dict[str, tuple[st.SearchStrategy[Any], Callable[[Any, Path], Any]]] = {}


def _reader(inputs: st.SearchStrategy[Any]) -> Callable[[Callable[[Any, Path], Any]], Callable[[Any, Path], Any]]:
    def add(read: Callable[[Any, Path], Any]) -> Callable[[Any, Path], Any]:
        READERS[read.__name__.removeprefix("read_")] = inputs, read
        return read

    return add


@_reader(VALUES.map(_json) | _DEEP.map(str.encode) | st.binary(max_size=200) | VALUES.map(_json).flatmap(changed_bytes))
def read_bounded_json(text: bytes, folder: Path) -> None:
    bounded_json.parse(text, "x: the text", 1 << 16)


_CAMERA = {"name": "robot_0/eye", "width": 32, "height": 24, "depth": True, "pos": [0, 0, 1], "quat": [1, 0, 0, 0], "fovy": 45}
_DESCRIPTION = {
    "batches": 1, "episodes": 4, "fps": "500/33", "gzip": 4, "model_archive": "model_1.zip", "streams": ["qpos uint8(2000,)"],
    "settings": {"task": "pick", "robot": "franka", "policy_dt_ms": 66, "terminate_upon_success": True, "cameras": [_CAMERA], "render": {"brightness": 1.0}, "code": {}},
    "video": {"crf": 25, "preset": "veryfast", "tune": "", "keyint": 20, "threads": 1, "depth_unit": 0.0002, "molmospaces_depth": False},
}  # fmt: skip


@_reader(changed(_DESCRIPTION).map(_json) | _DEEP.map(str.encode))
def read_description(text: bytes, folder: Path) -> None:
    found = Description.parse(text, "x.h5")
    assert found.fps is None or 0 < found.fps < 10**7
    assert set(found.video or {}) <= {"crf", "preset", "tune", "keyint", "encoder_threads", "depth_unit", "molmospaces_depth"}


_ROW = {"episode": 0, "path": "house_0/trajectories_batch_1_of_1.h5", "trajectory": "traj_0", "seed": 5, "length": 7, "success": True, "outcome": "success", "task": "pick"}


def _parquet(rows: list[dict[str, Any]]) -> bytes:
    import pyarrow
    import pyarrow.parquet

    out = io.BytesIO()
    try:
        pyarrow.parquet.write_table(pyarrow.Table.from_pylist(rows), out)
    except (pyarrow.ArrowException, OverflowError, TypeError, UnicodeError):  # Parquet has no such values
        hypothesis.reject()
    return out.getvalue()


_ROWS = changed([_ROW, _ROW | {"episode": 1, "trajectory": "traj_1"}]).filter(lambda rows: all(isinstance(row, dict) for row in rows))


@_reader(_ROWS.map(_parquet) | changed_bytes(_parquet([_ROW])))
def read_index(content: bytes, folder: Path) -> None:
    (folder / "index.parquet").write_bytes(content)
    for row in index.rows_of(folder / "index.parquet"):
        assert ".." not in row["path"] and row["path"][0] != "/" and row["length"] >= 0


@_reader(st.lists(changed({"arm": [0.1, -2e-9], "nested": {"deep": {"é": [True, None]}}, "text": "x"}).map(_json) | st.binary(max_size=60), min_size=1, max_size=4))
def read_json_rows(texts: list[bytes], folder: Path) -> None:
    width = max(map(len, texts))
    rows = np.array([list(text.ljust(width, b"\0")) for text in texts], np.uint8).reshape(len(texts), width)
    for values, given in json_rows.decode(rows, "x.h5 traj_0/obs/x").values():
        assert len(values) == len(given) == len(texts)


_MODEL = (
    "<mujoco model='m'><compiler angle='radian'/><option timestep='0.002'/><asset><texture name='t' type='2d' builtin='checker' width='4' height='4'/>"
    "<material name='a' texture='t'/><mesh name='m' vertex='0 0 0 1 0 0 0 1 0 0 0 1'/><hfield name='h' nrow='2' ncol='2' size='1 1 1 1'/></asset><worldbody>"
    "<light pos='0 0 1'/><camera name='c' fovy='40'/><geom type='plane' size='1 1 .1' material='a'/><body name='b' pos='0 0 1'><joint name='j' type='hinge'/>"
    "<geom type='mesh' mesh='m'/><geom size='.1' mass='1'/><site name='s'/></body></worldbody><actuator><motor name='u' joint='j'/></actuator>"
    "<sensor><jointpos joint='j'/></sensor><keyframe><key qpos='1'/></keyframe></mujoco>"
)


@st.composite
def _models(draw: Any) -> bytes:
    import re

    text = _MODEL
    for _ in range(draw(st.integers(0, 2))):
        spots = list(re.finditer(r"(\w+)='([^']*)'", text))
        spot = draw(st.sampled_from(spots))
        value = str(draw(_SCALARS)).translate({ord(c): "" for c in "'<&\0"})
        if draw(st.booleans()):
            text = text[: spot.start(2)] + value + text[spot.end(2) :]
        else:
            name = draw(st.sampled_from(["file", "count", "size", "nuser_geom", "content_type", "plugin", "fileright", "gridsize", "name", "class", "euler"]))
            text = f"{text[: spot.start()]}{name}='{value}' {text[spot.start() :]}"
    return text.encode(errors="replace")


@_reader(_models() | changed_bytes(_MODEL.encode()))
def read_model(text: bytes, folder: Path) -> None:
    """Compiled, if there is a MuJoCo that compiles."""
    if closed_model.mujoco is None:
        closed_model.closed_model(text, {}, "x.zip")
    else:
        closed_model.compile_closed({"model.xml": text}, "x.zip")


def _zip(members: list[tuple[str, bytes, int]]) -> bytes:
    out = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(out, "w") as file:
        warnings.simplefilter("ignore")  # a name that is there twice
        for name, content, method in members:
            try:
                file.writestr(zipfile.ZipInfo(name), content, method)
            except (UnicodeError, ValueError):
                hypothesis.reject()
    return out.getvalue()


_METHODS = st.sampled_from([zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
_MEMBERS = st.lists(st.tuples(st.sampled_from([*_TEXTS, "a", "a/b", "model.xml"]) | st.text(min_size=1, max_size=5), st.binary(max_size=50), _METHODS), max_size=4)


@_reader(_MEMBERS.map(lambda members: _zip([("model.xml", _MODEL.encode(), 8), *members])) | changed_bytes(_zip([("model.xml", b"<mujoco/>", 8), ("a.png", b"x" * 99, 8)])))
def read_archive(content: bytes, folder: Path) -> None:
    for name in archive.files_of(io.BytesIO(content), "x.zip"):
        assert not name.startswith("/") and ".." not in name.split("/")


_SHAPES = st.lists(st.sampled_from([0, 1, 2, 7, 1000]), max_size=3).map(tuple).filter(lambda shape: math.prod(shape) <= 10**6)
_DTYPES = st.sampled_from(["u1", "i8", "f4", "f8", "?", ">f8", ">i4", "S3", "V7", "c16", "f2"])
_ATTRIBUTES = st.dictionaries(st.sampled_from(["crc32", "unit", "encoding", "width", "fps"]), st.sampled_from(_TEXTS[:15]) | st.integers(-(2**63), 2**63 - 1) | st.floats() | st.binary(min_size=1, max_size=9).map(np.bytes_), max_size=2)
_DATASETS = st.fixed_dictionaries({"shape": _SHAPES, "dtype": _DTYPES, "chunk": st.integers(1, 5), "filters": st.lists(st.sampled_from(["gzip", "lzf", "shuffle", "fletcher32"]), unique=True),
                                   "raw": st.lists(st.binary(max_size=40), max_size=3), "mask": st.integers(0, 15), "attributes": _ATTRIBUTES, "values": st.booleans()})  # fmt: skip


def _make_h5(path: Path, about: dict[str, Any]) -> None:
    """A dataset whose chunks are some bytes."""
    with h5py.File(path, "w") as file:
        shape, kind = about["shape"], np.dtype(about["dtype"])
        options: dict[str, Any] = {"shuffle": "shuffle" in about["filters"], "fletcher32": "fletcher32" in about["filters"]}
        options["compression"] = next((name for name in about["filters"] if name in ("gzip", "lzf")), None)
        if not shape or 0 in shape:
            options = {}
        else:
            options["chunks"] = tuple(min(size, about["chunk"] if i == 0 else 1000) for i, size in enumerate(shape))
        dataset = file.create_dataset("g/x", shape=shape, dtype=kind, **options)
        if about["values"] and kind.kind in "iuf":
            dataset[...] = np.ones(shape, kind)  # h5py writes a single number element by element
        for i, raw in enumerate(about["raw"] if options else []):
            if i * options["chunks"][0] < shape[0]:
                dataset.id.write_direct_chunk((i * options["chunks"][0], *[0] * (len(shape) - 1)), raw, about["mask"])
        for key, value in about["attributes"].items():
            dataset.attrs[key] = value


def _walk(group: Group) -> None:
    for _, item in group.items():
        if isinstance(item, Group):
            _walk(item)
            continue
        for key in ("crc32", "unit"):
            item.attrs.text(key)
        item.attrs.integer("width", 0, 10)
        values = item.read()
        assert isinstance(values, bytes) or np.shape(values) == item.shape
        if item.shape and len(item):
            assert np.array_equal(item[0], values[0], equal_nan=values.dtype.kind == "f")


@_reader(_DATASETS)
def read_hdf5(about: dict[str, Any], folder: Path) -> None:
    _make_h5(folder / "x.h5", about)
    with open_h5(folder / "x.h5") as file:
        _walk(file)


_STATE = {"dtype": "float32", "shape": [2], "names": ["a", "b"]}
_INFO = {"codebase_version": "v3.0", "fps": 10, "robot_type": "x", "data_path": "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
         "features": {"observation.state": _STATE, "action": {"dtype": "float32", "shape": [2]}, "observation.images.eye": {"dtype": "image", "shape": [4, 4, 3]}}}  # fmt: skip
_EPISODE = {"episode_index": 0, "tasks": ["t"], "length": 3, "data/chunk_index": 0, "data/file_index": 0}
_FRAME = {"observation.state": [0.0, 1.0], "action": [0.0, 1.0], "episode_index": 0, "task_index": 0, "observation.images.eye": {"bytes": "x", "path": "y"}}


@_reader(st.tuples(changed(_INFO), changed([_EPISODE]), changed([_FRAME] * 3)).filter(lambda one: all(isinstance(row, dict) for part in one[1:] for row in part)))
def read_lerobot(content: tuple[Any, Any, Any], folder: Path) -> None:
    info, episodes, rows = content
    for place, bytes_ in (("meta/info.json", _json(info)), ("meta/episodes/chunk-000/file-000.parquet", _parquet(episodes)), ("data/chunk-000/file-000.parquet", _parquet(rows))):
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_bytes(bytes_)
    source = lerobot_reader.LeRobotReader(folder)
    for number in source.episodes:
        rows = source.rows(number)
        for key in source.images:
            list(source.frames(number, key, rows))


_DEMO = {"env_args": {"env_name": "Lift", "env_kwargs": {"control_freq": 20}}, "problem_info": {"language_instruction": "lift"}, "ep_meta": {"lang": "x", "seed": 3},
         "rows": {"actions": 3, "rewards": 3, "dones": 3, "obs/joint": 3}}  # fmt: skip


@_reader(st.tuples(changed(_DEMO).filter(lambda about: isinstance(about, dict)), _DTYPES, st.sampled_from([None, _MODEL.encode()]) | _models()))
def read_robomimic(content: tuple[Any, str, bytes | None], folder: Path) -> None:
    about, kind, model = content
    with h5py.File(folder / "demo.hdf5", "w") as file:
        demo = file.create_group("data/demo_0")
        for key, where in (("env_args", file["data"]), ("problem_info", file["data"]), ("ep_meta", demo)):
            if key in about:
                where.attrs[key] = json.dumps(about[key])[:60_000]
        for name, rows in about["rows"].items() if isinstance(about.get("rows"), dict) else ():
            if type(rows) is int and 0 <= rows < 9 and isinstance(name, str) and "\0" not in name and "\ud800" not in name and name.strip("/.") and name not in demo:
                demo.create_dataset(name, data=np.zeros((rows, 2) if name in ("actions", "obs/joint") else rows, "f8" if name == "actions" else kind))
        if model is not None:
            demo.attrs["model_file"] = np.bytes_(model[:60_000] or b" ")
            demo["states"] = np.zeros((3, 3))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mjs.import_robomimic(folder / "demo.hdf5", folder / "out")
    assert all(episode.length for episode in mjs.Dataset(folder / "out").episodes)


def _page() -> Any:
    import viser

    class Slider(viser.GuiSliderHandle):
        min, max, step, value, disabled = 0.0, 1.0, 0.1, 0.5, False  # pyright: ignore[reportAssignmentType]

        def __init__(self) -> None:
            pass

    class Box(viser.GuiCheckboxHandle):
        value, disabled = False, False  # pyright: ignore[reportAssignmentType]

        def __init__(self) -> None:
            pass

    gui = SimpleNamespace(_gui_input_handle_from_uuid={"slider": Slider(), "box": Box()}, _command_handle_from_uuid={"key": None})
    return viser, SimpleNamespace(gui=gui, scene=SimpleNamespace(_handle_from_transform_controls_name={"/target": None}))


_CLIENT = [
    {"type": "GuiUpdateMessage", "uuid": "slider", "updates": {"value": 0.7}}, {"type": "GuiUpdateMessage", "uuid": "box", "updates": {"value": True}},
    {"type": "CommandTriggerMessage", "uuid": "key"}, {"type": "TransformControlsDragStartMessage", "name": "/target", "owner": ""},
    {"type": "TransformControlsUpdateMessage", "name": "/target", "owner": "", "position": [0.1, 0.2, 0.3], "wxyz": [1.0, 0.0, 0.0, 0.0]},
    {"type": "ViewerCameraMessage", "wxyz": [1.0, 0, 0, 0], "position": [0, 0, 1.0], "look_at": [0, 0, 0], "up_direction": [0, 0, 1], "fov": 1.0, "near": 0.1, "far": 9.0,
     "image_height": 60, "image_width": 80}, {"type": "GetRenderResponseMessage", "payload": "x", "render_uuid": "y"},
]  # fmt: skip


@_reader(st.sampled_from(_CLIENT).flatmap(changed) | st.binary(max_size=60))
def read_messages(message: Any, folder: Path) -> None:
    import msgspec

    from mjsense.viewer.messages import Messages

    try:
        raw = message if isinstance(message, bytes) else msgspec.msgpack.encode(message)
    except (OverflowError, UnicodeError, msgspec.MsgspecError):  # no client can send it
        hypothesis.reject()
    checked = Messages(*_page())(raw)
    if checked is not None:
        assert all(abs(container[key]) < 1e10 for container, key in _places(msgspec.msgpack.decode(checked)) if isinstance(container[key], float))


_ANSWER = {"actions": np.zeros((3, 8)), "state": {"flag": np.array([True]), "n": np.float32(0.5)}, "list": [1, -2.5, "x", None], "empty": np.zeros((0, 3), np.uint8)}
_PACKED = [messages.pack(_ANSWER, arrays) for arrays in ("openpi", "msgpack_numpy")]


@_reader(st.sampled_from(_PACKED).flatmap(changed_bytes) | st.binary(max_size=60))
def read_policy_messages(message: bytes, folder: Path) -> None:
    found = messages.unpack(message).value
    for value in found.values() if isinstance(found, dict) else ():
        assert not isinstance(value, np.ndarray) or (value.dtype.kind in "biuf" and value.nbytes <= len(message))


# ------------------------------------------------------------------------------------------------------------------- runs


def check(name: str, value: Any) -> None:
    """Runs a reader with an input. An AssertionError or an error that is not clear is a finding."""
    begun = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        try:
            READERS[name][1](value, Path(folder))
        except _CLEAR as error:
            assert "\n" not in str(error), f"the error has several lines: {error}"
            assert not isinstance(error, UnicodeError), f"the error does not say what is expected: {error!r}"
            assert 10 < len(str(error)) < 3000, f"the error is not one line of text: {error!r}"
    assert time.process_time() - begun < SECONDS, f"it took {time.process_time() - begun:.0f} s of CPU time"


def test_of(name: str, examples: int, same: bool) -> Callable[[], None]:
    """A function that checks a reader with so many inputs. ``same``: always the same ones."""
    settings = hypothesis.settings(max_examples=examples, deadline=None, derandomize=same, database=None, suppress_health_check=list(hypothesis.HealthCheck), print_blob=True)

    @settings
    @hypothesis.given(READERS[name][0])
    def run(value: Any) -> None:
        check(name, value)

    return run


def main(name: str, seconds: int) -> int:
    end, count = time.monotonic() + seconds, 0
    while time.monotonic() < end:
        test_of(name, 500, same=False)()
        count += 500
    print(f"{name}: {count} inputs")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2])))
