"""The benchmark of printed sheets: its views are those that it says, and its tables have what they say."""

from __future__ import annotations

from benchmarks.print import BOARDS, RADII_MM, curves, marks


def test_the_curves_are_within_what_the_page_says():
    rows = [line.split("|") for line in list(curves())[2:]]
    assert [float(row[1]) for row in rows] == list(RADII_MM)
    assert max(float(row[3]) for row in rows) < 0.01


def test_a_mark_settles_the_roll(monkeypatch):
    name = "symmetric 4 x 4, spacing 3.3 radii"
    monkeypatch.setattr("benchmarks.print.BOARDS", {name: BOARDS[name]})
    plain, marked = ([cell.strip() for cell in line.split("|")] for line in list(marks(6))[2:])
    assert plain[2:4] == ["none", "6 of 6"]
    assert plain[5] == "6"
    assert marked[2:] == ["one", "6 of 6", "6", "0", ""]
