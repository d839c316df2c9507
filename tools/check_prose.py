#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Finds phrases that do not belong in plain technical English, and misspelt words.

    tools/check_prose.py             the whole tree
    tools/check_prose.py PATH ...    these files or folders

In Markdown, text outside code is checked; in C++, Python, CMake and shell files, comments and string literals; in TOML, YAML and
XML files, comments.
"""

from __future__ import annotations

import io
import re
import subprocess
import sys
import tokenize
from collections.abc import Callable, Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]

CHECKED = [
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "CMakeLists.txt",
    "src",
    "python",
    "tests",
    "tools",
    "bench",
    "examples",
    "docs",
    "packaging",
    "models",
    "cmake",
    "dev",
    ".ci",
    ".github",
]

QUOTES = {"check_prose.py", "test_prose.py"}  # not checked: these files quote the phrases

# Phrase -> what to write instead. Only phrases that are wrong nearly everywhere.
PHRASES = {
    r"\b(?:no|any|some|every)body\b": "name the component or the user",
    r"\bwhoever\b|\bwho (?:waits|asks|pushes|pulls|leaves|sends|writes|reads)\b": "name the component or the user",
    r"\bstrangers?\b": "untrusted files, third parties",
    r"\bof (?:yours|ours)\b": "your own, user-defined; built-in",
    r"\b(?:is|are|was|were) (?:asked|told)\b": "is called, is evaluated, receives",
    r"\bbeside\b": "compared with, in addition to, next to",
    r"\b(?:goes|go|went|gone) on(?: with)?\b": "continues",
    r"\bsays? so\b|\bsays? nothing of\b": "state what is reported",
    r"(?<!there )\b(?:is|are) no (?!longer|more|less|fewer|better|worse|larger|smaller|other)\w+": "is not a, has no",
    r"\binto senses\b": "name what is measured",
    r"\bdeeds?\b": "action",
    r"\bin the manner of\b": "like",
    r"\bwhere to\?|\bwhence\b|\bwhither\b|\bthereof\b|\bwherein\b|\bhitherto\b": "use plain words",
    r"\bthe least of\b|\bthe most of\b|\bat the most\b|\bat the least\b": "minimum, maximum, at most, at least",
    r"\bas it is there\b|\bas of ours\b": "use plain words",
    r"\bgive (?:--|out)": "pass",
    r"(?:^|[.:;|] |[\"'])What (?!is new)(?:nobody|nothing|cannot|can|a|is|are|does|has|they|it|others|lies|stands)\b"
    r"[^.?!|]*\b(?:is|are|costs|stays)\b": "begin the sentence with its subject",
}
RULES = [(re.compile(pattern, re.IGNORECASE), advice) for pattern, advice in PHRASES.items()]

# Names and words of other languages that codespell takes for mistakes.
SPELLED = "reacher,kinf,ot,lod,datas,shepperd,fro,nd"
SPELLING = [
    "docs",
    "src",
    "python",
    "tools",
    "bench",
    "examples",
    "models",
    "cmake",
    "packaging",
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
]
SKIPPED = "*_test.cc,test_*.py,*.xml,*.png,*.jpg,*.svg,*.stl,*.obj,*.msh,*.npy,_core.pyi"  # tests misspell on purpose


def markdown(text: str) -> Iterator[tuple[int, str]]:
    """(line, text) of paragraphs, list items and table rows, without code, headings and generated tables."""
    text = re.sub(r"<!-- (?:fields|data) .*?<!-- end -->|<!--.*?-->", blank, text, flags=re.DOTALL)
    text = re.sub(r"^(```+)[^\n]*\n.*?^\1", blank, text, flags=re.DOTALL | re.MULTILINE)
    text = re.sub(r"`[^`\n]*`", "`x`", text)
    return blocks(text.splitlines(), lambda line: re.match(r"\s*$|    \S|#", line), lambda line: re.match(r"\s*[-*|] ?", line))


def blank(match: re.Match[str]) -> str:
    return "\n" * match[0].count("\n")


def blocks(lines, ends, begins) -> Iterator[tuple[int, str]]:
    start, words = 0, []
    for number, line in enumerate([*lines, ""], 1):
        if words and (ends(line) or begins(line)):
            yield start, " ".join(words)
            words = []
        if not ends(line):
            start = start if words else number
            words.append(re.sub(r"^\s*(?:[-*|] ?)?", "", line).strip())


def cpp(text: str) -> Iterator[tuple[int, str]]:
    lines = [m[1] if (m := re.search(r"(?:^|\s)//+<? ?(.*)$", line)) else "" for line in text.splitlines()]
    yield from blocks(lines, lambda line: not line.strip(), lambda line: False)
    for number, line in enumerate(text.splitlines(), 1):
        code = re.sub(r"(?:^|\s)//.*$", "", line)
        yield from ((number, m[1]) for m in re.finditer(r'"((?:[^"\\]|\\.)*)"', code) if not line.startswith("#include"))


def python(text: str) -> Iterator[tuple[int, str]]:
    comments = [""] * (text.count("\n") + 1)
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            comments[token.start[0] - 1] = token.string.lstrip("# ")
        elif token.type == tokenize.STRING:
            for line, block in blocks(token.string.splitlines(), lambda line: not line.strip(), lambda line: False):
                yield token.start[0] + line - 1, block
    yield from blocks(comments, lambda line: not line.strip(), lambda line: False)


def hashes(text: str) -> Iterator[tuple[int, str]]:
    """Comments of files in which they begin with '#'."""
    lines = [m[1] if (m := re.search(r"(?:^|\s)#+!? ?(.*)$", line)) else "" for line in text.splitlines()]
    yield from blocks(lines, lambda line: not line.strip(), lambda line: False)


def script(text: str) -> Iterator[tuple[int, str]]:
    """Comments, strings and here-documents of shell and CMake files."""
    yield from hashes(text)
    for match in re.finditer(r"<<'?(\w+)'?.*\n((?:.*\n)*?)\1$", text, re.MULTILINE):
        first = text.count("\n", 0, match.start(2)) + 1
        yield from ((first + i, line) for i, line in enumerate(match[2].splitlines()))
    for number, line in enumerate(text.splitlines(), 1):
        yield from ((number, m[1]) for m in re.finditer(r'"((?:[^"\\]|\\.)*)"', line))


def xml(text: str) -> Iterator[tuple[int, str]]:
    for match in re.finditer(r"<!--(.*?)-->", text, re.DOTALL):
        yield text.count("\n", 0, match.start()) + 1, " ".join(match[1].split())


# By suffix, or by name for files without one.
READERS = {
    ".md": markdown,
    ".h": cpp,
    ".cc": cpp,
    ".py": python,
    ".pyi": python,
    ".cmake": script,
    ".sh": script,
    "dev": script,
    "run": script,
    ".toml": hashes,
    ".yml": hashes,
    ".txt": hashes,
    ".supp": hashes,
    ".xml": xml,
}


def reader(path: Path) -> Callable[[str], Iterator[tuple[int, str]]] | None:
    return READERS.get(path.suffix or path.name)


def findings(path: Path) -> Iterator[str]:
    """One line for each phrase of the list."""
    read = reader(path)
    assert read is not None, f"no reader of {path.name}"
    for line, block in read(path.read_text()):
        for rule, advice in RULES:
            for match in rule.finditer(block):
                yield f"{path}:{line}: '{match[0].strip()}' -> {advice}"


def files(names: list[str]) -> Iterator[Path]:
    for name in names:
        for path in sorted(ROOT.glob(name)) if "*" in name else [ROOT / name]:
            inside = [p for p in sorted(path.rglob("*")) if reader(p) and p.is_file() and p.name not in QUOTES]
            yield from inside if path.is_dir() else [path]


def main(names: list[str]) -> int:
    found = [finding for path in files(names or CHECKED) for finding in findings(path)]
    print("\n".join(found), end="\n" if found else "")
    spelling = subprocess.run(
        [
            sys.executable,
            "-m",
            "codespell_lib",
            "--quiet-level",
            "3",
            "--ignore-words-list",
            SPELLED,
            "--skip",
            SKIPPED,
            *(names or SPELLING),
        ],
        cwd=ROOT,
    )
    return 1 if found or spelling.returncode else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
