# SPDX-License-Identifier: Apache-2.0
"""Copies libmujoco and its plugins under names that no other libmujoco has.

    private_mujoco.py MUJOCO_FOLDER LIBMUJOCO OUTPUT_FOLDER

The dynamic linker identifies a library by its SONAME. With a name of its own, the copy and the libmujoco of any installed
`mujoco` can be loaded into one process. Only strings of the dynamic section are changed; no code.
"""

from __future__ import annotations

import struct
import sys
from pathlib import Path

SONAME = "libmj_mjsense.so"
PT_LOAD, PT_DYNAMIC = 1, 2
DT_NEEDED, DT_STRTAB, DT_SONAME = 1, 5, 14


def renamed(image: bytearray, old: bytes, new: bytes) -> bytearray:
    """The image with `old` replaced by `new` as its own name and as a library that it needs."""
    if image[:6] != b"\x7fELF\x02\x01":
        raise ValueError("not a 64-bit little-endian ELF file")
    if len(new) > len(old):
        raise ValueError(f"{new!r} is longer than {old!r}, whose place it takes")
    (table,) = struct.unpack_from("<Q", image, 32)
    size, count = struct.unpack_from("<HH", image, 54)
    headers = [struct.unpack_from("<IIQQQQ", image, table + i * size) for i in range(count)]

    def offset(address: int) -> int:
        return next(
            at + address - start
            for kind, _, at, start, _, length in headers
            if kind == PT_LOAD and start <= address < start + length
        )

    place, length = next((at, length) for kind, _, at, _, _, length in headers if kind == PT_DYNAMIC)
    entries = [struct.unpack_from("<QQ", image, at) for at in range(place, place + length, 16)]
    strings = next(offset(value) for tag, value in entries if tag == DT_STRTAB)
    found = False
    for tag, value in entries:
        if tag in (DT_NEEDED, DT_SONAME) and image[strings + value : strings + value + len(old) + 1] == old + b"\0":
            image[strings + value : strings + value + len(old)] = new.ljust(len(old), b"\0")
            found = True
    if not found:
        raise ValueError(f"neither SONAME nor NEEDED is {old!r}")
    return image


def main() -> None:
    folder, library, out = map(Path, sys.argv[1:])
    old = library.name.encode()
    jobs = [(library, out / SONAME), *((file, out / "plugin" / file.name) for file in sorted((folder / "plugin").glob("*.so")))]
    for source, target in jobs:
        target.parent.mkdir(parents=True, exist_ok=True)
        target.unlink(missing_ok=True)  # a process may have mapped it
        target.write_bytes(renamed(bytearray(source.read_bytes()), old, SONAME.encode()))
        target.chmod(0o755)
    for licence in sorted(folder.parent.glob("mujoco_core-*.dist-info/licenses/*")):
        (out / f"{licence.stem}.mujoco{licence.suffix}").write_bytes(licence.read_bytes())


if __name__ == "__main__":
    main()
