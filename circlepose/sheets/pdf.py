"""Pages as PDF, which has no circle: arcs by cubic curves stand for it. Needs reportlab, of the extra `print`."""

from __future__ import annotations

import io
import math
from collections.abc import Sequence
from importlib.util import find_spec
from typing import Any

from circlepose._version import __version__
from circlepose.errors import UsageError
from circlepose.sheets.shapes import Box, Page, Rings

CIRCLE_ERROR_MM = 1e-5
"""Largest distance of the curves from the circle that they stand for."""
LEAST_ARCS = 16
LARGEST_MM = 5080.0
"""14400 points, the largest side of a page that every reader shows."""
_POINTS = 72.0 / 25.4


def require_pdf() -> None:
    """Raise `UsageError` unless reportlab is installed."""
    if find_spec("reportlab") is None:
        raise UsageError("PDF needs reportlab, which is not installed; run: pip install 'circlepose[print]'")


def arc_error(radius: float, arcs: int) -> float:
    """Return how far a circle's cubic curves are from it, at most: 2/27 sin^6 / cos^2 of a quarter arc, in radii."""
    quarter = math.pi / (2.0 * arcs)
    return radius * 2.0 / 27.0 * math.sin(quarter) ** 6 / math.cos(quarter) ** 2


def arcs_for(radius: float, error: float = CIRCLE_ERROR_MM) -> int:
    """Return the number of arcs, a multiple of four, whose curves are within `error` of a circle."""
    arcs = LEAST_ARCS
    while arc_error(radius, arcs) > error:
        arcs += 4
    return arcs


def arc_points(x: float, y: float, radius: float, arcs: int) -> list[tuple[float, float]]:
    """Return the control points of a circle's curves, 3 `arcs` + 1 of them: the first curve has the first four."""
    handle = 4.0 / 3.0 * math.tan(math.pi / (2.0 * arcs))
    points = [(x + radius, y)]
    for i in range(arcs):
        a, b = (2.0 * math.pi * (i + each) / arcs for each in (0, 1))
        points += [
            (x + radius * (math.cos(a) - handle * math.sin(a)), y + radius * (math.sin(a) + handle * math.cos(a))),
            (x + radius * (math.cos(b) + handle * math.sin(b)), y + radius * (math.sin(b) - handle * math.cos(b))),
            (x + radius * math.cos(b), y + radius * math.sin(b)),
        ]
    return points


def pdf_of(pages: Sequence[Page], title: str) -> bytes:
    """Return the PDF document of `pages`; raises `UsageError` without reportlab, and where a page is too large."""
    require_pdf()
    from reportlab.pdfgen.canvas import Canvas  # noqa: PLC0415 - an extra

    largest = max(side for page in pages for side in page.size_mm)
    if largest > LARGEST_MM:
        raise UsageError(
            f"a page of PDF is at most {LARGEST_MM:g} mm long, this one has {largest:.0f} mm; give --paper, or .svg."
        )
    content = io.BytesIO()
    # Equal pages are equal files.
    canvas = Canvas(content, pageCompression=1, invariant=1, pdfVersion=(1, 6))
    canvas.setTitle(title)
    canvas.setCreator(f"circlepose {__version__}")
    canvas.setViewerPreference("PrintScaling", "None")
    for page in pages:
        canvas.setPageSize(tuple(_POINTS * side for side in page.size_mm))
        _draw(canvas, page)
        canvas.showPage()
    canvas.save()
    return content.getvalue()


def _draw(canvas: Any, page: Page) -> None:
    # Down and in mm, as the page is.
    canvas.transform(_POINTS * page.scale[0], 0, 0, -_POINTS * page.scale[1], 0, _POINTS * page.size_mm[1])
    canvas.saveState()
    window = canvas.beginPath()
    _box(window, page.window)
    canvas.clipPath(window, stroke=0, fill=0)
    if page.ground is not None:
        _fill(canvas, [page.ground], is_ink=True)
    for rings in page.rings:
        _circles(canvas, rings, page.ground is None)
    canvas.restoreState()
    for line in page.lines:
        canvas.setStrokeGray(0.0 if line.is_ink else 1.0)
        canvas.setLineWidth(line.width_mm)
        canvas.line(line.x0_mm, line.y0_mm, line.x1_mm, line.y1_mm)
    if page.code:
        _fill(canvas, page.code, is_ink=True)
    canvas.setStrokeGray(0.0)
    for text in page.texts:
        canvas.setLineWidth(text.width_mm)
        path = canvas.beginPath()
        for first, *others in text.strokes:
            path.moveTo(*first)
            for point in others:
                path.lineTo(*point)
        canvas.drawPath(path, stroke=1, fill=0)


def _circles(canvas: Any, rings: Rings, is_ink: bool) -> None:
    for i, radius in enumerate(rings.radii_mm):
        path = canvas.beginPath()
        first, *others = arc_points(rings.x_mm, rings.y_mm, radius, arcs_for(radius))
        path.moveTo(*first)
        for each in range(0, len(others), 3):
            path.curveTo(*others[each], *others[each + 1], *others[each + 2])
        path.close()
        canvas.setFillGray(0.0 if is_ink != bool(i % 2) else 1.0)
        canvas.drawPath(path, stroke=0, fill=1)


def _fill(canvas: Any, boxes: Sequence[Box], *, is_ink: bool) -> None:
    path = canvas.beginPath()
    for box in boxes:
        _box(path, box)
    canvas.setFillGray(0.0 if is_ink else 1.0)
    canvas.drawPath(path, stroke=0, fill=1)


def _box(path: Any, box: Box) -> None:
    path.rect(box.x_mm, box.y_mm, box.width_mm, box.height_mm)
