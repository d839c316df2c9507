# SPDX-License-Identifier: Apache-2.0
"""Replay of recorded episodes in plain MuJoCo, and its comparison with the recorded states."""

from __future__ import annotations

import copy
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mjsense import _libmujoco
from mjsense._arguments import checked
from mjsense.dataset.files import open_h5

if TYPE_CHECKING:
    import mujoco

    from mjsense.dataset.dataset import Dataset
    from mjsense.dataset.episode import Episode
else:
    mujoco = _libmujoco.shared

_STATE = int(mujoco.mjtState.mjSTATE_INTEGRATION) if _libmujoco.shared else 0
_MODEL_FILE = "model.xml"


@dataclass(frozen=True)
class ReplayInputs:
    """What an episode stores for replay. docs/formats.md describes the arrays."""

    state: np.ndarray
    written: np.ndarray
    ctrl: np.ndarray | None
    mocap: np.ndarray | None
    held: np.ndarray


def _where(episode: Episode) -> str:
    return f"episode {episode.index} ({episode.path.name}, {episode.trajectory})"


def inputs_of(episode: Episode) -> ReplayInputs:
    """Raises ValueError if the recording has none."""
    cached = episode._store.rows.find((episode.index, "replay"))
    if cached is not None:
        return cached
    with open_h5(episode.path) as file:
        group = file[episode.trajectory].get("replay")
        if group is None:
            raise ValueError(
                f"{_where(episode)} has no data for replay. Record it again without --no-replay (replay=False); "
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


def _archived_model(episode: Episode) -> mujoco.MjModel:
    name = episode._recording.get("model_archive")
    if not name:
        inputs_of(episode)  # states the reason if there is no data for replay at all
        raise ValueError(f"{_where(episode)}: the attribute 'recording' names no model_archive")
    path = episode.path.parent / name

    def compile_model() -> tuple[mujoco.MjModel, int]:
        if not path.exists():
            raise FileNotFoundError(f"{_where(episode)} needs the model archive {path}, which is missing; copy it from the recording's folder")
        with zipfile.ZipFile(path) as archive:
            assets = {file: archive.read(file) for file in archive.namelist() if file != _MODEL_FILE}
            text = archive.read(_MODEL_FILE).decode()
        try:
            return mujoco.MjModel.from_xml_string(text, assets), 1
        except ValueError as error:
            raise ValueError(f"MuJoCo {mujoco.__version__} cannot compile {path}: {error}") from error

    return episode._store.models.get(path, compile_model)


def model_of(episode: Episode) -> mujoco.MjModel:
    _require_mujoco()
    model = copy.deepcopy(_archived_model(episode))
    with open_h5(episode.path) as file:
        for name, dataset in file[episode.trajectory].get("replay/model", {}).items():
            field = getattr(model, name)
            values = dataset[:].reshape(field.shape)
            field[:] = np.where(np.isnan(values), field, values) if values.dtype.kind == "f" else values
    size, stored = mujoco.mj_stateSize(model, _STATE), inputs_of(episode).state.shape[1]
    if size != stored:
        raise ValueError(
            f"{_where(episode)}: the recorded state has {stored} numbers, that of MuJoCo {mujoco.__version__} has {size}. "
            "Replay needs a MuJoCo of the series that recorded."
        )
    return model


def set_state(model: mujoco.MjModel, data: mujoco.MjData, state: np.ndarray) -> None:
    _require_mujoco()
    mujoco.mj_setState(model, data, state, _STATE)
    mujoco.mj_forward(model, data)


def _get_state(model: mujoco.MjModel, data: mujoco.MjData) -> np.ndarray:
    state = np.empty(mujoco.mj_stateSize(model, _STATE))
    mujoco.mj_getState(model, data, state, _STATE)
    return state


class _Stepper:
    """Simulates one step of the policy as it was recorded."""

    def __init__(self, episode: Episode, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data, self._inputs = model, data, inputs_of(episode)
        period = episode.settings.get("policy_dt_ms") or float(1000 / episode.fps)
        self._substeps = round(period / 1000 / model.opt.timestep)
        ctrl = self._inputs.ctrl
        self._per_tick = self._substeps // ctrl.shape[1] if ctrl is not None else 0
        self._held = [(model.jnt_qposadr[j], model.jnt_dofadr[j]) for j in self._inputs.held]

    def step(self, state: np.ndarray, t: int) -> np.ndarray:
        """The state at observation ``t``, simulated from ``state`` at observation ``t - 1``."""
        model, data, inputs = self._model, self._data, self._inputs
        written = inputs.written[t]
        mujoco.mj_setState(model, data, np.where(np.isnan(written), state, written), _STATE)
        poses = [data.qpos[q : q + 7].copy() for q, _ in self._held]
        for substep in range(self._substeps):
            if inputs.ctrl is not None and substep % self._per_tick == 0:
                tick = substep // self._per_tick
                data.ctrl[:] = inputs.ctrl[t, tick]
                if inputs.mocap is not None:
                    data.mocap_pos[:] = inputs.mocap[t, tick, :, :3]
                    data.mocap_quat[:] = inputs.mocap[t, tick, :, 3:]
            mujoco.mj_step(model, data)
            for (q, v), pose in zip(self._held, poses):
                data.qpos[q : q + 7] = pose
                data.qvel[v : v + 6] = 0
        return _get_state(model, data)


def replay_episode(
    episode: Episode, from_: str, model: mujoco.MjModel | None, data: mujoco.MjData | None
) -> Iterator[tuple[int, mujoco.MjData]]:
    if from_ not in ("states", "actions"):
        raise ValueError(f"from_ is {from_!r}; it must be 'states' or 'actions'")
    states = inputs_of(episode).state
    model = model_of(episode) if model is None else model
    data = mujoco.MjData(model) if data is None else data

    def run() -> Iterator[tuple[int, mujoco.MjData]]:
        stepper = _Stepper(episode, model, data) if from_ == "actions" else None
        state = states[0]
        for t in range(episode.length):
            if stepper is None:
                state = states[t]
            elif t:
                state = stepper.step(state, t)
            set_state(model, data, state)
            yield t, data

    return run()


def _dataset(root: str | Path | Dataset, episodes: Sequence[int] | None) -> Dataset:
    from mjsense.dataset.dataset import Dataset

    if isinstance(root, Dataset):
        if episodes is not None:
            raise ValueError("episodes= cannot be combined with a Dataset; choose them when it is created")
        return root
    return Dataset(root, episodes=episodes)


@checked
def replay(
    root: str | Path | Dataset, *, from_: Literal["states", "actions"] = "states", episodes: Sequence[int] | None = None
) -> Iterator[tuple[Episode, int, mujoco.MjData]]:
    """Replays recorded episodes in plain MuJoCo: yields ``(episode, t, data)`` for every observation.

    Args:
        root: Folder of a recording, or a :class:`Dataset`.
        from_: ``states`` sets every recorded state; ``actions`` sets the first one and then simulates with the recorded controls.
        episodes: Positions of episodes in the recording; by default all.
    """
    for episode in _dataset(root, episodes).episodes:
        for t, data in episode.replay(from_):
            yield episode, t, data


@dataclass(frozen=True)
class Deviation:
    """The first place at which a replayed state differs from the recorded one."""

    step: int
    """Observation."""
    field: str
    """Part of the state: ``qpos``, ``qvel``, ``act``, ``ctrl`` and so on."""
    element: str
    """Joint, body, actuator or equality constraint, and the index inside it."""
    recorded: float
    replayed: float
    count: int
    """Number of values of the state that differ at this step."""

    def __str__(self) -> str:
        return (f"step {self.step}: {self.field} of {self.element}: recorded {self.recorded!r}, replayed {self.replayed!r} "
                f"(difference {self.replayed - self.recorded:.3g}; {self.count} values differ at this step)")  # fmt: skip


@dataclass(frozen=True)
class EpisodeCheck:
    """Result of the replay of one episode; None: every step is equal bit for bit."""

    episode: int
    steps: int
    stepwise: Deviation | None
    """First deviation if each step starts from the recorded state."""
    open_loop: Deviation | None
    """First deviation if only the first state is set."""

    @property
    def ok(self) -> bool:
        """Whether both replays are equal bit for bit."""
        return self.stepwise is None and self.open_loop is None


@dataclass(frozen=True)
class ReplayReport:
    """Result of :func:`check_replay`, one entry per episode. It is true if all episodes are equal."""

    episodes: list[EpisodeCheck]

    @property
    def ok(self) -> bool:
        """Whether all episodes are equal bit for bit."""
        return all(episode.ok for episode in self.episodes)

    def __bool__(self) -> bool:
        return self.ok

    def __repr__(self) -> str:
        equal, steps = sum(e.ok for e in self.episodes), sum(e.steps for e in self.episodes)
        lines = [f"{equal} of {len(self.episodes)} episodes ({steps} steps) replay equal bit for bit"]
        for e in self.episodes:
            lines += [f"  episode {e.episode}, {how}: {d}" for how, d in (("stepwise", e.stepwise), ("open loop", e.open_loop)) if d]
        return "\n".join(lines)


def _named(model: mujoco.MjModel, kind: mujoco.mjtObj, i: int, inside: int) -> str:
    word = kind.name.removeprefix("mjOBJ_").lower()
    return f"{word} '{mujoco.mj_id2name(model, kind, int(i)) or i}'[{inside}]"


def _element(model: mujoco.MjModel, part: str, i: int) -> str:
    """The element to which the value ``i`` of a part of the state belongs."""
    objects = mujoco.mjtObj
    if part == "qpos":
        joint = int(np.searchsorted(model.jnt_qposadr, i, "right")) - 1
        return _named(model, objects.mjOBJ_JOINT, joint, i - model.jnt_qposadr[joint])
    if part in ("qvel", "warmstart", "qfrc_applied"):
        joint = model.dof_jntid[i]
        return _named(model, objects.mjOBJ_JOINT, joint, i - model.jnt_dofadr[joint])
    if part == "ctrl":
        return _named(model, objects.mjOBJ_ACTUATOR, i, 0)
    if part == "act":
        owner = int(np.flatnonzero((model.actuator_actadr <= i) & (i < model.actuator_actadr + model.actuator_actnum))[0])
        return _named(model, objects.mjOBJ_ACTUATOR, owner, i - model.actuator_actadr[owner])
    if part == "xfrc_applied":
        return _named(model, objects.mjOBJ_BODY, i // 6, i % 6)
    if part == "eq_active":
        return _named(model, objects.mjOBJ_EQUALITY, i, 0)
    if part in ("mocap_pos", "mocap_quat"):
        width = 3 if part == "mocap_pos" else 4
        body = int(np.flatnonzero(model.body_mocapid == i // width)[0])
        return _named(model, objects.mjOBJ_BODY, body, i % width)
    return f"value {i}"


def _deviation(model: mujoco.MjModel, t: int, recorded: np.ndarray, replayed: np.ndarray) -> Deviation | None:
    differs = recorded.view(np.uint64) != replayed.view(np.uint64)
    if not differs.any():
        return None
    first = int(differs.argmax())
    part, i = "state", first
    start = 0
    for bit in range(_STATE.bit_length()):
        if not _STATE >> bit & 1:
            continue
        size = mujoco.mj_stateSize(model, 1 << bit)
        if first < start + size:
            part, i = mujoco.mjtState(1 << bit).name.removeprefix("mjSTATE_").lower(), first - start
            break
        start += size
    return Deviation(t, part, _element(model, part, i), float(recorded[first]), float(replayed[first]), int(differs.sum()))


def check_episode(episode: Episode) -> EpisodeCheck:
    model = model_of(episode)
    states, stepper = inputs_of(episode).state, _Stepper(episode, model, mujoco.MjData(model))
    found: dict[str, Any] = {"stepwise": None, "open_loop": None}
    for how in found:
        state = states[0]
        for t in range(1, episode.length):
            state = stepper.step(states[t - 1] if how == "stepwise" else state, t)
            found[how] = _deviation(model, t, states[t], state)
            if found[how]:
                break
    return EpisodeCheck(episode.index, episode.length - 1, **found)


@checked
def check_replay(root: str | Path | Dataset, *, episodes: Sequence[int] | None = None) -> ReplayReport:
    """Replays episodes in plain MuJoCo, stepwise from each recorded state and open loop from the first one, and compares all states bit
    for bit with the recorded ones. The report names the first deviation of each by step, part of the state, and joint, body or actuator.

    Args:
        root: Folder of a recording, or a :class:`Dataset`.
        episodes: Positions of episodes in the recording; by default all.
    """
    return ReplayReport([check_episode(episode) for episode in _dataset(root, episodes).episodes])
