# SPDX-License-Identifier: Apache-2.0
"""OpenEXR pictures of surroundings, which the package OpenEXR reads."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from mjsense.core.optional import optional

_MAX_HEIGHT = 4096
_MAX_CHANNELS = 16
_LARGEST = 1e9


def radiance_file(path: str, content: bytes) -> bytes:
    """The picture as a Radiance file, which the library reads. Its mantissas have 8 bits: the error is at most 0.4 %.

    Raises:
        ModuleNotFoundError: Without the package OpenEXR.
        ValueError: For a file that is damaged, too large, of a wrong size, or without the channels R, G and B of finite values.
    """
    openexr = optional("OpenEXR", "exr", f"environment '{path}'")
    with tempfile.TemporaryDirectory() as folder:
        # The file may change while it is read, and its size is checked before its pixels are decoded.
        copy = Path(folder, "picture.exr")
        copy.write_bytes(content)
        try:
            opened = openexr.File(str(copy), header_only=True)
            if len(opened.parts) != 1:  # the package would decode all of them
                raise _BadPicture(f"{len(opened.parts)} pictures; a file with one is expected")
            header = opened.header()
            window = header["dataWindow"]
            width, height = (int(x) + 1 for x in np.subtract(window[1], window[0]))
            if not 1 <= height <= _MAX_HEIGHT or width != 2 * height:
                raise _BadPicture(
                    f"{width} x {height} pixels; an equirectangular image is twice as wide as high, and at most "
                    f"{2 * _MAX_HEIGHT} x {_MAX_HEIGHT} pixels are read"
                )
            if len(header["channels"]) > _MAX_CHANNELS:
                raise _BadPicture(f"{len(header['channels'])} channels; at most {_MAX_CHANNELS} are read")
            channels = openexr.File(str(copy), separate_channels=True).channels()
            missing = [name for name in "RGB" if name not in channels]
            if missing:
                raise _BadPicture(f"no channel {missing[0]}; there are {', '.join(map(str, channels)) or 'none'}")
            rgb = np.stack([np.asarray(channels[name].pixels, np.float32) for name in "RGB"], -1)
        except _BadPicture as error:
            raise ValueError(f"environment '{path}': {error}") from None
        except Exception as error:  # the package raises several types for damaged files
            raise ValueError(f"environment '{path}': not an OpenEXR picture, or damaged") from error
    if rgb.shape != (height, width, 3):
        raise ValueError(f"environment '{path}': its channels have other sizes than its window")
    if not (rgb >= 0).all() or not (rgb <= _LARGEST).all():
        y, x, c = np.argwhere(~((rgb >= 0) & (rgb <= _LARGEST)))[0]
        raise ValueError(
            f"environment '{path}': radiance {rgb[y, x, c]:g} in column {x}, row {y}; values are from 0 to {_LARGEST:g}"
        )
    mantissa, exponent = np.frexp(rgb.max(-1))
    scale = np.where(mantissa > 0, np.ldexp(1.0, 8 - np.maximum(exponent, -127)), 0)
    rgbe = np.zeros((height, width, 4), np.uint8)
    rgbe[..., :3] = np.minimum(np.round(rgb * scale[..., None]), 255)
    rgbe[..., 3] = np.where(mantissa > 0, np.maximum(exponent, -127) + 128, 0)
    return b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + f"-Y {height} +X {width}\n".encode() + rgbe.tobytes()


class _BadPicture(Exception):
    pass
