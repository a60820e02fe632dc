"""The defaults that the pages and `--help` state are those of the code."""

from __future__ import annotations

import dataclasses
import re

import pytest
import typer.main

from circlepose.batch.measure import DEFAULT_TIMEOUT_S, IN_PROCESS_MOST
from circlepose.io.scenes.reader import _View
from circlepose.planning.views import USUAL
from circlepose.targets.hints import NORMAL_SPREAD_DEG, UP_SPREAD_DEG
from circlepose.targets.lengths import MAX_RADII
from circlepose.targets.target import FLATNESS_SHARE, Target
from circlepose_cli.app import app
from tests.support.paths import ROOT

DOCS = ROOT / "docs"
COMMANDS = typer.main.get_command(app).commands
STUDIES = COMMANDS["study"].commands


def page(name):
    return (DOCS / name).read_text(encoding="utf-8")


def option(command, name):
    return next(parameter for parameter in command.params if name in parameter.opts)


def default(command, name):
    return option(command, name).default


CHECK, ESTIMATE, PLAN = COMMANDS["check"], COMMANDS["estimate"], COMMANDS["plan"]
STATED = [
    ("cli.md", r"`--timeout SECONDS` \| time for one image, ([\d.]+) s by default", DEFAULT_TIMEOUT_S),
    ("cli.md", r"`--jobs N` \|.* by default one a core, for more than (\d+) images", IN_PROCESS_MOST),
    ("scaling.md", r"by default one a core, for more than (\d+) images", IN_PROCESS_MOST),
    ("cli.md", r"`--normal-spread-deg DEG` \|.* good to ([\d.]+) deg by default", NORMAL_SPREAD_DEG),
    ("cli.md", r"`--up-spread-deg DEG` \|.* good to ([\d.]+) deg by default", UP_SPREAD_DEG),
    ("cli.md", r"`--position-mm MM` \|.* ([\d.]+) by default", default(CHECK, "--position-mm")),
    ("cli.md", r"`--normal-deg DEG` \|.* ([\d.]+) by default", default(CHECK, "--normal-deg")),
    ("ci.md", r"`--position-mm ([\d.]+) --normal-deg [\d.]+` are the defaults", default(CHECK, "--position-mm")),
    ("ci.md", r"`--position-mm [\d.]+ --normal-deg ([\d.]+)` are the defaults", default(CHECK, "--normal-deg")),
    ("cli.md", r"`--repeats N` \|.*\(default (\d+)", default(STUDIES["noise"], "--repeats")),
    ("cli.md", r"`--scenes N` \|.*\(default (\d+)", default(STUDIES["gcc"], "--scenes")),
    ("cli.md", r"`--seed N` \|.*\(default (\d+)", default(STUDIES["noise"], "--seed")),
    ("cli.md", r"`--steps N` \|.*\(default (\d+)", default(PLAN, "--steps")),
    ("cli.md", r"`--noise LEVELS` \|.*\(default ([\d.]+)", USUAL.noise_levels),
    ("cli.md", r"`--blur-px PX` \|.*\(default ([\d.]+)", USUAL.blur_px),
    ("cli.md", r"`--contrast LEVELS` \|.*\(default ([\d.]+)", USUAL.contrast_levels),
    ("file-formats.md", r"a `spread_deg` of ([\d.]+) \(the default\)", NORMAL_SPREAD_DEG),
    ("file-formats.md", r"`normal_hint` \|.*spread_deg: ([\d.]+)\}", NORMAL_SPREAD_DEG),
    ("file-formats.md", r"`up_hint` \|.*spread_deg: ([\d.]+)\}", UP_SPREAD_DEG),
    ("file-formats.md", r"`flatness_sigma_mm` \|.*\| ([\d.]+) % of the largest radius", 100.0 * FLATNESS_SHARE),
    ("file-formats.md", r"`radii_mm` \|.*two to (\d+) radii", MAX_RADII),
    ("estimator.md", r"f is ([\d.]+) % of the largest radius", 100.0 * FLATNESS_SHARE),
]


@pytest.mark.parametrize(("name", "pattern", "value"), STATED)
def test_a_stated_number_is_the_codes(name, pattern, value):
    found = re.findall(pattern, page(name))
    assert found
    assert {float(number) for number in found} == {float(value)}


def test_every_default_number_of_the_manual_is_compared():
    lines = [line for line in page("cli.md").splitlines() if re.search(r"\d[^|]* by default|default \d", line)]
    assert len(lines) >= 8
    for line in lines:
        assert any(re.search(pattern, line) for name, pattern, _ in STATED if name == "cli.md"), line


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("--timeout", DEFAULT_TIMEOUT_S),
        ("--normal-spread-deg", NORMAL_SPREAD_DEG),
        ("--up-spread-deg", UP_SPREAD_DEG),
    ],
)
def test_a_default_in_the_help_is_the_codes(name, value):
    stated = re.search(r"Default: (?:the target's, else )?([\d.]+\d)", option(ESTIMATE, name).help)
    assert float(stated[1]) == value


def test_a_choice_that_is_called_the_default_is_it():
    rows = re.findall(r"^\| `(--[a-z-]+) ([a-z-]+)` \|.*\(the default\) \|$", page("cli.md"), re.MULTILINE)
    assert len(rows) >= 2
    for name, choice in rows:
        assert default(ESTIMATE, name) == choice
    assert "`--no-refine` | " in page("cli.md")
    assert default(ESTIMATE, "--refine") is True


def rows_of(text):
    """Key, meaning and default of each row of a page's tables of keys."""
    return re.findall(r"^\| `(\w+)` \| (.*) \| ([^|]*) \|$", text, re.MULTILINE)


def test_defaults_of_the_target_file_are_those_of_a_target():
    known = {field.name: field.default for field in dataclasses.fields(Target)}
    compared = set()
    for key, _, stated in rows_of(page("file-formats.md").split("## Targets")[1]):
        value = known.get(key, dataclasses.MISSING)
        if value is not dataclasses.MISSING and value is not None:
            written = f"{value:g}" if isinstance(value, float) else str(value).lower()
            assert re.match(r"`?(\w+)", stated)[1] == written, key
            compared.add(key)
    assert {"count", "polarity", "radius_sigma_mm"} <= compared


def test_defaults_of_a_scene_are_those_of_its_reader():
    compared = 0
    for key, _, stated in rows_of(page("rendering.md")):
        field = _View.model_fields.get(key)
        if field is not None and isinstance(field.default, (int, float)):
            assert float(stated) == field.default, key
            compared += 1
    assert compared >= 4
