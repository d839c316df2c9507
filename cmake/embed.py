# SPDX-License-Identifier: Apache-2.0
"""embed.py MODELS_DIR OUT.cc: write every MJCF and TOML below MODELS_DIR as a string of mjsense::embedded_models()."""

import pathlib
import sys

root, out = map(pathlib.Path, sys.argv[1:])
lines = ['#include "mjsense/core/files/embedded_files.h"', "", "#include <array>", "", "namespace mjsense {", "namespace {"]
files = sorted(p for p in root.rglob("*") if p.suffix in (".xml", ".toml"))
for i, path in enumerate(files):
    data = path.read_bytes()
    rows = [",".join(str(b) for b in data[k : k + 120]) for k in range(0, len(data), 120)]
    lines.append(f"constexpr char kFile{i}[] = {{" + ",\n".join(rows) + ("," if rows else "") + "0};")
lines.append(f"constexpr std::array<EmbeddedFile, {len(files)}> kFiles = {{{{")
lines += [f'    {{"{p.relative_to(root).as_posix()}", {{kFile{i}, {p.stat().st_size}}}}},' for i, p in enumerate(files)]
lines += [
    "}};",
    "}  // namespace",
    "std::span<const EmbeddedFile> embedded_files() { return kFiles; }",
    "}  // namespace mjsense",
    "",
]
out.write_text("\n".join(lines))
