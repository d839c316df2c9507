# SPDX-License-Identifier: Apache-2.0
"""Code blocks of the pages run unchanged (CONTRIBUTING, "Documentation")."""

import importlib.util
import re
import shlex
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import MagicMock

import mujoco
import pytest
from program_runs import run_program

import mjsense as mjs
from mjsense import commands
from mjsense.evaluation.remote.adapter_file import adapter_of_table
from mjsense.exporting.formats import FORMATS

ROOT = Path(__file__).parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted(ROOT.glob("docs/**/*.md")), *sorted(ROOT.glob("src/**/page.md")),
         *sorted(ROOT.glob("models/**/page.md"))]
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
# Module that pages import -> names used of it. Modules that are not installed are replaced by stubs.
OTHERS: dict[str, list[str]] = {"matplotlib": ["matplotlib.pyplot"], "rerun": [], "stable_baselines3": ["mjsense.tasks.rl.sb3"], "torch": []}
MISSING = [name for name in OTHERS if importlib.util.find_spec(name) is None]
SHORT = ["--episodes", "1", "--horizon", "2", "--keep-failures", "--size", "64x48", "-q", "--no-sheet"]  # of recordings


def blocks(page, *languages):
    """[(line, code)] of the fenced blocks in these languages, those in HTML comments too."""
    text = page.read_text()
    return [(text.count("\n", 0, m.start()) + 2, m[2]) for m in FENCE.finditer(text) if m[1] in languages]


def pages(*languages):
    return [pytest.param(p, id=str(p.relative_to(ROOT))) for p in PAGES if blocks(p, *languages)]


def test_every_block_is_in_a_language_that_is_tested():
    for page in PAGES:
        known = blocks(page, "python", "cpp", "cmake", "toml")
        assert page.read_text().count("\n```") == 2 * len(known), page


def test_relative_links_lead_to_files_of_the_repository():
    """As a code host shows the pages. docs/collect.py rewrites the links for the site, whose builder checks them."""
    dead = []
    for page in PAGES:
        text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
        for target in re.findall(r"""(?:\]\(|src=")(?!\w+:)([^)#\s"]+)""", text):
            if not (page.parent / target).exists():
                dead.append(f"{page.relative_to(ROOT)}: {target}")
    assert not dead, "\n".join(dead)


class Viewer:
    """MuJoCo's viewer, closed by its user after two frames."""

    def __init__(self, model, data):
        self.user_scn, self.frames = mujoco.MjvScene(model, 1000), 0

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        assert self.user_scn.ngeom > 0

    def is_running(self):
        self.frames += 1
        return self.frames <= 2

    def sync(self): ...


# The pages of docs/drop_in need other packages: test_adapters.py runs them.
@pytest.mark.parametrize("page", [page for page in pages("python") if page.values[0].parent.name != "drop_in"])
def test_python(page, tmp_path, monkeypatch):
    """All blocks of a page, one after the other, in an empty folder. Third-party viewers and trainers are not required."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "mujoco.viewer", SimpleNamespace(launch_passive=Viewer))
    monkeypatch.setattr(mujoco, "viewer", sys.modules["mujoco.viewer"], raising=False)
    for name in MISSING:
        if re.search(rf"^\s*(import|from) {name}\b", page.read_text(), re.MULTILINE):
            for module in (name, *OTHERS[name]):
                monkeypatch.setitem(sys.modules, module, MagicMock())
    if page.stem in ("warp", "mujoco_warp"):
        pytest.importorskip("mujoco_warp")
    for name, format in FORMATS.items():
        if f"export_{name}(" in page.read_text() or f'format="{name}"' in page.read_text():
            pytest.importorskip(format.library)
    monkeypatch.setattr(mjs, "view", MagicMock())  # waits for a browser
    if "matplotlib" in MISSING:
        monkeypatch.setattr(mjs, "plot", MagicMock())
    names = {"__name__": "page"}
    for line, code in blocks(page, "python"):
        exec(compile("\n" * (line - 1) + code, str(page), "exec"), names)  # errors show the page's line


def squeezed(text):
    return "".join(text.split())


@pytest.mark.parametrize("page", pages("cpp", "cmake"))
def test_cpp_blocks_are_in_compiled_files(page):
    files = [*ROOT.glob("examples/cpp/*/*"), *ROOT.glob("src/**/*_test.cc")]
    compiled = "".join(squeezed(f.read_text()) for f in files if f.is_file())
    for line, code in blocks(page, "cpp", "cmake"):
        assert all(squeezed(part) in compiled for part in code.strip().split("\n\n")), f"{page}:{line}"


def run(arguments, cwd):
    module = {"view": "viser", "plot": "matplotlib"}.get(arguments[0])
    is_only_parsed = (
        arguments[0] == "dataset"  # these recordings have one episode; test_edit.py runs the command
        or arguments[0] in ("evaluate", "serve", "benchmark", "results", "compare")  # of a network and of servers that are not there
        or ("view" in arguments and "--export" not in arguments)  # a viewer would wait for a browser
        or (module and importlib.util.find_spec(module) is None)
        or "rrd" in arguments[-1]
    )
    if is_only_parsed:
        commands.parser_of(arguments[0]).parse_args(arguments[1:])
        return
    done = run_program(*arguments, cwd=cwd)
    assert done.returncode == 0, f"mjsense {shlex.join(arguments)}\n{done.stdout}{done.stderr}"


@pytest.mark.parametrize("page", pages("toml"))
def test_experiment_files(page, tmp_path):
    for _, text in blocks(page, "toml"):
        if "actions" in (table := tomllib.loads(text)):
            adapter_of_table(table, "of a page")
            continue
        (tmp_path / "job.toml").write_text(text)
        run(["record", "--config", "job.toml", *SHORT], tmp_path)


def command_lines(page):
    """The lines that begin with the program's name, without their comments."""
    return [shlex.split(line, comments=True)[1:] for line in re.findall(r"^    (mjsense .*)$", page.read_text(), re.MULTILINE)]


@pytest.mark.parametrize("page", [p for p in pages("python", "toml") if command_lines(p.values[0])])
def test_command_lines(page, tmp_path):
    """The lines run unchanged in a folder with the repository's models; recordings are shortened."""
    for folder in ("models", "bench"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    # Files that the command lines refer to.
    import numpy as np

    (tmp_path / "map.toml").write_text('state = "obs/agent/qpos/arm"')
    np.save(tmp_path / "mid360.npy", np.random.default_rng(0).uniform(-0.5, 0.5, (20000, 2)))
    if any("room.glb" in line for line in command_lines(page)):
        trimesh = pytest.importorskip("trimesh")
        trimesh.creation.box((8, 4, 8)).export(tmp_path / "room.glb")
    lines = command_lines(page)
    if not any(line[0] == "record" for line in lines):
        run(["record", "pick", "--out", "data", *SHORT], tmp_path)
    for line in lines:
        if line[0] == "record":
            words = [line[i] for i in range(len(line)) if "--episodes" not in line[max(0, i - 1) : i + 1]]
            run([*words, *SHORT], tmp_path)
        elif line[0] == "export":
            if importlib.util.find_spec(FORMATS[line[1]].library):
                run([word for word in line if word != "--success"], tmp_path)
        else:
            run(line, tmp_path)


def test_the_page_of_the_program_lists_every_command():
    program = run_program("--help").stdout
    commands = re.findall(r"^  ([a-z]+) ", program.partition("Subcommands:")[2], re.MULTILINE)
    table = (ROOT / "docs/program.md").read_text().partition("| --- |")[2].partition("\n\n")[0]
    assert len(commands) > 20 and [name for name in commands if not re.search(rf"`(mjsense )?{name}\b", table)] == []


@pytest.mark.parametrize("page", [pytest.param(p, id=str(p.relative_to(ROOT))) for p in PAGES])
def test_code_in_tables_has_no_bars(page):
    """A bar in a cell must be escaped, and the site shows the backslash in code."""
    assert not [line for line in page.read_text().splitlines() if re.match(r"\|.*`[^`]*\\\|[^`]*`", line)]


def test_figures_equal_the_performance_notes(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "bench")
    import figures

    notes = (ROOT / "docs/performance_notes.md").read_text()
    for page in (ROOT / "README.md", ROOT / "docs/performance.md"):
        text = page.read_text()
        assert "<!-- bench " in text
        assert text == figures.rewritten(text, lambda name, _: figures.table(name, notes)), "python bench/page.py renews it"


def test_models_of_the_pages_exist():
    assert "robots/quadruped.xml" in mjs.embedded_models()
