# SPDX-License-Identifier: Apache-2.0
"""MJCF of untrusted files in a form in which MuJoCo reads the files of an archive and no others.

MuJoCo reads a file from disk if it is not among those in memory: when it parses (``include``, ``model``, ``flexcomp``) and when
it compiles (meshes, textures, height fields, skins). Therefore the text that it gets is written here, from the elements that a
strict XML parser has found: no element that reads files when it is parsed, and no name of a file that is not a member of the
archive. What the elements ask for, such as textures of 60,000 x 60,000 pixels, is counted before MuJoCo allocates it.
"""

from __future__ import annotations

import contextlib
import posixpath
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING
from xml.parsers import expat

from mjsense.core import libmujoco
from mjsense.dataset.archive import MODEL_FILE, fault_of_name, read_archive
from mjsense.dataset.model_sizes import MAX_ARENA, check_sizes

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

    import mujoco
else:
    mujoco = libmujoco.shared

MAX_TEXT = 64 << 20  # bytes
MAX_ELEMENTS = 300_000
MAX_DEPTH = 400  # MuJoCo's parser stops at 500

FILE_TAGS = {"mesh": "meshdir", "texture": "texturedir", "hfield": "assetdir", "skin": "assetdir"}
"""Elements that name files, and the attribute of ``compiler`` with the folder of their files."""
SIDES = ("fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")
_FOLDERS = ("assetdir", "meshdir", "texturedir")
_MESHES = (".stl", ".obj", ".msh")
_CONTENT = {
    "image/png",
    "image/ktx",
    "image/vnd.mujoco.texture",
    "image/vnd.mujoco.hfield",
    "model/stl",
    "model/obj",
    "model/vnd.mujoco.msh",
}
_CONVERSION = re.compile(r"%[-+ #0'*.$\dhlLqjztw]*[A-Za-z]")
"""MuJoCo 4.0.1 uses a name that it does not know as the format of a message: ``%n`` ends the process."""
_ERRORS: tuple[type[Exception], ...] = (ValueError, RuntimeError, *((mujoco.FatalError,) if libmujoco.shared else ()))
_REFUSED = {"include": "reads other files", "attach": "reads other files", "model": "reads other files"}


def parsed(text: str | bytes, about: str) -> Element:
    """The root of a model's MJCF: elements and attributes only. Raises ValueError for a document type, entities, and text beyond
    the limits."""
    from xml.etree.ElementTree import TreeBuilder  # slow to import

    if len(text) > MAX_TEXT:
        raise ValueError(f"{about}: the model has {len(text)} bytes, the limit is {MAX_TEXT}")
    builder, parser = TreeBuilder(), expat.ParserCreate()
    count = depth = 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal count, depth
        count, depth = count + 1, depth + 1
        if count > MAX_ELEMENTS or depth > MAX_DEPTH:
            what, limit = ("elements", MAX_ELEMENTS) if count > MAX_ELEMENTS else ("nested elements", MAX_DEPTH)
            raise ValueError(f"{about}: line {parser.CurrentLineNumber}: more than {limit} {what}, which is the limit")
        for key, value in attributes.items():
            if "%" in value and _CONVERSION.search(value):
                raise ValueError(
                    f"{about}: line {parser.CurrentLineNumber}: {key[:40]} of '{tag[:40]}' is {value[:60]!r}, which "
                    "is a format of printf"
                )
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def doctype(*_: object) -> None:
        raise ValueError(f"{about}: line {parser.CurrentLineNumber}: a document type, which a model must not have")

    parser.StartElementHandler, parser.EndElementHandler, parser.StartDoctypeDeclHandler = start, end, doctype
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise ValueError(f"{about}: not valid XML: {error}") from None
    except LookupError as error:  # an unknown encoding
        raise ValueError(f"{about}: not valid XML: {error}") from None
    root = builder.close()
    if root.tag != "mujoco":
        raise ValueError(f"{about}: the root element is '{root.tag[:40]}', expected 'mujoco'")
    _check_numbers(root, about)
    return root


def _check_numbers(root: Element, about: str) -> None:
    """Raises ValueError for NaN, which MuJoCo only warns of."""
    names = {element.get(key) for element in root.iter() for key in ("name", "class")}
    for element in root.iter():
        for key, value in element.items():
            if "nan" not in value.lower() or value in names or element.tag == "text":
                continue
            if any(word.lower().lstrip("+-") == "nan" for word in value.split()):
                raise ValueError(f"{about}: {key[:40]} of '{element.tag[:40]}' is {value[:60]!r}, expected finite numbers")


def close_names(root: Element, find: Callable[[Element, str, str, str], str], about: str) -> None:
    """Replaces all names of files by those that ``find`` gives, which are relative to no folder.

    Args:
        find: Given an element, the attribute, its value and the folder that the model states for it. It raises ValueError for
            unknown files.
    """
    for element in root.iter():
        if element.tag in _REFUSED:
            raise ValueError(
                f"{about}: the element '{element.tag}' {_REFUSED[element.tag]}, which the model of a recording must not"
            )
        for key in element.attrib:
            named = (key.startswith("file") and key != "file" and key not in SIDES) or (
                key == "file" and element.tag not in FILE_TAGS
            )
            if named or (key in SIDES and element.tag != "texture"):
                raise ValueError(
                    f"{about}: the element '{element.tag[:40]}' names a file ('{key[:40]}'), expected one of "
                    f"{', '.join(FILE_TAGS)}"
                )
        kind = element.get("content_type")
        if kind is not None and kind not in _CONTENT:
            raise ValueError(
                f"{about}: the content_type {kind[:80]!r} of '{element.tag[:40]}' is unknown, expected one of "
                f"{', '.join(sorted(_CONTENT))}"
            )
        plugin = element.get("plugin")
        if plugin is not None and not re.fullmatch(r"mujoco\.[\w.]{1,80}", plugin):
            raise ValueError(f"{about}: the plugin {plugin[:80]!r} is not one of MuJoCo's own")
    folders: dict[str, str] = dict.fromkeys(_FOLDERS, "")
    strip = False
    for compiler in root.iter("compiler"):
        for key in _FOLDERS:
            folders[key] = compiler.attrib.pop(key, folders[key])
        strip = compiler.attrib.pop("strippath", "true" if strip else "false") == "true"
    unread = any(one.get("builtin", "none") != "none" for default in root.iter("default") for one in default.iter("texture"))
    for element in root.iter():
        if element.tag not in FILE_TAGS:
            continue
        if element.tag == "texture":
            if element.get("builtin", "checker" if unread else "none") != "none":  # MuJoCo does not read the files of these
                for key in ("file", *SIDES):
                    element.attrib.pop(key, None)
            elif "file" in element.attrib:
                for key in SIDES:
                    element.attrib.pop(key, None)
        elif "file" in element.attrib and (also := {"vertex", "builtin", "elevation"} & element.attrib.keys()):
            raise ValueError(f"{about}: the {element.tag} '{element.get('name', '')[:80]}' has both a file and '{min(also)}'")
        for key in ("file", *SIDES):
            if key not in element.attrib:
                continue
            file = element.attrib[key]
            if "name" not in element.attrib and key == "file" and element.tag != "skin":
                # The name that it has without one.
                element.set("name", posixpath.splitext(posixpath.basename(file.replace("\\", "/")))[0])
            folder = folders[FILE_TAGS[element.tag]] or folders["assetdir"]
            element.set(key, find(element, key, posixpath.basename(file) if strip else file, folder))


def check_member(element: Element, name: str, about: str) -> None:
    """Raises ValueError for a file of which MuJoCo could take the name or the kind for something else."""
    if fault := fault_of_name(name):
        raise ValueError(
            f"{about}: the {element.tag} '{element.get('name', '')[:80]}' names the file {name[:80]!r}, which {fault}"
        )
    if element.tag == "mesh" and not name.lower().endswith(_MESHES):
        raise ValueError(
            f"{about}: the mesh '{element.get('name', '')[:80]}' names the file {name[:80]!r}, expected one of "
            f"{', '.join(_MESHES)}"
        )


def closed_model(text: str | bytes, members: Mapping[str, bytes], about: str) -> str:
    """MJCF that MuJoCo compiles from these files only.

    Args:
        text: The model as MJCF.
        members: The other files by name.
        about: The file, for errors.

    Raises:
        ValueError: The model names a file that is not in ``members``, contains an element that reads files, or exceeds a limit.
    """
    from xml.etree import ElementTree  # slow to import

    root = parsed(text, about)

    def find(element: Element, key: str, file: str, folder: str) -> str:
        for name in (posixpath.normpath(posixpath.join(folder, file)), file):
            if name in members:
                check_member(element, name, about)
                return name
        raise ValueError(
            f"{about}: the {element.tag} '{element.get('name', '')[:80]}' names the file {file[:120]!r}, which is "
            "not in the archive"
        )

    close_names(root, find, about)
    check_sizes(root, members, about)
    return ElementTree.tostring(root, encoding="unicode")


def check_archive(path: str | Path) -> None:
    """Raises ValueError, with one line, if the files of an archive cannot be read, or if its model names other files or is too
    large.

    The model is not compiled.
    """
    files = read_archive(Path(path))
    text = files.pop(MODEL_FILE)
    closed_model(text, files, f"{path}: {MODEL_FILE}")


def compile_closed(files: Mapping[str, bytes], about: str) -> mujoco.MjModel:
    """The model of an archive's files. ``about`` names the archive in errors; the package ``mujoco`` must be of mjsense's
    series."""
    members = {name: content for name, content in files.items() if name != MODEL_FILE}
    text = closed_model(files[MODEL_FILE], members, f"{about}: {MODEL_FILE}")
    with compiling(about):
        spec = mujoco.MjSpec.from_string(text, assets=members)
        if unknown := [name for name in _files_of(spec) if name not in members]:
            raise ValueError(f"it reads the file {unknown[0][:120]!r}, which is not in the archive")
        model = spec.compile()
    check_compiled(model, about)
    return model


@contextlib.contextmanager
def compiling(about: str) -> Iterator[None]:
    """Errors of MuJoCo as one line with the name of the archive."""
    try:
        yield
    except _ERRORS as error:
        raise ValueError(f"{about}: MuJoCo cannot compile the model: {' '.join(str(error).split())}") from None


def _files_of(spec: mujoco.MjSpec) -> Iterator[str]:
    """Names of all files that the compiler reads."""
    for element in (*spec.meshes, *spec.hfields, *spec.skins, *spec.textures):
        yield from filter(None, [element.file, *getattr(element, "cubefiles", ())])
    yield from filter(None, [getattr(spec, folder, "") or "" for folder in ("meshdir", "texturedir")])


def check_compiled(model: mujoco.MjModel, about: str) -> None:
    """Raises ValueError for a model that needs too much memory, or whose time step is not usable."""
    for what, size in (("arrays", model.nbuffer), ("arena", model.narena)):
        if size > MAX_ARENA:
            raise ValueError(f"{about}: the {what} of the model have {size} bytes, the limit is {MAX_ARENA}")
    if not 1e-9 < model.opt.timestep < 1e3:
        raise ValueError(
            f"{about}: the timestep of the model is {model.opt.timestep} s, expected more than 1e-9 s and less than 1000 s"
        )
