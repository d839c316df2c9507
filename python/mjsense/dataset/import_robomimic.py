# SPDX-License-Identifier: Apache-2.0
"""Import of robomimic's, robosuite's and LIBERO's HDF5 files as recordings."""

from __future__ import annotations

import importlib.util
import json
import posixpath
import re
import warnings
from collections.abc import Callable, Iterable
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense.core import libmujoco
from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.core.declared_fields import given_options
from mjsense.core.new_output import new_output
from mjsense.dataset import bounded_json
from mjsense.dataset import foreign_values as foreign
from mjsense.dataset.hdf5 import open_h5
from mjsense.dataset.import_rows import NOT_A_NUMBER, Rows, archive_of, compile_archive, unique_name
from mjsense.dataset.model_fields import MAX_STATE

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = libmujoco.shared

_CONTROL_FREQ = 20  # robosuite's default
_IMAGES = ("_image", "_rgb")  # endings of the names of images: robosuite's and LIBERO's
_MAX_DEMONSTRATIONS = 1_000_000


@checked
def import_robomimic(
    file: str | Path,
    out: str | Path,
    *,
    episodes: Iterable[int] | None = None,
    fps: float | None = None,
    assets: str | Path | None = None,
    model: bool = True,
    # options of a recording
    batches: int = 0,
    gzip: int = 4,
    ffmpeg: str = "",
    crf: int = 25,
    preset: str = "veryfast",
    tune: str = "fastdecode",
    keyint: int = 20,
    # end of options
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a data set of robomimic, robosuite or LIBERO as a recording, which can be inspected, read, and replayed from its
    states.

    Row t of the recording has observation t and action t - 1, so the last action of a demonstration, whose result the file does
    not contain, is left out. Demonstrations without rows are left out, with a warning. Demonstrations with equal models are in
    one ``house_N`` folder. Images that a file states to have the bottom row first, as LIBERO's do, are turned. The files of the
    models are read from the folder of the data set and from ``assets``, and from nowhere else.

    Args:
        file: HDF5 file with ``data/demo_i``.
        out: Folder to write. It must not exist, or be empty; after an error it is not written.
        episodes: Positions of demonstrations, in the order of their numbers; by default all.
        fps: Steps per second; by default as the file's ``env_args`` state, or 20, robosuite's default.
        assets: Folder of the package ``robosuite`` or of LIBERO's assets, for models that name their meshes and textures; by
            default the installed ``robosuite``.
        model: Whether the models are imported, which replay needs.

        Options:
        batches: Number of HDF5 files over which the episodes are distributed; 0: one per four episodes.
        gzip: Compression level of arrays, 0 to 9.
        ffmpeg: Path of the ffmpeg program; by default ``$MJSENSE_FFMPEG``, else the one in ``PATH``.
        crf: Quality of the videos, from 0 (lossless) to 51 (worst).
        preset: Speed preset of the video encoder, from ultrafast to veryslow; see the page on file formats.
        tune: Tuning of x264 for a purpose; empty: none. ``fastdecode`` halves the time of decoding, and files are a
            seventh larger.
        keyint: Maximum number of frames between key frames. A small value makes random access faster, a large value
            makes files smaller.
        Others:
        progress: Called with the number of written demonstrations and of all demonstrations.

    Returns:
        ``out``.

    Raises:
        FileNotFoundError: A model names a file that does not exist in these folders.
        ValueError: The file has no demonstrations, arrays of a demonstration have different lengths, or a model and its states do
            not fit.
    """
    files = given_options("FilesCfg", locals())
    path = Path(file)
    with open_h5(path) as source:
        data = foreign.group_at(source, "data", str(path))
        found = [] if data is None else sorted((n for n in data if re.fullmatch(r"demo_\d{1,9}", n)), key=lambda n: int(n[5:]))
        if not found:
            raise ValueError(f"{path} contains no demonstrations (data/demo_0 ...)")
        if len(found) > _MAX_DEMONSTRATIONS:
            raise ValueError(f"{path} has {len(found)} demonstrations, the limit is {_MAX_DEMONSTRATIONS}")
        wanted = range(len(found)) if episodes is None else list(episodes)
        if wrong := [i for i in wanted if not 0 <= i < len(found)]:
            raise ValueError(f"episodes: {wrong[0]} is not in {path}, which has {len(found)} demonstrations")
        about = _About(path, data)
        rate = Fraction(fps).limit_denominator(10**6) if fps else about.rate
        demos: list[_Demonstration] = []
        archives: dict[tuple[str, bytes], tuple[str, bytes]] = {}
        for i in wanted:
            demos.append(demo := _Demonstration(path, data, found[i], about, model, assets))
            demo.archive = archives.setdefault(demo.archive, demo.archive)  # equal ones share memory
        kept = _with_rows(path, demos)
        houses: dict[tuple[str, bytes], list[_Demonstration]] = {}
        for demo in kept:
            houses.setdefault(demo.archive, []).append(demo)
        done = 0
        with new_output(out) as part:
            for house, (archive, members) in enumerate(houses.items()):
                settings = {"env": about.name, "source": path.name, "env_args": about.arguments}
                options = {**files, "house": house, "episodes": len(members)} | ({"archive": archive} if archive[0] else {})
                writer = _Writer(part, members[0], about, rate, settings, options)
                for i, demo in enumerate(members):
                    writer.write(
                        i, demo, {"task_description": about.name, "policy_dt_ms": float(1000 / rate)} | about.instruction
                    )
                    done += 1
                    if progress is not None:
                        progress(done, len(kept))
                writer.complete()
    return Path(out)


def _with_rows(path: Path, demos: list[_Demonstration]) -> list[_Demonstration]:
    empty = [demo.name for demo in demos if demo.length == 0]
    if len(empty) == len(demos):
        raise ValueError(f"{path}: no demonstration has rows: {', '.join(empty[:10])}")
    if empty:
        warnings.warn(
            f"{path}: {', '.join(empty[:10])} {'has' if len(empty) == 1 else 'have'} no rows, and {len(empty)} of "
            f"{len(demos)} demonstrations "
            "are left out",
            stacklevel=4,
        )
    if short := [demo.name for demo in demos if demo.length == 1]:
        warnings.warn(
            f"{path}: {', '.join(short[:10])}: one row, whose action is left out ({len(short)} of {len(demos)} demonstrations)",
            stacklevel=4,
        )
    return [demo for demo in demos if demo.length > 0]


class _About:
    """What the attributes of ``data`` state."""

    def __init__(self, path: Path, data: Any) -> None:
        def read(name: str) -> dict[str, Any]:
            text = foreign.attribute(data, name, f"{path}: data")
            return bounded_json.parse_object(text, f"{path}: {name}", foreign.MAX_JSON) if text else {}

        self.arguments = read("env_args") or read("env_info")
        name = self.arguments.get("env_name") or foreign.attribute(data, "env", f"{path}: data") or path.stem
        self.name = foreign.text(name, f"{path}: env_name")
        self.rate = self._rate(f"{path}: env_args")
        self.upside_down = foreign.attribute(data, "macros_image_convention", f"{path}: data") == "opengl"
        words = read("problem_info").get("language_instruction") or ""
        if isinstance(words, list) and all(isinstance(word, str) for word in words):
            words = "".join(words)
        instruction = foreign.text(words, f"{path}: language_instruction of problem_info")
        self.instruction = {"task_description": instruction, "text": instruction} if instruction else {}

    def _rate(self, place: str) -> Fraction:
        ours, theirs = (foreign.mapping(self.arguments.get(key) or {}, f"{place}: {key}") for key in ("mjsense", "env_kwargs"))
        if period := ours.get("policy_dt_ms"):
            return 1000 / Fraction(foreign.number(period, f"{place}: policy_dt_ms", 0.01, 1e6)).limit_denominator(1000)
        return foreign.rate(theirs.get("control_freq") or _CONTROL_FREQ, f"{place}: control_freq")


class _Demonstration:
    """The arrays of ``demo_i``, whose types and lengths have been checked, and its model."""

    def __init__(self, path: Path, data: Any, name: str, about: _About, with_model: bool, assets: str | Path | None) -> None:
        self.name, self.about = f"data/{name}", f"{path}: data/{name}"
        demo = foreign.group_at(data, name, f"{path}: data")
        actions = foreign.dataset_at(demo, "actions", self.about)
        if actions is None:
            raise ValueError(f"{self.about}: 'actions' is missing")
        self.length = len(actions)
        self.arrays: dict[str, Any] = {"actions": actions}
        observations: Any = foreign.group_at(demo, "obs", self.about)
        for key in observations or ():
            self.arrays[f"obs/{foreign.plain_name(key, f'{self.about}: obs')}"] = foreign.dataset_at(
                observations, key, f"{self.about}: obs"
            )
        for key in ("rewards", "dones", "states", "integration_states"):
            if (array := foreign.dataset_at(demo, key, self.about)) is not None:
                self.arrays[key] = array
        for key, array in self.arrays.items():
            if len(array) != self.length:
                raise ValueError(
                    f"{self.about}: {key} has {counted(len(array), 'row')}, and actions has {self.length}; expected "
                    "the same number"
                )
            if key in ("rewards", "dones") and array.ndim != 1 and array.shape != (self.length, 1):
                raise ValueError(f"{self.about}: {key} has the shape {[*array.shape]}, expected [{self.length}]")
        # Images are read one by one, everything else as a whole.
        if (size := sum(array.bytes for array in self.arrays.values() if array.ndim != 4)) > foreign.MAX_BYTES:
            raise ValueError(f"{self.about}: its arrays of numbers have {size} bytes, the limit is {foreign.MAX_BYTES}")
        text = foreign.attribute(demo, "ep_meta", self.about)
        meta = bounded_json.parse_object(text, f"{self.about}: ep_meta", foreign.MAX_JSON) if text else {}
        self.language = foreign.text(meta.get("lang") or "", f"{self.about}: lang of ep_meta")
        self.outcome = foreign.text(meta.get("outcome") or "", f"{self.about}: outcome of ep_meta", 1000)
        self.seed = foreign.whole(meta.get("seed") or 0, f"{self.about}: seed of ep_meta", 0, 2**63 - 1)
        has_model = with_model and "model_file" in demo.attrs and "states" in self.arrays and self.length > 0
        self.archive = _archive(path, demo, self.about, assets) if has_model else ("", b"")
        """File name and bytes of the archive of the model; empty if there is none."""


# The model of a demonstration: robosuite's MJCF names files by their paths on the machine that recorded.


def _archive(path: Path, demo: Any, about: str, assets: str | Path | None) -> tuple[str, bytes]:
    stored = foreign.group_at(demo, "assets", about)

    def read(file: str, folder: str) -> tuple[str, bytes]:
        if stored is not None and (content := _stored(stored, file, about)) is not None:
            return file, content
        content = foreign.read_bytes(_find(path, file, folder, assets, about), about)
        return unique_name(file, content), content

    return archive_of(foreign.attribute(demo, "model_file", about), read, f"{about}: model_file")


def _stored(assets: Any, file: str, about: str) -> bytes | None:
    """The bytes of a file that the data set contains itself."""
    *folders, name = file.split("/")
    group = assets
    for folder in folders:
        if not folder or group is None or hasattr(group, "dtype"):
            return None
        group = foreign.group_at(group, folder, f"{about}: assets") if folder in group else None
    if group is None or not name or name not in group:
        return None
    content = foreign.dataset_at(group, name, f"{about}: assets")
    if content.dtype != np.uint8 or content.ndim != 1:
        raise ValueError(
            f"{about}: assets: {foreign.found(file)} is {content.dtype} {[*content.shape]}, expected uint8 with one dimension"
        )
    return content[()].tobytes()


def _find(path: Path, file: str, folder: str, assets: str | Path | None, about: str) -> Path:
    """A file that a model names: in the folder of assets, or next to the data set."""
    name = posixpath.normpath(posixpath.join(folder, file).replace("\\", "/"))
    parts = [part for part in name.split("/") if part]
    package = importlib.util.find_spec("robosuite") if assets is None and "robosuite" in parts else None
    root = Path(assets) if assets is not None else Path(package.origin).parent if package and package.origin else None
    candidates: list[tuple[Path, Path]] = []
    if root is not None and ".." not in parts:
        if "robosuite" in parts:
            candidates.append((root, root.joinpath(*parts[len(parts) - parts[::-1].index("robosuite") :])))
        candidates += [(root, root.joinpath(*parts[start:])) for start in range(len(parts))]
    if not name.startswith("/") and ".." not in parts:
        candidates.append((path.parent, path.parent.joinpath(*parts)))
    for inside, candidate in candidates:
        if candidate.is_file():
            return foreign.regular_inside((inside,), candidate, about)
    hint = (
        "install robosuite, or pass assets= (--assets) the folder of its package"
        if "robosuite" in parts and assets is None
        else ("pass assets= (--assets) the folder that contains it")
    )
    places = " or ".join(str(place) for place in (root, path.parent) if place is not None)
    demo = about.removeprefix(f"{path}: ")
    raise FileNotFoundError(
        f"{path}: the model of {demo} names {file[:300]!r}, which does not exist in {places}; {hint}, or leave the model out "
        "with model=False (--without-model)"
    )


class _Writer:
    """Writes the demonstrations that share one model."""

    def __init__(
        self,
        out: str | Path,
        demo: _Demonstration,
        about: _About,
        rate: Fraction,
        settings: dict[str, Any],
        options: dict[str, Any],
    ) -> None:
        self._model = compile_archive(demo.archive[1], demo.about) if demo.archive[0] else None
        self._streams = Rows(demo.about)
        self._rows: dict[
            str, tuple[np.ndarray, str]
        ] = {}  # row to write to, and the array of the demonstration that it comes from
        self._turned: set[str] = set()
        for place, values in sorted(demo.arrays.items()):
            if not place.startswith("obs/"):
                continue
            key, kind = place.removeprefix("obs/"), next((end for end in _IMAGES if place.endswith(end)), "")
            if kind and values.dtype == np.uint8 and values.ndim == 4 and values.shape[3] == 3:
                shape = (*foreign.image_shape(values.shape[1], values.shape[2], f"{demo.about}: {place}"), 3)
                self._add(demo, key.removesuffix(kind), place, "uint8", shape, "Image of the camera.", video=True)
            elif key.endswith("_depth") and values.dtype.kind == "f" and values.ndim == 4 and values.shape[3] == 1:
                shape = foreign.image_shape(values.shape[1], values.shape[2], f"{demo.about}: {place}")
                self._add(demo, key, place, "float32", shape, "Depth image of the camera.", video=True, unit="m")
            else:
                self._add(
                    demo, f"observation/{key}", place, values.dtype.name, values.shape[1:], "Observation of the demonstration."
                )
                continue
            if about.upside_down:
                self._turned.add(place)
        actions = demo.arrays["actions"]
        self._add(
            demo,
            "actions/action",
            "actions",
            actions.dtype.name,
            actions.shape[1:],
            "Action that led to this row; 0 in the first row.",
        )
        self._state = None if self._model is None else self._streams.add_state(self._model)
        self._core = self._streams.recorder(out, rate, settings, options)

    def _add(
        self, demo: _Demonstration, name: str, place: str, dtype: str, shape: tuple[int, ...], description: str, **more: Any
    ) -> None:
        if name in self._rows:
            raise ValueError(f"{demo.about}: {place} and {self._rows[name][1]} are the same camera '{name}'")
        if dtype == "float16":
            dtype = "float32"
        if dtype.startswith("float") and "video" not in more:
            description += NOT_A_NUMBER
        self._rows[name] = self._streams.add(name, dtype, shape, description, **more), place

    def write(self, number: int, demo: _Demonstration, scene: dict[str, Any]) -> None:
        scene = scene | ({"text": demo.language} if demo.language else {})
        length, arrays = demo.length, demo.arrays
        rewards, ended = (arrays[key][()].reshape(length) if key in arrays else np.zeros(length) for key in ("rewards", "dones"))
        if not np.isfinite(rewards).all():
            raise ValueError(f"{demo.about}: rewards[{int(np.argmin(np.isfinite(rewards)))}] is not finite, expected a number")
        self._check(demo)
        states = self._states(demo, self._model) if self._model is not None else None
        # Arrays are read as a whole, images one by one.
        values: dict[str, Any] = {
            place: arrays[place] if arrays[place].ndim == 4 else arrays[place][()] for _, place in self._rows.values()
        }
        self._core.begin_episode(0, number, demo.seed)
        for t in range(length):
            for row, place in self._rows.values():
                if place == "actions":
                    row[0] = values[place][t - 1] if t else 0
                else:
                    image = values[place][t]
                    row[0] = (image[::-1] if place in self._turned else image).reshape(row[0].shape)
            if states is not None and self._state is not None:
                self._state[0] = states[t]
            reward = float(rewards[t - 1]) if t else 0.0
            last = t == length - 1
            self._core.append([0], [reward], [bool(t and ended[t - 1])], [last], [reward > 0])
        outcome = (
            "no success: the file has no rewards" if "rewards" not in arrays else "success" if rewards[-1] > 0 else "no success"
        )
        self._core.finish_episode(0, json.dumps(scene), demo.outcome or outcome)

    def _check(self, demo: _Demonstration) -> None:
        """Raises ValueError if the arrays of a demonstration are not those of the first one."""
        known = {place: row for row, place in self._rows.values()}
        for place in known.keys() | {place for place in demo.arrays if place.startswith("obs/")}:
            if place not in known or place not in demo.arrays:
                raise ValueError(
                    f"{demo.about}: {place} is {'missing' if place in known else 'not'} in "
                    f"{'this' if place in known else 'the first'} demonstration; "
                    "expected the same observations in all"
                )
            size = known[place][0].size
            if (here := int(np.prod(demo.arrays[place].shape[1:]))) != size:
                raise ValueError(
                    f"{demo.about}: {place} has {counted(here, 'number')} in a row, and {size} in the first demonstration"
                )

    def _states(self, demo: _Demonstration, model: mujoco.MjModel) -> np.ndarray:
        """MuJoCo's whole state at each observation."""
        place = self._state
        assert place is not None
        whole = demo.arrays.get("integration_states")
        if whole is not None and whole.shape[1:] == place.shape[1:]:
            return _finite(whole[()], f"{demo.about}: integration_states")
        stored, size = demo.arrays["states"], 1 + model.nq + model.nv
        if stored.shape[1:] != (size,):
            raise ValueError(
                f"{demo.about}: states have {counted(int(np.prod(stored.shape[1:])), 'number')}; time, qpos and qvel "
                f"of its model are {size}"
            )
        states = _finite(stored[()], f"{demo.about}: states")
        data, result = mujoco.MjData(model), np.empty((len(states), place.shape[1]))
        for t, state in enumerate(states):
            data.time, data.qpos[:], data.qvel[:] = state[0], state[1 : 1 + model.nq], state[1 + model.nq :]
            mujoco.mj_getState(model, data, result[t], mujoco.mjtState.mjSTATE_INTEGRATION)
        return result

    def complete(self) -> None:
        self._core.complete()


def _finite(states: np.ndarray, about: str) -> np.ndarray:
    if (wrong := ~(np.abs(states) <= MAX_STATE)).any():
        index = tuple(np.argwhere(wrong)[0].tolist())
        raise ValueError(f"{about}{[*index]}: is {states[index]}, expected a number of at most {MAX_STATE:g}")
    return states
