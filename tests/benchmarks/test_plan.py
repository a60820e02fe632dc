"""The benchmark of predictions: a cell is measured, and its row is in the table."""

from __future__ import annotations

import pytest

from benchmarks.plan import cells, lines, outcome


def test_a_cell_and_its_row():
    every = list(cells())
    assert len(every) == len({cell.name for cell in every}) == 30
    rings = outcome(next(cell for cell in every if cell.name == "rings, 30 px, 40 deg"), 6)
    assert rings.found == (1.0, 1.0)
    assert rings.trials == 6
    assert rings.wrong == (pytest.approx(0.0, abs=1e-6), 0)
    # The root mean square of six.
    assert 0.3 < rings.position < 2.0
    assert 0.3 < rings.normal < 2.0
    table = list(lines([rings]))
    assert table[2].startswith("| rings, 30 px, 40 deg | 1.00 / 1.00 | ")
    assert table[-1].startswith("Within 15 %: position ")
