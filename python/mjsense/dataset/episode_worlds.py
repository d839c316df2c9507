# SPDX-License-Identifier: Apache-2.0
"""A simulation of a recording's archived model, whose worlds show recorded episodes. It works with or without the package
``mujoco``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense.core import mujoco_names
from mjsense.dataset import playback
from mjsense.dataset.archive import MODEL_FILE, read_archive
from mjsense.dataset.closed_model import check_compiled, closed_model, compiling
from mjsense.dataset.model_fields import check_inputs
from mjsense.scene.randomizable import field_of
from mjsense.scene.scene import Scene
from mjsense.sensors.configs import SceneCfg
from mjsense.sim.simulation import Simulation

if TYPE_CHECKING:
    from mjsense.dataset.episode import Episode

_LIGHT = ("light_ambient", "light_diffuse", "light_specular")
# Elements that sensors and edits may add to the archived model, which renumbers the others.
_RENUMBERED = {
    "cam": (mujoco_names.Obj.CAMERA, "ncam"),
    "light": (mujoco_names.Obj.LIGHT, "nlight"),
    "site": (mujoco_names.Obj.SITE, "nsite"),
}


class _ArchivedSceneCfg(SceneCfg):
    """A scene whose base is the model of an archive, of which nothing is read from disk."""

    def __init__(self, text: str, members: dict[str, bytes], **more: Any) -> None:
        super().__init__(base=text, **more)
        object.__setattr__(self, "_mjs_members", members)  # C++ reads it


class EpisodeWorlds:
    """Worlds of the archived model. :meth:`begin` gives a world the model of an episode.

    Args:
        episode: Any episode of the recording.
        num_worlds: Number of worlds.
        sensors: Sensors of the scene.
        edit: Edits the spec before it is compiled. Bodies, joints and geoms must stay as they are.
        check: Is called with the archived model.
        brightness: Factor of all lights.
        threads: Number of threads; 0: one per available CPU.
    """

    def __init__(
        self,
        episode: Episode,
        num_worlds: int,
        sensors: Sequence[Any] = (),
        *,
        edit: Callable[[Any], None] | None = None,
        check: Callable[[Any], None] | None = None,
        brightness: float = 1.0,
        threads: int = 0,
    ) -> None:
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
        members = read_archive(archive)
        text = closed_model(members.pop(MODEL_FILE), members, f"{archive}: {MODEL_FILE}")
        with compiling(str(archive)):
            recorded = Scene(_ArchivedSceneCfg(text, members)).model
        check_compiled(recorded, str(archive))
        if check is not None:
            check(recorded)
        self.scene = Scene(_ArchivedSceneCfg(text, members, sensors=tuple(sensors), spec_fn=edit_spec))
        self.sim = Simulation(self.scene, num_worlds, threads=threads)
        self._rows: dict[str, Any] = {}
        for prefix, (kind, count) in _RENUMBERED.items():
            before, now = (
                [mujoco_names.id2name(m, kind, i) for i in range(getattr(m, count))] for m in (recorded, self.sim.model)
            )
            kept = [i for i, name in enumerate(now) if name in before]  # additions have new names
            if len(kept) == len(before) < len(now):
                self._rows[prefix] = kept
        self._recorded = recorded
        self._changed: list[set[str]] = [set() for _ in range(num_worlds)]

    def begin(self, world: int, episode: Episode) -> None:
        """Gives a world the model of an episode, and resets its sensors."""
        sim, fields = self.sim, playback.fields_of(episode, self._recorded)
        stored = playback.inputs_of(episode).state.shape[1]
        if stored != sim.state.shape[1]:
            raise ValueError(
                f"{playback.where(episode)}: the recorded state has {stored} numbers, that of the model has "
                f"{sim.state.shape[1]}. "
                "An edit must not add joints, actuators or bodies."
            )
        check_inputs(
            playback.inputs_of(episode),
            self._recorded,
            stored,
            playback.substeps_of(episode, self._recorded),
            playback.where(episode),
        )
        for name in self._changed[world] - fields.keys():
            self._write(world, name, np.array(field_of(sim.model, name)))
        for name, values in fields.items():
            self._write(world, name, self._field(episode, name, values))
        self._changed[world] = set(fields)
        sim.reset([world])
        sim._core.model_changed([world], False)

    def _write(self, world: int, name: str, values: np.ndarray) -> None:
        rows = self.sim._core.model_field(name).view(values.dtype)
        rows[world] = values.ravel()[: rows.shape[1]]  # of bvh_aabb a world has the boxes of bodies, not those of meshes

    def _field(self, episode: Episode, name: str, values: np.ndarray) -> np.ndarray:
        """A field of the model of an episode, with the rows of this scene."""
        before, now = np.atleast_1d(field_of(self._recorded, name)), np.array(np.atleast_1d(field_of(self.sim.model, name)))
        if values.dtype.kind == "f":
            values = np.where(np.isnan(values), before, values)
        if name in _LIGHT:
            values = self._brightness * values
        rows = self._rows.get(name.split("_")[0])
        if rows is not None:
            now[rows] = values
            return now
        if now.shape != values.shape:
            raise ValueError(
                f"{playback.where(episode)}: the edited model has another shape of '{name}': {now.shape} instead of "
                f"{values.shape}. "
                "Only cameras, lights, sites with names, and sensors can be added."
            )
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
        for name in mujoco_names.STATE:
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
