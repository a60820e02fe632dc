"""Printed sheets as pixels, by renderers of their own, and what circlepose measures in them."""

from __future__ import annotations

import io
import itertools

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.diagnostics.inspection import inspect
from circlepose.sheets.shapes import Page, Rings

PX_PER_MM = 20.0
"""508 dpi: all pages of whole tenths of a mm have whole pixels, which renderers do not stretch."""


def svg_pixels(content: bytes, px_per_mm: float = PX_PER_MM) -> Image:
    """Return the gray levels of an SVG document, by resvg."""
    import resvg_py  # noqa: PLC0415 - an extra

    encoded = bytes(resvg_py.svg_to_bytes(svg_string=content.decode(), dpi=25.4 * px_per_mm))
    return cv2.imdecode(np.frombuffer(encoded, np.uint8), cv2.IMREAD_GRAYSCALE)


def pdf_pixels(content: bytes, px_per_mm: float = PX_PER_MM) -> list[Image]:
    """Return the gray levels of each page of a PDF document, by PDFium."""
    import pypdfium2  # noqa: PLC0415 - an extra

    document = pypdfium2.PdfDocument(content)
    try:
        pages = [
            page.render(scale=25.4 * px_per_mm / 72.0, grayscale=True).to_numpy().squeeze().copy()
            for page in document
        ]
    finally:
        document.close()
    return pages


def dxf_pixels(content: bytes, px_per_mm: float = PX_PER_MM) -> Image:
    """Return the gray levels of a DXF document, by ezdxf's drawing of it and resvg."""
    import ezdxf  # noqa: PLC0415 - an extra
    from ezdxf.addons.drawing import Frontend, RenderContext, layout, svg  # noqa: PLC0415
    from ezdxf.addons.drawing.config import BackgroundPolicy, ColorPolicy, Configuration  # noqa: PLC0415

    document = ezdxf.read(io.StringIO(content.decode()))
    look = Configuration(
        background_policy=BackgroundPolicy.WHITE, color_policy=ColorPolicy.BLACK, max_flattening_distance=1e-4
    )
    # The outlines are as wide as a pen; what is filled has the true size.
    for entity in document.modelspace().query("CIRCLE ELLIPSE"):
        document.modelspace().delete_entity(entity)
    backend = svg.SVGBackend()
    Frontend(RenderContext(document), backend, config=look).draw_layout(document.modelspace())
    page = layout.Page(0, 0, layout.Units.mm, margins=layout.Margins.all(0))
    drawn = backend.get_string(page, settings=layout.Settings(scale=1))
    return svg_pixels(drawn.encode(), px_per_mm)


def true_circles(page: Page) -> FloatArray:
    """Return center and radius (n, 3) mm, as drawn, of the circles of a page that lie whole in its window."""
    window = page.window
    whole = [
        each
        for each in page.rings
        if window.x_mm <= each.x_mm - each.radii_mm[0]
        and each.x_mm + each.radii_mm[0] <= window.right_mm
        and window.y_mm <= each.y_mm - each.radii_mm[0]
        and each.y_mm + each.radii_mm[0] <= window.bottom_mm
    ]
    rows = [(each.x_mm, each.y_mm, radius) for each in whole for radius in each.radii_mm]
    return np.array(rows, np.float64).reshape(-1, 3) * [*page.scale, np.sqrt(np.prod(page.scale))]


def measured_circles(image: Image, page: Page) -> FloatArray:
    """Return center and radius (m, 3) mm of what is found in a page's pixels."""
    height, width = image.shape
    # A page that is no whole number of pixels is stretched to one.
    per_mm = np.array([width, height]) / page.size_mm
    found = [contour.ellipse for contour in inspect(image, rings=True).extraction.contours]
    # Pixels are counted from the center of the first.
    rows = [
        (*((each.center + 0.5) / per_mm), np.sqrt(each.semi_major * each.semi_minor / np.prod(per_mm)))
        for each in found
    ]
    return np.array(rows, np.float64).reshape(-1, 3)


def errors_of(image: Image, page: Page) -> tuple[FloatArray, int]:
    """Return what is measured less the truth (n, 3) mm, NaN for circles not found, and how many others were found."""
    truth, found = true_circles(page), measured_circles(image, page)
    errors = np.full(truth.shape, np.nan)
    taken = set()
    for i, j in itertools.product(range(len(truth)), range(len(found))):
        if np.abs(found[j] - truth[i]).max() < 0.5:
            errors[i] = found[j] - truth[i]
            taken.add(j)
    # Those that the window cuts may be found in part.
    whole = {(x, y) for x, y, _ in (truth / [*page.scale, 1.0]).round(6).tolist()}
    cut = [each for each in page.rings if (round(each.x_mm, 6), round(each.y_mm, 6)) not in whole]
    others = [
        j for j in range(len(found)) if j not in taken and not any(_is_of(found[j], each, page) for each in cut)
    ]
    return errors, len(others)


def _is_of(found: FloatArray, rings: Rings, page: Page) -> bool:
    x, y = found[:2] / page.scale
    return bool(np.hypot(x - rings.x_mm, y - rings.y_mm) < 2.0 * rings.radii_mm[0])
