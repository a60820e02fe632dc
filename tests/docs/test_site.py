"""The documentation site: its generated pages hold all of the program, it builds, and its links lead somewhere."""

from __future__ import annotations

import shutil
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec

import pytest

import circlepose
from tests.support.paths import ROOT

DOCS = ROOT / "docs"
NEEDED = ("sphinx", "myst_parser", "furo", "nbclient", "ipykernel", "pandas", "matplotlib")


@pytest.fixture
def generator(monkeypatch):
    """The module of docs/sitegen of a name."""
    monkeypatch.syspath_prepend(str(DOCS))
    return lambda name: import_module(f"sitegen.{name}")


def every_option(command):
    yield from (name for each in command.params for name in (*each.opts, *each.secondary_opts) if name[0] == "-")


def test_every_command_and_option_is_in_the_reference(generator):
    cli_pages = generator("cli_pages")
    found = dict(cli_pages.commands())
    assert {"circlepose estimate", "circlepose demo", "circlepose study noise"} <= set(found)
    for name, command in found.items():
        listed = cli_pages.option_list(name, command)
        options = set(every_option(command))
        assert options or name in {"circlepose statuses", "circlepose schema", "circlepose completion"}
        for option in options:
            assert any(option in line.split() for line in listed.replace(",", " ").replace("/", " ").splitlines()), (
                f"{name} {option}"
            )


def test_the_page_of_a_command_opens_with_its_help(generator):
    cli_pages = generator("cli_pages")
    name, command = next(item for item in cli_pages.commands() if item[0] == "circlepose camera")
    page = cli_pages.page(name, command, below=[])
    assert page.startswith("# circlepose camera\n\n```text\nUsage: circlepose camera ")
    assert "--format" in page.split("```{program}")[0]


def test_every_public_name_is_in_the_reference(generator):
    api_pages = generator("api_pages")
    assert {api_pages.kind(name) for name in api_pages.names()} == set(api_pages.KINDS)
    assert {*api_pages.names(), "__version__"} == set(circlepose.__all__)
    assert "| `OK` | `ok` | measured |" in api_pages.entry("Status")


SCHEMA = {
    "title": "Poses",
    "description": "What estimate writes.",
    "required": ["schema"],
    "properties": {
        "schema": {"const": "circlepose.poses/1", "description": "This schema."},
        "images": {"type": "array", "items": {"properties": {"status": {"enum": ["ok", "a|b"]}}}},
        "pose": {"anyOf": [{"$ref": "#/$defs/pose"}, {"type": "null"}]},
    },
    "$defs": {"pose": {"properties": {"sigma": {"type": ["number", "null"], "description": "mm | rad"}}}},
}


def test_a_schema_is_shown_with_all_its_keys(generator):
    page = generator("schema_pages").page("poses.json", SCHEMA)
    assert '| `schema` | `"circlepose.poses/1"` | This schema. |' in page
    assert "| `images[].status` |" in page
    assert "| `pose` | pose or null | (may be absent) |" in page
    assert "## pose" in page
    assert r"| `sigma` | number or null | mm \| rad (may be absent) |" in page


def test_links_out_of_the_folder_lead_to_the_sites_copy_or_to_github(generator):
    for_site = generator("links").for_site
    text = "[a](../benchmarks/README.md#b) [c](cli.md#d) ![e](pictures/ring.png) [f](../sample_images) [g](https://h)"
    moved = "[a](generated/benchmarks/README.md#b) [c](cli.md#d) ![e](generated/pictures/ring.png) "
    moved += "[f](https://github.com/circlepose/circlepose/tree/main/sample_images) [g](https://h)"
    assert for_site(text, "docs/x.md") == moved
    back = for_site("[a](../../docs/cli.md#d)", "benchmarks/results/flatness.md")
    assert back == "[a](../../../cli.md#d)"
    fenced = "```sh\n[a](../b)\n```"
    assert for_site(fenced, "docs/x.md") == fenced


def run(folder, *typed):
    done = subprocess.run(
        [sys.executable, *typed], cwd=folder, capture_output=True, text=True, encoding="utf-8", check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_site_builds_without_a_warning_and_its_links_hold(tmp_path):
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        pytest.skip(f"the site needs the extra docs: {', '.join(missing)} not installed")
    unwanted = shutil.ignore_patterns("_build", "generated", "__pycache__")
    for folder in ("docs", "sample_images", "benchmarks"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=unwanted)
    shutil.copy(ROOT / "CHANGELOG.md", tmp_path)
    run(tmp_path, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html", "docs", "site")
    run(tmp_path, "docs/check_links.py", "site")
    assert (tmp_path / "site" / "generated" / "notebooks" / "own_detection.html").is_file()
