# SPDX-License-Identifier: Apache-2.0
"""A simulation of a recording's archived model, whose worlds show recorded episodes. It works with or without the package ``mujoco``."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _mujoco
from mjsense._options import PREFIX
from mjsense._randomizable import check_randomizable, field_of
from mjsense.configs import SceneCfg
from mjsense.dataset import playback
from mjsense.dataset.files import open_h5
from mjsense.scene import Scene
from mjsense.simulation import Simulation

if TYPE_CHECKING:
    from mjsense.dataset.episode import Episode

_LIGHT = ("light_ambient", "light_diffuse", "light_specular")
# Elements that sensors and edits may add to the archived model, which renumbers the others.
_RENUMBERED = {"cam": (_mujoco.Obj.CAMERA, "ncam"), "light": (_mujoco.Obj.LIGHT, "nlight"), "site": (_mujoco.Obj.SITE, "nsite")}

_PARTS = ["time", "qpos", "qvel", "act", "qacc_warmstart", "ctrl", "qfrc_applied", "xfrc_applied", "eq_active", "mocap_pos", "mocap_quat", "userdata"]


def _model_fields(episode: Episode) -> dict[str, np.ndarray]:
    with open_h5(episode.path) as file:
        return {name: dataset[:] for name, dataset in file[episode.trajectory].get("replay/model", {}).items()}


def recorded_options(episode: Episode) -> dict[str, np.ndarray]:
    """Options in which the model of an episode differs from the archived one, ``opt.gravity``; NaN: the same."""
    with open_h5(episode.path) as file:
        return {name: data[:] for name, data in file[episode.trajectory].get("replay/model", {}).items() if name.startswith(PREFIX)}


class EpisodeWorlds:
    """Worlds of the archived model. :meth:`begin` gives a world the model of an episode.

    Args:
        episode: Any episode of the recording.
        num_worlds: Number of worlds.
        sensors: Sensors of the scene.
        edit: Edits the spec before it is compiled. Bodies, joints and geoms must stay as they are.
        brightness: Factor of all lights.
        threads: Number of threads; 0: one per available CPU.
    """

    def __init__(
        self, episode: Episode, num_worlds: int, sensors: Sequence[Any] = (), *, edit: Callable[[Any], None] | None = None,
        brightness: float = 1.0, threads: int = 0,
    ) -> None:  # fmt: skip
        self._brightness = brightness

        def edit_spec(spec: Any) -> None:
            if brightness != 1.0:
                for light in [*spec.lights, spec.visual.headlight]:
                    for name in _LIGHT:
                        field = name.removeprefix("light_")
                        setattr(light, field, brightness * np.array(getattr(light, field)))
            if edit is not None:
                edit(spec)

        archive = playback.archive_of(episode)
        with tempfile.TemporaryDirectory(prefix="mjsense") as folder:
            for name, data in playback.read_archive(archive).items():
                (Path(folder) / name).parent.mkdir(parents=True, exist_ok=True)
                (Path(folder) / name).write_bytes(data)
            model_file = Path(folder) / playback.MODEL_FILE
            recorded = Scene(SceneCfg(base=model_file)).model
            self.scene = Scene(SceneCfg(base=model_file, sensors=tuple(sensors), spec_fn=edit_spec))
        self.sim = Simulation(self.scene, num_worlds, threads=threads)
        self._rows: dict[str, Any] = {}
        for prefix, (kind, count) in _RENUMBERED.items():
            before, now = ([_mujoco.id2name(m, kind, i) for i in range(getattr(m, count))] for m in (recorded, self.sim.model))
            kept = [i for i, name in enumerate(now) if name in before]  # additions have new names
            if len(kept) == len(before) < len(now):
                self._rows[prefix] = kept
        self._recorded = recorded
        self._changed: list[set[str]] = [set() for _ in range(num_worlds)]

    def begin(self, world: int, episode: Episode) -> None:
        """Gives a world the model of an episode, and resets its sensors."""
        sim, fields = self.sim, _model_fields(episode)
        stored = playback.inputs_of(episode).state.shape[1]
        if stored != sim.state.shape[1]:
            raise ValueError(f"{playback.where(episode)}: the recorded state has {stored} numbers, that of the model has {sim.state.shape[1]}. "
                             "An edit must not add joints, actuators or bodies.")  # fmt: skip
        for name in self._changed[world] - fields.keys():
            self._write(world, name, np.array(field_of(sim.model, name)))
        for name, values in fields.items():
            self._write(world, name, self._field(episode, name, values))
        self._changed[world] = set(fields)
        sim.reset([world])
        sim._core.model_changed([world], False)

    def _write(self, world: int, name: str, values: np.ndarray) -> None:
        if name.startswith(PREFIX):
            check_randomizable(self.sim.model, name)
        rows = self.sim._core.model_field(name).view(values.dtype)
        rows[world] = values.ravel()[: rows.shape[1]]  # of bvh_aabb a world has the boxes of bodies, not those of meshes

    def _field(self, episode: Episode, name: str, values: np.ndarray) -> np.ndarray:
        """A field of the model of an episode, with the rows of this scene."""
        before, now = field_of(self._recorded, name), np.array(field_of(self.sim.model, name))
        if before.size != values.size:
            raise ValueError(f"{playback.where(episode)}: replay/model/{name} has {values.size} numbers, the field of the archived model {before.size}")
        values = values.reshape(before.shape)
        if values.dtype.kind == "f":
            values = np.where(np.isnan(values), before, values)
        if name in _LIGHT:
            values = self._brightness * values
        rows = self._rows.get(name.split("_")[0])
        if rows is not None:
            now[rows] = values
            return now
        if now.shape != values.shape:
            raise ValueError(f"{playback.where(episode)}: the edited model has another shape of '{name}': {now.shape} instead of {values.shape}. "
                             "Only cameras, lights, sites with names, and sensors can be added.")  # fmt: skip
        return values


class OwnStepper(playback.Stepper):
    """Simulates with the MuJoCo that mjsense contains, for environments without a ``mujoco`` of its series."""

    def __init__(self, episode: Episode) -> None:
        worlds = EpisodeWorlds(episode, 1, threads=1)
        worlds.begin(0, episode)
        self._sim = sim = worlds.sim
        fields = ("ctrl", "qpos", "qvel", "mocap_pos", "mocap_quat")
        super().__init__(episode, sim.model, SimpleNamespace(**{name: getattr(sim, name)[0] for name in fields}))

    def _set_state(self, state: np.ndarray) -> None:
        show_states(self._sim, [0], [state])

    def _advance(self) -> None:
        self._sim.step_raw()

    def _get_state(self) -> np.ndarray:
        return self._sim.state[0].copy()

    def part(self, i: int) -> tuple[str, int]:
        sim = self._sim
        for name in _PARTS:
            values = sim._component(name)
            inside = i - (values.ctypes.data - sim.state.ctypes.data) // sim.state.itemsize
            if 0 <= inside < values.size:  # of the only world
                return name.removeprefix("qacc_"), inside
        return "state", i


def show_states(sim: Simulation, world_ids: Sequence[int], states: Sequence[np.ndarray]) -> None:
    """Sets worlds to these states; derived quantities follow when they are read."""
    rows = sim.state
    for world, state in zip(world_ids, states):
        rows[world] = state
    sim.invalidate(world_ids)
