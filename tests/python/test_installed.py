# SPDX-License-Identifier: Apache-2.0
"""The installed files: the public headers are complete and include only public headers; there is one version of MuJoCo."""

import re
from pathlib import Path

from mjsense.core import libmujoco

ROOT = Path(__file__).parents[2]
UMBRELLAS = ("mjsense/mjsense.h", "mjsense_tasks/mjsense_tasks.h")
PUBLIC = re.findall(r"^  (mjsense\S+\.h)$", (ROOT / "cmake/PublicHeaders.cmake").read_text(), re.MULTILINE)


def includes(header):
    return re.findall(r'^#\s*include\s+["<](mjsense(?:_tasks)?/[^">]+)[">]', (ROOT / "src" / header).read_text(), re.MULTILINE)


def test_public_headers_include_public_headers_only():
    assert sorted(set(PUBLIC), key=lambda h: (h not in UMBRELLAS, h)) == PUBLIC
    for header in PUBLIC:
        if header.startswith("mjsense/"):
            assert not [i for i in includes(header) if i.startswith("mjsense_tasks/")], f"{header} includes headers of the second library"
        private = [i for i in includes(header) if i not in PUBLIC]
        assert not private, f"{header} includes what is not installed: {private} (cmake/PublicHeaders.cmake)"
        libraries = set(re.findall(r"^#\s*include\s+<([a-z0-9_]+)/", (ROOT / "src" / header).read_text(), re.MULTILINE))
        assert libraries <= {"mujoco"}, f"{header} includes a library that users need not have: {libraries}"


def test_umbrella_headers_include_every_public_header():
    sensing, tasks = map(includes, UMBRELLAS)
    assert all(header.startswith("mjsense/") for header in sensing)
    assert tasks[0] == UMBRELLAS[0]
    assert [*UMBRELLAS, *sensing, *tasks[1:]] == PUBLIC


def test_one_series_of_mujoco():
    series = re.search(r"set\(MJSENSE_MUJOCO (\S+)\)", (ROOT / "cmake/Dependencies.cmake").read_text())[1]
    assert series == ".".join(map(str, libmujoco.SERIES))
    for file in ("pyproject.toml", "requirements.txt", "python/mjsense/core/libmujoco.py"):
        found = re.findall(r"mujoco(?:-core)?(>=[\d.]+,<[\d.]+)", (ROOT / file).read_text())
        assert set(found) == {libmujoco.REQUIREMENT.removeprefix("mujoco")}, file
