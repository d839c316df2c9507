# SPDX-License-Identifier: Apache-2.0
"""Replay of recordings, and its comparison with the recorded states."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mjsense.core import libmujoco
from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.core.mujoco_names import Obj, id2name
from mjsense.core.old_names import old_argument
from mjsense.core.progress_line import counter
from mjsense.dataset.dataset import Dataset, opened
from mjsense.dataset.deviation import Deviation
from mjsense.dataset.episode_worlds import OwnStepper
from mjsense.dataset.playback import Stepper, check_unchanged, inputs_of, model_of
from mjsense.dataset.sensor_check import SensorCheck, check_sensors

if TYPE_CHECKING:
    import mujoco

    from mjsense.dataset.episode import Episode
else:
    mujoco = libmujoco.shared


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
    for episode in opened(root, episodes).episodes:
        for t, data in episode.replay(from_):
            yield episode, t, data


@dataclass(frozen=True)
class EpisodeCheck:
    """Result of the replay of one episode."""

    episode: int
    """Position in the recording."""
    steps: int
    stepwise: Deviation | None = None
    """First deviation of the simulation if each step starts from the recorded state; None: equal bit for bit, or not
    simulated."""
    open_loop: Deviation | None = None
    """The same if only the first state is set."""
    sensors: SensorCheck | None = None
    """Comparison of the sensors; None: not compared."""
    refused: str = ""
    """Why the episode cannot be simulated."""

    @property
    def deviations(self) -> dict[str, Deviation]:
        """All deviations: ``stepwise``, ``open loop``, or the name of a stream."""
        found = {name: one for name, one in (("stepwise", self.stepwise), ("open loop", self.open_loop)) if one}
        return found | {one.field: one for one in (self.sensors.deviations if self.sensors else ())}

    @property
    def ok(self) -> bool:
        """Whether everything that was compared is equal bit for bit, and the episode can be simulated."""
        return not self.deviations and not self.refused


@dataclass(frozen=True)
class ReplayReport:
    """Result of :func:`check_replay`, one entry per episode. It is true if all episodes are equal."""

    episodes: list[EpisodeCheck]

    @property
    def ok(self) -> bool:
        """Whether everything that was compared is equal bit for bit."""
        return all(episode.ok for episode in self.episodes)

    def __bool__(self) -> bool:
        return self.ok

    def __repr__(self) -> str:
        equal, steps = sum(e.ok for e in self.episodes), sum(e.steps for e in self.episodes)
        lines = [f"{equal} of {len(self.episodes)} episodes ({counted(steps, 'step')}) replay equal bit for bit"]
        checks = [e.sensors for e in self.episodes if e.sensors]
        if checks:
            streams = {name for check in checks for name in (*check.equal, *(found.field for found in check.deviations))}
            lines.append(f"{len(streams)} streams were computed from the states and compared")
            reasons: dict[str, set[str]] = {}
            for check in checks:
                for name, reason in check.not_computed.items():
                    reasons.setdefault(reason, set()).add(name)
            lines += [f"not computed: {', '.join(sorted(names))}: {reason}" for reason, names in sorted(reasons.items())]
        for e in self.episodes:
            lines += [f"  episode {e.episode}, {how}: {found}" for how, found in e.deviations.items()] + [
                f"  {e.refused}"
            ] * bool(e.refused)
        return "\n".join(lines)

    def to_dict(self) -> dict[str, Any]:
        """The report as JSON objects."""
        return {"ok": self.ok, "episodes": [asdict(episode) | {"ok": episode.ok} for episode in self.episodes]}


def _element(model: mujoco.MjModel, part: str, i: int) -> str:
    """The element to which the value ``i`` of a part of the state belongs."""

    def named(kind: Obj, element: int, inside: int) -> str:
        return f"{kind.name.lower()} '{id2name(model, kind, int(element)) or element}'[{inside}]"

    if part == "qpos":
        joint = int(np.searchsorted(model.jnt_qposadr, i, "right")) - 1
        return named(Obj.JOINT, joint, i - model.jnt_qposadr[joint])
    if part in ("qvel", "warmstart", "qfrc_applied"):
        joint = model.dof_jntid[i]
        return named(Obj.JOINT, joint, i - model.jnt_dofadr[joint])
    if part == "ctrl":
        return named(Obj.ACTUATOR, i, 0)
    if part == "act":
        owner = int(np.flatnonzero((model.actuator_actadr <= i) & (i < model.actuator_actadr + model.actuator_actnum))[0])
        return named(Obj.ACTUATOR, owner, i - model.actuator_actadr[owner])
    if part == "xfrc_applied":
        return named(Obj.BODY, i // 6, i % 6)
    if part == "eq_active":
        return named(Obj.EQUALITY, i, 0)
    if part in ("mocap_pos", "mocap_quat"):
        width = 3 if part == "mocap_pos" else 4
        body = int(np.flatnonzero(model.body_mocapid == i // width)[0])
        return named(Obj.BODY, body, i % width)
    return f"value {i}"


def _deviation(stepper: Stepper, t: int, recorded: np.ndarray, replayed: np.ndarray) -> Deviation | None:
    differs = recorded.view(np.uint64) != replayed.view(np.uint64)
    if not differs.any():
        return None
    first = int(differs.argmax())
    part, i = stepper.part(first)
    return Deviation(
        t, part, _element(stepper.model, part, i), float(recorded[first]), float(replayed[first]), int(differs.sum())
    )


def _stepper(episode: Episode) -> Stepper:
    if mujoco is None:
        return OwnStepper(episode)
    model = model_of(episode)
    return Stepper(episode, model, mujoco.MjData(model))


def check_episode(episode: Episode) -> EpisodeCheck:
    states = inputs_of(episode).state
    try:
        check_unchanged(episode)
    except ValueError as error:
        return EpisodeCheck(episode.index, episode.length - 1, refused=str(error))
    stepper = _stepper(episode)
    found: dict[str, Any] = {"stepwise": None, "open_loop": None}
    for how in found:
        state = states[0]
        for t in range(1, episode.length):
            state = stepper.step(states[t - 1] if how == "stepwise" else state, t)
            found[how] = _deviation(stepper, t, states[t], state)
            if found[how]:
                break
    return EpisodeCheck(episode.index, episode.length - 1, **found)


@old_argument("worlds", "num_worlds")
@checked
def check_replay(
    root: str | Path | Dataset,
    *,
    actions: bool = True,
    states: bool = False,
    episodes: Sequence[int] | None = None,
    num_worlds: int = 4,
    threads: int = 0,
    progress: bool | Callable[[int, int], None] | None = None,
) -> ReplayReport:
    """Replays recorded episodes and compares everything bit for bit with the recording.

    The report names the first deviation of each kind by step, part of the state or stream, and joint, body or index.

    Args:
        root: Folder of a recording, or a :class:`Dataset`.
        actions: Simulate in plain MuJoCo (without the package ``mujoco``: in mjsense's own copy of it) with the recorded
            controls, stepwise from each recorded state and open loop from the first one, and compare the states.
        states: Build the recording's task again, repeat each step from the recorded state, and compare every stream, rewards and
            success. Depth is compared bit for bit, rgb by its video, because the encoder makes equal files of equal images.
            Streams of the policy, and others that cannot be computed, are listed with the reason.
        episodes: Positions of episodes in the recording; by default all.
        num_worlds: Number of episodes whose sensors are computed in parallel.
        threads: Number of threads that compute sensors; 0: one per available CPU.
        progress: Show the progress on stderr, or a function that is called with the number of checks done and of all; by default
            shown where stderr is a terminal or a notebook.
    """
    chosen = opened(root, episodes).episodes
    checks: dict[int, EpisodeCheck] = {}
    report, done, total = counter("checks", progress), 0, len(chosen) * (actions + states)
    for episode in chosen if actions else ():
        checks[episode.index] = check_episode(episode)
        done += 1
        report(done, total)
    for episode, sensors in check_sensors(chosen, worlds=num_worlds, threads=threads) if states else ():
        made = checks.get(episode.index) or EpisodeCheck(episode.index, episode.length - 1)
        checks[episode.index] = replace(made, sensors=sensors)
        done += 1
        report(done, total)
    return ReplayReport([checks[index] for index in sorted(checks)])
