# SPDX-License-Identifier: Apache-2.0
"""Checks arguments and attribute names of the Python API and reports errors in one sentence.

Annotations define the valid arguments. ``checked`` reads the annotations of a function, or of every public method of a class,
once. A call then costs one test per given argument.
"""

from __future__ import annotations

import ast
import functools
import inspect
import re
from collections.abc import Callable
from numbers import Integral, Real
from pathlib import PurePath
from types import FunctionType
from typing import Any, TypeVar, cast

import numpy as np

from mjsense.core.errors import did_you_mean, unexpected_keyword

Seed = int
"""A non-negative int of 64 bits."""

OutputArray = np.ndarray
"""A NumPy array that a function writes to."""

T = TypeVar("T")


def _is_int(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and -(2**31) <= int(value) < 2**31


def _is_seed(value: Any) -> bool:
    return isinstance(value, Integral) and not isinstance(value, bool) and 0 <= int(value) < 2**64


def _is_list(value: Any) -> bool:
    return hasattr(value, "__iter__") and not isinstance(value, (str, bytes))


def _is_list_of_str(value: Any) -> bool:
    return _is_list(value) and all(isinstance(one, str) for one in value)


def _is_iterable_of_str(value: Any) -> bool:
    return _is_list_of_str(value) if hasattr(value, "__len__") else _is_list(value)  # others can be read only once


def _is_a(value: Any, name: str) -> bool:
    return any(base.__name__ == name for base in type(value).__mro__)


# The elements of annotations: a test and its description for messages. Names of classes are tested by name.
_KINDS: dict[str, tuple[Callable[[Any], bool], str]] = {
    "None": (lambda value: value is None, "None"),
    "int": (_is_int, "an int of 32 bits"),
    "Seed": (_is_seed, "an int of 64 bits from 0 on"),
    "float": (lambda value: isinstance(value, Real) and not isinstance(value, bool), "a number"),
    "bool": (lambda value: isinstance(value, (bool, np.bool_)), "a bool"),
    "str": (lambda value: isinstance(value, str), "a str"),
    "Path": (lambda value: isinstance(value, PurePath), "a Path"),
    "Callable": (callable, "a function"),
    "OutputArray": (lambda value: isinstance(value, np.ndarray), "a numpy array"),
    "Sequence[str]": (_is_list_of_str, "a sequence of str"),
    "Sequence[int]": (_is_list, "a sequence of int"),
    "Iterable[str]": (_is_iterable_of_str, "a sequence of str"),
    "Sequence": (_is_list, "a sequence"),
    "Iterable": (_is_list, "a sequence"),
    "Tasks": (
        lambda value: isinstance(value, str) or callable(value) or _is_a(value, "Task") or hasattr(value, "_mjs_compose"),
        "a mjsense.Task or the name of one",
    ),
    "Policies": (
        lambda value: (
            value is None or isinstance(value, str) or callable(value) or _is_a(value, "Policy") or hasattr(value, "_mjs_policy")
        ),
        "a mjsense.Policy, a function, or the name of one",
    ),
    "Scenes": (
        lambda value: isinstance(value, (str, PurePath)) or callable(value) or _is_a(value, "SceneFileCfg"),
        "the name or file of a scene, a mjsense.SceneFileCfg, or a function that makes a mjsense.SceneCfg",
    ),
    "Robots": (
        lambda value: isinstance(value, (str, PurePath)) or _is_a(value, "Robot"),
        "the name of a robot, the path of its .toml, or a mjsense.Robot",
    ),
    "Mapping": (lambda value: hasattr(value, "keys") or _is_a(value, "Mapping"), "a mapping"),
    "dict": (lambda value: isinstance(value, dict), "a dict"),
}
_ANYTHING = {"Any", "np.ndarray", "Sequence[int] | None"}  # the last are worlds: checked elsewhere, because masks are valid too


def _kind(word: str) -> tuple[Callable[[Any], bool], str] | None:
    if word in _ANYTHING:
        return None
    for name in (word, word.split("[")[0]):
        if name in _KINDS:
            return _KINDS[name]
    if word.startswith("Literal["):
        return _KINDS["str"]
    cls = word.split(".")[-1]
    return (lambda value: _is_a(value, cls)), f"a {word}"


def _check_of(context: str, name: str, annotation: Any) -> Callable[[Any], None] | None:
    """A function that raises for values that the annotation does not allow; None if it allows every value."""
    if not isinstance(annotation, str) or annotation in _ANYTHING:
        return None
    kinds = [_kind(word.strip()) for word in re.split(r"\|(?![^\[]*\])", annotation)]
    known = [kind for kind in kinds if kind is not None]
    if len(known) < len(kinds):
        return None
    tests = [test for test, _ in known]
    words = " or ".join(text for _, text in known)
    literal = re.fullmatch(r"Literal(\[.*\])", annotation)
    choices = literal and ast.literal_eval(literal[1])

    def check(value: Any) -> None:
        for test in tests:
            if test(value):
                if choices and value not in choices:
                    listed = ", ".join(one or repr(one) for one in choices)
                    raise ValueError(f"{context}: {name} is {value!r}: must be one of {listed}{did_you_mean(value, choices)}")
                return
        out_of_range = "an int" in words and isinstance(value, Integral) and not isinstance(value, bool)
        raise (ValueError if out_of_range else TypeError)(f"{context}: {name} must be {words}, not {short(value)}")

    return check


def short(value: Any) -> str:
    """The value in a message."""
    text = repr(value)
    return text if len(text) <= 120 else f"{text[:117]}..."


def checked(target: T, owner: str = "", context: str = "") -> T:
    """Decorates a function, or a class with public methods, to check arguments against their annotations.

    Args:
        owner: Name of the class in messages; by default its own.
        context: What messages begin with; by default the name of the function, and that of its class.
    """
    if isinstance(target, type):
        for name, value in list(vars(target).items()):
            if isinstance(value, FunctionType) and (name in ("__init__", "__call__", "__getitem__") or name[0] != "_"):
                setattr(target, name, checked(value, owner or target.__name__))
        return target
    function: Any = target
    if not context:
        context = f"{owner}()" if function.__name__ == "__init__" else f"{owner}.{function.__name__}()".lstrip(".")
    parameters = inspect.signature(function).parameters
    checks = {name: _check_of(context, name, p.annotation) for name, p in parameters.items() if p.kind is not p.VAR_KEYWORD}
    if not any(checks.values()):
        return target
    closed = all(p.kind is not p.VAR_KEYWORD for p in parameters.values())
    positional = [checks.get(name) for name, p in parameters.items() if p.kind is p.POSITIONAL_OR_KEYWORD]

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        for value, check in zip(args, positional):
            if check is not None:
                check(value)
        for name, value in kwargs.items():
            if closed and name not in checks:
                raise unexpected_keyword(context, name, [one for one in checks if one != "self"])
            check = checks.get(name)
            if check is not None:
                check(value)
        return function(*args, **kwargs)

    if function.__name__ == "__init__":
        function.__qualname__ = context.removesuffix("()")  # in Python's message about missing arguments
    return cast(T, call)


def check_options(context: str, options: dict[str, Any], function: Any, without: tuple[str, ...]) -> None:
    """Checks keyword arguments that a function, such as ``make()``, passes on to another one. Messages begin with ``context``.

    Args:
        without: Arguments that only the other function has.
    """
    parameters = inspect.signature(function).parameters
    for name, value in options.items():
        if name not in parameters or name in without:
            raise unexpected_keyword(context, name, [one for one in parameters if one not in without])
        check = _check_of(context, name, parameters[name].annotation)
        if check is not None:
            check(value)


class KnownAttributes:
    """Makes assignment to an unknown attribute an error: ``sim.qposs = 3``. Subclasses may add attributes."""

    _complete = False
    """True when __init__ has created all attributes; dataclasses have a list of them."""

    def __setattr__(self, name: str, value: Any) -> None:
        cls = type(self)
        fields = getattr(cls, "__dataclass_fields__", {})
        if (
            (fields or self._complete)
            and name[0] != "_"
            and name not in fields
            and name not in self.__dict__
            and not hasattr(cls, name)
            and cls.__module__.split(".")[0] == "mjsense"
        ):
            known = {one for one in (*fields, *self.__dict__, *dir(cls)) if one[0] != "_"}
            raise AttributeError(f"{cls.__name__} has no attribute '{name}'{did_you_mean(name, known)}")
        object.__setattr__(self, name, value)
