# SPDX-License-Identifier: Apache-2.0
"""Shows the docstrings of dataclass fields in ``help()``; Python discards these strings when it compiles a class."""

from __future__ import annotations

import dataclasses
import functools
import sys
from typing import Any


def show_field_docs(module_name: str) -> None:
    """Appends the field docstrings to the docstring of every dataclass of this module, including fields of bases, at the first
    access."""
    for cls in list(vars(sys.modules[module_name]).values()):
        if isinstance(cls, type) and cls.__module__ == module_name and dataclasses.is_dataclass(cls):
            cls.__doc__ = _Doc(cls.__doc__ or "")  # type: ignore[assignment]


class _Doc:
    """A docstring that is generated on access, because importing ast and parsing the module takes longer than the rest of the
    import."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __get__(self, instance: Any, cls: Any) -> str:
        import inspect

        known = {k: v for base in reversed(cls.__mro__) for k, v in _texts(base.__module__).get(base.__name__, {}).items()}
        lines = [line for f in dataclasses.fields(cls) for line in _lines(f, known.get(f.name, ""))]
        return "\n".join([inspect.cleandoc(self.text), "", *lines]).rstrip() + "\n"


@functools.cache
def _texts(module_name: str) -> dict[str, dict[str, str]]:
    """Docstrings of the fields, by class and field."""
    import ast
    import inspect

    try:
        tree = ast.parse(inspect.getsource(sys.modules[module_name]))
    except (OSError, TypeError):  # installed without sources, or built in
        return {}
    return {node.name: dict(_fields(node)) for node in ast.walk(tree) if isinstance(node, ast.ClassDef)}


def _fields(node: Any):
    import ast
    import inspect

    for field, text in zip(node.body, node.body[1:]):
        if (
            isinstance(field, ast.AnnAssign)
            and isinstance(field.target, ast.Name)
            and isinstance(text, ast.Expr)
            and isinstance(text.value, ast.Constant)
            and isinstance(text.value.value, str)
        ):
            yield field.target.id, inspect.cleandoc(text.value.value)


def _lines(field: dataclasses.Field, text: str) -> list[str]:
    import textwrap

    default = "" if field.default is dataclasses.MISSING else f" = {field.default!r}"
    return [f"{field.name}: {field.type}{default}", *textwrap.indent(text, "    ").splitlines()]
