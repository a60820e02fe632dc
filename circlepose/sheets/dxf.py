"""A page as DXF, whose unit is the millimeter, y upwards. Needs ezdxf, which comes with the extra `print`."""

from __future__ import annotations

import io
from importlib.util import find_spec
from typing import Any

from circlepose.errors import UsageError
from circlepose.sheets.shapes import Box, Page

_MILLIMETERS = 4
"""of $INSUNITS"""
_INK, _PAPER = 7, 255
"""colors: black, or white where the ground is dark"""
LAYERS = {
    "CIRCLES": "the outlines",
    "FILL": "what is of ink",
    "BARS": "lines to measure and to trim",
    "TEXT": "small print and names",
    "CODE": "the QR code",
    "PAGE": "the border of the paper",
}


def require_dxf() -> None:
    """Raise `UsageError` unless ezdxf is installed."""
    if find_spec("ezdxf") is None:
        raise UsageError("DXF needs ezdxf, which is not installed; run: pip install 'circlepose[print]'")


def dxf_of(page: Page) -> bytes:
    """Return the DXF document of a page; its circles are CIRCLE, or ELLIPSE where `Page.scale` differs in x and y.

    Raises `UsageError` without ezdxf.
    """
    require_dxf()
    import ezdxf  # noqa: PLC0415 - an extra

    document: Any = ezdxf.new("R2010", units=_MILLIMETERS)
    document.header["$INSUNITS"] = _MILLIMETERS
    document.header["$MEASUREMENT"] = 1
    for name, meaning in LAYERS.items():
        document.layers.add(name).description = meaning
    drawing = _Drawing(document.modelspace(), page)
    drawing.circles()
    drawing.lines()
    drawing.texts()
    drawing.boxes()
    drawing.border()
    stream = io.StringIO()
    document.write(stream)
    return stream.getvalue().encode(document.output_encoding, errors="replace")


class _Drawing:
    """Puts a page into a model space."""

    def __init__(self, space: Any, page: Page) -> None:
        self._space = space
        self._page = page

    def circles(self) -> None:
        page = self._page
        fill = None
        if page.ground is not None:
            fill = self._hatch()
            fill.paths.add_polyline_path(self._corners(page.ground), is_closed=True, flags=1)
        for rings in page.rings:
            own = fill if fill is not None else self._hatch()
            for i, radius in enumerate(rings.radii_mm):
                self._circle(rings.x_mm, rings.y_mm, radius)
                edges = own.paths.add_edge_path(flags=1 if fill is None and i == 0 else 16)
                center = self._at(rings.x_mm, rings.y_mm)
                if self._is_even:
                    edges.add_arc(center, radius * page.scale[0], 0.0, 360.0)
                else:
                    edges.add_ellipse(center, *self._axes(radius), 0.0, 360.0)

    def lines(self) -> None:
        for line in self._page.lines:
            self._space.add_line(
                self._at(line.x0_mm, line.y0_mm), self._at(line.x1_mm, line.y1_mm), dxfattribs={"layer": "BARS"}
            )

    def texts(self) -> None:
        for text in self._page.texts:
            for stroke in text.strokes:
                self._space.add_lwpolyline([self._at(x, y) for x, y in stroke], dxfattribs={"layer": "TEXT"})

    def boxes(self) -> None:
        for box in self._page.code:
            a, b, c, d = self._corners(box)
            self._space.add_solid([a, b, d, c], dxfattribs={"layer": "CODE", "color": _INK})

    def border(self) -> None:
        page = Box(0.0, 0.0, self._page.width_mm, self._page.height_mm)
        self._space.add_lwpolyline(self._corners(page), close=True, dxfattribs={"layer": "PAGE"})

    @property
    def _is_even(self) -> bool:
        return self._page.scale[0] == self._page.scale[1]

    def _hatch(self) -> Any:
        return self._space.add_hatch(color=_INK, dxfattribs={"layer": "FILL", "hatch_style": 0})

    def _circle(self, x: float, y: float, radius: float) -> None:
        attributes = {"layer": "CIRCLES"}
        if self._is_even:
            self._space.add_circle(self._at(x, y), radius * self._page.scale[0], dxfattribs=attributes)
        else:
            major, ratio = self._axes(radius)
            self._space.add_ellipse(self._at(x, y), (*major, 0.0), ratio, dxfattribs=attributes)

    def _axes(self, radius: float) -> tuple[tuple[float, float], float]:
        """Return the major semi-axis, and the ratio of the minor one to it."""
        wide, high = (radius * each for each in self._page.scale)
        return ((wide, 0.0), high / wide) if wide >= high else ((0.0, high), wide / high)

    def _at(self, x: float, y: float) -> tuple[float, float]:
        across, down = self._page.scale
        return x * across, (self._page.height_mm - y) * down

    def _corners(self, box: Box) -> list[tuple[float, float]]:
        return [
            self._at(x, y)
            for x, y in (
                (box.x_mm, box.y_mm),
                (box.right_mm, box.y_mm),
                (box.right_mm, box.bottom_mm),
                (box.x_mm, box.bottom_mm),
            )
        ]
