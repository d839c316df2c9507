# SPDX-License-Identifier: Apache-2.0
"""Shows what stands under a dataclass's fields in ``help()``: Python forgets these strings when it compiles a class."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import sys
import textwrap


def show_field_docs(module_name: str) -> None:
    """Appends its fields to the docstring of every dataclass of this module, those of its bases included."""
    module = sys.modules[module_name]
    try:
        tree = ast.parse(inspect.getsource(module))
    except OSError:  # installed without sources
        return
    texts: dict[str, dict[str, str]] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ClassDef):
            texts[node.name] = dict(_fields(node))
    for cls in vars(module).values():
        if inspect.isclass(cls) and cls.__module__ == module_name and dataclasses.is_dataclass(cls):
            known = {k: v for base in reversed(cls.__mro__) for k, v in texts.get(base.__name__, {}).items()}
            lines = [line for f in dataclasses.fields(cls) for line in _lines(f, known.get(f.name, ""))]
            cls.__doc__ = "\n".join([inspect.cleandoc(cls.__doc__ or ""), "", *lines]).rstrip() + "\n"


def _fields(node: ast.ClassDef):
    for field, text in zip(node.body, node.body[1:]):
        if (isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name) and isinstance(text, ast.Expr)
                and isinstance(text.value, ast.Constant) and isinstance(text.value.value, str)):  # fmt: skip
            yield field.target.id, inspect.cleandoc(text.value.value)


def _lines(field: dataclasses.Field, text: str) -> list[str]:
    default = "" if field.default is dataclasses.MISSING else f" = {field.default!r}"
    return [f"{field.name}: {field.type}{default}", *textwrap.indent(text, "    ").splitlines()]
