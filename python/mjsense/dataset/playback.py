# SPDX-License-Identifier: Apache-2.0
"""Replay of a recorded episode in plain MuJoCo."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense.core import libmujoco
from mjsense.dataset.archive import read_archive
from mjsense.dataset.closed_model import check_archive, compile_closed
from mjsense.dataset.hdf5 import open_h5
from mjsense.dataset.model_fields import INPUTS, ReplayInputs, check_inputs, check_model_fields, read_input

if TYPE_CHECKING:
    import mujoco

    from mjsense.dataset.episode_rows import EpisodeRows
else:
    mujoco = libmujoco.shared

STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION) if libmujoco.shared else 0


def where(episode: EpisodeRows) -> str:
    return f"episode {episode.index} ({episode.path.name}, {episode.trajectory})"


def inputs_of(episode: EpisodeRows) -> ReplayInputs:
    """Raises ValueError if the recording has none."""
    cached = episode._store.rows.find((episode.index, "replay"))
    if cached is not None:
        return cached
    with open_h5(episode.path) as file:
        group = file[episode.trajectory].get("replay")
        if group is None and "env" in episode.settings:
            raise ValueError(
                f"{where(episode)} has no data for replay: the environment '{episode.settings['env']}' is not "
                "simulated by mjsense"
            )
        if group is None:
            raise ValueError(
                f"{where(episode)} has no data for replay. Record it again without --no-replay (replay=False); "
                "recordings of versions without replay lack parts of the state."
            )
        arrays = {name: read_input(group, name, episode._entry.length, where(episode)) for name in INPUTS}
    for name in ("state", "written"):
        if arrays[name] is None:
            raise ValueError(f"{where(episode)}: replay/{name} is missing")
    if arrays["held"] is None:
        arrays["held"] = np.zeros(0, np.int32)
    result = ReplayInputs(**arrays)
    episode._store.rows.add((episode.index, "replay"), result, sum(a.nbytes for a in arrays.values() if a is not None))
    return result


def states_of(episode: EpisodeRows) -> np.ndarray:
    """A copy of the states of an episode, of those rows that a trimmed one has."""
    states = inputs_of(episode).state
    return states.copy() if episode._kept is None else states[episode._kept]


def _require_mujoco() -> None:
    if libmujoco.shared is None:
        raise RuntimeError(f"replay needs the series of MuJoCo that mjsense records with: {libmujoco.explain()}")


def archive_of(episode: EpisodeRows) -> Path:
    """The file with the model and its assets."""
    name = episode._recording.model_archive  # a plain file name
    if not name:
        inputs_of(episode)  # states the reason if there is no data for replay at all
        raise ValueError(f"{where(episode)}: the attribute 'recording' names no model_archive")
    path = episode.path.parent / name
    if not path.exists():
        raise FileNotFoundError(
            f"{where(episode)} needs the model archive {path}, which is missing; copy it from the recording's folder"
        )
    return path


def archived_model(episode: EpisodeRows) -> mujoco.MjModel:
    path = archive_of(episode)

    return episode._store.models.get(path, lambda: (compile_closed(read_archive(path), str(path)), 1))


def changed_fields(episode: EpisodeRows) -> list[str]:
    """Fields of mjModel in which the episode differs from the archived model."""
    with open_h5(episode.path) as file:
        return list(file[episode.trajectory].get("replay/model", ()))


def set_option(model: Any, name: str, values: np.ndarray) -> None:
    """Sets ``opt.gravity``; NaN: the value that the model has."""
    name = name.removeprefix("opt.")
    now = np.atleast_1d(np.asarray(getattr(model.opt, name)))
    values = np.where(np.isnan(values), now, values) if values.dtype.kind == "f" else values
    setattr(model.opt, name, values if np.ndim(getattr(model.opt, name)) else values[0].item())


def check_unchanged(episode: EpisodeRows) -> None:
    """Raises ValueError if the model was written during the episode, which therefore cannot be simulated again."""
    with open_h5(episode.path) as file:
        dataset = file[episode.trajectory].get("replay/changed")
        names = "" if dataset is None else dataset.text()
    if names:
        raise ValueError(
            f"{where(episode)} cannot be simulated from its actions: {', '.join(names.split())} of the model "
            "changed during the episode, and the "
            "recording has the values at its end"
        )


def model_of(episode: EpisodeRows) -> mujoco.MjModel:
    _require_mujoco()
    model = copy.deepcopy(archived_model(episode))
    for name, values in fields_of(episode, model).items():
        if name.startswith("opt."):
            set_option(model, name, values)
            continue
        field = getattr(model, name)
        field[...] = np.where(np.isnan(values), field, values) if values.dtype.kind == "f" else values
    check_inputs(inputs_of(episode), model, mujoco.mj_stateSize(model, STATE), substeps_of(episode, model), where(episode))
    return model


def fields_of(episode: EpisodeRows, model: mujoco.MjModel, prefix: str = "") -> dict[str, np.ndarray]:
    """The checked fields in which the episode differs from the archived model; NaN in floats: the archive's value.

    Args:
        prefix: Beginning of the names of the fields to read.
    """
    with open_h5(episode.path) as file:
        group = file[episode.trajectory].get("replay/model", {})
        if not hasattr(group, "items"):
            raise ValueError(f"{where(episode)}: replay/model is an array, expected a group")
        return check_model_fields({name: data for name, data in group.items() if name.startswith(prefix)}, model, where(episode))


def check_episode(episode: EpisodeRows) -> None:
    """Raises ValueError, with one line, for an episode whose archive or data for replay would be refused by replay, render or the
    viewer.

    Without the package ``mujoco`` the archive and the arrays are checked, but not the values of the model's fields.
    """
    archive = archive_of(episode)
    if libmujoco.shared is None:
        check_archive(archive)
        inputs_of(episode)
        return
    model = archived_model(episode)
    fields_of(episode, model)
    check_inputs(inputs_of(episode), model, mujoco.mj_stateSize(model, STATE), substeps_of(episode, model), where(episode))


def substeps_of(episode: EpisodeRows, model: mujoco.MjModel) -> float:
    """Physics steps of one row."""
    period = episode.settings.get("policy_dt_ms") or float(1000 / episode.fps)
    if isinstance(period, bool) or not isinstance(period, (int, float)) or not 0 < period < 1e9:
        raise ValueError(f"{where(episode)}: policy_dt_ms is {period!r:.60}, expected a number of milliseconds")
    return period / 1000 / model.opt.timestep


def set_state(model: mujoco.MjModel, data: mujoco.MjData, state: np.ndarray) -> None:
    _require_mujoco()
    mujoco.mj_setState(model, data, state, STATE)
    mujoco.mj_forward(model, data)


class Stepper:
    """Simulates one step of the policy as it was recorded, in plain MuJoCo."""

    def __init__(self, episode: EpisodeRows, model: mujoco.MjModel, data: Any) -> None:
        self.model, self._data, self._inputs = model, data, inputs_of(episode)
        self._substeps = round(substeps_of(episode, model))
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
    episode: EpisodeRows, from_: str, model: mujoco.MjModel | None, data: mujoco.MjData | None
) -> Iterator[tuple[int, mujoco.MjData]]:
    if from_ not in ("states", "actions"):
        raise ValueError(f"from_ is {from_!r}; it must be 'states' or 'actions'")
    if from_ == "actions" and episode._kept is not None:
        raise ValueError(f"{where(episode)} is trimmed; only the complete episode can be simulated from its actions")
    if from_ == "actions":
        check_unchanged(episode)
    states = states_of(episode)
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
