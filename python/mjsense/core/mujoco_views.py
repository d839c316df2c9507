# SPDX-License-Identifier: Apache-2.0
"""MuJoCo's Python objects: those of the environment's ``mujoco`` if it is of the series that mjsense is built for, else views.

A view has the attributes of ``mujoco.MjModel`` or ``mujoco.MjData``: numbers, NumPy arrays on the memory of the struct, ``opt``,
``vis``, ``stat``, contacts, and the elements by name (``model.geom("box").size``). MuJoCo's functions cannot take it.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np

from mjsense import _core
from mjsense.core import libmujoco
from mjsense.core.mujoco_names import rows_of_joint

if TYPE_CHECKING:
    import mujoco


def model_of(address: int) -> mujoco.MjModel:
    """An mjModel as a Python object, which owns it from now on."""
    if libmujoco.shared is not None:
        return libmujoco.shared.MjModel._from_model_ptr(address)
    return MjModelView(_core.OwnedModel.take(address))  # has its attributes


def data_of(model: Any) -> mujoco.MjData:
    """A new mjData of a model."""
    if libmujoco.shared is not None:
        return libmujoco.shared.MjData(model)
    return MjDataView(model)  # has its attributes


class _Memory:
    """Memory that NumPy arrays share; keeps its owner alive."""

    def __init__(self, owner: Any, address: int, dtype: np.dtype, shape: tuple[int, ...]) -> None:
        self._owner = owner
        self.__array_interface__ = {"data": (address, False), "typestr": f"|V{dtype.itemsize}", "shape": shape, "version": 3}


def array_of(owner: Any, address: int, kind: Any, shape: tuple[int, ...]) -> np.ndarray:
    """An array on memory that `owner` keeps; records for the fields of a struct."""
    dtype = np.dtype(kind)
    if 0 in shape or address == 0:
        array = np.zeros(shape, dtype)
    else:
        array = np.asarray(_Memory(owner, address, dtype, shape)).view(dtype)
    return array.view(np.recarray) if dtype.names else array


class _Struct:
    """The fields of a struct as attributes."""

    def __init__(self, owner: Any, fields: dict[str, Any]) -> None:
        self.__dict__.update(_owner=owner, _fields=fields, _arrays={})

    def _get(self, name: str) -> Any:
        """A struct or an array; scalars are arrays of the shape ()."""
        if name not in self._arrays:
            field = self._fields[name]
            self._arrays[name] = _Struct(self._owner, field) if isinstance(field, dict) else array_of(self._owner, *field)
        return self._arrays[name]

    def _missing(self, name: str) -> NoReturn:
        raise AttributeError(f"'{type(self).__name__}' object has no attribute '{name}'")

    def __getattr__(self, name: str) -> Any:
        if name not in self._fields:
            self._missing(name)
        value = self._get(name)
        if isinstance(value, _Struct):
            return value
        if name in ("names", "paths", "text_data"):
            return value.tobytes()
        return value.item() if value.shape == () else value

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self._fields:
            self._missing(name)
        self._get(name)[...] = value

    def __dir__(self) -> list[str]:
        return sorted({*object.__dir__(self), *self._fields})


_SAME = "actuator body cam eq exclude flex geom hfield jnt key light mat mesh numeric pair sensor site skin tendon tex tuple"
KINDS = {name: name for name in _SAME.split()} | {
    "camera": "cam",
    "equality": "eq",
    "joint": "jnt",
    "keyframe": "key",
    "material": "mat",
    "ten": "tendon",
    "texture": "tex",
}
"""Methods that give an element by name or id, with the prefix of the fields of mjModel."""
_DATA_KINDS = {name: name for name in ("actuator", "cam", "geom", "light", "site")} | {
    "body": "",
    "jnt": "",
    "sensor": "",
    "tendon": "ten",
}
"""Kinds of elements that mjData knows, with the prefix of its fields."""

_SHAPES = {"numeric": ("size",), "hfield": ("nrow", "ncol"), "tex": ("height", "width", "nchannel")}
"""Kinds of elements with data of their own, and the fields that tell its shape."""


class _Element:
    """An element of a model by name: ``model.geom("box").size``. Attributes are arrays on the struct's memory."""

    def __init__(self, view: _View, kind: str, index: int) -> None:
        self.__dict__.update(_view=view, _kind=kind, id=index, name=view._model._names(kind)[index])

    def _rows(self) -> dict[str, slice]:
        """Fields with a number of rows per element: size of the fields' first dimension -> rows of this element."""
        m, i = self._view._model, self.id
        if self._kind == "jnt":
            return dict(zip(("nq", "nv"), rows_of_joint(m, i)))
        if self._kind == "actuator":
            return {
                "nu": slice(first := int(m.actuator_ctrladr[i]), first + int(m.actuator_ctrlnum[i])),
                "nout": slice(first := int(m.actuator_outadr[i]), first + int(m.actuator_outnum[i])),
                "na": slice(first := max(0, int(m.actuator_actadr[i])), first + max(0, int(m.actuator_actnum[i]))),
            }
        if self._kind == "sensor":
            return {"nsensordata": slice(first := int(m.sensor_adr[i]), first + int(m.sensor_dim[i]))}
        return {}

    def _find(self, name: str) -> np.ndarray | None:
        return self._view._element_field(self._kind, self.id, self._rows(), name)

    def __getattr__(self, name: str) -> Any:
        found = self._find(name)
        if found is None:
            raise AttributeError(f"{type(self._view).__name__}.{self._kind}('{self.name}') has no attribute '{name}'")
        return found

    def __setattr__(self, name: str, value: Any) -> None:
        getattr(self, name)[...] = value

    def __repr__(self) -> str:
        return f"<{self._kind} '{self.name}', id {self.id}, of {self._view!r}>"


class _View(_Struct):
    _address: int
    _model: MjModelView
    _element_kinds: frozenset[str]

    def _element_field(self, kind: str, index: int, rows: dict[str, slice], name: str) -> np.ndarray | None:
        raise NotImplementedError

    def _missing(self, name: str) -> NoReturn:
        real = type(self).__name__.removesuffix("View")
        raise AttributeError(
            f"{type(self).__name__} has no attribute '{name}', and mujoco.{real} of another version may: {libmujoco.explain()}"
        )

    def __getattr__(self, name: str) -> Any:
        if name in KINDS and KINDS[name] in self._element_kinds:
            return lambda key: self._element(KINDS[name], key)
        return super().__getattr__(name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *(name for name, kind in KINDS.items() if kind in self._element_kinds)})

    def _element(self, kind: str, key: str | int) -> _Element:
        names = self._model._names(kind)
        if isinstance(key, str):
            if not key or key not in names:
                raise KeyError(f"Invalid name '{key}'. Valid names: {sorted(filter(None, names))}")
            return _Element(self, kind, names.index(key))
        if not -len(names) <= (index := int(key)) < len(names):
            raise IndexError(f"Invalid index {key}. Valid indices from 0 to {len(names) - 1}")
        return _Element(self, kind, index % len(names))

    def __repr__(self) -> str:
        # pybind11 shows the arguments that a function of mujoco does not accept: this is the explanation that users read then.
        return f"<{type(self).__name__}: cannot be passed to MuJoCo's functions; {libmujoco.explain()}>"

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"{type(self).__name__} cannot be pickled: {libmujoco.explain()}")


class MjModelView(_View):
    """An mjModel with the attributes of ``mujoco.MjModel``, for environments whose ``mujoco`` is of another series or missing."""

    _element_kinds = frozenset(KINDS.values())

    def __init__(self, owner: _core.OwnedModel) -> None:
        super().__init__(owner, _core.model_fields(owner.address))
        self.__dict__.update(_address=owner.address, _model=self, _known={})

    def _names(self, kind: str) -> list[str]:
        if kind not in self._known:
            names = self.names
            starts = self._get(f"name_{kind}adr").tolist()
            self._known[kind] = [names[start : names.index(b"\0", start)].decode() for start in starts]
        return self._known[kind]

    def _element_field(self, kind: str, index: int, rows: dict[str, slice], name: str) -> np.ndarray | None:
        if kind in _SHAPES and name == "data":
            shape = [int(self._get(f"{kind}_{size}")[index]) for size in _SHAPES[kind]]
            start = int(self._get(f"{kind}_adr")[index])
            return self._get(f"{kind}_data")[start : start + math.prod(shape)].reshape(shape)
        if kind == "jnt" and name in ("qpos0", "qpos_spring"):
            return self._get(name)[rows["nq"]]
        if kind == "jnt" and f"dof_{name}" in self._fields and (name == "bodyid" or f"jnt_{name}" not in self._fields):
            return self._get(f"dof_{name}")[rows["nv"]]
        count, field = len(self._names(kind)), f"{kind}_{name}"
        if field not in self._fields or len(whole := self._get(field)) != count:
            return None
        return whole.reshape(count, -1)[index]

    def __copy__(self) -> MjModelView:
        return MjModelView(_core.OwnedModel.copy(self._address))

    def __deepcopy__(self, memo: Any) -> MjModelView:
        return self.__copy__()


_BODY = frozenset(
    """
    xpos xquat xmat xipos xiquat ximat xfrc_applied subtree_com subtree_linvel subtree_angmom cinert crb cvel cacc
    cfrc_int cfrc_ext
    """.split()
)
_DOFS = frozenset(
    """
    qvel qacc qacc_warmstart qacc_smooth qfrc_applied qfrc_bias qfrc_passive qfrc_spring qfrc_damper qfrc_gravcomp
    qfrc_fluid qfrc_actuator qfrc_smooth qfrc_constraint qfrc_inverse cdof cdof_dot qLDiagInv
    """.split()
)


class MjDataView(_View):
    """An mjData with the attributes of ``mujoco.MjData``, for environments whose ``mujoco`` is of another series or missing."""

    _element_kinds = frozenset(_DATA_KINDS)

    def __init__(self, model: MjModelView) -> None:
        owner = _core.OwnedData.make(model._address)
        super().__init__(owner, _core.data_fields(model._address, owner.address))
        self.__dict__.update(
            _address=owner.address, _model=model, _arena=frozenset(_core.arena_fields(model._address, owner.address))
        )

    @property
    def model(self) -> MjModelView:
        """The model."""
        return self._model

    def __getattr__(self, name: str) -> Any:
        if name in self.__dict__.get("_arena", ()):
            return array_of(self._owner, *_core.arena_fields(self._model._address, self._address)[name])
        return super().__getattr__(name)

    def __dir__(self) -> list[str]:
        return sorted({*super().__dir__(), *self._arena})

    def _element_field(self, kind: str, index: int, rows: dict[str, slice], name: str) -> np.ndarray | None:
        if kind == "jnt":
            if name in ("xanchor", "xaxis"):
                return self._get(name)[index]
            part = rows["nq"] if name == "qpos" else rows["nv"] if name in _DOFS else None
            return None if part is None else self._get(name)[part]
        if kind == "sensor":
            return self.sensordata[rows["nsensordata"]] if name == "data" else None
        if kind == "body":
            return self._get(name)[index] if name in _BODY else None
        if kind == "actuator":
            if name in ("ctrl", "act"):
                return self._get(name)[rows["nu" if name == "ctrl" else "na"]]
            return self._get(f"actuator_{name}")[rows["nout"]] if name in ("length", "velocity", "force") else None
        field = f"{_DATA_KINDS[kind]}_{name}"
        count = len(self._model._names(kind))
        if field not in self._fields or len(whole := self._get(field)) != count:
            return None
        return whole.reshape(count, -1)[index]
