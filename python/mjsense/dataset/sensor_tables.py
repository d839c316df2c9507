# SPDX-License-Identifier: Apache-2.0
"""Sensors from the [[sensors]] tables of a TOML file: built-in kinds by their fields, and Python classes, as in a robot.toml."""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mjsense.core.errors import did_you_mean
from mjsense.core.input_files import read_toml
from mjsense.sensors import configs
from mjsense.sensors.named_class import sensor_of_class

_PYTHON = "python"


def _nearest(context: str, what: str, name: str, known: Sequence[str]) -> ValueError:
    return ValueError(f"{context}: unknown {what} '{name}'{did_you_mean(name, known, 'there are')}")


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
    if not all(reference.partition(":")):
        raise ValueError(f"{context}: class is '{reference}': must be 'package.module:Class'")
    sensor = sensor_of_class(reference, table.get("args", {}), context)
    if name := table.get("name"):
        sensor.uuid = name
    return sensor


def sensors_of(path: str | Path) -> list[Any]:
    """Sensors of the scene. Names of elements are full names in the model (``robot_0/gripper/base``), or local names with
    ``entity``."""
    tables = read_toml(path).get("sensors")
    if not isinstance(tables, list) or not tables or not all(isinstance(table, dict) for table in tables):
        raise ValueError(f"{path}: contains no [[sensors]] tables")
    kinds = {
        cls.kind: cls
        for cls in vars(configs).values()
        if isinstance(cls, type) and issubclass(cls, configs.SensorCfg) and hasattr(cls, "kind")
    }
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
