# SPDX-License-Identifier: Apache-2.0
"""Replay of recordings, and its comparison with the recorded states."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mjsense import _libmujoco
from mjsense._arguments import checked
from mjsense._progress import tracked
from mjsense.dataset.dataset import Dataset
from mjsense.dataset.playback import STATE, Stepper, inputs_of, model_of

if TYPE_CHECKING:
    import mujoco

    from mjsense.dataset.episode import Episode
else:
    mujoco = _libmujoco.shared


def _dataset(root: str | Path | Dataset, episodes: Sequence[int] | None) -> Dataset:
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
    for bit in range(STATE.bit_length()):
        if not STATE >> bit & 1:
            continue
        size = mujoco.mj_stateSize(model, 1 << bit)
        if first < start + size:
            part, i = mujoco.mjtState(1 << bit).name.removeprefix("mjSTATE_").lower(), first - start
            break
        start += size
    return Deviation(t, part, _element(model, part, i), float(recorded[first]), float(replayed[first]), int(differs.sum()))


def check_episode(episode: Episode) -> EpisodeCheck:
    model = model_of(episode)
    states, stepper = inputs_of(episode).state, Stepper(episode, model, mujoco.MjData(model))
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
def check_replay(root: str | Path | Dataset, *, episodes: Sequence[int] | None = None, progress: bool | None = None) -> ReplayReport:
    """Replays episodes in plain MuJoCo, stepwise from each recorded state and open loop from the first one, and compares all states bit
    for bit with the recorded ones. The report names the first deviation of each by step, part of the state, and joint, body or actuator.

    Args:
        root: Folder of a recording, or a :class:`Dataset`.
        episodes: Positions of episodes in the recording; by default all.
        progress: Show the progress on stderr; by default where it is a terminal or a notebook.
    """
    chosen = _dataset(root, episodes).episodes
    return ReplayReport([check_episode(episode) for episode in tracked(chosen, len(chosen), "episodes", enabled=progress)])
