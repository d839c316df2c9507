# SPDX-License-Identifier: Apache-2.0
"""Model archives: ZIP files with a model and the files that it names. They may come from anyone, so their sizes and names are
checked before anything is decompressed, and nothing is written to disk."""

from __future__ import annotations

import io
import os
import stat
import struct
import zipfile
import zlib
from pathlib import Path
from typing import IO

from mjsense.dataset.places import open_plain

MODEL_FILE = "model.xml"

MAX_BYTES = 1 << 30
"""Of all files of an archive together. The largest scenes with scanned objects have about a third of it."""
MAX_MEMBERS = 20_000
MAX_NAME = 255  # bytes
MAX_RATIO, RATIO_FROM = 100, 64 << 20
"""Meshes and textures shrink to a tenth at best. More than this ratio is refused from this size on; small files of zeros may have
it."""

_END = struct.Struct("<4s4H2LH")  # the record at the end of a ZIP file
_DIRECTORY_ENTRY = 46 + MAX_NAME + 64  # bytes: the fixed part, a name, and some extra fields


def read_archive(path: Path) -> dict[str, bytes]:
    """The files of a model archive by name. Raises ValueError if it is damaged, exceeds a limit, or has names that are not
    plain."""
    with open_plain(path) as file:
        return files_of(file, path)


def files_of(file: IO[bytes], about: object) -> dict[str, bytes]:
    """The files of an open archive. ``about`` names it in errors."""
    try:
        _check_directory(file, about)
        with zipfile.ZipFile(file) as archive:
            members = archive.infolist()
            _check_members(members, file.seek(0, os.SEEK_END), about)
            files = {member.filename: _content(archive, member, about) for member in members}
    except (
        zipfile.BadZipFile,
        zlib.error,
        EOFError,
        NotImplementedError,
        RuntimeError,
        OSError,
        UnicodeError,
        struct.error,
        OverflowError,
    ) as error:
        raise _refusal(about, f"{error or type(error).__name__}; copy it from the original recording") from None
    if MODEL_FILE not in files:
        raise _refusal(about, f"it contains no {MODEL_FILE}")
    return files


def _content(archive: zipfile.ZipFile, member: zipfile.ZipInfo, about: object) -> bytes:
    """The bytes of a file. At most one more than it states is unpacked. ZipFile.read() would unpack up to 2 GiB, of which it then
    leaves out the rest."""
    stated, member.file_size = member.file_size, member.file_size + 1
    with archive.open(member) as file:
        content = file.read(stated + 1)
    if len(content) != stated:
        raise _refusal(about, f"{member.filename!r} does not unpack to the {stated} bytes that it states")
    return content


def archive_bytes(files: dict[str, bytes]) -> bytes:
    """An archive of these files, in this order. Equal files give equal bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(zipfile.ZipInfo(name), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def fault_of_name(name: str) -> str:
    """Why a name cannot be that of a file in an archive; "" if it can."""
    if not name or len(name.encode(errors="replace")) > MAX_NAME:
        return f"has {len(name)} characters, expected 1 to {MAX_NAME} bytes"
    if any(ord(c) < 32 or ord(c) == 127 or c in '\\:"<>' for c in name):
        return "contains a character that names of files must not have"
    if name.startswith("/") or any(part in ("", ".", "..") for part in name.split("/")):
        return "is not the name of a file inside of the archive"
    return ""


def _refusal(about: object, reason: str) -> ValueError:
    return ValueError(f"the model archive {about} cannot be read: {reason}")


def _check_directory(file: IO[bytes], about: object) -> None:
    """Checks the size of the directory before zipfile loads it. Archives of recordings have neither a comment nor 64-bit
    records."""
    size = file.seek(0, os.SEEK_END)
    if size > MAX_BYTES:
        raise _refusal(about, f"it has {size} bytes, the limit is {MAX_BYTES}")
    if size < _END.size:
        raise _refusal(about, f"it has {size} bytes and is not a ZIP file; copy it from the original recording")
    file.seek(size - _END.size)
    magic, *_, entries, length, _, comment = _END.unpack(file.read(_END.size))
    file.seek(max(0, size - _END.size - 20))
    if magic != b"PK\5\6" or comment or file.read(4) == b"PK\6\7":
        raise _refusal(about, "it does not end as a ZIP file without a comment does; copy it from the original recording")
    if entries > MAX_MEMBERS or length > MAX_MEMBERS * _DIRECTORY_ENTRY:
        raise _refusal(about, f"it states {entries} files in a directory of {length} bytes, the limit is {MAX_MEMBERS} files")
    file.seek(0)


def _check_members(members: list[zipfile.ZipInfo], size: int, about: object) -> None:
    """``size``: of the archive, in bytes."""
    if len(members) > MAX_MEMBERS:
        raise _refusal(about, f"it has {len(members)} files, the limit is {MAX_MEMBERS}")
    names: set[str] = set()
    for member in members:
        name = member.orig_filename
        if (fault := fault_of_name(name)) or name != member.filename:
            raise _refusal(about, f"the name {name[:80]!r} {fault or 'is damaged'}")
        if name in names:
            raise _refusal(about, f"{name!r} is in it twice")
        names.add(name)
        kind = stat.S_IFMT(member.external_attr >> 16)
        if kind not in (0, stat.S_IFREG):
            raise _refusal(about, f"{name!r} is a link, a folder or a device, expected a file")
        if member.flag_bits & 0x41:
            raise _refusal(about, f"{name!r} is encrypted")
        if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
            raise _refusal(
                about, f"{name!r} is compressed with method {member.compress_type}, expected 0 (stored) or 8 (deflate)"
            )
        packed = max(1, member.compress_size)
        if member.file_size > RATIO_FROM and member.file_size > MAX_RATIO * packed:
            raise _refusal(
                about, f"{name!r} would grow from {packed} to {member.file_size} bytes, the limit is a factor of {MAX_RATIO}"
            )
    for name in names:
        for parent in Path(name).parents:
            if str(parent) in names:
                raise _refusal(about, f"{str(parent)!r} is both a file and a folder in it")
    total = sum(member.file_size for member in members)
    if total > MAX_BYTES:
        raise _refusal(about, f"its files have {total} bytes, the limit is {MAX_BYTES}")
    packed = sum(member.compress_size for member in members)
    if packed > size:
        raise _refusal(about, f"its files take {packed} bytes of {size}: they overlap")
    if total > RATIO_FROM and total > MAX_RATIO * max(1, packed):
        raise _refusal(about, f"its files would grow from {packed} to {total} bytes, the limit is a factor of {MAX_RATIO}")
