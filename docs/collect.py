# SPDX-License-Identifier: Apache-2.0
"""MkDocs hook: adds the pages that live outside docs/ and expands `folder/*` in the navigation.

The page of a sensor, task, policy or robot lies next to its code (src/mjsense/sensors/*/page.md and so on). CHANGELOG.md and
CONTRIBUTING.md are read from the root of the repository. Links in the sources lead to files of the repository, so that they work
on a code host too; on the site they lead to its pages.
"""

import os
import pathlib
import re

from mkdocs.structure.files import File

ROOT = pathlib.Path(__file__).parent.parent
SOURCE, TASKS = ROOT / "src" / "mjsense", ROOT / "src" / "mjsense_tasks"
FOLDERS = {"sensors": SOURCE, "robots": ROOT / "models", "tasks": TASKS, "policies": TASKS}
SINGLE = ("effects",)
FROM_ROOT = {"CHANGELOG.md": "changelog.md", "CONTRIBUTING.md": "contributing.md"}
INTRODUCTIONS = {
    "sensors": "One page for each kind of sensor: what it measures, an example, its fields, its cost and its configuration.",
    "robots": "Pages of the robots that have one. `mjsense robots` lists all of them.",
    "tasks": "What each task asks for: start, success, reward and the sensors that it adds. [Tasks and "
    "planners](../tasks.md) compares them.",
    "policies": "Policies that have a page of their own. The general planner is described in [Tasks and planners](../tasks.md).",
}


def title(page):
    """The first heading."""
    return re.search(r"^# (.+)$", page.read_text(), re.MULTILINE)[1]


def description(page):
    """The first sentence."""
    text = re.sub(r"<!--.*?-->|```.*?```", "", page.read_text(), flags=re.DOTALL)
    paragraph = next(p for p in text.split("\n\n")[1:] if re.match(r"\w", p))
    return re.split(r"(?<=[.])\s", " ".join(paragraph.split()))[0]


def with_site_links(text):
    """Links of a file in the root: those into docs/ lead to the site's pages, those to other files become plain text."""
    text = re.sub(r"\]\(docs/", "](", text)
    return re.sub(r"\[([^\]]+)\]\((?!https?:)([\w./-]+/[\w./-]*|[A-Z]+\.md)\)", r"\1", text)


def site_path(file):
    """The page of the site that shows a file of the repository, given by its path in it; None: there is none."""
    if file.startswith("docs/"):
        return file.removeprefix("docs/")
    for folder, root in FOLDERS.items():
        inside = f"{(root / folder).relative_to(ROOT)}/"
        if f"{file}/" == inside:
            return f"{folder}/index.md"
        if file.startswith(inside) and file.endswith("/page.md"):
            return f"{folder}/{file.removeprefix(inside).removesuffix('/page.md')}.md"
    for folder in SINGLE:
        if file == f"{(SOURCE / folder).relative_to(ROOT)}/page.md":
            return f"{folder}.md"
    return None


def linked(text, source):
    """The text of a page, whose links to files lead to the pages of the site that show them."""
    here = source.relative_to(ROOT)

    def link(match):
        target = os.path.normpath(here.parent / match[2])
        page = site_path(target)
        return match[0] if page is None else f"{match[1]}{os.path.relpath(page, os.path.dirname(site_path(str(here))))}"

    return re.sub(r"""(\]\(|src=")(?!\w+:)([^)#\s"]+)""", link, text)


def on_page_markdown(markdown, page, config, files):
    source = ROOT / "docs" / page.file.src_uri
    return linked(markdown, source) if source.exists() else markdown


def expanded(nav, folders):
    """The navigation with `folder/*` replaced by the pages of the folder."""
    if isinstance(nav, list):
        return [expanded(entry, folders) for entry in nav]
    if isinstance(nav, dict):
        return {key: expanded(value, folders) for key, value in nav.items()}
    return folders[nav[:-2]] if nav.endswith("/*") else nav


def on_files(files, config):
    def add(path, content):
        files.append(File.generated(config, path, content=content))

    folders = {}
    for folder, root in FOLDERS.items():
        pages = sorted((root / folder).glob("*/page.md"))
        for page in pages:
            add(f"{folder}/{page.parent.name}.md", linked(page.read_text(), page))
            for picture in sorted([*page.parent.glob("*.svg"), *page.parent.glob("*.png")]):
                add(f"{folder}/{picture.name}", picture.read_bytes())
        rows = "".join(f"| [{title(page).split(':')[0]}]({page.parent.name}.md) | {description(page)} |\n" for page in pages)
        add(
            f"{folder}/index.md",
            f"# {folder.capitalize()}\n\n{INTRODUCTIONS[folder]}\n\n| page | summary |\n| --- | --- |\n{rows}",
        )
        folders[folder] = [f"{folder}/index.md", *(f"{folder}/{page.parent.name}.md" for page in pages)]
    for folder in SINGLE:
        add(f"{folder}.md", linked((page := SOURCE / folder / "page.md").read_text(), page))
    for source, page in FROM_ROOT.items():
        add(page, with_site_links((ROOT / source).read_text()))
    config.nav = expanded(config.nav, folders)
    return files
