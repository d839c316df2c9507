# SPDX-License-Identifier: Apache-2.0
"""Sensors from the [[sensors]] tables of a TOML file: built-in kinds by their fields, and Python classes, as in a robot.toml."""

from __future__ import annotations

import dataclasses
import difflib
import importlib
import types
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mjsense import configs

_PYTHON = "python"


def _nearest(context: str, what: str, name: str, known: Sequence[str]) -> ValueError:
    near = difflib.get_close_matches(name, known, 1)
    return ValueError(f"{context}: unknown {what} '{name}'; {f'did you mean {near[0]!r}?' if near else 'there are ' + ', '.join(known)}")


def _classes(hint: Any) -> list[type[Any]]:
    """The configurations that a type hint allows: ``ContactMatch | None``, ``Sequence[ContactMatch]``."""
    if dataclasses.is_dataclass(hint) and isinstance(hint, type):
        return [hint]
    if typing.get_origin(hint) in (typing.Union, types.UnionType) or typing.get_args(hint):
        return list(dict.fromkeys(found for inner in typing.get_args(hint) for found in _classes(inner)))
    return []


def _made(cls: type[Any], table: dict[str, Any], context: str) -> Any:
    """A configuration with the fields of a table; inner tables become configurations too."""
    hints = typing.get_type_hints(cls)
    fields = [field.name for field in dataclasses.fields(cls)]
    values = {}
    for key, value in table.items():
        if key == "kind":
            continue
        if key not in fields:
            raise _nearest(context, f"key of '{cls.kind}'" if hasattr(cls, "kind") else "key", key, fields)
        values[key] = _value(_classes(hints[key]), value, f"{context}: {key}")
    try:
        return cls(**values)
    except (TypeError, ValueError, KeyError) as error:
        raise ValueError(f"{context}: {error.args[0] if error.args else error}") from error


def _value(classes: list[type[Any]], value: Any, context: str) -> Any:
    if isinstance(value, list):
        return [_value(classes, one, context) for one in value]
    if not isinstance(value, dict) or not classes:
        return value
    kinds = {str(getattr(cls, "kind", "")): cls for cls in classes}
    if len(classes) == 1:
        return _made(classes[0], value, context)
    if value.get("kind") not in kinds:
        raise _nearest(context, "kind", str(value.get("kind", "")), list(kinds))
    return _made(kinds[value["kind"]], value, context)


def _python_sensor(table: dict[str, Any], context: str) -> Any:
    reference = str(table.get("class", ""))
    module, _, attribute = reference.partition(":")
    if not module or not attribute:
        raise ValueError(f"{context}: class is '{reference}': must be 'package.module:Class'")
    try:
        sensor = getattr(importlib.import_module(module), attribute)(**table.get("args", {}))
    except (ImportError, AttributeError, TypeError) as error:
        raise ValueError(f"{context}: class '{reference}' cannot be used: {error}") from error
    if name := table.get("name"):
        sensor.uuid = name
    return sensor


def sensors_of(path: str | Path) -> list[Any]:
    """Sensors of the scene. Names of elements are full names in the model (``robot_0/gripper/base``), or local names with ``entity``."""
    import tomllib  # slow to import

    try:
        tables = tomllib.loads(Path(path).read_text()).get("sensors")
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f"{path}: {error}") from error
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        raise ValueError(f"{path}: contains no [[sensors]] tables")
    kinds = {cls.kind: cls for cls in vars(configs).values() if isinstance(cls, type) and issubclass(cls, configs.SensorCfg) and hasattr(cls, "kind")}
    sensors = []
    for i, table in enumerate(tables):
        kind, context = str(table.get("kind", "")), f"{path}: sensors[{i}]"
        if kind == _PYTHON:
            sensors.append(_python_sensor(table, context))
        elif kind in kinds:
            sensors.append(_made(kinds[kind], table, context))
        else:
            raise _nearest(context, "kind", kind, [*kinds, _PYTHON])
    return sensors
