# SPDX-License-Identifier: Apache-2.0
"""Checksums of user-defined tasks, policies and sensors, so that a recording can only be resumed with equal ones.

Two parts are compared: the code, that is, the bytecode of the object's classes and of every function that they use outside of
installed packages; and the values of its attributes. For installed packages the version is compared.
"""

from __future__ import annotations

import enum
import hashlib
import inspect
import logging
import pathlib
import re
import sys
import types
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from mjsense.sensors.sensor import Sensor
from mjsense.tasks.policy import Policy
from mjsense.tasks.task import Task

_BOUND = {"sim", "num_worlds", "action_groups", "action_low", "action_high", "wanted", "phase", "num_retries"}
"""Attributes that mjsense sets."""


def checksums(owner: Any, place: str, must_compare: bool = False) -> dict[str, str]:
    """Checksums of the code and of each attribute of ``owner``, by name; with a method ``fingerprint()``, of its result instead
    of the attributes.

    Raises:
        ValueError: An attribute's value cannot be compared, and ``must_compare`` is true.
    """
    values = {"fingerprint": owner.fingerprint()} if callable(getattr(owner, "fingerprint", None)) else _attributes(owner)
    found = {}
    for name, value in {"code": type(owner), **values}.items():
        try:
            # Attribute values of its classes are compared separately, by name.
            found[name] = _digest(value, type(owner).__mro__ if name == "code" else ())
        except _NotComparable as error:
            if must_compare:
                what = "the code" if name == "code" else f"attribute '{name}'"
                raise ValueError(
                    f"cannot resume: {what} of the {place} has a {error}, which cannot be compared with that of the "
                    "recording; give "
                    f"{type(owner).__name__} a method fingerprint() that returns a text of what its data depend on"
                ) from None
            found[name] = f"a {error}, not compared"
    return found


def _attributes(owner: Any) -> dict[str, Any]:
    """Attributes of the instance and of its user-defined classes."""
    names = set(getattr(owner, "__dict__", ()))
    for cls in type(owner).__mro__:
        slots = vars(cls).get("__slots__", ())
        names |= {slots} if isinstance(slots, str) else set(slots)
        if not _is_installed(cls.__module__):
            names |= {name for name, value in vars(cls).items() if not _is_code(value)}
    names = {name for name in names - _BOUND if not name.startswith(("__", "_mjs_", "_abc_"))}
    # Attributes that were added later belong to the worlds of a previous recording.
    names = getattr(owner, "__dict__", {}).setdefault("_mjs_compared", names)
    return {name: getattr(owner, name) for name in sorted(names) if hasattr(owner, name)}


def _is_code(value: Any) -> bool:
    return isinstance(value, (types.FunctionType, classmethod, staticmethod, property)) or hasattr(type(value), "__set__")


class _NotComparable(Exception):
    pass


def _is_installed(module: str | None) -> bool:
    top = (module or "").split(".")[0]
    if top in ("mjsense", "builtins") or top in sys.stdlib_module_names:
        return top != "__main__"
    file = getattr(sys.modules.get(module or ""), "__file__", None) or ""
    return not {"site-packages", "dist-packages"}.isdisjoint(pathlib.PurePath(file).parts)


def _digest(value: Any, without_values: tuple[type, ...] = ()) -> str:
    writer = _Writer(without_values)
    writer.add(value)
    return writer.sum.hexdigest()[:16]


class _Writer:
    """Updates a hash with a value and, recursively, its contents."""

    def __init__(self, without_values: tuple[type, ...]) -> None:
        self._without_values = without_values
        self.sum = hashlib.sha256()
        self._seen: dict[int, int] = {}
        self._kept: list[Any] = []  # keeps objects alive, so that their ids stay unique

    def add(self, value: Any) -> None:
        plain = (type(None), bool, int, float, complex, str, bytes, pathlib.PurePath)
        if isinstance(value, plain) and not isinstance(value, enum.Enum):
            return self._text(f"{type(value).__name__} {value!r}")
        if isinstance(value, (np.ndarray, np.generic)) and value.dtype != object:
            self._text(f"array {value.dtype.str} {value.shape}")
            return self.sum.update(np.ascontiguousarray(value).tobytes())
        if id(value) in self._seen:
            return self._text(f"seen {self._seen[id(value)]}")
        self._seen[id(value)] = len(self._seen)
        self._kept.append(value)
        if isinstance(value, types.CodeType):
            self._code(value)
        elif isinstance(value, (types.ModuleType, logging.Logger)):
            self._text(f"name {_without_room(value.__name__ if isinstance(value, types.ModuleType) else value.name)}")
        elif isinstance(value, type):
            self._class(value)
        elif isinstance(value, types.FunctionType):
            self._function(value)
        elif isinstance(value, types.MethodType):
            self._list("method", (value.__func__, value.__self__))
        elif isinstance(value, (classmethod, staticmethod)):
            self._list("method", (value.__func__,))
        elif isinstance(value, (types.GetSetDescriptorType, types.MemberDescriptorType)):
            self._text(value.__name__)
        elif isinstance(value, property):
            self._list("property", (value.fget, value.fset, value.fdel))
        elif isinstance(value, (list, tuple)):
            self._list(type(value).__name__, value)
        elif isinstance(value, (set, frozenset)):
            self._list("set", sorted(_digest(item) for item in value))
        elif isinstance(value, Mapping):
            self._list(type(value).__name__, [part for item in value.items() for part in item])
        else:
            self._object(value)

    def _text(self, text: str) -> None:
        data = text.encode("utf-8", "surrogatepass")
        self.sum.update(f"{len(data)} ".encode() + data)

    def _list(self, kind: str, items: Any) -> None:
        self._text(f"{kind} {len(items)}")
        for item in items:
            self.add(item)

    def _name(self, value: Any) -> None:
        module = value.__module__ or ""
        version = getattr(sys.modules.get(module.split(".")[0]), "__version__", "")
        self._text(f"{_without_room(module)}.{value.__qualname__} {version}")

    def _class(self, cls: type) -> None:
        if _is_installed(cls.__module__):
            return self._name(cls)
        self._text(f"class {cls.__qualname__}")
        self._list("bases", cls.__bases__)
        for name, value in sorted(vars(cls).items()):
            if _is_code(value) or name == "__doc__" or not (name.startswith(("__", "_abc_")) or cls in self._without_values):
                self._text(name)
                self.add(value)

    def _function(self, function: types.FunctionType) -> None:
        if _is_installed(function.__module__):
            return self._name(function)
        self.add(function.__code__)
        self._list("defaults", function.__defaults__ or ())
        self.add(function.__kwdefaults__)
        self._list("closure", [cell.cell_contents for cell in function.__closure__ or () if _is_filled(cell)])
        known = inspect.unwrap(function).__globals__
        for name in _names(function.__code__):
            if name in known and not name.startswith("__"):
                self._text(name)
                self.add(known[name])

    def _code(self, code: types.CodeType) -> None:
        self.sum.update(code.co_code)
        self._text(f"{code.co_flags} {code.co_names} {code.co_varnames} {code.co_argcount} {code.co_kwonlyargcount}")
        self._list("consts", code.co_consts)

    def _object(self, value: Any) -> None:
        if isinstance(value, enum.Enum):
            return self._text(f"{type(value).__qualname__}.{value.name}")
        self.add(type(value))
        if isinstance(value, np.random.Generator):
            return self.add(value.bit_generator.state)
        if callable(getattr(value, "detach", None)):  # a PyTorch tensor
            return self.add(_numbers(value))
        if isinstance(value, types.BuiltinFunctionType):
            return self._text(value.__qualname__)
        state = _attributes(value) if isinstance(value, (Task, Policy, Sensor)) else getattr(value, "__dict__", None)
        own_state = getattr(type(value), "__getstate__", None) is not getattr(object, "__getstate__", None)
        if state is None or own_state:
            try:
                reduced = value.__reduce_ex__(4)
            except Exception:
                raise _NotComparable(f"{type(value).__module__}.{type(value).__qualname__}") from None
            if isinstance(reduced, str):
                return self._text(reduced)
            return self.add([list(part) if isinstance(part, Iterator) else part for part in reduced[1:]])
        self._list("attributes", [part for name, item in sorted(state.items()) for part in (name, item)])


def _without_room(module: str) -> str:
    """The name that a module had before the package had rooms, so that recordings of that time can be resumed."""
    if module == "mjsense.core.representations":  # a part of every class of sensors
        return "mjsense._show"
    return re.sub(r"^mjsense\.(core|scene|sensors|sim|tasks)\.", "mjsense.", module)


def _numbers(tensor: Any) -> Any:
    tensor = tensor.detach().cpu()
    try:
        return tensor.numpy()
    except TypeError:  # NumPy has no such type
        return [str(tensor.dtype), tensor.float().numpy()]


def _is_filled(cell: types.CellType) -> bool:
    try:
        _ = cell.cell_contents
    except ValueError:
        return False
    return True


def _names(code: types.CodeType) -> list[str]:
    """Names that a function and its nested functions may look up."""
    names = set(code.co_names)
    for const in code.co_consts:
        if isinstance(const, types.CodeType):
            names |= set(_names(const))
    return sorted(names)
