#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Fails if two files define a type, function or variable of the same name with external linkage.

Two definitions of `mjsense::House` violate C++'s one-definition rule: the linker keeps one copy of each inline member and
reports nothing. Only names outside anonymous namespaces are compared; functions are compared with the types of their
parameters. Different build variants of one file (ALTERNATIVES) are exempt. Arguments: the folders to read, by default all
C++ code of the repository.
"""

from __future__ import annotations

import re
import sys
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
FOLDERS = ("src", "python/bindings", "tests", "examples/cpp", "packaging")
# Alternative implementations: a build contains one file of each pair.
ALTERNATIVES = (
    {"src/mjsense/render/opengl/gl_absent.cc", "src/mjsense/render/opengl/gl_renderer.cc"},
    {"src/mjsense/hdf5/child_reader.cc", "tests/fuzz/in_process.cc"},
)
# Functions that each program defines once.
ENTRY_POINTS = ("main(", "LLVMFuzzerTestOneInput(")

TOKEN = re.compile(
    r"(?P<comment>//[^\n]*|/\*.*?\*/)"
    r'|(?P<raw>R"(?P<delimiter>[^()\\\s]*)\(.*?\)(?P=delimiter)")'
    r"|(?P<string>\"(?:\\.|[^\"\\\n])*\"|(?<![0-9A-Za-z])'(?:\\.|[^'\\\n])+')"
    r"|(?P<directive>^[ \t]*\#(?:\\\n|[^\n])*)"
    r"|(?P<word>[A-Za-z_]\w*|[0-9][\w.']*|::|->|\[\[|\]\]|&&|[^\s\w])",
    re.DOTALL | re.MULTILINE,
)
TYPE = {"class", "struct", "union", "enum"}
NOT_A_NAME = set(
    """
    if for while switch return catch sizeof alignof decltype noexcept requires TEST TEST_F TEST_P NB_MODULE
    INSTANTIATE_TEST_SUITE_P alignas __attribute__ static_assert
    """.split()
)


class Definition(NamedTuple):
    name: str  # qualified name; for functions with the types of the parameters
    file: str
    line: int


def tokens(text: str) -> list[tuple[str, int]]:
    """Words and punctuation with their lines; literals become `""`."""
    found, line, end = [], 1, 0
    for match in TOKEN.finditer(text):
        line += text.count("\n", end, match.start())
        end = match.start()
        if match["word"]:
            found.append((match["word"], line))
        elif match["raw"] or match["string"]:
            found.append(('""', line))
    return found


def without_groups(words: list[str], opening: str, closing: str) -> list[str]:
    """The words outside the brackets of one kind."""
    kept, depth = [], 0
    for word in words:
        depth += word == opening
        if depth == 0:
            kept.append(word)
        depth -= word == closing
    return kept


def split_at_commas(words: list[str]) -> list[list[str]]:
    parts, depth = [[]], 0
    for word in words:
        if word == "," and depth == 0:
            parts.append([])
            continue
        depth += word in "<([{"
        depth -= word in ">)]}"
        parts[-1].append(word)
    return [part for part in parts if part]


def parameter_type(words: list[str]) -> str:
    """The type of a parameter, without its name and default value."""
    if "=" in words:
        words = words[: words.index("=")]
    words = [word for word in words if word not in ("const", "std", "::", "mjsense")]
    arrays = [word for word in words if word == "["]
    words = without_groups(words, "[", "]")
    if len(words) > 1 and re.match(r"[A-Za-z_]\w*$", words[-1]) and words[-2] not in ("unsigned", "long"):
        words = words[:-1]
    return " ".join(words + ["*"] * bool(arrays))


def function_name(words: list[str]) -> str | None:
    """`name(type, type)` of the head of a function definition; None if it is something else or has internal linkage."""
    flat = without_groups(words, "[[", "]]")
    if flat[:1] == ["template"]:
        depth = 0
        for i, word in enumerate(flat[1:], 1):
            depth += word == "<"
            depth -= word == ">"
            if depth == 0:
                flat = flat[i + 1 :]
                break
    if (
        "static" in flat
        or "friend" in flat
        or ("=" in flat[: flat.index("(") if "(" in flat else None] and "operator" not in flat)
    ):
        return None
    depth = 0
    for i, word in enumerate(flat):
        if word == "(" and depth == 0 and i > 0:
            name, j = flat[i - 1], i - 1
            if "operator" in flat[:i]:
                j = flat.index("operator")
                name = " ".join(flat[j:i])
            elif not re.match(r"[A-Za-z_]\w*$", name) or name in NOT_A_NAME:
                return None
            elif name.isupper() and "_" in name:
                return None  # a macro
            while j > 1 and flat[j - 1] == "::":  # a member: Class::name
                if flat[j - 2] == ">":
                    return None  # a specialisation of a template
                name, j = f"{flat[j - 2]}::{name}", j - 2
            end, level = i, 0
            for end in range(i, len(flat)):
                level += flat[end] == "("
                level -= flat[end] == ")"
                if level == 0:
                    break
            types = [parameter_type(part) for part in split_at_commas(flat[i + 1 : end])]
            suffix = " const" if flat[end + 1 : end + 2] == ["const"] else ""
            return f"{name}({', '.join(types)}){suffix}"
        depth += word in "<"
        depth -= word in ">"
    return None


def definitions(text: str, file: str) -> list[Definition]:
    """What a file defines with external linkage at namespace scope."""
    found: list[Definition] = []
    scopes: list[str | None] = []  # names of the enclosing namespaces; None: anonymous
    head: list[str] = []
    start, i, all_tokens = 0, 0, tokens(text)

    def add(name: str) -> None:
        if None not in scopes and not (name.startswith(ENTRY_POINTS) and not any(scopes)):
            found.append(Definition("::".join([*(s for s in scopes if s), name]), file, start))

    def skip_braces(at: int) -> int:
        depth = 0
        while at < len(all_tokens):
            depth += all_tokens[at][0] == "{"
            depth -= all_tokens[at][0] == "}"
            at += 1
            if depth == 0:
                break
        return at

    while i < len(all_tokens):
        word, line = all_tokens[i]
        if not head:
            start = line
        if word == "{":
            plain = without_groups(without_groups(head, "<", ">"), "[[", "]]")
            kind = next((w for w in plain if w in TYPE), None)
            if plain[:1] == ["namespace"] or plain[:2] == ["inline", "namespace"]:
                name = "".join(plain[plain.index("namespace") + 1 :])
                scopes.append(name or None)
                head, i = [], i + 1
                continue
            if plain[:1] == ["extern"] and len(plain) == 2:  # extern "C" {
                scopes.append("")
                head, i = [], i + 1
                continue
            i = skip_braces(i)
            if head.count("(") > head.count(")"):  # a default argument
                continue
            if kind and "(" not in plain and "=" not in plain:
                # The name may be qualified (`struct Recorder::Impl {`); bases follow a colon. Specialisations are skipped.
                name = re.match(r"(?:\w+::)*\w+", "".join(w for w in plain[plain.index(kind) + 1 :] if w not in TYPE | {"final"}))
                if name and head[:3] != ["template", "<", ">"]:
                    add(f"type {name[0]}")
                # Members of `struct X {...} variable;` end at the semicolon.
                continue
            name = function_name(head)
            if name:
                # Constructors' initialisers may contain braces: X::X() : a{1} {...}
                while i < len(all_tokens) and all_tokens[i][0] in (",", "{") and ":" in head:
                    i = skip_braces(i) if all_tokens[i][0] == "{" else i + 1
                    while i < len(all_tokens) and all_tokens[i][0] not in "{;}":
                        i += 1
                add(name)
                head = []
            elif ("=" in head and "operator" not in head) or "(" not in head:
                head.append("{}")  # an initialiser: its semicolon ends it
                continue
            head = []
            continue
        if word == "}":
            if scopes:
                scopes.pop()
            head = []
        elif word == ";":
            plain = without_groups(without_groups(head, "<", ">"), "[[", "]]")
            internal = {"static", "using", "typedef", "extern", "friend", "return"} & set(plain)
            constant = {"const", "constexpr", "constinit"} & set(plain) and "inline" not in plain
            specialised = head[:3] == ["template", "<", ">"]
            if not internal and not constant and not specialised and plain[:1] != ["namespace"] and not TYPE & set(plain):
                before = plain[: next((k for k, w in enumerate(plain) if w in ("=", "{}")), len(plain))]
                before = without_groups(before, "[", "]")
                if "(" not in before and len(before) > 1 and re.match(r"[A-Za-z_]\w*$", before[-1]) and before[-2] != "::":
                    add(f"variable {before[-1]}")
            head = []
        else:
            head.append(word)
        i += 1
    return found


def duplicates(found: list[Definition]) -> list[str]:
    by_name: dict[str, dict[str, Definition]] = defaultdict(dict)
    for definition in found:
        by_name[definition.name].setdefault(definition.file, definition)
    return [
        f"{name} is defined in " + " and ".join(f"{d.file}:{d.line}" for d in files.values())
        for name, files in sorted(by_name.items())
        if len(files) > 1 and not any(set(files) <= pair for pair in ALTERNATIVES)
    ]


def main(arguments: list[str]) -> int:
    found: list[Definition] = []
    for folder in arguments or FOLDERS:
        for path in sorted((ROOT / folder).rglob("*")):
            if path.suffix in (".h", ".cc"):
                name = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else str(path)
                found += definitions(path.read_text(), name)
    errors = duplicates(found)
    print("\n".join(errors), file=sys.stderr)
    return 1 if errors else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
