# SPDX-License-Identifier: Apache-2.0
"""Griffe extension: turns the reStructuredText marks of our docstrings (roles, double backticks, `::`) into Markdown."""

import re
from typing import Any

import griffe

ROLE = re.compile(r":(?:class|func|meth|mod|attr):`~?([\w.]+)`")


class Docstrings(griffe.Extension):
    def on_object(self, *, obj: griffe.Object, loader: Any, **kwargs: Any) -> None:
        if obj.docstring is None:
            return
        text = ROLE.sub(lambda match: reference(match[1], obj), obj.docstring.value)
        text = text.replace("``", "`")
        obj.docstring.value = re.sub(r"::$", ":", text, flags=re.MULTILINE)


def reference(name: str, obj: griffe.Object) -> str:
    """A link to the entry of `name`: a full path, a member of the same class, or a name of the package."""
    owner = obj if obj.is_class else obj.parent
    if name.startswith("mjsense"):
        path = name
    elif owner is not None and owner.is_class and name in owner.members:
        path = f"mjsense.{owner.name}.{name}"
    else:
        path = f"mjsense.{name}"
    return f"[`{name}`][{path}]"
