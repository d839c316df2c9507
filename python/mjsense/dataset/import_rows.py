# SPDX-License-Identifier: Apache-2.0
"""What imports of other programs' data sets share: rows that are filled by hand, and archives of models."""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
import zlib
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core, _libmujoco
from mjsense._written_rows import WrittenRows
from mjsense.recorder import FILE_OPTIONS, VIDEO_OPTIONS

if TYPE_CHECKING:
    import mujoco
else:
    mujoco = _libmujoco.shared

OPTIONS = FILE_OPTIONS | VIDEO_OPTIONS
_WRITTEN = "Values written into the previous state before this step; NaN: not written."


class Rows(WrittenRows):
    """The streams of a recording with one world."""

    def add_state(self, model: mujoco.MjModel) -> np.ndarray:
        """Declares the data for replay. Returns the array ``[1, nstate]`` to write MuJoCo's states to, in the order of mjSTATE_INTEGRATION."""
        size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
        state = self.add("replay/state", "float64", (size,), "MuJoCo's state, in the order of mjSTATE_INTEGRATION.", frame="world")
        self.add("replay/written", "float64", (size,), _WRITTEN, frame="world")[:] = np.nan
        return state

    def recorder(self, out: str | Path, rate: Fraction, settings: dict[str, Any], options: dict[str, Any]) -> Any:
        """The recorder of these streams."""
        text = json.dumps(settings, sort_keys=True)
        return _core.Recorder(None, 1, self.handles, str(out), rate.numerator, rate.denominator, text, options)


def archive_of(text: str, read: Callable[[str, str], tuple[str, bytes]]) -> tuple[str, bytes]:
    """File name and bytes of the archive of a model.

    Args:
        text: The model as MJCF.
        read: Name in the archive and content of a file, given its name in the MJCF and the folder that the MJCF states for its kind.
    """
    from xml.etree import ElementTree  # slow to import

    tree = ElementTree.fromstring(text)
    folders: dict[str, str] = {}
    for compiler in tree.iter("compiler"):
        for kind in ("assetdir", "meshdir", "texturedir"):
            folders[kind] = compiler.attrib.pop(kind, folders.get(kind, ""))
    files: dict[str, bytes] = {}
    for element in tree.iter():
        folder = folders.get({"mesh": "meshdir", "texture": "texturedir"}.get(element.tag, ""), "") or folders.get("assetdir", "")
        for key in [key for key in element.attrib if key.startswith("file")]:
            file = element.attrib[key]
            if "name" not in element.attrib and element.tag in ("mesh", "texture", "hfield"):
                element.set("name", PurePosixPath(file).stem)  # the name that it has without one
            new, content = read(file, folder)
            element.set(key, new)
            files[new] = content
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in {"model.xml": ElementTree.tostring(tree), **dict(sorted(files.items()))}.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return f"model_{hashlib.sha256(buffer.getvalue()).hexdigest()[:12]}.zip", buffer.getvalue()


def unique_name(file: str, content: bytes) -> str:
    """Name of a file in an archive: files of different folders may have one name."""
    return f"{zlib.crc32(content):08x}_{PurePosixPath(file).name}"


def compile_archive(archive: bytes, about: str) -> mujoco.MjModel:
    """The model of an archive."""
    if mujoco is None:
        raise RuntimeError(f"import needs the series of MuJoCo that mjsense uses: {_libmujoco.explain()}")
    with zipfile.ZipFile(io.BytesIO(archive)) as files:
        contents = {name: files.read(name) for name in files.namelist()}
    try:
        return mujoco.MjModel.from_xml_string(contents.pop("model.xml").decode(), contents)
    except ValueError as error:
        raise ValueError(f"{about}: MuJoCo {mujoco.__version__} cannot compile its model: {error}") from error
