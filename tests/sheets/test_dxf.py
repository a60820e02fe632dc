"""DXF as ezdxf reads it back: in mm, y upwards, circles as circles."""

from __future__ import annotations

import io

import pytest

from circlepose.sheets.dxf import dxf_of
from circlepose.sheets.figure import figure_of
from circlepose.sheets.pages import lay_out
from circlepose.targets.target import Target
from tests.support.boards import grid

ezdxf = pytest.importorskip("ezdxf")


def read(page):
    return ezdxf.read(io.StringIO(dxf_of(page).decode()))


def test_it_is_in_mm_and_without_a_fault():
    (page,) = lay_out(figure_of(Target.circle(60.0)), ("a.",)).pages
    document = read(page)
    assert document.header["$INSUNITS"] == document.units == 4
    assert document.header["$MEASUREMENT"] == 1
    assert not document.audit().errors


@pytest.mark.parametrize("dark", [True, False])
def test_circles_are_circles_in_their_places(dark):
    target = Target.board(grid("symmetric", 3, 4, 30.0, 8.0, marks={(0, 1): (8.0, 4.0)}))
    (page,) = lay_out(figure_of(target), ("a.",), is_dark_on_light=dark).pages
    circles = read(page).modelspace().query("CIRCLE")
    found = [(entity.dxf.center.x, entity.dxf.center.y, entity.dxf.radius) for entity in circles]
    true = [(each.x_mm, page.height_mm - each.y_mm, radius) for each in page.rings for radius in each.radii_mm]
    assert len(found) == len(true) == 13
    for one, other in zip(found, true, strict=True):
        assert one == pytest.approx(other, abs=1e-9)


def test_what_is_drawn_for_an_uneven_printer_is_an_ellipse():
    (page,) = lay_out(figure_of(Target.circle(60.0)), ("a.",), scale=(1.002, 0.998)).pages
    (ellipse,) = read(page).modelspace().query("ELLIPSE")
    assert ellipse.dxf.major_axis.magnitude == pytest.approx(60.0 * 1.002)
    assert ellipse.dxf.ratio == pytest.approx(0.998 / 1.002)
