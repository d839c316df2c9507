# SPDX-License-Identifier: Apache-2.0
"""The check of phrases (tools/check_prose.py): finds the listed phrases in each kind of file, and nothing in code."""

import importlib.util
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def check_prose():
    spec = importlib.util.spec_from_file_location("check_prose", ROOT / "tools" / "check_prose.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("text", [
    "What nobody commands is where it is.", "An object that is no target.", "A sensor of yours.", "5 % faster beside MuJoCo.",
    "Safe with files of strangers.", "The job goes on without it.", "The policy is asked once a step.", "where to? give --out DIR",
    "What cannot be placed is put back.",
])  # fmt: skip
def test_finds_unidiomatic_text(check_prose, tmp_path, text):
    for name, content in (("a.md", text), ("b.md", f"- {text}"), ("c.md", f"| x | {text} |"), ("a.h", f"// {text}"),
                          ("b.cc", f'  throw ValueError("{text}");'), ("a.py", f'"""{text}"""'), ("b.py", f"x = 1  # {text}"),
                          ("a.cmake", f"# {text}"), ("a.sh", f"cat <<'EOF'\n{text}\nEOF"), ("b.sh", f'echo "{text}"'),
                          ("a.toml", f"x = 1  # {text}"), ("a.xml", f"<!-- {text} -->")):  # fmt: skip
        (tmp_path / name).write_text(content + "\n")
        assert list(check_prose.findings(tmp_path / name)), (name, text)


def test_finds_a_phrase_across_two_lines(check_prose, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("First line.\n\nThe job goes\non without it.\n")
    assert [line.split(": ", 1)[0] for line in check_prose.findings(page)] == [f"{page}:3"]


@pytest.mark.parametrize("name, text", [
    ("a.md", "Groups without a command use their measured position. There is no target."),
    ("b.md", "```python\nnobody = 1  # beside\n```\n\n    nobody\n\nThe word `nobody` in code."),
    ("c.md", "<!-- nobody -->\n<!-- fields XCfg -->\n| a | of yours |\n<!-- end -->"),
    ("a.h", "int nobody = 0;  // metres"),
    ("a.py", "nobody = beside"),
    ("a.toml", 'nobody = "beside"'),
    ("a.xml", "<nobody/>"),
])  # fmt: skip
def test_plain_text_passes(check_prose, tmp_path, name, text):
    (tmp_path / name).write_text(text + "\n")
    assert not list(check_prose.findings(tmp_path / name))


def test_rewritten_files_have_no_findings(check_prose):
    paths = list(check_prose.files(check_prose.CHECKED))
    assert len(paths) > 1000
    assert [finding for path in paths for finding in check_prose.findings(path)] == []
