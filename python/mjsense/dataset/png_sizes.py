# SPDX-License-Identifier: Apache-2.0
"""Sizes of a PNG file, found before a library allocates memory for its contents."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator

_CHANNELS = {0: 1, 2: 3, 3: 1, 4: 2, 6: 4}
"""Channels of a PNG file's pixels by its colour type."""
_TEXTS = (b"zTXt", b"iTXt", b"iCCP")
_MAX_TEXT, _MAX_RATIO = 1 << 24, 1032  # bytes of a text that MuJoCo's reader unpacks, and the largest ratio of deflate
_PIECE = 1 << 20


def image_size(content: bytes) -> tuple[int, int]:
    """Width and height that a PNG file states; (0, 0) if it is none."""
    if content[:8] != b"\x89PNG\r\n\x1a\n" or len(content) < 24:
        return 0, 0
    return struct.unpack(">II", content[16:24])


def unpacked_size(content: bytes, about: str) -> int:
    """Number of bytes, at most, to which the pixels and texts of a PNG file unpack; 0 for other files.

    Raises:
        ValueError: The pixels are damaged, or unpack to more than the stated width and height. MuJoCo compares these after it has
            unpacked all.
    """
    width, height = image_size(content)
    if not width or not height or len(content) < 26:
        return 0
    # Interlaced images have up to four times as many lines, each with a byte for its filter and one to fill up.
    most = height * (width * content[24] * _CHANNELS.get(content[25], 4) // 8 + 8)
    chunks = list(_chunks(content))
    pixels = b"".join(data for kind, data in chunks if kind == b"IDAT")
    if _MAX_RATIO * len(pixels) > most:
        unpacker, packed, size = zlib.decompressobj(-zlib.MAX_WBITS), pixels[2:], 0
        try:
            while not unpacker.eof and size <= most and (piece := unpacker.decompress(packed, _PIECE)):
                size, packed = size + len(piece), unpacker.unconsumed_tail
        except zlib.error as error:
            raise ValueError(f"{about}: its pixels are damaged: {error}") from None
        if size > most:
            raise ValueError(f"{about}: its pixels unpack to more than the {width} x {height} pixels that it states")
    return most + sum(min(_MAX_RATIO * len(data), _MAX_TEXT) for kind, data in chunks if kind in _TEXTS)


def text_size(content: bytes) -> int:
    """Number of bytes, at most, to which the texts of a PNG file unpack without a limit of the reader."""
    return sum(_MAX_RATIO * len(data) for kind, data in _chunks(content) if kind in _TEXTS)


def _chunks(content: bytes) -> Iterator[tuple[bytes, memoryview]]:
    """Kind and data of each chunk of a PNG file."""
    at, view = 8, memoryview(content)
    while at + 8 <= len(content):
        size, kind = struct.unpack_from(">I4s", content, at)
        yield kind, view[at + 8 : at + 8 + size]
        at += 12 + size
