# SPDX-License-Identifier: Apache-2.0
"""The documentation site: complete, searchable, readable without scrolling sideways, independent of other servers."""

import inspect
import json
import operator
import os
import re
import subprocess
import sys
from pathlib import Path

import browser
import pytest

import mjsense as mjs
from mjsense.core.old_names import ROOMS

ROOT = Path(__file__).parents[2]
STUB = ROOT / "build/dev/python/mjsense/_core.pyi"


@pytest.fixture(scope="session")
def site(tmp_path_factory):
    if not STUB.exists():
        pytest.skip(f"{STUB} is not built (./dev build)")
    folder = tmp_path_factory.mktemp("site")
    done = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", folder], cwd=ROOT,
                          capture_output=True, text=True, env={**os.environ, "NO_MKDOCS_2_WARNING": "1"})  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="session")
def documented(site):
    """Names that have an entry in the reference of the Python API."""
    return {name for page in (site / "reference").glob("*.html") for name in re.findall(r'id="(mjsense\.[\w.]+)"', page.read_text())}


def in_rooms():
    """``mjsense.ROOM.NAME`` of the classes and functions that are not at the top; of those in two rooms the first one."""
    places = {name: f"{room}.{name}" for room in reversed(ROOMS) for name in sys.modules[room].__all__ if name not in mjs.__all__}
    return [path for path in places.values() if callable(operator.attrgetter(path.partition(".")[2])(mjs))]


def test_every_public_name_is_in_the_reference(documented):
    modules = {name for name in mjs.__all__ if inspect.ismodule(getattr(mjs, name))}
    wanted = {f"mjsense.{name}" for name in mjs.__all__ if not name.startswith("_") and name not in modules}
    wanted |= {getattr(mjs, name).__name__ for name in modules}
    wanted |= {*in_rooms()}
    assert wanted <= documented, sorted(wanted - documented)


def test_every_public_method_is_in_the_reference(documented):
    wanted = set()
    for path in [*(f"mjsense.{name}" for name in mjs.__all__), *in_rooms()]:
        value = operator.attrgetter(path.partition(".")[2])(mjs)
        if isinstance(value, type) and value.__module__.startswith("mjsense.") and value.__module__ != "mjsense._core":
            wanted |= {f"{path}.{k}" for k, v in vars(value).items() if not k.startswith("_") and callable(v)}
    assert wanted and wanted <= documented, sorted(wanted - documented)


def test_every_native_name_is_in_the_reference(documented):
    wanted = {f"mjsense._core.{name}" for name in re.findall(r"^(?:class|def) ([a-zA-Z]\w*)", STUB.read_text(), re.MULTILINE)}
    assert wanted and wanted <= documented, sorted(wanted - documented)


def test_components_of_the_state_are_arrays(site):
    page = re.sub(r"<[^>]+>", "", (site / "reference/simulation.html").read_text())
    assert re.search(r"qpos: NDArray\[float64\]\s+Joint positions \[B, nq\] \(m, rad\)\. Live, float64; call forward\(\)", page)
    assert re.search(r"qpos: Any\s+Joint positions \[B, nq\] \(m, rad\)\. Live, float32, on the device", page)


def test_signatures_of_configurations_equal_their_fields(site):
    page = re.sub(r"<[^>]+>", "", (site / "reference/sensor_configs.html").read_text())
    assert re.search(r"ContactMatch\(\s*mode: Literal\[.*?\],\s*pattern:", page, re.DOTALL)


@pytest.mark.parametrize("word", ["headless", "autoreset", "randomize", "replay"])
def test_search_finds(site, word):
    index = json.loads((site / "search/search_index.json").read_text())
    assert any(word in (entry["title"] + entry["text"]).lower() for entry in index["docs"])


def test_pages_load_nothing_from_other_servers(site):
    loads = re.compile(r"""<(?:script|img|iframe|source|video)[^>]*\bsrc="?(?:https?:)?//|<link[^>]*rel="?(?:stylesheet|preconnect|icon)[^>]*//""")
    for page in site.rglob("*.html"):
        assert not loads.search(page.read_text()), page
    for sheet in site.rglob("*.css"):
        assert not re.search(r"(?:@import|url\()\s*['\"]?(?:https?:)?//", sheet.read_text()), sheet


@pytest.fixture(scope="session")
def measured(site):
    if browser.chromium() is None:
        pytest.skip("needs Chromium (apt-get install chromium)")
    return browser.measure(site, width=1280)


def test_tables_fit_their_column_at_1280_pixels(measured):
    assert sum(found["tables"] for found in measured.values()) > 100
    assert {page: found["wide"] for page, found in measured.items() if found["wide"]} == {}


def test_browser_requests_no_other_server(measured):
    assert {page: found["foreign"] for page, found in measured.items() if found["foreign"]} == {}


def test_search_works_without_a_server(site):
    if browser.chromium() is None:
        pytest.skip("needs Chromium (apt-get install chromium)")
    assert "time.html" in browser.search_from_disk(site, "freshness")


def test_readme_for_pypi_has_no_relative_links(tmp_path):
    backend = pytest.importorskip("scikit_build_core.build")
    pytest.importorskip("hatch_fancy_pypi_readme")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(ROOT)
        name = backend.prepare_metadata_for_build_wheel(str(tmp_path))
    text = (tmp_path / name / "METADATA").read_text()
    targets = re.findall(r'\]\(([^)\s]+)|(?:src|href)="([^"]+)', text)
    assert targets and all((a or b).startswith(("https://", "#")) for a, b in targets), targets
    assert "<!--" not in text
    for field in ("Author:", "Keywords:", "Classifier: Typing :: Typed", "Project-URL: Documentation"):
        assert field in text


def test_messages_of_the_troubleshooting_page_exist():
    """Each heading in backticks quotes a message: every part between dots is in the sources."""
    files = [p for folder, kinds in (("src", ("*.cc", "*.h")), ("python", ("*.cc", "*.py"))) for kind in kinds for p in (ROOT / folder).rglob(kind)]
    text = "".join(p.read_text() for p in files if not p.stem.endswith("_test"))
    text = re.sub(r'"\s*\n\s*f?"', "", text)  # literals that continue on the next line
    headings = re.findall(r"^### `(.+)`$", (ROOT / "docs/troubleshooting.md").read_text(), re.MULTILINE)
    missing = [(heading, part) for heading in headings for part in heading.split("...") if (words := part.strip(" ;,:()")) and words not in text]
    assert len(headings) > 20 and not missing
