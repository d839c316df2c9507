# SPDX-License-Identifier: Apache-2.0
"""What imports of other programs' data sets share: rows that are filled by hand, and archives of models."""

from __future__ import annotations

import hashlib
import io
import json
import math
import re
import zlib
from collections.abc import Callable, Sequence
from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.core import libmujoco
from mjsense.dataset.archive import MAX_BYTES, MODEL_FILE, archive_bytes, files_of
from mjsense.dataset.closed_model import check_member, close_names, compile_closed, parsed
from mjsense.dataset.model_sizes import check_sizes
from mjsense.recording.written_rows import WrittenRows

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = libmujoco.shared

MAX_OBSERVATION = 1 << 29  # bytes of all streams together; an image of 2^25 pixels has 10^8
NOT_A_NUMBER = " NaN: as in the imported file."
"""The end of the descriptions of its numbers."""
_WRITTEN = "Values written into the previous state before this step; NaN: not written."


class Rows(WrittenRows):
    """The streams of a recording with one world.

    Args:
        about: The data set, for errors.
    """

    def __init__(self, about: str) -> None:
        super().__init__()
        self._about, self._bytes = about, 0

    def add(self, name: str, dtype: str, shape: Sequence[int], description: str, **more: Any) -> np.ndarray:
        self._bytes += math.prod(shape) * np.dtype(dtype).itemsize
        if self._bytes > MAX_OBSERVATION:
            raise ValueError(f"{self._about}: one observation has more than {MAX_OBSERVATION} bytes, which is the limit")
        return super().add(name, dtype, shape, description, **more)

    def add_state(self, model: mujoco.MjModel) -> np.ndarray:
        """Declares the data for replay. Returns the array ``[1, nstate]`` to write MuJoCo's states to, in the order of
        mjSTATE_INTEGRATION."""
        size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
        state = self.add(
            "replay/state", "float64", (size,), "MuJoCo's state, in the order of mjSTATE_INTEGRATION.", frame="world"
        )
        self.add("replay/written", "float64", (size,), _WRITTEN, frame="world")[:] = np.nan
        return state

    def recorder(self, out: str | Path, rate: Fraction, settings: dict[str, Any], options: dict[str, Any]) -> Any:
        """The recorder of these streams."""
        text = json.dumps(settings, sort_keys=True)
        return _core.Recorder(None, 1, self.handles, str(out), rate.numerator, rate.denominator, text, options)


def archive_of(text: str, read: Callable[[str, str], tuple[str, bytes]], about: str) -> tuple[str, bytes]:
    """File name and bytes of the archive of a model, with the files that MuJoCo reads when it compiles it.

    Args:
        text: The model as MJCF.
        read: Name in the archive and content of a file, given its name in the MJCF and the folder that the MJCF states for its
            kind.
        about: The file with the model, for errors.
    """
    from xml.etree import ElementTree  # slow to import

    root = parsed(text, about)
    files: dict[str, bytes] = {}

    def find(element: ElementTree.Element, key: str, file: str, folder: str) -> str:
        name, content = read(file, folder)
        check_member(element, name, about)
        files[name] = content
        if sum(map(len, files.values())) > MAX_BYTES:
            raise ValueError(f"{about}: the files of the model have more than {MAX_BYTES} bytes, which is the limit")
        return name

    close_names(root, find, about)
    check_sizes(root, files, about)
    content = archive_bytes({MODEL_FILE: ElementTree.tostring(root), **dict(sorted(files.items()))})
    return f"model_{hashlib.sha256(content).hexdigest()[:12]}.zip", content


def unique_name(file: str, content: bytes) -> str:
    """Name of a file in an archive: files of different folders may have one name."""
    name = re.sub(r"[^\w.\-]", "_", PurePosixPath(file.replace("\\", "/")).name)
    return f"{zlib.crc32(content):08x}_{name[-100:]}"


def compile_archive(archive: bytes, about: str) -> mujoco.MjModel:
    """The model of an archive."""
    if mujoco is None:
        raise RuntimeError(f"import needs the series of MuJoCo that mjsense uses: {libmujoco.explain()}")
    return compile_closed(files_of(io.BytesIO(archive), about), about)
