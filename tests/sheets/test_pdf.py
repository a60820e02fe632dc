"""Circles as cubic curves: the error that is stated is the one that is there."""

from __future__ import annotations

import numpy as np
import pytest

from circlepose.errors import UsageError
from circlepose.sheets.figure import figure_of
from circlepose.sheets.pages import lay_out
from circlepose.sheets.pdf import CIRCLE_ERROR_MM, LEAST_ARCS, arc_error, arc_points, arcs_for, pdf_of
from circlepose.targets.target import Target


def largest_error(radius, arcs):
    """Distance of densely sampled curves from the circle."""
    points = np.array(arc_points(3.0, -7.0, radius, arcs))
    t = np.linspace(0.0, 1.0, 401)[:, None]
    worst = 0.0
    for a, b, c, d in (points[i : i + 4] for i in range(0, len(points) - 1, 3)):
        curve = (1 - t) ** 3 * a + 3 * (1 - t) ** 2 * t * b + 3 * (1 - t) * t**2 * c + t**3 * d
        worst = max(worst, np.abs(np.linalg.norm(curve - (3.0, -7.0), axis=1) - radius).max())
    return worst


def test_four_arcs_would_be_16_micrometers_off():
    assert largest_error(60.0, 4) == pytest.approx(0.0164, abs=1e-4)


@pytest.mark.parametrize("radius", [0.1, 8.0, 60.0, 500.0, 5000.0])
def test_the_curves_are_as_near_as_stated(radius):
    arcs = arcs_for(radius)
    assert arcs >= LEAST_ARCS
    assert arcs % 4 == 0
    assert largest_error(radius, arcs) < 1.01 * CIRCLE_ERROR_MM < 1e-4


@pytest.mark.parametrize("arcs", [4, 8, 16, 24])
def test_the_error_is_the_formula(arcs):
    assert largest_error(60.0, arcs) == pytest.approx(arc_error(60.0, arcs), rel=0.02)


def test_the_curves_close_and_go_once_around():
    points = np.array(arc_points(0.0, 0.0, 1.0, 16))
    assert points[-1] == pytest.approx(points[0], abs=1e-12)
    ends = np.unwrap(np.arctan2(points[::3, 1], points[::3, 0]))
    assert ends[-1] - ends[0] == pytest.approx(2.0 * np.pi)


def test_a_page_has_the_size_of_the_paper_and_asks_for_no_scaling():
    pytest.importorskip("reportlab")
    pypdfium2 = pytest.importorskip("pypdfium2")
    pages = lay_out(figure_of(Target.circle(30.0)), ("a.",), None, (210.0, 297.0)).pages
    content = pdf_of(pages, "a")
    assert pypdfium2.PdfDocument(content)[0].get_size() == pytest.approx((210.0 / 25.4 * 72.0, 297.0 / 25.4 * 72.0))
    assert b"/PrintScaling /None" in content
    assert content == pdf_of(pages, "a")


def test_a_page_that_no_reader_shows_is_refused():
    pytest.importorskip("reportlab")
    with pytest.raises(UsageError, match="a page of PDF is at most 5080 mm long"):
        pdf_of(lay_out(figure_of(Target.circle(3000.0)), ("a.",)).pages, "a")
