# SPDX-License-Identifier: Apache-2.0
"""Replay of a recorded episode in plain MuJoCo."""

from __future__ import annotations

import copy
import zipfile
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _libmujoco
from mjsense.dataset.files import open_h5

if TYPE_CHECKING:
    import mujoco

    from mjsense.dataset.episode import Episode
else:
    mujoco = _libmujoco.shared

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION) if _libmujoco.shared else 0
MODEL_FILE = "model.xml"


@dataclass(frozen=True)
class ReplayInputs:
    """What an episode stores for replay. docs/formats.md describes the arrays."""

    state: np.ndarray
    written: np.ndarray
    ctrl: np.ndarray | None
    mocap: np.ndarray | None
    held: np.ndarray


def where(episode: Episode) -> str:
    return f"episode {episode.index} ({episode.path.name}, {episode.trajectory})"


def inputs_of(episode: Episode) -> ReplayInputs:
    """Raises ValueError if the recording has none."""
    cached = episode._store.rows.find((episode.index, "replay"))
    if cached is not None:
        return cached
    with open_h5(episode.path) as file:
        group = file[episode.trajectory].get("replay")
        if group is None and "env" in episode.settings:
            raise ValueError(f"{where(episode)} has no data for replay: the environment '{episode.settings['env']}' is not simulated by mjsense")
        if group is None:
            raise ValueError(
                f"{where(episode)} has no data for replay. Record it again without --no-replay (replay=False); "
                "recordings of versions without replay lack parts of the state."
            )
        arrays: dict[str, Any] = {name: group[name][:] if name in group else None for name in ("state", "written", "ctrl", "mocap", "held")}
    if arrays["held"] is None:
        arrays["held"] = np.zeros(0, np.int32)
    result = ReplayInputs(**arrays)
    episode._store.rows.add((episode.index, "replay"), result, sum(a.nbytes for a in arrays.values() if a is not None))
    return result


def _require_mujoco() -> None:
    if _libmujoco.shared is None:
        raise RuntimeError(f"replay needs the series of MuJoCo that mjsense records with: {_libmujoco.explain()}")


def archive_of(episode: Episode) -> Path:
    """The file with the model and its assets."""
    name = episode._recording.get("model_archive")
    if not name:
        inputs_of(episode)  # states the reason if there is no data for replay at all
        raise ValueError(f"{where(episode)}: the attribute 'recording' names no model_archive")
    path = episode.path.parent / name
    if not path.exists():
        raise FileNotFoundError(f"{where(episode)} needs the model archive {path}, which is missing; copy it from the recording's folder")
    return path


def read_archive(path: Path) -> dict[str, bytes]:
    """The files of a model archive."""
    try:
        with zipfile.ZipFile(path) as archive:
            files = {name: archive.read(name) for name in archive.namelist()}
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError) as error:
        raise ValueError(f"the model archive {path} cannot be read: {error}; copy it from the original recording") from error
    if MODEL_FILE not in files or any(Path(name).is_absolute() or ".." in Path(name).parts for name in files):
        raise ValueError(f"the model archive {path} cannot be read: it contains no {MODEL_FILE}, or names outside of its folder")
    return files


def archived_model(episode: Episode) -> mujoco.MjModel:
    path = archive_of(episode)

    def compile_model() -> tuple[mujoco.MjModel, int]:
        assets = read_archive(path)
        text = assets.pop(MODEL_FILE).decode()
        try:
            return mujoco.MjModel.from_xml_string(text, assets), 1
        except ValueError as error:
            raise ValueError(f"MuJoCo {mujoco.__version__} cannot compile {path}: {error}") from error

    return episode._store.models.get(path, compile_model)


def changed_fields(episode: Episode) -> list[str]:
    """Fields of mjModel in which the episode differs from the archived model."""
    with open_h5(episode.path) as file:
        return list(file[episode.trajectory].get("replay/model", ()))


def set_option(model: Any, name: str, values: np.ndarray) -> None:
    """Sets ``opt.gravity``; NaN: the value that the model has."""
    name = name.removeprefix("opt.")
    now = np.atleast_1d(np.asarray(getattr(model.opt, name)))
    values = np.where(np.isnan(values), now, values) if values.dtype.kind == "f" else values
    setattr(model.opt, name, values if np.ndim(getattr(model.opt, name)) else values[0].item())


def check_unchanged(episode: Episode) -> None:
    """Raises ValueError if the model was written during the episode, which therefore cannot be simulated again."""
    with open_h5(episode.path) as file:
        group = file[episode.trajectory].get("replay", {})
        names = group["changed"][:].tobytes().decode() if "changed" in group else ""
    if names:
        raise ValueError(
            f"{where(episode)} cannot be simulated from its actions: {', '.join(names.split())} of the model changed during the episode, and the "
            "recording has the values at its end"
        )


def model_of(episode: Episode) -> mujoco.MjModel:
    _require_mujoco()
    model = copy.deepcopy(archived_model(episode))
    with open_h5(episode.path) as file:
        for name, dataset in file[episode.trajectory].get("replay/model", {}).items():
            if name.startswith("opt."):
                set_option(model, name, dataset[:])
                continue
            field = getattr(model, name)
            values = dataset[:].reshape(field.shape)
            field[:] = np.where(np.isnan(values), field, values) if values.dtype.kind == "f" else values
    size, stored = mujoco.mj_stateSize(model, STATE), inputs_of(episode).state.shape[1]
    if size != stored:
        raise ValueError(
            f"{where(episode)}: the recorded state has {stored} numbers, that of MuJoCo {mujoco.__version__} has {size}. "
            "Replay needs a MuJoCo of the series that recorded."
        )
    return model


def set_state(model: mujoco.MjModel, data: mujoco.MjData, state: np.ndarray) -> None:
    _require_mujoco()
    mujoco.mj_setState(model, data, state, STATE)
    mujoco.mj_forward(model, data)


class Stepper:
    """Simulates one step of the policy as it was recorded, in plain MuJoCo."""

    def __init__(self, episode: Episode, model: mujoco.MjModel, data: Any) -> None:
        self.model, self._data, self._inputs = model, data, inputs_of(episode)
        period = episode.settings.get("policy_dt_ms") or float(1000 / episode.fps)
        self._substeps = round(period / 1000 / model.opt.timestep)
        ctrl = self._inputs.ctrl
        self._per_tick = self._substeps // ctrl.shape[1] if ctrl is not None else 0
        self._held = [(model.jnt_qposadr[j], model.jnt_dofadr[j]) for j in self._inputs.held]

    def step(self, state: np.ndarray, t: int) -> np.ndarray:
        """The state at observation ``t``, simulated from ``state`` at observation ``t - 1``."""
        data, inputs = self._data, self._inputs
        written = inputs.written[t]
        self._set_state(np.where(np.isnan(written), state, written))
        poses = [data.qpos[q : q + 7].copy() for q, _ in self._held]
        for substep in range(self._substeps):
            if inputs.ctrl is not None and substep % self._per_tick == 0:
                tick = substep // self._per_tick
                data.ctrl[:] = inputs.ctrl[t, tick]
                if inputs.mocap is not None:
                    data.mocap_pos[:] = inputs.mocap[t, tick, :, :3]
                    data.mocap_quat[:] = inputs.mocap[t, tick, :, 3:]
            self._advance()
            for (q, v), pose in zip(self._held, poses):
                data.qpos[q : q + 7] = pose
                data.qvel[v : v + 6] = 0
        return self._get_state()

    def _set_state(self, state: np.ndarray) -> None:
        mujoco.mj_setState(self.model, self._data, state, STATE)

    def _advance(self) -> None:
        mujoco.mj_step(self.model, self._data)

    def _get_state(self) -> np.ndarray:
        state = np.empty(mujoco.mj_stateSize(self.model, STATE))
        mujoco.mj_getState(self.model, self._data, state, STATE)
        return state

    def part(self, i: int) -> tuple[str, int]:
        """The part of the state to which its value ``i`` belongs, and the position inside the part."""
        for bit in (1 << n for n in range(STATE.bit_length()) if STATE >> n & 1):
            size = mujoco.mj_stateSize(self.model, bit)
            if i < size:
                return mujoco.mjtState(bit).name.removeprefix("mjSTATE_").lower(), i
            i -= size
        raise AssertionError(i)


def replay_episode(
    episode: Episode, from_: str, model: mujoco.MjModel | None, data: mujoco.MjData | None
) -> Iterator[tuple[int, mujoco.MjData]]:
    if from_ not in ("states", "actions"):
        raise ValueError(f"from_ is {from_!r}; it must be 'states' or 'actions'")
    if from_ == "actions" and episode._kept is not None:
        raise ValueError(f"{where(episode)} is trimmed; only the complete episode can be simulated from its actions")
    if from_ == "actions":
        check_unchanged(episode)
    states = episode.states
    model = model_of(episode) if model is None else model
    data = mujoco.MjData(model) if data is None else data

    def run() -> Iterator[tuple[int, mujoco.MjData]]:
        stepper = Stepper(episode, model, data) if from_ == "actions" else None
        state = states[0]
        for t in range(episode.length):
            if stepper is None:
                state = states[t]
            elif t:
                state = stepper.step(state, t)
            set_state(model, data, state)
            yield t, data

    return run()
