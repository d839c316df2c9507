# SPDX-License-Identifier: Apache-2.0
"""``mjlab.utils.spec_config``: edits of an entity's spec. Edits of geoms are supported; make other edits in ``spec_fn``."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

import mujoco

from mjsense.compat.mjlab._names import matching, value_of

_STRUCTURE = ("contype", "conaffinity", "condim", "priority")
_CONDIMS: tuple[Any, ...] = (1, 3, 4, 6)
_ARRAYS = ("friction", "solref", "solimp")


def _set(geom: Any, name: str, value: Any) -> None:
    if value is None:
        return
    if name == "condim" and value not in _CONDIMS:
        raise ValueError(f"condim of geom '{geom.name}' is {value}: must be 1, 3, 4 or 6")
    if name in _ARRAYS:
        getattr(geom, name)[: len(value)] = value
    else:
        setattr(geom, name, value)


@dataclass(kw_only=True)
class _Tuning:
    friction: Any = None
    solref: Any = None
    solimp: Any = None
    margin: Any = None
    gap: Any = None
    solmix: Any = None


_TUNING = tuple(field.name for field in fields(_Tuning))


@dataclass
class GeomCfg(_Tuning):
    """Changes the given properties of the geoms that an expression matches. Values may be mappings from expressions."""

    geom_names_expr: tuple[str, ...]
    group: Any = None
    contype: Any = None
    conaffinity: Any = None
    condim: Any = None
    priority: Any = None

    def edit_spec(self, spec: mujoco.MjSpec) -> None:
        """Raises ValueError for a condim that MuJoCo does not have."""
        chosen = set(matching(self.geom_names_expr, [geom.name for geom in spec.geoms]))
        for geom in spec.geoms:
            for name in ("group", *_STRUCTURE, *_TUNING) if geom.name in chosen else ():
                _set(geom, name, value_of(getattr(self, name), geom.name))


@dataclass
class CollisionCfg(_Tuning):
    """Sets contype, conaffinity, condim and priority of the geoms that an expression matches.

    Collisions of all other geoms are disabled, unless ``disable_other_geoms`` is False.
    """

    geom_names_expr: tuple[str, ...]
    contype: Any
    conaffinity: Any
    condim: Any
    priority: Any
    disable_other_geoms: bool = True

    def edit_spec(self, spec: mujoco.MjSpec) -> None:
        """Raises ValueError if a mapping has no value for a geom, or for a condim that MuJoCo does not have."""
        chosen = set(matching(self.geom_names_expr, [geom.name for geom in spec.geoms]))
        for geom in spec.geoms:
            if geom.name not in chosen:
                if self.disable_other_geoms:
                    geom.contype = geom.conaffinity = 0
                continue
            for name in (*_STRUCTURE, *_TUNING):
                value = value_of(getattr(self, name), geom.name)
                if value is None and name in _STRUCTURE:
                    raise ValueError(f"CollisionCfg: {name} has no value for geom '{geom.name}': end the mapping with '.*'")
                _set(geom, name, value)
