# SPDX-License-Identifier: Apache-2.0
"""An export format as another package adds one: a text file with one line of JSON for each episode. Run by test_new_format.py."""

import json

from mjsense.exporting.formats import FORMATS, Format

FORMATS["lines"] = Format("one line for each episode", "programs that read JSON", "export", "json", ("trim_idle",), module=__name__)


def write(source, path, progress=None):
    lines = [{"episode": e.index, "steps": e.length - 1, "action": source.rows(e)["action"].tolist()} for e in source.each(progress)]
    path.write_text("".join(f"{json.dumps(line)}\n" for line in lines))


def join(source, parts, path):
    path.write_text("".join(part.read_text() for part in parts))
