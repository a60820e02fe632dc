"""The pages hold together: links lead somewhere, commands can be typed, pictures are small and used."""

from __future__ import annotations

import json
import re
import shlex

import pytest
import typer.main

from circlepose_cli.app import app
from tests.support.paths import ROOT

DOCS = ROOT / "docs"
PAGES = [*sorted(DOCS.glob("*.md")), *sorted((ROOT / "benchmarks").rglob("*.md"))]
COMMANDS = typer.main.get_command(app).commands
NOTEBOOKS = sorted((DOCS / "notebooks").glob("*.ipynb"))
PICTURES = sorted((DOCS / "pictures").glob("*.png"))


def prose(path):
    """The text of a page without its fenced blocks."""
    return re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)


def anchors(path):
    """The anchors that GitHub gives a page's headings."""
    headings = re.findall(r"^#+ (.*)$", prose(path), re.MULTILINE)
    shown = [re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading) for heading in headings]
    return {re.sub(r"[^\w -]", "", heading).strip().lower().replace(" ", "-") for heading in shown}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_relative_links_lead_somewhere(page):
    if page.name == "index.md":
        assert "generated/" not in prose(page)
    for path, anchor in re.findall(r"\]\((?![a-z]+:)([^)\s#]*)(?:#([^)\s]+))?\)", prose(page)):
        target = (page.parent / path).resolve() if path else page
        assert target.exists(), path
        assert not anchor or anchor in anchors(target), f"{path}#{anchor}"


def test_every_page_is_in_the_table_of_contents():
    listed = re.findall(r"^([\w/-]+)$", (DOCS / "index.md").read_text(encoding="utf-8"), re.MULTILINE)
    assert {path.stem for path in DOCS.glob("*.md")} - {"index"} <= set(listed)
    assert {f"generated/notebooks/{path.stem}" for path in NOTEBOOKS} <= set(listed)


def typed_commands(page):
    """The calls of circlepose in a page's blocks that are run."""
    blocks = re.findall(r"^```sh\n(.*?)^```$", page.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)
    lines = (line for block in blocks for line in block.replace("\\\n", " ").splitlines())
    words = [shlex.split(line, comments=True) for line in lines]
    return [each[1:] for each in words if each[:1] == ["circlepose"]]


def test_the_commands_of_the_quickstart_exist():
    calls = typed_commands(DOCS / "quickstart.md")
    assert {"demo", "estimate", "camera", "explain"} <= {call[0] for call in calls}
    for call in calls:
        if not call[0].startswith("-"):
            known = {name for option in COMMANDS[call[0]].params for name in (*option.opts, *option.secondary_opts)}
            assert {word for word in call if re.match(r"-\D", word)} <= known, call


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.name)
def test_notebooks_are_stored_without_outputs(path):
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    code = [cell for cell in cells if cell["cell_type"] == "code"]
    assert len(code) >= 5
    assert all(cell["outputs"] == [] and cell["execution_count"] is None for cell in code)


def test_pictures_are_small_and_each_is_used():
    texts = "\n".join(path.read_text(encoding="utf-8") for path in (ROOT / "README.md", *DOCS.glob("*.md")))
    assert len(PICTURES) >= 6
    for path in PICTURES:
        assert path.stat().st_size < 100_000, path.name
        assert f"pictures/{path.name})" in texts, path.name
    assert set(re.findall(r"pictures/([\w-]+\.png)\)", texts)) == {path.name for path in PICTURES}
