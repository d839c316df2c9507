# SPDX-License-Identifier: Apache-2.0
"""The models of a simulation's worlds: copies for look-ups, fields that differ between worlds, and changes of them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.core import mujoco_names, mujoco_views
from mjsense.core.errors import did_you_mean
from mjsense.scene import physics_options
from mjsense.scene.randomizable import bounds_of_meshes, check_randomizable, field_of, valid_values
from mjsense.scene.read_only_model import read_only

if TYPE_CHECKING:
    import mujoco


class WorldModels:
    """The models of the worlds of a C++ simulation."""

    def __init__(self, core: Any) -> None:
        self._core = core
        self._shared: mujoco.MjModel | None = None
        self._copies: dict[int, mujoco.MjModel] = {}
        self._version = 0
        self._fields: dict[str, np.ndarray] = {}

    @property
    def shared(self) -> mujoco.MjModel:
        """A read-only copy of the model that all worlds were made of."""
        if self._shared is None:
            self._shared = read_only(mujoco_views.model_of(self._core.copy_model()))
        return self._shared

    def of(self, world: int) -> mujoco.MjModel:
        """The copy with the values of one world, which are read anew."""
        if world not in self._copies:
            self._copies[world] = mujoco_views.model_of(self._core.copy_model())
        self._core.write_model(world, self._copies[world]._address)
        return self._copies[world]

    def copies(self) -> list[mujoco.MjModel]:
        """All copies made so far."""
        return [*([] if self._shared is None else [self._shared]), *self._copies.values()]

    def follow(self) -> None:
        """Updates the copies that of() has created."""
        version = self._core.model_version()
        if version != self._version:
            for world in self._copies:
                self.of(world)
            self._version = version

    def field(self, name: str) -> np.ndarray:
        """A field with one value per world, ``[B, ...]``, live."""
        if name not in self._fields or self._core.closed:
            like = field_of(self.shared, name)
            if not isinstance(like, np.ndarray):
                if name.startswith(physics_options.PREFIX):
                    option = name.removeprefix(physics_options.PREFIX)
                    raise AttributeError(
                        f"MuJoCo has no option '{option}'{did_you_mean(option, physics_options.names(), 'there are')}"
                    )
                arrays = [field for field in dir(self.shared) if isinstance(getattr(self.shared, field, None), np.ndarray)]
                raise AttributeError(f"mjModel has no array '{name}'{did_you_mean(name, arrays)}")
            values = self._core.model_field(name)
            self._fields[name] = values.view(like.dtype).reshape(self._core.num_worlds, *like.shape)
        return self._fields[name]

    def timestep_changed(self) -> None:
        """Makes the copies have the new time step."""
        self._shared = None
        self.follow()

    def clear(self) -> None:
        """Forgets the live arrays."""
        self._fields.clear()

    def randomize(self, field: str, values: Any, worlds: np.ndarray) -> bool:
        """Sets a field in these worlds, and what MuJoCo derives from it. If MuJoCo cannot use the values, nothing changes.

        Args:
            worlds: Ids of worlds, int ``[n]``.

        Returns:
            Whether derived quantities can be computed now: not while the simulation is running, when only options can be set.
        """
        check_randomizable(self.shared, field)
        target = self.field(field)
        before = target[worlds].copy()
        target[worlds] = valid_values(self.shared, field, values, before, worlds)
        if field.startswith(physics_options.PREFIX):
            ready = self._core.options_changed()
            self.follow()
            return ready
        if field == "geom_dataid":
            now = {name: self.field(name)[worlds] for name in ("geom_size", "geom_aabb", "geom_rbound")}
            for name, new in bounds_of_meshes(self.shared, target[worlds], now).items():
                self.field(name)[worlds] = new
        has_derived = field in _core.setconst_inputs()
        try:
            self._changed(worlds, has_derived)
        except ValueError as error:
            target[worlds] = before
            self._changed(worlds, has_derived)
            named = re.sub(r"\bbody (\d+)", lambda match: f"body '{self.shared.body(int(match[1])).name}'", str(error))
            raise ValueError(f"{field}: {named}") from None
        self.follow()
        return True

    def _changed(self, worlds: np.ndarray, has_derived: bool) -> None:
        """``has_derived``: MuJoCo derives values from what was written. It would give all meshes the radius that the shared model
        has."""
        meshes = np.flatnonzero(self.shared.geom_type == mujoco_names.Geom.MESH) if has_derived else []
        radii = self.field("geom_rbound")[:, meshes] if len(meshes) else None
        try:
            self._core.model_changed(worlds.tolist(), has_derived)
        finally:
            if radii is not None:
                self.field("geom_rbound")[:, meshes] = radii
