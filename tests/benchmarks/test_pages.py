"""Each benchmark starts as a module, and has its page."""

from __future__ import annotations

import importlib
import re

import pytest

from tests.support.paths import ROOT

FOLDER = ROOT / "benchmarks"
NAMES = sorted(path.stem for path in FOLDER.glob("*.py") if path.stem != "__init__")
INDEX = (FOLDER / "README.md").read_text(encoding="utf-8")


def test_the_index_lists_every_benchmark_once():
    assert sorted(re.findall(r"^\| \[(\w+)\]\(results/\1\.md\) \|", INDEX, re.MULTILINE)) == NAMES


@pytest.mark.parametrize("name", NAMES)
def test_a_benchmark_has_its_page_with_its_command(name):
    page = (FOLDER / "results" / f"{name}.md").read_text(encoding="utf-8")
    assert page.startswith("# ")
    assert f"python -m benchmarks.{name}" in page
    assert f"python -m benchmarks.{name}" in (FOLDER / f"{name}.py").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", NAMES)
def test_a_benchmark_is_imported(name):
    if name == "batch":
        pytest.importorskip("resource")
    importlib.import_module(f"benchmarks.{name}")


def test_links_of_the_pages_lead_somewhere():
    for page in (FOLDER / "README.md", *(FOLDER / "results").glob("*.md"), *(ROOT / "docs").glob("*.md")):
        for link in re.findall(r"\]\(([^)#\s]+?)(?:#[^)]*)?\)", page.read_text(encoding="utf-8")):
            assert link.startswith("https://") or (page.parent / link).exists(), f"{page.name}: {link}"
