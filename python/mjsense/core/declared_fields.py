# SPDX-License-Identifier: Apache-2.0
"""The declarations of options and configurations in C++."""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from typing import Any

from mjsense import _core


@functools.cache
def _structs() -> dict[str, dict[str, dict[str, Any]]]:
    structs = json.loads(_core.schema())["structs"]
    return {name: {field["name"]: field for field in struct["fields"]} for name, struct in structs.items()}


def declared_fields(struct: str) -> dict[str, dict[str, Any]]:
    """The declared fields of a struct, such as ``ImageCfg``, by name, as ``mjsense schema`` prints them."""
    return _structs()[struct]


def given_options(struct: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
    """The arguments of a function that are options of a struct. None stands for an option that is not given."""
    return {name: arguments[name] for name in declared_fields(struct) if arguments.get(name) is not None}
