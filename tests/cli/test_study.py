from __future__ import annotations

import csv
import io
import json
import re
import subprocess
import sys
from importlib import import_module

import pytest
import typer.main

from circlepose.solvers import fu_zhou_coaxial, fu_zhou_coplanar
from circlepose.studies import gcc as gcc_study
from circlepose.studies import noise as noise_study
from circlepose.studies.gcc import GccPoint, gcc_rows, printed_points
from circlepose.studies.noise import noise_rows, printed_noise_rows, readings
from circlepose.studies.published import TABLE1
from circlepose.studies.table1 import table1_rows
from circlepose.studies.table2 import table2_rows
from circlepose_cli.app import main
from circlepose_cli.commands import study
from circlepose_cli.reports.study import gcc_sheet, noise_sheet, table1_sheet, table2_sheet

COMMANDS = typer.main.get_command(study.study).commands


@pytest.fixture(scope="module")
def papers(project_root):
    return (project_root / "docs" / "papers.md").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def table1():
    return table1_rows()


POINTS = [
    GccPoint("boss", 10.0, 0.25, -4.0, chosen_right=True),
    GccPoint("recess", 20.0, -0.125, 8.0, chosen_right=True),
    GccPoint("boss", 40.0, None, None),
]


@pytest.fixture
def run(capsys, monkeypatch):
    """Run a command line with one quick reading; returns exit code, standard output and standard error."""
    quick = readings()[:1]
    monkeypatch.setattr(noise_study, "readings", lambda: quick)
    monkeypatch.setattr(gcc_study, "gcc_points", lambda scenes, seed: POINTS[: 2 * scenes])

    def run_it(*args):
        code = main(["study", *map(str, args)])
        captured = capsys.readouterr()
        return code, captured.out, captured.err

    return run_it


def documented(papers, command):
    """The lines of a command's output in the page."""
    return papers.split(f"```console\n$ {command}\n")[1].split("\n```")[0].split("\n")


def cells(line):
    return [cell for cell in re.split(r"\s{2,}", line.strip()) if cell]


def numbers(text):
    return [float(number) for number in re.findall(r"-?\d+\.\d+", text)]


def rows_of(lines):
    """The cells of a printed table's rows, below its rule."""
    rule = next(number for number, line in enumerate(lines) if "───" in line)
    body = lines[rule + 1 :]
    return [cells(line) for line in body[: next((n for n, line in enumerate(body) if not line.strip()), len(body))]]


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_and_option_is_in_the_manual(project_root, name):
    manual = (project_root / "docs" / "cli.md").read_text(encoding="utf-8").split("\n## circlepose study\n")[1]
    assert f"`circlepose study {name}`" in manual
    command = COMMANDS[name]
    assert len(command.get_short_help_str(100)) <= 50
    for parameter in command.params:
        assert parameter.help, parameter.name
        for option in parameter.opts:
            assert option == "--help" or f"`{option}" in manual, option


@pytest.mark.parametrize("args", [["study", "--help"], ["study", "noise", "--help"]])
def test_help_imports_nothing_heavy(args):
    code = (
        "import sys; from circlepose_cli.app import main; code = main(sys.argv[1:]); "
        "print(*sys.modules, file=sys.stderr); sys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code, *args], capture_output=True, text=True, timeout=60, check=True)
    assert {"numpy", "cv2", "scipy", "pydantic", "rich", "yaml"}.isdisjoint(done.stderr.split())
    assert "--help" in done.stdout


def test_a_pipe_gets_csv_and_the_notes_go_to_standard_error(run):
    code, out, err = run("noise", "--repeats", 5)
    rows = list(csv.DictReader(io.StringIO(out)))
    assert code == 0
    assert [row["Reading"] for row in rows] == ["print"] * 3 + ["view a"] * 3
    assert (rows[0]["SD of centre (mm)"], rows[2]["SD of normal (deg)"]) == ("6.29", "4.61")
    assert rows[0]["Bias of centre (mm)"] == ""
    assert "5 repeats, seed 0" in err


def test_json_holds_full_precision_and_the_notes(run):
    code, out, err = run("noise", "--repeats", 5, "--seed", 7, "--format", "json")
    document = json.loads(out)
    assert (code, err) == (0, "")
    assert document["schema"] == "circlepose.study.noise/1"
    assert "seed 7" in document["notes"][0]
    assert document["rows"][0]["Bias of centre (mm)"] is None
    expected = next(noise_rows(5, 7, readings()[:1])).center_sd_mm
    assert document["rows"][3]["SD of centre (mm)"] == expected


def test_json_lines_have_the_schema_in_each(run):
    _, out, _ = run("noise", "--repeats", 2, "--format", "jsonl")
    assert [json.loads(line)["schema"] for line in out.splitlines()] == ["circlepose.study.noise/1"] * 6


def test_a_table_says_below_what_its_numbers_are(run):
    code, out, _ = run("noise", "--repeats", 5, "--format", "table")
    assert code == 0
    assert rows_of(out.split("\n"))[0] == ["print", "p, q, b, c", "1", "6.29", "1.63", "--", "--", "--"]
    assert "SD of centre: root mean square distance to the mean centre" in out


def test_the_form_follows_the_files_ending(run, tmp_path):
    assert run("noise", "--repeats", 2, "-o", tmp_path / "noise.json")[:2] == (0, "")
    assert len(json.loads((tmp_path / "noise.json").read_text())["rows"]) == 6
    code, _, err = run("noise", "--repeats", 2, "-o", tmp_path / "gone" / "noise.csv")
    assert code == 2
    assert "does not exist" in err


def test_a_plot(run, tmp_path):
    pytest.importorskip("matplotlib")
    assert run("noise", "--repeats", 2, "--plot", tmp_path / "noise.svg")[0] == 0
    assert "standard deviation" in (tmp_path / "noise.svg").read_text() or (tmp_path / "noise.svg").stat().st_size > 0


def test_the_gcc_study_in_every_form(run):
    for output_format in ("csv", "json", "jsonl", "table"):
        code, out, _ = run("gcc", "--format", output_format)
        assert code == 0
        assert "print, 2a" in out
    code, out, err = run("gcc", "--scenes", 1, "--seed", 7)
    rows = list(csv.DictReader(io.StringIO(out)))
    assert [(row["Part"], row["Tilt (deg)"], row["Right pair, largest (mm)"]) for row in rows] == [
        ("print, 2a", "14", "1.86"),
        ("print, 2b", "27", "0.37"),
        ("boss", "5 to 15", "0.25"),
        ("recess", "15 to 30", "0.12"),
    ]
    assert "seed 7" in err
    assert run("gcc", "--scenes", 0)[0] == 2


def test_a_plot_of_gcc(run, tmp_path):
    pytest.importorskip("matplotlib")
    assert run("gcc", "--plot", tmp_path / "gcc.png")[0] == 0
    assert (tmp_path / "gcc.png").stat().st_size > 1000


@pytest.mark.parametrize("name", ["noise", "gcc"])
@pytest.mark.parametrize(
    ("file", "message"), [("noise.png", "circlepose[report]"), ("noise.jpg", ".png, .svg, .pdf")]
)
def test_a_plot_that_cannot_be_made_is_told_before_anything_is_done(run, tmp_path, monkeypatch, name, file, message):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    code, out, err = run(name, "--plot", tmp_path / file)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.splitlines()) == 1


def test_repeats_must_be_at_least_2(run):
    code, _, err = run("noise", "--repeats", 1)
    assert code == 2
    assert "--repeats" in err


def test_the_sheet_of_table_1_is_laid_out_as_the_papers(table1):
    sheet = table1_sheet(table1)
    assert [*sheet.decimals][:7] == [
        "Method",
        "Source",
        "Image",
        "Circle center position",
        "Position difference (mm)",
        "Surface normal",
        "Orientation difference (deg)",
    ]
    printed = [row for row in sheet.rows if row[1] == "print"]
    assert [(row[0], row[2], row[3], row[5]) for row in printed] == [
        (row.method, f"({row.image})", row.center_mm, row.normal) for row in TABLE1
    ]


def test_table1_in_the_page_is_what_is_printed(papers, table1, capsys, monkeypatch):
    monkeypatch.setattr("circlepose.studies.table1.table1_rows", lambda: table1)
    assert main(["study", "table1", "--format", "table"]) == 0
    shown = [line.strip() for line in capsys.readouterr().out.split("\n") if line.strip()]
    page = [line.strip() for line in documented(papers, "circlepose study table1 --format table")]
    rule = next(number for number, line in enumerate(shown) if "───" in line)
    assert page[: rule + 1] == shown[: rule + 1]
    assert_like(rows_of(shown)[: len(table1)], rows_of(page))
    for note in table1_sheet(table1).notes:
        assert note in " ".join(page)


def test_noise_in_the_page_has_the_readings_printed(papers):
    page = rows_of(documented(papers, "circlepose study noise --format table"))
    names = [reading.name for reading in readings()]
    labels = [row[0] for row in page if row[0] in ("print", *names)]
    assert labels == ["print", *dict.fromkeys(names)]
    four = [*printed_noise_rows(), *noise_rows(1000, 0, readings()[:1])]
    for row, shown in zip(noise_sheet(four, 1000, 0).rows, page, strict=False):
        assert shown[-6] == f"{row[2]:.0f}"
        assert [float(each) for each in shown[-5:-3]] == pytest.approx([row[3], row[4]], rel=0.02, abs=0.006)


def test_gcc_in_the_page_has_the_columns_and_the_printed_rows(papers):
    page = documented(papers, "circlepose study gcc --format table")
    rows = rows_of(page)
    sheet = gcc_sheet(gcc_rows([*printed_points(), *POINTS]), 0)
    assert [row[:2] for row in rows[:2]] == [list(row[:2]) for row in sheet.rows[:2]]
    # A part is named in the first of its rows.
    assert {len(row) for row in rows} == {len(sheet.decimals), len(sheet.decimals) - 1}
    assert [row[0] for row in rows if len(row) == len(sheet.decimals)] == ["print, 2a", "print, 2b", "boss", "recess"]
    assert numbers(" ".join(rows[0])) == pytest.approx(sheet.rows[0][4:7])
    for note in sheet.notes:
        assert note in " ".join(line.strip() for line in page)


def test_table2_in_the_page_is_what_is_printed(papers):
    page = rows_of(documented(papers, "circlepose study table2 --format table"))
    sheet = table2_sheet(table2_rows(["2a"]))
    starts = [number for number, row in enumerate(page) if re.fullmatch(r"[12][a-d]", row[0])]
    assert [page[start][0] for start in starts] == ["1a", "1b", "1c", "1d", "2a", "2b"]
    shown = page[starts[4] : starts[5]]
    assert len(shown) == len(sheet.rows)
    for row, line in zip(sheet.rows, shown, strict=True):
        expected = [number for cell in row[3:] for number in (cell if isinstance(cell, tuple) else (cell,))]
        given = numbers(" ".join(line))
        assert given == pytest.approx([value for value in expected if value is not None], abs=0.3)


def assert_like(shown, page):
    """Compare the rows of Table I: texts equal, numbers within the tolerance of their column."""
    assert len(shown) == len(page)
    for ours, theirs in zip(shown, page, strict=True):
        assert len(ours) == len(theirs)
        # The method is not repeated, so columns count from the right.
        assert ours[:-6] == theirs[:-6]
        for tolerance, our, their in zip((2.0, 2.0, 0.02, 0.3, 2.0, 0.3), ours[-6:], theirs[-6:], strict=True):
            assert numbers(our) == pytest.approx(numbers(their), abs=tolerance)


@pytest.mark.parametrize(
    "name",
    [
        "imaged_center",
        "vanishing_line",
        "imaged_circular_points",
        "rotation_from_circular_points",
        "translation",
        "normal_from_imaged_center",
    ],
)
def test_the_functions_of_the_equations_are_named_in_the_page(papers, name):
    assert callable(getattr(fu_zhou_coplanar, name))
    assert f"`{name}`" in papers or f".{name}`" in papers
    assert fu_zhou_coaxial.__name__.removeprefix("circlepose.") in papers


def test_every_function_that_the_page_names_is_there(papers):
    named = set(re.findall(r"`((?:[a-z_0-9]+\.)+[A-Za-z_0-9]+)`", papers))
    named = {name for name in named if not name.endswith(".yaml")}
    assert len(named) > 20
    for name in named:
        module, _, attribute = name.rpartition(".")
        owner = import_module(f"circlepose.{module}")
        assert hasattr(owner, attribute) or import_module(f"circlepose.{name}"), name
