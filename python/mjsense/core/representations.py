# SPDX-License-Identifier: Apache-2.0
"""Representations of sensors: one line of text, a table with thumbnails in notebooks, and the text of help()."""

from __future__ import annotations

import base64
import inspect
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mjsense.core.errors import printable
from mjsense.core.png import png_of

_THUMBNAIL = 160
"""Maximum side length, pixels."""


class Row(NamedTuple):
    """A row of a sensor's representation: one field."""

    name: str
    """Empty for the only or main field."""
    dtype: str
    shape: tuple[int, ...]
    """Including the world axis, if the number of worlds is known."""
    unit: str
    frame: str
    sentence: str

    def text(self) -> str:
        """'force float32 [64, 4, 3] N in world'."""
        shape = f"{self.dtype} [{', '.join(map(str, self.shape))}]"
        return " ".join(filter(None, (self.name, shape, self.unit, self.frame and f"in {self.frame}")))


def rows_of(specs: Mapping[str, Any], num_worlds: int | None) -> list[Row]:
    """Creates the rows from the specs of a sensor's fields."""
    worlds = () if num_worlds is None else (num_worlds,)
    return [Row(name, s.dtype, (*worlds, *s.shape), s.unit, s.frame, s.description) for name, s in specs.items()]


def plain(text: object, limit: int = 300) -> str:
    """A text of a file, a model or an error as one line or more of plain text for a page: printable, and shortened to ``limit``
    characters."""
    shown = printable(str(text)[: limit + 1])
    return shown if len(shown) <= limit else shown[: limit - 1] + "\N{HORIZONTAL ELLIPSIS}"


def escaped(text: object, limit: int = 10_000) -> str:
    """The same as HTML that displays exactly this text."""
    import html  # slow to import, and needed in notebooks and viewers only

    return html.escape(plain(text, limit))


def line(head: str, rows: list[Row]) -> str:
    """``<contact sensor 'feet': found float32 [64, 4]; force float32 [64, 4, 3] N>``."""
    return printable(f"<{head}: {'; '.join(row.text() for row in rows)}>" if rows else f"<{head}>")


class HelpOfObject:
    """``__doc__`` of a class whose instances have their own text, ``_help()``, so that help(sensor) describes the instance."""

    def __init__(self, of_class: str | None) -> None:
        self._of_class = of_class

    def __get__(self, thing: Any, cls: type) -> str | None:
        return self._of_class if thing is None else thing._help()


def help_of_objects(cls: type) -> None:
    cls.__doc__ = HelpOfObject(cls.__doc__)  # pyright: ignore[reportAttributeAccessIssue]  # a descriptor of a str


def help_text(cls: type, rows: list[Row]) -> str:
    """One line per field, then the documentation of the class."""
    fields = [f"{row.text()}: {row.sentence}" if row.sentence else row.text() for row in rows]
    text = "\n".join([*fields, "", f"help({cls.__name__}) says what it can do.", "", inspect.cleandoc(cls.__doc__ or "")])
    return printable(text).strip()


def table(head: str, rows: list[Row], images: Mapping[str, np.ndarray]) -> str:
    """The same as HTML, with those images ``[H, W, C]`` that can be displayed."""
    fields = grid(("field", "dtype", "shape", "unit", "frame", ""), [_cells(row) for row in rows]) if rows else ""
    return f"<div><b>{escaped(head)}</b>{fields}{figures(images)}</div>"


def grid(header: tuple[str, ...], rows: Sequence[Sequence[Any]]) -> str:
    """An HTML table."""

    def line_of(tag: str, cells: Sequence[Any]) -> str:
        return "<tr>" + "".join(f"<{tag} style='text-align:left'>{escaped(cell)}</{tag}>" for cell in cells) + "</tr>"

    return f"<table>{line_of('th', header)}{''.join(line_of('td', row) for row in rows)}</table>"


def figures(images: Mapping[str, np.ndarray]) -> str:
    """Those images ``[H, W, C]`` that can be displayed, with their names, as HTML."""
    return "".join(
        f"<figure style='display:inline-block;margin:4px'><img src='{source}'/><figcaption>{escaped(name)}</figcaption></figure>"
        for name, image in images.items()
        if (source := thumbnail(image))
    )


def block(head: str, content: str, folded: Mapping[str, str] | None = None) -> str:
    """HTML with a bold first line, its content, and parts that open at a click."""
    parts = "".join(
        f"<details><summary>{escaped(name)}</summary>{inner}</details>" for name, inner in (folded or {}).items() if inner
    )
    return f"<div><b>{escaped(head)}</b>{content}{parts}</div>"


def _cells(row: Row) -> tuple[str, ...]:
    return row.name, row.dtype, f"[{', '.join(map(str, row.shape))}]", row.unit, row.frame, row.sentence


def thumbnail(image: np.ndarray) -> str | None:
    """Data URL of a small PNG; None for arrays that cannot be displayed as an image."""
    if image.ndim != 3 or min(image.shape) < 1:
        return None
    step = -(-max(image.shape[:2]) // _THUMBNAIL)
    pixels = coloured(image[::step, ::step])
    return None if pixels is None else "data:image/png;base64," + base64.b64encode(png_of(pixels)).decode("ascii")


_VIRIDIS = np.array(
    [
        (68, 1, 84),
        (72, 40, 120),
        (62, 74, 137),
        (49, 104, 142),
        (38, 130, 142),
        (31, 158, 137),
        (53, 183, 121),
        (110, 206, 88),
        (181, 222, 43),
        (253, 231, 37),
    ],
    np.float64,
)
"""Samples of the colour map viridis at equal distances."""


def colour_map(values: np.ndarray) -> np.ndarray:
    """Colours float64 [..., 3], 0 to 255, of values from 0 (dark blue) to 1 (yellow)."""
    at = np.clip(values, 0, 1) * (len(_VIRIDIS) - 1)
    return np.stack([np.interp(at, np.arange(len(_VIRIDIS)), _VIRIDIS[:, c]) for c in range(3)], axis=-1)


def is_image(shape: tuple[int, ...], dtype: Any) -> bool:
    """Whether rows of this shape can be shown by :func:`coloured`."""
    kind = np.dtype(dtype).kind
    return (
        len(shape) == 3
        and min(shape) > 0
        and (shape[2] in (1, 3) if kind == "f" else shape[2] in (1, 2) if kind == "i" else shape[2] == 3)
    )


def coloured(image: np.ndarray) -> np.ndarray | None:
    """uint8 [H, W, 3] image for display: colours unchanged, depth by a colour map with near surfaces bright, a colour per id,
    normals in the usual colours. None for other arrays."""
    channels = image.shape[2]
    if image.dtype == np.uint8 and channels == 3:
        return image
    if image.dtype.kind == "f" and channels == 1:
        seen = np.isfinite(image) & (image > 0)
        low, high = (image[seen].min(), image[seen].max()) if seen.any() else (0.0, 1.0)
        near = 1 - np.where(seen, image - low, 0) / max(high - low, 1e-9)
        return np.where(seen, colour_map(near[..., 0]), 0).astype(np.uint8)
    if image.dtype.kind == "i" and channels in (1, 2):
        ids = image[..., :1].astype(np.int64)
        return np.where(ids < 0, 0, 64 + ids * np.array([73, 151, 211]) % 192).astype(np.uint8)
    if image.dtype.kind == "f" and channels == 3:
        return np.clip(127.5 * (np.nan_to_num(image) + 1), 0, 255).astype(np.uint8)
    return None
