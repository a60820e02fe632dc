"""Letters of strokes: as long as they are laid out, and none of them a circle to a camera."""

from __future__ import annotations

import string

import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.support.sheet_rasters import svg_pixels
from circlepose.diagnostics.inspection import inspect
from circlepose.sheets.letters import plain_letters, strokes_of, text_length, wrapped
from circlepose.sheets.shapes import Box, Page, Text
from circlepose.sheets.svg import svg_of

PRINTABLE = string.ascii_letters + string.digits + string.punctuation + " "


def test_every_printable_letter_has_strokes():
    assert plain_letters(PRINTABLE) == PRINTABLE
    assert all(strokes_of(letter, 2.0) for letter in PRINTABLE if letter != " ")


def test_others_are_replaced():
    assert plain_letters("Größe\n中") == "Gr??e??"


def test_no_two_letters_look_the_same():
    looks = {letter: str(strokes_of(letter, 6.0)) for letter in PRINTABLE}
    assert len(set(looks.values())) == len(PRINTABLE)


@given(st.text(PRINTABLE, min_size=1, max_size=30), st.floats(0.5, 5.0))
def test_strokes_lie_within_the_length(letters, size):
    xs = [x for stroke in strokes_of(letters, size) for x, _ in stroke]
    assert all(-1e-9 <= x <= text_length(letters, size) + 1e-9 for x in xs)


@given(
    st.lists(st.text(string.ascii_letters, min_size=1, max_size=60), min_size=1, max_size=12), st.floats(8.0, 90.0)
)
def test_lines_are_no_longer_than_asked_for_and_lose_nothing(words, length):
    lines = wrapped(words, length, 1.8)
    assert all(text_length(line, 1.8) <= length for line in lines)
    assert "".join(lines).replace(" ", "") == "".join(words)


@pytest.mark.parametrize("px_per_mm", [6.0, 12.0, 20.0, 30.0])
def test_no_letter_is_found_as_a_circle(px_per_mm):
    pytest.importorskip("resvg_py")
    lines = [PRINTABLE[i : i + 24] for i in range(0, len(PRINTABLE), 24)]
    texts = tuple(Text(4.0, 8.0 + 5.0 * i, 1.8, line) for i, line in enumerate(lines))
    page = Page(60.0, 30.0, Box(0.0, 0.0, 1.0, 1.0), (), None, (), texts)
    assert inspect(svg_pixels(svg_of(page, "letters"), px_per_mm)).extraction.contours == ()
