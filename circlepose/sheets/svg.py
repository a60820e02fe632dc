"""A page as SVG, whose unit is the millimeter."""

from __future__ import annotations

from collections.abc import Iterator
from xml.sax.saxutils import escape

from circlepose.sheets.shapes import Box, Line, Page, Rings, Text

_INK, _PAPER = "#000", "#fff"


def svg_of(page: Page, title: str) -> bytes:
    """Return the SVG document of a page; a circle is a `<circle>` with its center and radius in mm."""
    width, height = (_number(each) for each in page.size_mm)
    scaled = page.scale != (1.0, 1.0)
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" '
        f'viewBox="0 0 {width} {height}">',
        f"<title>{_shown(title)}</title>",
        f'<rect width="{width}" height="{height}" fill="{_PAPER}"/>',
        *([f'<g transform="scale({page.scale[0]:.9g} {page.scale[1]:.9g})">'] if scaled else []),
        f'<clipPath id="window">{_rectangle(page.window)}</clipPath>',
        '<g clip-path="url(#window)">',
        *([_rectangle(page.ground, _INK)] if page.ground is not None else []),
        *(circle for rings in page.rings for circle in _circles(rings, page.ground is None)),
        "</g>",
        *map(_line, page.lines),
        *([_code(page.code)] if page.code else []),
        f'<g fill="none" stroke="{_INK}">',
        *map(_text, page.texts),
        "</g>",
        *(["</g>"] if scaled else []),
        "</svg>\n",
    ]
    return "\n".join(lines).encode()


def _circles(rings: Rings, is_ink: bool) -> Iterator[str]:
    for i, radius in enumerate(rings.radii_mm):
        fill = _INK if is_ink != bool(i % 2) else _PAPER
        yield (
            f'<circle cx="{_number(rings.x_mm)}" cy="{_number(rings.y_mm)}" r="{_number(radius)}" fill="{fill}">'
            f"<title>{_shown(rings.name)}</title></circle>"
        )


def _rectangle(box: Box, fill: str | None = None) -> str:
    painted = "" if fill is None else f' fill="{fill}"'
    return (
        f'<rect x="{_number(box.x_mm)}" y="{_number(box.y_mm)}" '
        f'width="{_number(box.width_mm)}" height="{_number(box.height_mm)}"{painted}/>'
    )


def _code(boxes: tuple[Box, ...]) -> str:
    steps = "".join(
        f"M{_number(each.x_mm)} {_number(each.y_mm)}h{_number(each.width_mm)}v{_number(each.height_mm)}"
        f"h{_number(-each.width_mm)}z"
        for each in boxes
    )
    return f'<path fill="{_INK}" shape-rendering="crispEdges" d="{steps}"/>'


def _line(line: Line) -> str:
    return (
        f'<line x1="{_number(line.x0_mm)}" y1="{_number(line.y0_mm)}" x2="{_number(line.x1_mm)}" '
        f'y2="{_number(line.y1_mm)}" stroke-width="{_number(line.width_mm)}" '
        f'stroke="{_INK if line.is_ink else _PAPER}"/>'
    )


def _text(text: Text) -> str:
    steps = "".join("M" + " ".join(f"{_number(x)} {_number(y)}" for x, y in stroke) for stroke in text.strokes)
    return f'<path stroke-width="{_number(text.width_mm)}" d="{steps}"><title>{_shown(text.letters)}</title></path>'


def _shown(text: str) -> str:
    """Return a text as XML allows it."""
    return escape("".join(letter if letter.isprintable() else "?" for letter in text))


def _number(value: float) -> str:
    """Return a length in mm, to a nanometer."""
    return f"{value:.6f}".rstrip("0").rstrip(".") if abs(value) >= 5e-7 else "0"
