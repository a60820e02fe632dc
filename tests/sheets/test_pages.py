"""Pages: nothing lies on anything else or in the margin, and tiles hold every circle that no seam must cut."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from circlepose.errors import UsageError
from circlepose.sheets.figure import Figure, clear_mm, figure_of
from circlepose.sheets.furniture import BAR_MM, EDGE_MM, MOST_BAR_MM, bar_mm
from circlepose.sheets.letters import STROKE
from circlepose.sheets.pages import lay_out
from circlepose.sheets.paper import PAPERS, paper_mm
from circlepose.sheets.shapes import Box
from circlepose.sheets.tiles import OVERLAP_MM
from circlepose.targets.target import Target
from tests.support.boards import grid

WORDS = ("target.yaml: board of 7 x 9 circles of radius 8 mm, symmetric, spacing 30 mm, dark on light.", "Print it.")
CODE = (26.5, (Box(2.0, 2.0, 3.5, 3.5), Box(21.0, 21.0, 3.5, 3.5)))


def text_box(text):
    points = np.array([point for stroke in text.strokes for point in stroke])
    half = STROKE * text.size_mm / 2.0
    low, high = points.min(axis=0) - half, points.max(axis=0) + half
    return Box(*low, *(high - low))


def line_box(line):
    x, y = sorted((line.x0_mm, line.x1_mm)), sorted((line.y0_mm, line.y1_mm))
    return Box(x[0], y[0], x[1] - x[0], y[1] - y[0])


def meets(first, second):
    return (
        first.x_mm < second.right_mm
        and second.x_mm < first.right_mm
        and first.y_mm < second.bottom_mm
        and second.y_mm < first.bottom_mm
    )


def assert_tidy(page):
    """Texts, bars, code and circles are apart from each other and in the printable part."""
    texts = [text_box(text) for text in page.texts]
    # Seams lie in the window, bars around it.
    bars = [box for box in map(line_box, page.lines) if not meets_or_touches(box, page.window)]
    code = []
    if page.code:
        left, top = min(box.x_mm for box in page.code), min(box.y_mm for box in page.code)
        right, bottom = max(box.right_mm for box in page.code), max(box.bottom_mm for box in page.code)
        code = [Box(left, top, right - left, bottom - top)]
    for box in (*texts, *bars, *code, page.window):
        assert box.x_mm >= EDGE_MM - 2.5
        assert box.y_mm >= EDGE_MM - 2.5
        assert box.right_mm <= page.width_mm - EDGE_MM + 2.5
        assert box.bottom_mm <= page.height_mm - EDGE_MM + 2.5
    for first, second in itertools.combinations((*texts, *code, page.window), 2):
        assert not meets(first, second), (first, second)
    for bar in bars:
        assert not any(meets(bar, each) for each in (*texts, *code)), bar


def meets_or_touches(first, second):
    wider = Box(second.x_mm - 1e-9, second.y_mm - 1e-9, second.width_mm + 2e-9, second.height_mm + 2e-9)
    return meets(Box(first.x_mm, first.y_mm, max(first.width_mm, 1e-12), max(first.height_mm, 1e-12)), wider)


FIGURES = {
    "disc": figure_of(Target.circle(60.0)),
    "small": figure_of(Target.circle(1.0)),
    "rings": figure_of(Target.rings((40.0, 20.0), count=3)),
    "board": figure_of(Target.board(grid("symmetric", 7, 9, 30.0, 8.0))),
    "hexagonal": figure_of(Target.board(grid("hexagonal", 5, 5, 90.0, 35.0))),
}


@pytest.mark.parametrize("code", [None, CODE], ids=["plain", "code"])
@pytest.mark.parametrize("paper", [None, "A4", "A3", "letter", "180x240"])
@pytest.mark.parametrize("name", FIGURES)
def test_nothing_lies_on_anything_else(name, paper, code):
    sheet = lay_out(FIGURES[name], WORDS, code, None if paper is None else paper_mm(paper))
    for page in sheet.pages:
        assert_tidy(page)
        if paper is not None:
            assert sorted((page.width_mm, page.height_mm)) == sorted(paper_mm(paper))


@pytest.mark.parametrize("name", FIGURES)
def test_every_circle_is_on_the_one_page_with_its_clear_margin(name):
    (page,) = lay_out(FIGURES[name], WORDS).pages
    assert len(page.rings) == len(FIGURES[name].rings)
    for each in page.rings:
        reach = each.radii_mm[0] + clear_mm(each.radii_mm[0]) - 1e-9
        assert page.window.x_mm <= each.x_mm - reach
        assert each.x_mm + reach <= page.window.right_mm
        assert page.window.y_mm <= each.y_mm - reach
        assert each.y_mm + reach <= page.window.bottom_mm


@settings(max_examples=40, deadline=None)
@given(
    pattern=st.sampled_from(["symmetric", "asymmetric", "hexagonal"]),
    rows=st.integers(2, 9),
    columns=st.integers(2, 9),
    radius=st.floats(2.0, 30.0),
    ratio=st.floats(2.2, 5.0),
    paper=st.sampled_from(["A4", "letter", "180x150"]),
    is_dark=st.booleans(),
)
def test_tiles_hold_each_circle_where_it_is(pattern, rows, columns, radius, ratio, paper, is_dark):
    figure = figure_of(Target.board(grid(pattern, rows, columns, ratio * radius, radius)))
    sheet = lay_out(figure, WORDS, CODE, paper_mm(paper), is_dark_on_light=is_dark)
    whole = set()
    for page in sheet.pages:
        assert_tidy(page)
        window = page.window
        for each in page.rings:
            reach = each.radii_mm[0]
            inside = (
                window.x_mm <= each.x_mm - reach
                and each.x_mm + reach <= window.right_mm
                and window.y_mm <= each.y_mm - reach
                and each.y_mm + reach <= window.bottom_mm
            )
            if inside:
                whole.add(each.name)
    assert whole >= {each.name for each in figure.rings} - set(sheet.cut)
    # Circles have the same distances on all tiles.
    at = {each.name: (each.x_mm, each.y_mm) for each in figure.rings}
    for page in sheet.pages:
        shifts = np.array([(each.x_mm - at[each.name][0], each.y_mm - at[each.name][1]) for each in page.rings])
        assert len(shifts) == 0 or np.ptp(shifts, axis=0).max() < 1e-9


def test_seams_run_between_the_circles_where_they_can():
    figure = figure_of(Target.board(grid("symmetric", 9, 9, 40.0, 12.0)))
    sheet = lay_out(figure, WORDS, None, paper_mm("A4"))
    assert sheet.cut == ()
    assert len(sheet.pages) == 6
    assert sheet.columns == 3


def test_the_lines_of_neighbors_are_the_same_seam():
    figure = figure_of(Target.board(grid("symmetric", 2, 9, 40.0, 12.0)))
    first, second = lay_out(figure, WORDS, None, paper_mm("A4")).pages[:2]
    left_of = {each.name: each.x_mm for each in first.rings}
    shift = next(left_of[each.name] - each.x_mm for each in second.rings if each.name in left_of)
    # The second is trimmed at the left of its window, which lies so far from the end of the first's.
    seam = second.window.x_mm + shift
    assert first.window.right_mm - seam == pytest.approx(OVERLAP_MM)
    assert any(line.x0_mm == line.x1_mm == pytest.approx(seam) for line in first.lines)


def test_a_circle_that_no_seam_can_spare_is_named():
    figure = figure_of(Target.board(grid("asymmetric", 9, 9, 30.0, 18.0)))
    sheet = lay_out(figure, WORDS, None, paper_mm("A4"))
    assert sheet.cut
    assert set(sheet.cut) < {each.name for each in figure.rings}


@pytest.mark.parametrize(
    ("target", "paper", "said"),
    [
        (Target.circle(120.0), "A4", "too small for circle disc of radius 120 mm"),
        (Target.circle(65.0), "180x180", "too small for circle disc of radius 65 mm"),
        (Target.circle(5.0), "50x50", "leave no 10 mm for circles"),
        (Target.circle(5.0), "30x200", "too narrow for the QR code"),
        (Target.board(grid("symmetric", 2, 2, 1e6, 5.0)), "A4", "the sheet is 1000020 mm long"),
        (Target.board(grid("symmetric", 70, 70, 100.0, 5.0)), "A4", "at most 400 are made"),
    ],
)
def test_a_paper_that_is_too_small_is_refused(target, paper, said):
    with pytest.raises(UsageError, match=said):
        lay_out(figure_of(target), WORDS, CODE, paper_mm(paper))


@pytest.mark.parametrize("room", [10.0, 19.99, 55.0, 210.0, 4000.0])
def test_bars_are_round_and_fit(room):
    length = bar_mm(room)
    assert length <= room
    assert length <= MOST_BAR_MM
    assert length % BAR_MM == 0.0
    assert length > min(room, MOST_BAR_MM) - BAR_MM


def test_papers_are_read_by_name_and_by_size():
    assert paper_mm("A4") == paper_mm("a4") == PAPERS["a4"]
    assert paper_mm("Letter") == (215.9, 279.4)
    assert paper_mm("100x50.5") == (100.0, 50.5)


@pytest.mark.parametrize("text", ["A9", "100", "0x50", "-1x50", "100 x 50 cm", "", "nanxnan"])
def test_no_paper_is_refused(text):
    with pytest.raises(UsageError, match="--paper: expected A5, A4"):
        paper_mm(text)


def test_a_paper_is_turned_where_that_helps():
    wide = Figure(FIGURES["board"].rings[:9], 266.0, 26.0)
    (page,) = lay_out(wide, WORDS, None, paper_mm("A4")).pages
    assert (page.width_mm, page.height_mm) == (297.0, 210.0)
