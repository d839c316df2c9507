# SPDX-License-Identifier: Apache-2.0
"""Options of the program that are fields of configurations: their values as texts of the command line and in experiment files.

``table.py`` lists the fields; it is generated from their declarations in C++.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

_EXPECTED = {
    "bool": "a bool",
    "int": "an int of 32 bits",
    "unsigned": "an int of 64 bits from 0 on",
    "number": "a number",
    "text": "a str",
    "path": "a str",
}
_NUMBER = re.compile(r"-?((\d+\.?\d*|\.\d+)(e[+-]?\d+)?|inf|nan)", re.ASCII | re.IGNORECASE)


def suggestion(name: str, known: Iterable[str]) -> str:
    """``"; did you mean 'record'?"``, or nothing."""
    from mjsense.core.errors import nearest  # slow to import

    return "".join(f"; did you mean '{one}'?" for one in nearest(name, known)[:1])


class Field(NamedTuple):
    """A field of a configuration."""

    name: str
    """As a parameter in Python."""
    option: str
    """As a key of an experiment file."""
    flag: str
    """As an option of the command line, with ``_`` instead of ``-``."""
    kind: str
    """Type of the value, or of each element of a list: bool, int, unsigned, number, text or path."""
    help: str
    words: Sequence[str] = ()
    """The words that a text may be; empty: any."""
    default: str = ""
    is_list: bool = False
    is_on: bool = False
    """A bool that is true by default: its option is ``--no-FLAG``."""
    is_either: bool = False
    """A bool without a default: its options are ``--FLAG`` and ``--no-FLAG``."""
    hidden: bool = False
    """Without an option of its own."""
    low: float | None = None
    high: float | None = None
    above_low: bool = False
    """``low`` itself is excluded."""

    @property
    def expected(self) -> str:
        """``an int``"""
        one = " or ".join(filter(None, [", ".join(self.words[:-1]), self.words[-1]])) if self.words else _EXPECTED[self.kind]
        return f"a list, each {one}" if self.is_list else one

    @property
    def metavar(self) -> str:
        """``auto|shapes|real`` if that is short, otherwise the name of the type."""
        words = "|".join(self.words)
        kinds = {"int": "INT", "unsigned": "INT", "number": "FLOAT", "path": "DIR"}
        return words if words and len(words) <= 24 else "NAMES" if self.is_list else kinds.get(self.kind, "TEXT")

    def of_text(self, text: str, place: str) -> Any:
        """The value that a text of the command line states. ``place`` begins the message of a ValueError: ``--episodes``."""
        parts = ([] if text == "none" else text.split(",")) if self.is_list else [text]
        values = [self._of_word(part) for part in parts]
        if None in values or (self.is_list and "" in parts):
            separated = ", separated by commas, or none" if self.is_list else ""
            raise ValueError(f"{place} is '{text}': must be {self.expected}{separated}")
        return self._checked(values if self.is_list else values[0], place)

    def of_toml(self, value: Any, place: str) -> Any:
        """The value of the key of an experiment file, which may also be the text of the command line for a list."""
        if self.is_list and isinstance(value, str):
            return self.of_text(value, f"{place}: {self.option}")
        values = value if self.is_list else [value]
        if not isinstance(values, list) or not all(map(self._has_type, values)):
            raise ValueError(f"{place}: the value of '{self.option}' has the wrong type: must be {self.expected}")
        return self._checked(value, f"{place}: {self.option}")

    def _of_word(self, text: str) -> Any:
        """The value, or None if the text does not state one of this kind."""
        if self.kind == "bool":
            return {"true": True, "false": False}.get(text)
        if self.kind == "number":
            return float(text) if _NUMBER.fullmatch(text) else None
        if self.kind in ("int", "unsigned"):
            value = int(text) if re.fullmatch(r"-?\d{1,20}", text, re.ASCII) else None
            return value if self._has_type(value) else None
        return text

    def _has_type(self, value: Any) -> bool:
        if isinstance(value, bool) or self.kind == "bool":
            return self.kind == "bool" and isinstance(value, bool)
        if self.kind == "int":
            return isinstance(value, int) and -(2**31) <= value < 2**31
        if self.kind == "unsigned":
            return isinstance(value, int) and 0 <= value < 2**64
        return isinstance(value, (int, float) if self.kind == "number" else str)

    def _checked(self, value: Any, place: str) -> Any:
        for one in value if self.is_list else [value]:
            if self.words and one not in self.words:
                words = ", ".join(word or '""' for word in self.words)
                raise ValueError(f"{place} is '{one}': must be one of {words}{suggestion(one, self.words)}")
            if self.kind in ("int", "number") and not self._is_in_range(one):
                raise ValueError(f"{place} is {one:g}: {self._range()}")
        return value

    def _is_in_range(self, value: float) -> bool:
        low, high = -1e308 if self.low is None else float(self.low), 1e308 if self.high is None else float(self.high)
        return low <= value <= high and not (self.above_low and value == low)

    def _range(self) -> str:
        if self.low is None or self.high is None:
            word = f"above {self.low:g}" if self.above_low else f"at least {self.low:g}" if self.low is not None else ""
            return f"must be {word or (f'at most {self.high:g}' if self.high is not None else 'finite')}"
        return (
            f"must be above {self.low:g}, at most {self.high:g}"
            if self.above_low
            else f"must be between {self.low:g} and {self.high:g}"
        )


def find(fields: Sequence[Field], name: str) -> Field | None:
    """The field with this name in Python or as an option."""
    return next((field for field in fields if name in (field.name, field.option)), None)


def read_size(fields: Sequence[Field], text: str) -> dict[str, int]:
    """Width and height of a text such as ``640x368``."""
    width, x, height = text.partition("x")
    try:
        if x:
            return {
                name: of.of_text(part, "") for name, part in (("width", width), ("height", height)) if (of := find(fields, name))
            }
    except ValueError:
        pass
    raise ValueError(f"size '{text}': expected WIDTHxHEIGHT, such as 640x368")
