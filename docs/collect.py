"""Collects the page of every sensor (src/mjsense/sensors/*/page.md) into the documentation: one page a sensor, kept in its room."""

import pathlib

from mkdocs.structure.files import File

ROOM = pathlib.Path(__file__).parent.parent / "src" / "mjsense" / "sensors"


def on_files(files, config):
    pages = sorted(ROOM.glob("*/page.md"))
    for page in pages:
        name = page.parent.name
        files.append(File.generated(config, f"sensors/{name}.md", content=page.read_text()))
        for picture in sorted(page.parent.glob("*.svg")) + sorted(page.parent.glob("*.png")):
            files.append(File.generated(config, f"sensors/{picture.name}", content=picture.read_bytes()))
    index = "# Sensors\n\n" + "".join(f"- [{p.parent.name}]({p.parent.name}.md)\n" for p in pages)
    files.append(File.generated(config, "sensors/index.md", content=index))
    return files
