# SPDX-License-Identifier: Apache-2.0
"""What is installed: the public headers, alone and complete, and one version of MuJoCo."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PUBLIC = re.findall(r"^  (mjsense/\S+\.h)$", (ROOT / "cmake/PublicHeaders.cmake").read_text(), re.MULTILINE)


def includes(header):
    return re.findall(r'^#\s*include\s+["<](mjsense/[^">]+)[">]', (ROOT / "src" / header).read_text(), re.MULTILINE)


def test_public_headers_include_public_headers_only():
    assert sorted(set(PUBLIC), key=lambda h: (h != "mjsense/mjsense.h", h)) == PUBLIC
    for header in PUBLIC:
        private = [i for i in includes(header) if i not in PUBLIC]
        assert not private, f"{header} includes what is not installed: {private} (cmake/PublicHeaders.cmake)"
        libraries = set(re.findall(r"^#\s*include\s+<([a-z0-9_]+)/", (ROOT / "src" / header).read_text(), re.MULTILINE))
        assert libraries <= {"mujoco"}, f"{header} includes a library that is an affair of ours: {libraries}"


def test_the_umbrella_is_every_public_header():
    assert ["mjsense/mjsense.h", *includes("mjsense/mjsense.h")] == PUBLIC


def test_one_version_of_mujoco():
    version = re.search(r"set\(MJSENSE_MUJOCO (\S+)\)", (ROOT / "cmake/Dependencies.cmake").read_text())[1]
    for file, found in {
        "pyproject.toml": r"mujoco-core==([\d.]+)",
        "requirements.txt": r"mujoco-core==([\d.]+)",
        "python/mjsense/__init__.py": r'_MUJOCO = "([\d.]+)"',
    }.items():
        assert set(re.findall(found, (ROOT / file).read_text())) == {version}, file
