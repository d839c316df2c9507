# SPDX-License-Identifier: Apache-2.0
"""Import of robomimic's and robosuite's HDF5 files as recordings."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Callable, Iterable, Mapping
from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _libmujoco
from mjsense._arguments import checked
from mjsense.dataset.hdf5 import open_h5, text_of
from mjsense.dataset.import_rows import OPTIONS, Rows, archive_of, compile_archive, unique_name

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = _libmujoco.shared

_CONTROL_FREQ = 20  # robosuite's default


@checked
def import_robomimic(
    file: str | Path,
    out: str | Path,
    *,
    episodes: Iterable[int] | None = None,
    fps: float | None = None,
    assets: str | Path | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Path:
    """Writes a robomimic or robosuite data set as a recording, which can be inspected, read, and replayed from its states.

    Row t of the recording has observation t and action t - 1, so the last action of a demonstration, whose result the file does not
    contain, is left out. Demonstrations with equal models are in one ``house_N`` folder.

    Args:
        file: HDF5 file with ``data/demo_i``.
        out: Folder to write. It must not contain a recording.
        episodes: Positions of demonstrations, in the order of their numbers; by default all.
        fps: Steps per second; by default as the file's ``env_args`` state, or 20, robosuite's default.
        assets: Folder of the package ``robosuite``, for models that name its meshes and textures; by default the installed one.
        progress: Called with the number of written demonstrations and of all demonstrations.

    Returns:
        ``out``.

    Raises:
        FileNotFoundError: A model names a file that does not exist.
        ValueError: The file has no demonstrations, or a model and its states do not fit.
    """
    path = Path(file)
    with open_h5(path) as source:
        if "data" not in source or not (found := sorted((n for n in source["data"] if n.startswith("demo_")), key=lambda n: int(n[5:]))):
            raise ValueError(f"{path} contains no demonstrations (data/demo_0 ...)")
        data = source["data"]
        if wrong := [i for i in episodes or () if not 0 <= i < len(found)]:
            raise ValueError(f"episodes: {wrong[0]} is not in {path}, which has {len(found)} demonstrations")
        names = found if episodes is None else [found[i] for i in episodes]
        arguments = _json_of(data.attrs.get("env_args", data.attrs.get("env_info", "{}")))
        name = str(arguments.get("env_name") or text_of(data.attrs.get("env", "")) or path.stem)
        rate = Fraction(fps).limit_denominator(10**6) if fps else _rate(arguments)
        houses: dict[tuple[str, bytes], list[str]] = {}
        for demo in names:
            houses.setdefault(_archive(path, data[demo], assets), []).append(demo)
        done = 0
        for house, (archive, demos) in enumerate(houses.items()):
            settings = {"env": name, "source": path.name, "env_args": arguments}
            options = {**OPTIONS, "house": house, "episodes": len(demos)} | ({"archive": archive} if archive[0] else {})
            writer = _Writer(out, data[demos[0]], archive, rate, settings, options)
            for i, demo in enumerate(demos):
                writer.write(i, data[demo], {"task_description": name, "policy_dt_ms": float(1000 / rate)})
                done += 1
                if progress is not None:
                    progress(done, len(names))
            writer.complete()
    return Path(out)


def _rate(arguments: dict[str, Any]) -> Fraction:
    period = arguments.get("mjsense", {}).get("policy_dt_ms")
    if period:
        return Fraction(1000) / Fraction(period).limit_denominator(1000)
    return Fraction(arguments.get("env_kwargs", {}).get("control_freq") or _CONTROL_FREQ).limit_denominator(10**6)


def _json_of(text: Any) -> dict[str, Any]:
    return json.loads(text_of(text) or "{}")


# The model of a demonstration: robosuite's MJCF names files by their paths on the machine that recorded.


def _archive(path: Path, demo: Any, assets: str | Path | None) -> tuple[str, bytes]:
    """File name and bytes of the archive of a demonstration's model; empty if it has none."""
    if "model_file" not in demo.attrs or "states" not in demo:
        return "", b""
    stored = {name: bytes(content[:]) for name, content in _leaves(demo.get("assets", {}))}

    def read(file: str, folder: str) -> tuple[str, bytes]:
        if file in stored:
            return file, stored[file]
        content = _find(path, file, folder, assets, demo.name).read_bytes()
        return unique_name(file, content), content

    return archive_of(text_of(demo.attrs["model_file"]), read)


def _leaves(group: Mapping[str, Any], prefix: str = "") -> Iterable[tuple[str, Any]]:
    for name, value in group.items():
        if hasattr(value, "dtype"):
            yield prefix + name, value
        else:
            yield from _leaves(value, f"{prefix}{name}/")


def _find(path: Path, file: str, folder: str, assets: str | Path | None, demo: str) -> Path:
    """A file that a model names: as it is, next to the data set, or in the package robosuite."""
    parts = PurePosixPath(file).parts
    candidates = [Path(file), Path(folder) / file, path.parent / folder / file]
    if "robosuite" in parts:
        package = importlib.util.find_spec("robosuite") if assets is None else None
        root = Path(assets) if assets is not None else Path(package.origin).parent if package and package.origin else None
        if root is not None:
            candidates.insert(0, root.joinpath(*parts[len(parts) - parts[::-1].index("robosuite") :]))
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    hint = "; install robosuite, or pass assets= (--assets) the folder of its package" if "robosuite" in parts and assets is None else ""
    raise FileNotFoundError(f"{path}: the model of {demo[1:]} names {file}, which does not exist{hint}")


class _Writer:
    """Writes the demonstrations that share one model."""

    def __init__(self, out: str | Path, demo: Any, archive: tuple[str, bytes], rate: Fraction, settings: dict[str, Any], options: dict[str, Any]) -> None:
        self._model = compile_archive(archive[1], demo.name[1:]) if archive[0] else None
        self._streams = Rows()
        self._rows: dict[str, tuple[np.ndarray, str]] = {}  # row to write to, and the dataset of the demonstration that it comes from
        for key, values in sorted(demo.get("obs", {}).items()):
            place = f"obs/{key}"
            if key.endswith("_image") and values.dtype == np.uint8 and values.ndim == 4 and values.shape[3] == 3:
                self._add(key.removesuffix("_image"), place, "uint8", values.shape[1:], "Image of the camera.", video=True)
            elif key.endswith("_depth") and values.dtype.kind == "f" and values.ndim == 4 and values.shape[3] == 1:
                self._add(key, place, "float32", values.shape[1:3], "Depth image of the camera.", video=True, unit="m")
            else:
                self._add(f"observation/{key}", place, values.dtype.name, values.shape[1:], "Observation of the demonstration.")
        self._add("actions/action", "actions", demo["actions"].dtype.name, demo["actions"].shape[1:], "Action that led to this row; 0 in the first row.")
        self._state = None if self._model is None else self._streams.add_state(self._model)
        self._core = self._streams.recorder(out, rate, settings, options)

    def _add(self, name: str, place: str, dtype: str, shape: tuple[int, ...], description: str, **more: Any) -> None:
        self._rows[name] = self._streams.add(name, dtype, shape, description, **more), place

    def write(self, number: int, demo: Any, scene: dict[str, Any]) -> None:
        about = _json_of(demo.attrs.get("ep_meta", "{}"))
        scene = scene | ({"text": about["lang"]} if about.get("lang") else {})
        length = len(demo["actions"])
        rewards = demo["rewards"][:] if "rewards" in demo else np.zeros(length)
        ended = demo["dones"][:] if "dones" in demo else np.zeros(length)
        states = self._states(demo, self._model) if self._model is not None else None
        # Arrays are read as a whole, images one by one.
        values = {place: demo[place] if demo[place].ndim == 4 else demo[place][:] for _, place in self._rows.values()}
        self._core.begin_episode(0, number, int(about.get("seed") or 0))
        for t in range(length):
            for row, place in self._rows.values():
                if place == "actions":
                    row[0] = values[place][t - 1] if t else 0
                else:
                    row[0] = values[place][t].reshape(row[0].shape)
            if states is not None and self._state is not None:
                self._state[0] = states[t]
            reward = float(rewards[t - 1]) if t else 0.0
            last = t == length - 1
            self._core.append([0], [reward], [bool(t and ended[t - 1])], [last], [reward > 0])
        outcome = "no success: the file has no rewards" if "rewards" not in demo else "success" if rewards[-1] > 0 else "no success"
        self._core.finish_episode(0, json.dumps(scene), str(about.get("outcome") or outcome))

    def _states(self, demo: Any, model: mujoco.MjModel) -> np.ndarray:
        """MuJoCo's whole state at each observation."""
        place = self._state
        assert place is not None
        if "integration_states" in demo and demo["integration_states"].shape[1:] == place.shape[1:]:
            return demo["integration_states"][:]
        states = demo["states"][:]
        if states.shape[1:] != (1 + model.nq + model.nv,):
            raise ValueError(f"{demo.name[1:]}: states have {states.shape[1]} numbers; time, qpos and qvel of its model are {1 + model.nq + model.nv}")
        data, result = mujoco.MjData(model), np.empty((len(states), place.shape[1]))
        for t, state in enumerate(states):
            data.time, data.qpos[:], data.qvel[:] = state[0], state[1 : 1 + model.nq], state[1 + model.nq :]
            mujoco.mj_getState(model, data, result[t], mujoco.mjtState.mjSTATE_INTEGRATION)
        return result

    def complete(self) -> None:
        self._core.complete()

