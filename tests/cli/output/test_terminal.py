"""Tables on a terminal of any width: no line is longer, and no number is folded, split or cut."""

from __future__ import annotations

import io
import os
import re
import struct
import subprocess
import threading
from dataclasses import replace

import numpy as np
import pytest
from rich.cells import cell_len

import circlepose
from circlepose.camera.camera import Camera
from circlepose.io.calibration.reader import read_camera_file
from circlepose.io.tables.selection import Selection
from circlepose.io.target_file import read_target
from circlepose.results import Flag, ImageResult, Status
from circlepose.targets.target import Target
from circlepose_cli.console.terminal import fitted
from circlepose_cli.output.table import write_table
from tests.support.board_results import TABLE_HEADER, made_board, made_board_result
from tests.support.discs import NORMAL, RADIUS_MM, disc_folder, discs_image, made_circle, made_result
from tests.support.paths import ROOT
from tests.support.processes import COMMAND, environment

fcntl = pytest.importorskip("fcntl")
termios = pytest.importorskip("termios")
WIDTHS = (60, 80, 100, 140, 200)
NUMBER = re.compile(r"-?\d+\.\d+")
END = b"\x1c"
SIGMAS = np.diag(np.array([0.0123, 0.0045, 0.34, 2e-4, 3e-4]) ** 2)


@pytest.fixture(autouse=True)
def no_colors(monkeypatch):
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setenv("TERM", "xterm")


@pytest.fixture(scope="module")
def measured():
    """All sample images, and a drawn one of 12 discs."""
    results = []
    for folder in sorted((ROOT / "sample_images").iterdir()):
        camera = read_camera_file(folder / "camera.yml").camera
        results += circlepose.measure(folder, camera, read_target(folder / "target.yaml"))
    camera = Camera.create([[500.0, 0.0, 319.5], [0.0, 500.0, 239.5], [0.0, 0.0, 1.0]], (), (640, 480))
    across, down = np.cross(NORMAL, [0.0, 1.0, 0.0]), np.cross(NORMAL, [1.0, 0.0, 0.0])
    centers = [np.array([0.0, 0.0, 420.0]) + 60.0 * (x * across + y * down) for y in (-1, 0, 1) for x in range(-2, 2)]
    discs = circlepose.estimate(
        discs_image(centers, NORMAL, camera),
        camera,
        replace(Target.circle(RADIUS_MM), count=12, same_plane=True),
        name="discs.png",
    )
    assert len(discs.circles) == 12
    return {"sample images": results, "12 discs": [discs]}


def on_terminal(width, write):
    """What `write` prints to the handle of a pseudo-terminal of `width` columns, line by line."""
    ours, theirs = os.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 50, width, 0, 0))
    read = bytearray()

    def read_all():
        while not read.endswith(END):
            read.extend(os.read(ours, 65536))

    reader = threading.Thread(target=read_all)
    reader.start()
    try:
        with open(theirs, "w", encoding="utf-8", closefd=False) as handle:
            write(handle)
    finally:
        # What is in the terminal may be lost where it is closed before it is read.
        os.write(theirs, END)
        reader.join()
        os.close(theirs)
        os.close(ours)
    return read.removesuffix(END).decode().replace("\r\n", "\n").splitlines()


def printed(results, layout="poses", selection=Selection()):  # noqa: B008 - frozen
    """The lines without a terminal, where there is room for all."""
    handle = io.StringIO()
    write_table(results, handle, layout, selection=selection)
    return handle.getvalue().splitlines()


def numbers(lines):
    """All numbers but the ambiguities that a narrow table leaves unsaid: those of 0, and those that a flag says."""
    return sorted(each for each in NUMBER.findall("\n".join(lines)) if each not in {"0.000", "0.500"})


@pytest.mark.parametrize("which", ["sample images", "12 discs"])
@pytest.mark.parametrize("width", WIDTHS)
@pytest.mark.parametrize("layout", ["poses", "table1", "table2"])
def test_a_table_fits_and_its_numbers_are_whole(measured, which, width, layout):
    results = measured[which]
    lines = on_terminal(width, lambda handle: write_table(results, handle, layout))
    assert max(map(cell_len, lines)) <= width
    whole, shown = numbers(printed(results, layout)), numbers(lines)
    if any(line.startswith("not shown: ") for line in lines):
        assert set(shown) <= set(whole)
    else:
        assert shown == whole


BOARDS = [
    made_board_result(made_board(), made_board(1, (), 1)),
    ImageResult("gone.png", Status.LAYOUT_MISMATCH, "another spacing?"),
    made_board_result(
        made_board(0, (Flag.AMBIGUOUS, Flag.RADIUS_MISFIT)), image="a_long_name_of_a_photograph_of_a_board.png"
    ),
]


@pytest.mark.parametrize("width", [1, 20, 47, *WIDTHS])
@pytest.mark.parametrize("layout", ["boards", "pairs"])
def test_a_table_of_boards_fits_and_its_numbers_are_whole(measured, width, layout):
    results = BOARDS if layout == "boards" else measured["12 discs"]
    lines = on_terminal(width, lambda handle: write_table(results, handle, layout))
    assert max(map(cell_len, lines)) <= max(width, 20)
    # The ambiguity of the last board is said by its flag.
    whole, shown = ([each for each in numbers(some) if each != "0.250"] for some in (printed(results, layout), lines))
    if any(line.startswith("not shown: ") for line in lines):
        assert set(shown) <= set(whole)
    else:
        assert shown == whole
    if width >= 60:
        # A table, not one value a line.
        assert any(line.startswith(" ───") for line in lines)
    if layout == "boards" and width == 200:
        assert lines[0].split() == TABLE_HEADER
        assert "1/12" in lines[2]
        assert any(line.endswith("layout_mismatch") for line in lines)


@pytest.mark.parametrize("width", [1, 19, 20, 33, 47])
@pytest.mark.parametrize("layout", ["poses", "table1", "table2"])
def test_a_narrow_terminal_gets_all_numbers_below_each_other(measured, width, layout):
    results = measured["12 discs"]
    lines = on_terminal(width, lambda handle: write_table(results, handle, layout))
    assert max(map(cell_len, lines)) <= max(width, 20)
    assert numbers(lines) == numbers(printed(results, layout))


def test_columns_that_are_left_out_are_named_with_how_to_get_them(measured):
    lines = on_terminal(80, lambda handle: write_table(measured["12 discs"], handle, "poses"))
    note = next(line for line in lines if line.startswith("not shown: "))
    wide = int(re.search(r"terminal of (\d+) columns", " ".join(lines[lines.index(note) :]))[1])
    assert "± deg" in note
    for width, is_complete in ((wide - 1, False), (wide, True)):
        lines = on_terminal(width, lambda handle: write_table(measured["12 discs"], handle, "poses"))
        assert any("± deg" in line for line in lines if "not shown" not in line) is is_complete


@pytest.mark.parametrize("columns", ["0", "-5", "many", "", "99999999999"])
def test_columns_that_are_no_number_are_not_used(measured, columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    lines = on_terminal(100, lambda handle: write_table(measured["12 discs"], handle, "poses"))
    assert 80 < max(map(cell_len, lines)) <= 100
    monkeypatch.setenv("COLUMNS", "62")
    lines = on_terminal(100, lambda handle: write_table(measured["12 discs"], handle, "poses"))
    assert max(map(cell_len, lines)) <= 62


def test_a_terminal_that_knows_no_width_is_taken_to_have_80_columns(measured):
    lines = on_terminal(0, lambda handle: write_table(measured["12 discs"], handle, "poses"))
    assert 60 < max(map(cell_len, lines)) <= 80


NAMES = [
    "測定画像" * 20 + ".png",
    "e\u0301a\u0308" * 60 + ".png",
    "صورة الدائرة " * 9 + ".png",
    "📷🔵" * 30 + ".png",
    "a b\n\x1b[31m" * 20 + ".png",
    "\udcff" * 80,
    "x" * 300,
    "",
]


@pytest.mark.parametrize("width", [20, *WIDTHS])
@pytest.mark.parametrize("name", NAMES)
def test_names_of_any_script_are_shortened_by_cells(name, width):
    results = [made_result(made_circle(covariance=SIGMAS), image=image) for image in (name, f"{name}b", "c.png")]
    lines = on_terminal(width, lambda handle: write_table(results, handle, "poses"))
    assert max(map(cell_len, lines)) <= width
    assert "\x1b" not in "".join(lines)
    body = [line for line in lines if "not shown" not in line and "columns shows" not in line]
    assert set(numbers(body)) <= set(numbers(printed(results)))
    # One value a line, the name begins each record.
    assert sum("c.png" in line for line in lines) == (1 if width > 20 else 2)


FAILED = ImageResult("gone.png", Status.NO_CIRCLE, "none")


def states(monkeypatch, **environment):
    """The styles on the lines of a chosen, an ambiguous, an other and a failed candidate."""
    monkeypatch.delenv("NO_COLOR")
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    circle = replace(made_circle(), flags=(), ambiguity=0.01)
    results = [made_result(circle), made_result(replace(circle, flags=(Flag.AMBIGUOUS,)), image="b.png"), FAILED]
    return on_terminal(140, lambda handle: write_table(results, handle, "poses"))


def test_colors_say_what_a_row_is(monkeypatch):
    good, other, ambiguous, _, failed = states(monkeypatch)[-5:]
    assert "\x1b[32m" in good
    assert "\x1b[2m" in other
    assert "\x1b[33m" in ambiguous
    assert "\x1b[33m" not in good
    assert "\x1b[31mno_circle" in failed


@pytest.mark.parametrize("environment", [{"NO_COLOR": "1"}, {"TERM": "dumb"}, {"NO_COLOR": "1", "FORCE_COLOR": "1"}])
def test_no_colors_where_they_are_not_wanted(monkeypatch, environment):
    assert "\x1b" not in "".join(states(monkeypatch, **environment))


def test_a_file_gets_no_colors_and_all_columns(monkeypatch):
    monkeypatch.delenv("NO_COLOR")
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "60")
    lines = printed([made_result(made_circle(covariance=SIGMAS), image="x" * 300), FAILED])
    assert "\x1b" not in "".join(lines)
    assert "x" * 300 in "\n".join(lines)
    assert "± deg" in lines[0]


def test_as_many_digits_as_sigma_allows():
    row = printed([made_result(made_circle(covariance=SIGMAS))])[2].split()
    # Sigmas: x 0.0123, y 0.0045, z 0.34 mm, of the normal 3.6e-4.
    assert row[2:8] == ["10.000", "-5.0000", "200.00", "0.52705", "0.10541", "-0.84327"]
    assert row[8:10] == ["0.34", "0.021"]
    assert printed([made_result()])[2].split()[2:8] == ["10.000", "-5.000", "200.000", "0.5270", "0.1054", "-0.8433"]


@pytest.mark.parametrize(
    ("sigma", "shown"), [(1e-30, "10.000000"), (0.0, "10.000"), (1e6, "10"), (0.0996, "10.00"), (0.1, "10.00")]
)
def test_digits_are_never_absurdly_many_or_rounded_away(sigma, shown):
    covariance = np.diag([sigma**2, 1.0, 1.0, 1.0, 1.0])
    assert printed([made_result(made_circle(covariance=covariance))])[2].split()[2] == shown


@pytest.mark.parametrize("width", [20, *WIDTHS])
def test_columns_that_are_chosen_are_never_left_out(measured, width):
    columns = ("center_z_mm", "image", "sigma_z_mm", "chosen", "settled_by", "instance", "normal_x", "flags")
    selection = Selection(columns, chosen_only=True)
    lines = on_terminal(
        width, lambda handle: write_table(measured["sample images"], handle, "poses", selection=selection)
    )
    assert max(map(cell_len, lines)) <= width
    assert numbers(lines) == numbers(printed(measured["sample images"], selection=selection))
    assert "false" not in "\n".join(lines)


@pytest.mark.parametrize("width", [20, 60])
def test_the_command_on_a_terminal(tmp_path, width):
    folder = disc_folder(tmp_path / "imgs", 1)
    command = [*COMMAND, "estimate", "-q", str(folder)]
    lines = on_terminal(
        width, lambda handle: subprocess.run(command, stdout=handle, env=environment(), timeout=60, check=True)
    )
    assert max(map(cell_len, lines)) <= width
    assert any("ambig" in line for line in lines)
    assert len(numbers(lines)) == 16


REPORT = """\
image       a.png: ok

levels      blur 0.71 px, contrast 160.1 levels, noise and misfit 1.02 levels, darker inside
uncertainty the image's noise alone; --camera-sigma and --radius-sigma-mm add what dominates in practice
"""


@pytest.mark.parametrize("width", [20, *WIDTHS])
def test_a_report_in_words_is_broken_between_words(width):
    lines = on_terminal(width, lambda handle: handle.write(fitted(REPORT, handle, 12)))
    assert max(map(len, lines)) <= width
    assert " ".join(" ".join(lines).split()) == " ".join(REPORT.split())
    assert fitted(REPORT, io.StringIO()) == REPORT
    if width == 60:
        assert {line[:12].strip() for line in lines} == {"image", "levels", "uncertainty", ""}


@pytest.mark.parametrize("size", ["²", "٣", "-5", "80x", ""])
def test_a_size_that_is_no_number_is_passed_over(tmp_path, size):
    folder = disc_folder(tmp_path / "imgs", 1)
    environ = {**environment(), "COLUMNS": size, "LINES": size}
    command = [*COMMAND, "estimate", "-q", str(folder), "--format", "table"]
    assert subprocess.run(command, env=environ, timeout=60, check=False, stdout=subprocess.DEVNULL).returncode == 0
