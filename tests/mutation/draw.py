# SPDX-License-Identifier: Apache-2.0
"""Mutants drawn by a seed: small changes of operators, constants, conditions and statements inside function bodies.

Changes that nearly always leave the behaviour as it is are not drawn: declarations of fields (`visit_fields`), arguments of error messages,
assertions, reserved memory, and `<` instead of `<=` between numbers that are not counts.
"""

import ast
import random
import re
from pathlib import Path
from typing import NamedTuple

GENERATED = {"configs.py", "effects.py", "data.py"}

SWAPS = {
    " < ": (" <= ", " >= "),
    " <= ": (" < ", " > "),
    " > ": (" >= ", " <= "),
    " >= ": (" > ", " < "),
    " == ": (" != ",),
    " != ": (" == ",),
    " + ": (" - ",),
    " - ": (" + ",),
    " * ": (" / ",),
    " / ": (" * ",),
    " += ": (" -= ",),
    " -= ": (" += ",),
    " && ": (" || ",),
    " || ": (" && ",),
    " and ": (" or ",),
    " or ": (" and ",),
    "true": ("false",),
    "false": ("true",),
    "True": ("False",),
    "False": ("True",),
    "std::min(": ("std::max(",),
    "std::max(": ("std::min(",),
    "min(": ("max(",),
    "max(": ("min(",),
}
OPERATORS = re.compile("|".join(r"(?<![\w:.])" * k[0].isalpha() + re.escape(k) + r"(?!\w)" * k[-1].isalpha() for k in SWAPS))
NUMBER = re.compile(r"(?<![\w.'])(\d+\.\d*(?:e-?\d+)?f?|\d+e-?\d+|\d+(?![\w.]))(?![\w'])")
CONDITION = re.compile(r"^\s*(?:\} else )?if (?:constexpr )?\((.*)\)(?: \{| [^{]*;)$")
# One whole statement: a call or an assignment, no declaration.
STATEMENT = re.compile(r"^\s*(?!\.|->|return\b|throw\b|delete\b|using\b|static\b|case\b|default\b|else\b|const\b|auto\b|static_assert\b|assert\b)"
                       r"[\w\]\[.>*():-]+(?: [-+*/|&]?= [^;]*|\([^;]*\))?;$")
COMPLETE = re.compile(r"(?:[;{}:)]|\belse)\s*$")  # how the line before a statement ends
# `i < n` and `i <= n` differ where both are counts. Two measured numbers are hardly ever equal.
BOUNDARY = {("<", "<="), ("<=", "<"), (">", ">="), (">=", ">")}
COUNT = re.compile(r"\bfor \(|size\(\)|\bnum_|_num\b|\bcount|(?:[<>]=?) \d+(?![\w.])")
# What says something about the code or to a person: fields, messages of errors, assertions, size of memory, arrays of a fixed size.
NEUTRAL = re.compile(r"\bv\(~[^;]*;|\b(?:throw|static_assert|assert|fail|refuse|error|complaint|warn|mju_warning)\b(?: \w+)?\([^;]*;"
                     r"|\.(?:reserve|shrink_to_fit)\([^;]*;|(?m:^)[ \t]*(?:const )?\w[\w:]* \w+\[\d+\](?:\[\d+\])*")
# Objects that a header may be part of. To build a mutant of a header is to build all of them.
MOST_OBJECTS = 12
INCLUDE = re.compile(r'^#include "(mjsense\w*/[^"]+)"', re.M)
PYTHON_CONDITION = re.compile(r"^\s*(?:if|elif) (.*):$")
PYTHON_STATEMENT = re.compile(r"^\s*(?!return\b|raise\b|import\b|from\b|yield\b|assert\b|pass\b)[\w.\[\]]+(?: [-+*/]?= .*|\(.*\))$")


class Site(NamedTuple):
    file: Path
    line: int  # from 1
    what: str
    new: str  # of the whole line


def sources(root: Path, room: str) -> list[Path]:
    """The files of a room that are the project's behaviour: no tests, no benchmarks, nothing generated."""
    if room.startswith("python/"):
        files = (root / "python/mjsense" / room.removeprefix("python/")).rglob("*.py")
        return sorted(f for f in files if f.name not in GENERATED)
    folders = [root / "python/bindings"] if room == "bindings" else (root / "src").glob(f"*/{room}")
    files = [f for folder in folders for f in folder.rglob("*") if f.suffix in (".h", ".cc")]
    return sorted(f for f in files if not re.search(r"_(test|bench)\.cc$|/testing/", f.as_posix()))


def without_comments_and_strings(text: str) -> str:
    """The same text with comments and the insides of C++ literals replaced by tildes: columns and lines stay."""
    pattern = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])+\'', re.DOTALL)
    return pattern.sub(lambda m: re.sub(r"[^\n]", "~", m[0]), text)


def without_neutral(code: str) -> str:
    """`code` (of the function above) without what is not to be changed, though a call of it may still be removed."""
    return NEUTRAL.sub(lambda m: re.sub(r"[^\n]", "~", m[0]), code)


def body_lines(text: str, python: bool) -> set[int]:
    """Numbers of the lines inside function bodies."""
    if python:
        lines: set[int] = set()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                first = node.body[0]
                skip = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant)  # a docstring
                for statement in node.body[skip:]:
                    lines |= set(range(statement.lineno, (statement.end_lineno or statement.lineno) + 1))
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Raise | ast.Assert):
                lines -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
        return lines
    lines, scopes, head, line = set(), [], "", 1
    for c in without_comments_and_strings(re.sub(r"(?m)^[ \t]*#(?:\\\n|[^\n])*", lambda m: "\n" * m[0].count("\n"), text)):
        if c == "\n":
            line += 1
            head += " "
        elif c == "{":
            inside = bool(scopes) and scopes[-1]
            scopes.append(inside or (")" in head and not re.match(r"\s*(namespace|enum)\b", head)))
            head = ""
        elif c == "}":
            if scopes:
                scopes.pop()
            head = ""
        elif c == ";":
            head = ""
        else:
            head += c
        if scopes and scopes[-1] and c.strip() and c not in "{}":
            lines.add(line)
    return lines


def changes(line: str, code: str, active: str, before: str, python: bool) -> list[tuple[str, str]]:
    """(what, new line) of every mutant of a line; `code` is the line without literals and comments, `active` also without_neutral(),
    `before` the code above."""
    found = []

    def replaced(match: re.Match[str], new: str, group: int = 0) -> str:
        return line[: match.start(group)] + new + line[match.end(group) :]

    for match in OPERATORS.finditer(active):
        for new in SWAPS[match[0]]:
            if (match[0].strip(), new.strip()) in BOUNDARY and not COUNT.search(code):
                continue
            if new == " - " and "~" in (active[match.start() - 1], active[match.end()]):
                continue  # joins text
            found.append((f"{match[0].strip()} becomes {new.strip()}", replaced(match, new)))
    for match in NUMBER.finditer(active):
        text = match[0].rstrip("f")
        whole = text.isdigit()
        news = [str(int(text) + 1), *(["0"] if int(text) > 1 else [])] if whole else [f"2 * {match[0]}" if float(text) else "1.0"]
        found += [(f"{match[0]} becomes {new}", replaced(match, new)) for new in news]
    if match := (PYTHON_CONDITION if python else CONDITION).match(code.rstrip()):
        depth = 0
        end = match.start(1)
        for end in range(match.start(1), len(code)):  # the parenthesis that closes the condition
            depth += code[end] in "(["
            depth -= code[end] in ")]"
            if depth < 0:
                break
        end = match.end(1) if python else end
        condition = line[match.start(1) : end]
        if ";" not in condition and " = " not in condition and ":=" not in condition:
            negated = f"not ({condition})" if python else f"!({condition})"
            found.append(("the condition is negated", line[: match.start(1)] + negated + line[end:]))
    removable = PYTHON_STATEMENT if python else STATEMENT
    if removable.match(code.rstrip()) and (python or COMPLETE.search(before)) and not re.match(r"\s*(?:v|[\w.]+\.reserve)\(", code):
        indent = re.match(r"\s*", line)[0]
        found.append(("a statement is removed", indent + ("pass" if python else ";")))
    return found


def sites(file: Path) -> list[Site]:
    text, python = file.read_text(), file.suffix == ".py"
    bodies = body_lines(text, python)
    lines = text.split("\n")
    if python:
        codes = [re.sub(r"#.*", "", re.sub(r"\"[^\"]*\"|'[^']*'", lambda m: "~" * len(m[0]), line)) for line in lines]
    else:
        codes = without_comments_and_strings(text).split("\n")
    actives = codes if python else without_neutral("\n".join(codes)).split("\n")
    found = []
    for number in sorted(bodies):
        line, code = lines[number - 1], codes[number - 1]
        if re.match(r"\s*(static_assert|template|for \(|constexpr|#)", code) and "=" not in code:
            continue
        before = next((c for c in reversed(codes[: number - 1]) if c.strip(" ~")), "")
        found += [Site(file, number, what, new) for what, new in changes(line, code, actives[number - 1], before, python) if new != line]
    return found


def compiles(site: Site) -> bool:
    """False for Python that cannot be read; C++ is left to its compiler."""
    lines = site.file.read_text().split("\n")
    lines[site.line - 1] = site.new
    return site.file.suffix != ".py" or is_python("\n".join(lines))


def is_python(text: str) -> bool:
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return True


def objects_of_headers(root: Path) -> dict[Path, int]:
    """The number of C++ files that a header of src/ is part of, directly or by other headers."""
    files = [*(root / "src").rglob("*.h"), *(root / "src").rglob("*.cc"), *(root / "python/bindings").rglob("*.[ch]*")]
    includes = {f: {root / "src" / name for name in INCLUDE.findall(f.read_text())} for f in files}
    count: dict[Path, int] = {}
    for file in (f for f in files if f.suffix == ".cc"):
        reached, todo = set(), [file]
        while todo:
            new = includes.get(todo.pop(), set()) - reached
            reached |= new
            todo += new
        for header in reached:
            count[header] = count.get(header, 0) + 1
    return count


def draw(root: Path, rooms: list[str], count: int, seed: int) -> list[tuple[str, Site]]:
    """(room, site): rooms take turns; in a room each line that can be changed is as likely as another."""
    rng = random.Random(seed)
    pools: dict[str, list[list[Site]]] = {}
    objects = objects_of_headers(root)
    for room in rooms:
        lines: dict[tuple[Path, int], list[Site]] = {}
        for file in sources(root, room):
            if objects.get(file, 0) > MOST_OBJECTS:
                continue
            for site in sites(file):
                lines.setdefault((site.file, site.line), []).append(site)
        pools[room] = list(lines.values())
        rng.shuffle(pools[room])
    order = [room for room in rooms if pools[room]]
    rng.shuffle(order)
    drawn: list[tuple[str, Site]] = []
    while len(drawn) < count and any(pools[room] for room in order):
        for room in order:
            if pools[room] and len(drawn) < count:
                site = rng.choice(pools[room].pop())
                if compiles(site):
                    drawn.append((room, site))
    return drawn
