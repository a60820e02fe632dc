"""The manual and the command line agree: every command and option has help and is in docs/cli.md."""

from __future__ import annotations

import re
from pathlib import Path
from typing import get_args

import pytest
import typer.main

from circlepose.detection import EXTRACTIONS
from circlepose.io.calibration.writers import WrittenForm
from circlepose.io.tables import LAYOUTS
from circlepose.io.tables.board_rows import BOARD_COLUMN_MEANING
from circlepose.io.tables.columns import COLUMN_MEANING
from circlepose.io.tables.pair_rows import PAIR_COLUMN_MEANING
from circlepose.results import FLAG_MEANING, STATUS_MEANING
from circlepose.solvers import METHODS
from circlepose.targets import POLARITIES
from circlepose_cli.app import app, main
from circlepose_cli.options.declared import CheckFormat, FormatChoice, ReportFormat

COMMANDS = typer.main.get_command(app).commands


@pytest.fixture(scope="module")
def manual(project_root):
    return (project_root / "docs" / "cli.md").read_text(encoding="utf-8")


def section(manual, command):
    return re.split(r"^## ", manual.split(f"\n## circlepose {command}\n")[1], flags=re.MULTILINE)[0]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_parameter_has_help(name):
    command = COMMANDS[name]
    assert command.help
    assert len(command.get_short_help_str(100)) <= 50
    for parameter in command.params:
        assert parameter.help, parameter.name


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_option_is_in_the_manual(manual, name):
    text = section(manual, name)
    assert f"(#circlepose-{name})" in manual
    for parameter in COMMANDS[name].params:
        for option in (*parameter.opts, *parameter.secondary_opts):
            if option.startswith("-") and option != "--help":
                assert f"`{option}" in text, option


@pytest.mark.parametrize(
    "choices",
    [
        (*METHODS, "all"),
        POLARITIES,
        EXTRACTIONS,
        CheckFormat,
        FormatChoice,
        LAYOUTS,
        ReportFormat,
        get_args(WrittenForm),
    ],
)
def test_every_choice_is_in_the_manual(manual, choices):
    for choice in choices:
        assert re.search(rf"`(--[a-z]+ )?{choice}`", manual), choice


def test_every_column_is_in_the_manual(manual):
    meanings = (COLUMN_MEANING, BOARD_COLUMN_MEANING, PAIR_COLUMN_MEANING)
    for column, meaning in (each for known in meanings for each in known.items()):
        assert f"| `{column}` | {meaning} |" in manual


@pytest.mark.parametrize("layout", ["poses", "boards"])
def test_the_columns_of_a_layout_say_whose_frame_they_are_in(manual, layout):
    before_the_columns = manual.split(f"**`{layout}`**: a row per")[1].split("| column | |")[0]
    assert "With `--world-board`" in before_the_columns
    assert "in the frame" in before_the_columns


def test_every_exit_code_is_in_the_manual(manual):
    for code in (0, 1, 2, 3, 130):
        assert f"\n| {code} | " in manual


def test_statuses_explains_all_of_them(capsys):
    assert main(["statuses"]) == 0
    out = capsys.readouterr().out
    for name, meaning in {**STATUS_MEANING, **FLAG_MEANING}.items():
        assert re.search(rf"^  {re.escape(name)} +{re.escape(meaning)}$", out, re.MULTILINE)


@pytest.mark.parametrize(
    "command",
    [
        "camera configs/calibration/opencv.yaml",
        "camera configs/calibration/opencv.yaml --to colmap",
        "inspect sample_images/coplanar/b.png --rings",
        "statuses",
        "schema",
    ],
)
def test_sample_output_in_the_manual_is_what_is_printed(manual, command, capsys, monkeypatch, project_root):
    monkeypatch.chdir(project_root)
    assert main(command.split()) == 0
    printed = capsys.readouterr().out
    assert f"```console\n$ circlepose {command}\n{printed}```\n" in manual


def test_the_refusal_of_a_conversion_in_the_manual_is_what_is_said(manual, capsys, monkeypatch, project_root):
    monkeypatch.chdir(project_root)
    command = "camera configs/calibration/opencv_fisheye.yaml --to mrcal"
    assert main(command.split()) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert f"`circlepose {command}`" in manual
    # The manual breaks the line; the last digits of a fit are the platform's.
    (shown,) = re.findall(r"```text\n(circlepose: configs/.*?)```", section(manual, "camera"), re.DOTALL)
    number = re.compile(r"\b0\.\d+\b")
    assert number.sub("N", " ".join(shown.split())) == number.sub("N", " ".join(said.err.split()))
    assert list(map(float, number.findall(shown))) == pytest.approx(
        list(map(float, number.findall(said.err))), rel=0.2
    )


SCENE = """
camera: {fx: 400, fy: 400, cx: 159.5, cy: 119.5, image_size: [320, 240]}
views:
  - image: small
    targets:
      - {kind: disc, center_mm: [10, -5, 200], normal: [0.5, 0.1, -0.8], radius_mm: 20, level: 40}
"""


def test_the_sample_of_plan_is_what_a_terminal_shows(manual, capsys, monkeypatch):
    (typed, shown) = re.search(
        r"^```console\n\$ circlepose (plan .*?)\n(.*?)^```$", manual, re.DOTALL | re.MULTILINE
    ).groups()
    for module in ("screen", "sheets"):
        monkeypatch.setattr(f"circlepose_cli.output.{module}.width_of", lambda _: 100)
    assert main([*typed.split(), "--format", "table"]) == 0
    printed = capsys.readouterr().out
    # The last digits are the platform's.
    number = re.compile(r"\b\d+\.\d+\b")
    assert number.sub("N", printed) == number.sub("N", shown)
    assert list(map(float, number.findall(printed))) == pytest.approx(
        list(map(float, number.findall(shown))), rel=0.02, abs=0.011
    )


def test_render_makes_what_estimate_measures(capsys, tmp_path):
    (tmp_path / "scene.yaml").write_text(SCENE)
    assert main(["render", str(tmp_path / "scene.yaml"), "-o", str(tmp_path / "out")]) == 0
    written = [Path(line).name for line in capsys.readouterr().out.splitlines()]
    assert written == ["small.png", "camera.yml", "target.yaml", "truth.csv"]
    assert main(["estimate", str(tmp_path / "out")]) == 0
    assert "small.png,0,disc" in capsys.readouterr().out


def test_the_sample_of_print_is_what_is_printed_and_written(manual, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    block = re.search(r"^```console\n(\$ cat plate\.yaml\n.*?)^```$", manual, re.DOTALL | re.MULTILINE)[1]
    (_, target), (command, printed), (_, written) = (
        each.split("\n", 1) for each in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]
    )
    Path("plate.yaml").write_text(target)
    assert main(command.split()[1:]) == 0
    captured = capsys.readouterr()
    said = [line for line in captured.err.splitlines(keepends=True) if not line.startswith("no QR code: it needs")]
    assert captured.out + "".join(said) == printed
    assert Path("sheet.yaml").read_text() == written
