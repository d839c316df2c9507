# SPDX-License-Identifier: Apache-2.0
"""The spec of a scene for functions that edit it, in environments whose ``mujoco`` is of another series or missing.

It has the attributes of ``mujoco.MjSpec`` that edits use: lists of elements, look-ups by name, ``add_...`` methods, and the
fields of elements. Enumerators may come from any version of ``mujoco``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NoReturn

import numpy as np

from mjsense import _core
from mjsense.core import libmujoco
from mjsense.core.mujoco_names import Obj
from mjsense.core.mujoco_views import array_of

_LISTS = {
    "bodies": Obj.BODY,
    "geoms": Obj.GEOM,
    "joints": Obj.JOINT,
    "sites": Obj.SITE,
    "cameras": Obj.CAMERA,
    "lights": Obj.LIGHT,
    "frames": Obj.FRAME,
    "actuators": Obj.ACTUATOR,
    "sensors": Obj.SENSOR,
    "pairs": Obj.PAIR,
    "excludes": Obj.EXCLUDE,
    "equalities": Obj.EQUALITY,
    "tendons": Obj.TENDON,
    "numerics": Obj.NUMERIC,
    "texts": Obj.TEXT,
    "keys": Obj.KEY,
    "meshes": Obj.MESH,
    "hfields": Obj.HFIELD,
    "textures": Obj.TEXTURE,
    "materials": Obj.MATERIAL,
}
_IN_BODIES = (Obj.BODY, Obj.GEOM, Obj.JOINT, Obj.SITE, Obj.CAMERA, Obj.LIGHT)
RENUMBERED = {"mjEQ_DISTANCE": 7, "mjDYN_USER": 7, "mjGAIN_USER": 6, "mjBIAS_USER": 5}
"""Enumerators of mjSpec that had other values in an earlier version."""


class _Fields:
    """Fields of an mjs struct as attributes."""

    def __init__(self, owner: Any, fields: dict[str, Any]) -> None:
        self.__dict__.update(_owner=owner, _fields=fields)

    def _missing(self, name: str) -> NoReturn:
        raise AttributeError(f"a scene's spec in Python has no '{name}' here: {libmujoco.explain()}")

    def __getattr__(self, name: str) -> Any:
        field = self._fields.get(name)
        if field is None:
            if name.startswith("__"):
                raise AttributeError(name)
            self._missing(name)
        if isinstance(field, dict):
            return _Fields(self._owner, field)
        address, kind, shape = field
        if shape is None:
            return _core.read_spec_field(address, kind)
        value = array_of(self._owner, address, kind, shape)
        return value.item() if shape == () else value

    def __setattr__(self, name: str, value: Any) -> None:
        field = self._fields.get(name)
        if field is None or isinstance(field, dict):
            self._missing(name)
        address, kind, shape = field
        if shape is None:
            _core.write_spec_field(address, kind, value if isinstance(value, str) else [*value])
            return
        target = array_of(self._owner, address, kind, shape)
        if shape == ():
            target[...] = RENUMBERED.get(getattr(value, "name", ""), value)
            return
        value = np.atleast_1d(np.asarray(value))
        if value.ndim > 1 or len(value) > len(target):
            raise ValueError(f"{name}: {value.tolist()} has more than {len(target)} numbers")
        target[: len(value)] = value

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), *self._fields})


class _Owner(_Fields):
    """What has elements: the spec, or a body."""

    _spec: MjSpecView

    def _add(self, kind: Obj, default: Any, given: dict[str, Any]) -> MjsView:
        parent = 0 if self is self._spec else self._element  # of MjsView
        if (address := _core.spec_add(self._spec._address, parent, kind, default)) == 0:
            self._missing(f"add_{kind.name.lower()}")
        made = MjsView(self._spec, address)
        try:
            for name, value in given.items():
                setattr(made, name, value)
        except Exception:
            _core.spec_delete(self._spec._address, address)
            raise
        return made

    def _elements(self, kind: Obj) -> list[int]:
        raise NotImplementedError

    def __getattr__(self, name: str) -> Any:
        if name in _LISTS:
            return [MjsView(self._spec, address) for address in self._elements(_LISTS[name])]
        kind = Obj.__members__.get(name.removeprefix("add_").upper()) if name.startswith("add_") else None
        if kind is not None and (kind in _IN_BODIES) == (self is not self._spec):

            def add(default: Any = None, **given: Any) -> MjsView:
                return self._add(kind, default, given)

            return add
        return super().__getattr__(name)


class MjsView(_Owner):
    """An element of a spec: a body, geom, sensor ..."""

    def __init__(self, spec: MjSpecView, element: int) -> None:
        super().__init__(spec._owner, _core.element_fields(element))
        self.__dict__.update(_spec=spec, _element=element)

    def _elements(self, kind: Obj) -> list[int]:
        return _core.spec_children(self._element, kind, False)

    @property
    def name(self) -> str:
        return _core.element_name(self._element)

    @property
    def parent(self) -> MjsView | None:
        """The body that it belongs to."""
        address = _core.element_parent(self._element)
        return MjsView(self._spec, address) if address else None

    def __setattr__(self, name: str, value: Any) -> None:
        if name == "name":
            _core.set_element_name(self._element, value)
        else:
            super().__setattr__(name, value)

    def add_freejoint(self, **given: Any) -> MjsView:
        return self._add(Obj.JOINT, None, {"type": 0, **given})

    def __eq__(self, other: object) -> bool:
        return isinstance(other, MjsView) and other._element == self._element

    def __hash__(self) -> int:
        return hash(self._element)

    def __repr__(self) -> str:
        return f"<{Obj(_core.element_kind(self._element)).name.lower()} '{self.name}' of a scene's spec>"


class MjSpecView(_Owner):
    """An mjSpec."""

    def __init__(self, owner: _core.Spec) -> None:
        super().__init__(owner, _core.spec_fields(owner.address))
        self.__dict__.update(_spec=self, _address=owner.address)

    def _elements(self, kind: Obj) -> list[int]:
        return _core.spec_elements(self._address, kind)

    @property
    def worldbody(self) -> MjsView:
        return self.bodies[0]

    def __getattr__(self, name: str) -> Any:
        kind = Obj.__members__.get(name.upper())
        if kind is not None and kind in _LISTS.values():
            return self._find(kind)
        return super().__getattr__(name)

    def _find(self, kind: Obj) -> Callable[[str], MjsView | None]:
        def find(name: str) -> MjsView | None:
            return next((MjsView(self, e) for e in self._elements(kind) if _core.element_name(e) == name), None)

        return find

    def delete(self, element: MjsView) -> None:
        """Removes an element."""
        _core.spec_delete(self._address, element._element)


def new_spec(base: str | None) -> Any:
    """An empty spec, or that of XML text or of a file."""
    if libmujoco.shared is None:
        return MjSpecView(_core.Spec(base))
    spec = libmujoco.shared.MjSpec
    if base is None:
        return spec()
    try:
        return spec.from_string(base) if base.lstrip().startswith("<") else spec.from_file(base)
    except UnicodeDecodeError as error:  # MuJoCo has cut its message inside of a character
        raise ValueError(error.object.decode(errors="replace")) from None
