# SPDX-License-Identifier: Apache-2.0
"""Files of other formats as surroundings that are only seen: C++ asks for their MJCF files."""

from __future__ import annotations

import hashlib
import tempfile
import threading
from functools import cache
from pathlib import Path

from mjsense.scene.converted_assets import convert_assets

_lock = threading.Lock()


@cache
def _folder() -> tempfile.TemporaryDirectory[str]:
    """Holds the converted files until the process ends, because scenes and the archives of recordings are made of them."""
    return tempfile.TemporaryDirectory(prefix="mjsense-backdrop-")


def backdrop_model(path: str) -> str:
    """The MJCF file of a .glb, .gltf or .obj file, which is converted once for each content.

    Raises:
        ValueError: For a file that cannot be converted.
    """
    source = Path(path)
    key = hashlib.sha256()
    if source.is_file():
        key.update(source.read_bytes())
    with _lock:
        out = Path(_folder().name) / key.hexdigest()[:16]
        made = list(out.glob("*.xml"))
        return str(made[0] if made else convert_assets(source, out, contacts=False))
