# SPDX-License-Identifier: Apache-2.0
"""Values that the files of other programs state, checked where they are read: each function returns a value of the promised type,
or raises ValueError with one line that names the file, the place, what was found and what is expected."""

from __future__ import annotations

import os
import re
import stat
from fractions import Fraction
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from mjsense.core.input_files import unreadable
from mjsense.dataset.hdf5 import Group
from mjsense.dataset.hdf5_rows import Rows

MAX_JSON = 16 << 20  # bytes
MAX_BYTES = 1 << 30  # of one array, or of one file that is read as a whole
MAX_ROWS = 10_000_000
MAX_SIDE, MAX_PIXELS = 16_384, 1 << 25
"""Of an image; 8K video has 2^25 pixels."""
MAX_ROW_NUMBERS = 1_000_000
RATES = (Fraction(1, 1000), Fraction(100_000))


def found(value: Any) -> str:
    """A value as messages show it."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def mapping(value: Any, about: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{about}: is {found(value)}, expected a JSON object")
    return value


def text(value: Any, about: str, limit: int = 10_000) -> str:
    if not isinstance(value, str) or len(value) > limit:
        raise ValueError(f"{about}: is {found(value)}, expected a text of at most {limit} characters")
    if re.search("[\ud800-\udfff]", value):  # JSON can contain them, and no file name, HDF5 file or web page can
        raise ValueError(f"{about}: is {found(value)}, which has half of a surrogate pair, expected Unicode text")
    return value


def whole(value: Any, about: str, lowest: int, highest: int) -> int:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, np.integer)) or not lowest <= value <= highest:
        raise ValueError(f"{about}: is {found(value)}, expected a whole number from {lowest} to {highest}")
    return int(value)


def number(value: Any, about: str, lowest: float, highest: float) -> float:
    if isinstance(value, (bool, np.bool_)) or not isinstance(value, (int, float, np.number)) or not lowest <= value <= highest:
        raise ValueError(f"{about}: is {found(value)}, expected a number from {lowest:g} to {highest:g}")
    return float(value)


def rate(value: Any, about: str) -> Fraction:
    """Rows per second."""
    low, high = (float(limit) for limit in RATES)
    return Fraction(number(value, about, low, high)).limit_denominator(10**6)


def plain_name(name: str, about: str, nested: bool = False) -> str:
    """A name that becomes part of a file name or a stream. ``nested``: may have several parts with ``/`` between them."""
    for part in name.split("/") if nested else [name]:
        if not re.fullmatch(r"\w[\w .+\-]*", part) or len(part.encode()) > 100 or ".." in part:
            raise ValueError(
                f"{about}: the name {found(name)} cannot be used, expected letters, digits, '_', '-' and '.', at most 100"
            )
    return name


def image_shape(height: Any, width: Any, about: str) -> tuple[int, int]:
    h, w = (whole(side, about, 1, MAX_SIDE) for side in (height, width))
    if h * w > MAX_PIXELS:
        raise ValueError(f"{about}: has {h} x {w} pixels, the limit is {MAX_PIXELS} pixels")
    return h, w


# ---------------------------------------------------------------------------------------------- files


def file_inside(root: Path, name: Any, about: str) -> Path:
    """A regular file in the folder ``root``. Raises ValueError for other names, and for links that lead out of it."""
    text(name, about, 1000)
    parts = name.split("/")
    if any(part in ("", ".", "..") for part in parts) or re.search(r"[\\:\x00-\x1f]", name):
        raise ValueError(f"{about}: is {found(name)}, expected the name of a file inside of {root}")
    return regular_inside((root,), root.joinpath(*parts), about)


def regular_inside(roots: tuple[Path, ...], path: Path, about: str) -> Path:
    """``path``, if it is a regular file in one of these folders after all links."""
    try:
        place = path.resolve()
        kind = place.stat().st_mode
    except (OSError, RuntimeError) as error:
        if path.is_symlink():
            raise ValueError(f"{about}: {path} is a link to {os.readlink(path)}, which cannot be read") from None
        raise unreadable(path, error if isinstance(error, OSError) else OSError(str(error))) from None
    inside = [root.resolve() for root in roots]
    # Data sets in the cache of the Hugging Face Hub are links from snapshots/REVISION to blobs.
    inside += [root.parents[1] / "blobs" for root in inside if root.parent.name == "snapshots"]
    if not any(place.is_relative_to(root) for root in inside):
        raise ValueError(f"{about}: {path} is a link to {place}, which is outside of {roots[0]}")
    if not stat.S_ISREG(kind):
        raise ValueError(f"{about}: {path} is not a regular file")
    return place


def open_file(path: Path, about: str, limit: int | None = None) -> BinaryIO:
    """A regular file, open for reading; a pipe that took its place is not waited for."""
    file = os.fdopen(os.open(path, os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK), "rb")
    status = os.fstat(file.fileno())
    if not stat.S_ISREG(status.st_mode) or (limit is not None and status.st_size > limit):
        file.close()
        most = "" if limit is None else f" of at most {limit}"
        raise ValueError(f"{about}: {path} has {status.st_size} bytes, expected a regular file{most}")
    return file


def read_bytes(path: Path, about: str, limit: int = MAX_BYTES) -> bytes:
    """The contents of a regular file."""
    with open_file(path, about, limit) as file:
        return file.read(limit + 1)


# ---------------------------------------------------------------------------------------------- HDF5


def attribute(owner: Group, name: str, about: str, otherwise: str = "") -> str:
    """A text attribute of a group."""
    value = owner.attrs.get(name)
    if value is None:
        return otherwise
    if isinstance(value, np.ndarray) and value.dtype == np.uint8 and value.ndim == 1:
        value = value.tobytes()
    if isinstance(value, bytes):
        try:
            return value.split(b"\0", 1)[0].decode()
        except UnicodeDecodeError:
            raise ValueError(f"{about}: the attribute '{name}' is not text in UTF-8") from None
    if not isinstance(value, str):
        raise ValueError(f"{about}: the attribute '{name}' is {found(value)}, expected a text")
    return value


def group_at(parent: Group, name: str, about: str) -> Any:
    """A group; None if there is none."""
    value = parent.get(name)
    if isinstance(value, Rows):
        raise ValueError(f"{about}: '{name}' is an array, expected a group")
    return value


def dataset_at(parent: Group, name: str, about: str) -> Any:
    """An array of numbers; None if there is none."""
    value = parent.get(name)
    if value is not None and not (isinstance(value, Rows) and value.is_number and value.shape):
        raise ValueError(f"{about}: '{name}' is {getattr(value, 'dtype', 'a group')}, expected an array of numbers")
    return value
