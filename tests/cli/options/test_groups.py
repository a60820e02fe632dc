"""Each option is declared once, and a command gets its dataclass filled."""

from __future__ import annotations

import ast
import re
from collections import Counter
from dataclasses import dataclass, fields
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from circlepose.detection import EXTRACTIONS
from circlepose.io.tables import LAYOUTS
from circlepose.solvers import METHODS
from circlepose.targets import POLARITIES, SAME_PLANE
from circlepose.targets.target import Target
from circlepose_cli.app import main
from circlepose_cli.options.camera_target import CameraTargetOptions
from circlepose_cli.options.groups import Parsed, takes


@dataclass(frozen=True, kw_only=True)
class Inner:
    pair: Annotated[
        tuple[str, int] | None, typer.Option("--pair"), Parsed(lambda option, text: (option, len(text)))
    ] = None
    plain: Annotated[int, typer.Option("--plain")] = 3


@dataclass(frozen=True, kw_only=True)
class Outer:
    word: Annotated[str, typer.Argument()]
    inner: Inner
    flag: Annotated[bool, typer.Option("--flag")] = False


@pytest.mark.parametrize(
    ("args", "expected"),
    [
        (["a"], Outer(word="a", inner=Inner())),
        (["a", "--pair", "xyz", "--flag"], Outer(word="a", inner=Inner(pair=("--pair", 3)), flag=True)),
        (["a", "--plain", "5"], Outer(word="a", inner=Inner(plain=5))),
    ],
)
def test_a_command_gets_its_dataclass(args, expected):
    got = []
    made = typer.Typer(add_completion=False)
    made.command()(takes(Outer)(got.append))
    result = CliRunner().invoke(made, args)
    assert (result.exit_code, got) == (0, [expected])


def test_an_option_is_declared_once_in_the_source(project_root):
    """Of the same name there may be two only where they mean different things."""
    declared = Counter()
    for path in (project_root / "cli").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "typer.Option":
                names = [arg.value for arg in node.args if isinstance(arg, ast.Constant)]
                declared.update(name for name in names if name.startswith("--"))
    several = {option for option, number in declared.items() if number > 1}
    different = {"--calib", "--distance-mm", "--format", "--help", "--output", "--picture", "--plot", "--target"}
    assert several <= different
    assert declared["--count"] == 1


@pytest.mark.parametrize(
    ("option", "choices"),
    [
        ("polarity", POLARITIES),
        ("extraction", EXTRACTIONS),
        ("layout", LAYOUTS),
        ("same-plane", SAME_PLANE),
    ],
)
def test_choices_are_those_of_the_library(option, choices, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    assert main(["estimate", "--help"]) == 0
    shown = re.sub(r"\s+", " ", capsys.readouterr().out)
    # Older releases of typer have square brackets.
    assert re.search(rf"--{option} [<\[]{re.escape('|'.join(choices))}[>\]]", shown)


def test_each_method_is_named_in_the_help(capsys):
    assert main(["estimate", "--help"]) == 0
    words = re.findall(r"[\w-]+", re.sub(r"-\s+", "-", capsys.readouterr().out))
    assert {*METHODS, "all"} <= set(words)


def test_target_options_have_the_names_of_the_fields_that_they_replace():
    replaced = {field.name for field in fields(CameraTargetOptions)} & {field.name for field in fields(Target)}
    assert replaced == {"count", "polarity", "depth_range_mm", "same_plane", "facing", "radius_sigma_mm"}
