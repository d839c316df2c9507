# SPDX-License-Identifier: Apache-2.0
"""Collects the pages that stand in the rooms (src/mjsense/sensors/*/page.md and so on) and beside robots into the documentation."""

import pathlib

from mkdocs.structure.files import File

ROOT = pathlib.Path(__file__).parent.parent
SOURCE = ROOT / "src" / "mjsense"
ROOMS = {"sensors": SOURCE, "robots": ROOT / "models", "tasks": SOURCE, "policies": SOURCE}
ALONE = ("effects",)  # rooms with one page


def on_files(files, config):
    for room, root in ROOMS.items():
        pages = sorted((root / room).glob("*/page.md"))
        for page in pages:
            files.append(File.generated(config, f"{room}/{page.parent.name}.md", content=page.read_text().replace("../../../../docs/", "../")))
            for picture in sorted(page.parent.glob("*.svg")) + sorted(page.parent.glob("*.png")):
                files.append(File.generated(config, f"{room}/{picture.name}", content=picture.read_bytes()))
        index = f"# {room.capitalize()}\n\n" + "".join(f"- [{p.parent.name}]({p.parent.name}.md)\n" for p in pages)
        files.append(File.generated(config, f"{room}/index.md", content=index))
    for room in ALONE:
        files.append(File.generated(config, f"{room}.md", content=(SOURCE / room / "page.md").read_text()))
    files.append(File.generated(config, "changelog.md", content=(ROOT / "CHANGELOG.md").read_text().replace("](docs/", "](")))
    return files
