"""What is drawn has its true size: circlepose measures the pixels of each form, as other programs render it."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.support.sheet_rasters import dxf_pixels, errors_of, pdf_pixels, svg_pixels
from circlepose.sheets.dxf import dxf_of
from circlepose.sheets.figure import figure_of
from circlepose.sheets.pages import lay_out
from circlepose.sheets.pdf import pdf_of
from circlepose.sheets.svg import svg_of
from circlepose.targets.board import BoardCircle, BoardLayout
from circlepose.targets.target import Target
from tests.support.boards import grid

MOST_MM = 0.01
SENTENCES = ("target.yaml: 0123456789, o O 8 &.", "Print at 100 % (actual size), {x: 1.002, y: 0.998}.")
LIST = BoardLayout(
    (
        BoardCircle("a", (0.0, 0.0, 0.0), (10.0,)),
        BoardCircle("b", (50.0, 15.0, 0.0), (8.0, 4.0)),
        BoardCircle("c", (20.0, 40.0, 0.0), (6.0,)),
    )
)
TARGETS = {
    "disc": Target.circle(40.0),
    "discs": Target.circle(9.0, count=3),
    "ring": Target.rings((40.0, 25.0, 12.0)),
    "board": Target.board(grid("symmetric", 3, 4, 30.0, 8.0, marks={(1, 2): (6.0,)})),
    "list": Target.board(LIST),
}


def pages_of(target, paper=None, *, dark=True, scale=(1.0, 1.0)):
    return lay_out(figure_of(target), SENTENCES, None, paper, is_dark_on_light=dark, scale=scale).pages


def assert_true(image, page):
    errors, others = errors_of(image, page)
    assert len(errors) > 0
    assert np.abs(errors).max() < MOST_MM
    assert others == 0


@pytest.mark.parametrize("dark", [True, False], ids=["dark", "bright"])
@pytest.mark.parametrize("name", TARGETS)
class TestTrueSize:
    def test_of_svg(self, name, dark):
        pytest.importorskip("resvg_py")
        (page,) = pages_of(TARGETS[name], dark=dark)
        assert_true(svg_pixels(svg_of(page, name)), page)

    def test_of_pdf(self, name, dark):
        pytest.importorskip("reportlab")
        pytest.importorskip("pypdfium2")
        (page,) = pages_of(TARGETS[name], dark=dark)
        (image,) = pdf_pixels(pdf_of([page], name))
        assert_true(image, page)

    def test_of_dxf(self, name, dark):
        pytest.importorskip("ezdxf")
        pytest.importorskip("resvg_py")
        (page,) = pages_of(TARGETS[name], dark=dark)
        assert_true(dxf_pixels(dxf_of(page)), page)


@pytest.mark.parametrize("dark", [True, False], ids=["dark", "bright"])
def test_each_tile_has_its_true_size(dark):
    pytest.importorskip("resvg_py")
    target = Target.board(grid("symmetric", 4, 4, 40.0, 12.0))
    pages = pages_of(target, (120.0, 140.0), dark=dark)
    assert len(pages) == 4
    for page in pages:
        assert_true(svg_pixels(svg_of(page, "tile")), page)


def test_each_page_of_a_pdf_has_its_true_size():
    pytest.importorskip("reportlab")
    pytest.importorskip("pypdfium2")
    pages = pages_of(Target.board(grid("symmetric", 4, 4, 40.0, 12.0)), (120.0, 140.0))
    images = pdf_pixels(pdf_of(pages, "tiles"))
    assert len(images) == len(pages) == 4
    for image, page in zip(images, pages, strict=True):
        assert_true(image, page)


@pytest.mark.parametrize("scale", [(1.1, 1.1), (1.1, 0.9)], ids=["even", "uneven"])
@pytest.mark.parametrize("form", ["svg", "pdf", "dxf"])
def test_what_a_printer_stretches_is_drawn_the_other_way_about(form, scale):
    pytest.importorskip("resvg_py")
    pytest.importorskip("ezdxf")
    pytest.importorskip("reportlab")
    pytest.importorskip("pypdfium2")
    (page,) = pages_of(TARGETS["board"], scale=scale)
    pixels = {
        "svg": lambda: svg_pixels(svg_of(page, "scaled")),
        "pdf": lambda: pdf_pixels(pdf_of([page], "scaled"))[0],
        "dxf": lambda: dxf_pixels(dxf_of(page)),
    }
    assert_true(pixels[form](), page)
