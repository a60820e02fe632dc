"""What is on a page, in mm: x to the right and y down from the top left corner of the paper."""

from __future__ import annotations

from dataclasses import dataclass, replace

from circlepose.sheets.letters import STROKE, Point, strokes_of


@dataclass(frozen=True, slots=True)
class Rings:
    """Concentric circles: the largest is filled with ink, or with paper on a ground of ink, the next by turns."""

    name: str
    x_mm: float
    y_mm: float
    radii_mm: tuple[float, ...]
    """the largest first"""

    def moved(self, x_mm: float, y_mm: float) -> Rings:
        """Return the same farther to the right and down."""
        return replace(self, x_mm=self.x_mm + x_mm, y_mm=self.y_mm + y_mm)


@dataclass(frozen=True, slots=True)
class Box:
    """A rectangle."""

    x_mm: float
    y_mm: float
    width_mm: float
    height_mm: float

    @property
    def right_mm(self) -> float:
        """X of the right side."""
        return self.x_mm + self.width_mm

    @property
    def bottom_mm(self) -> float:
        """Y of the lower side."""
        return self.y_mm + self.height_mm


@dataclass(frozen=True, slots=True)
class Line:
    """A straight line, as wide as its ink."""

    x0_mm: float
    y0_mm: float
    x1_mm: float
    y1_mm: float
    width_mm: float
    is_ink: bool = True
    """False: in the color of the paper"""


@dataclass(frozen=True, slots=True)
class Text:
    """A line of `letters`."""

    x_mm: float
    y_mm: float
    """where the base line begins"""
    size_mm: float
    """height of a capital"""
    letters: str
    is_upright: bool = False
    """whether it runs upwards"""

    @property
    def width_mm(self) -> float:
        """Width of its strokes."""
        return STROKE * self.size_mm

    @property
    def strokes(self) -> list[list[Point]]:
        """Its strokes, each through points of the page, mm."""
        lines = strokes_of(self.letters, self.size_mm)
        if self.is_upright:
            return [[(self.x_mm + y, self.y_mm - x) for x, y in line] for line in lines]
        return [[(self.x_mm + x, self.y_mm + y) for x, y in line] for line in lines]


@dataclass(frozen=True, slots=True)
class Page:
    """One page: the circles within `window`, and around them what is needed to print and measure it."""

    width_mm: float
    height_mm: float
    window: Box
    """outside of it no part of `rings` and `ground` is drawn"""
    rings: tuple[Rings, ...]
    ground: Box | None
    """of ink, under bright discs"""
    lines: tuple[Line, ...]
    texts: tuple[Text, ...]
    code: tuple[Box, ...] = ()
    """dark parts of the QR code"""
    scale: tuple[float, float] = (1.0, 1.0)
    """by which all lengths in x and in y are drawn, for a printer that makes them as much smaller or larger"""

    @property
    def size_mm(self) -> tuple[float, float]:
        """Width and height as drawn."""
        return self.width_mm * self.scale[0], self.height_mm * self.scale[1]


@dataclass(frozen=True, slots=True)
class Sheet:
    """The pages of a target."""

    pages: tuple[Page, ...]
    """from the top left, row by row"""
    columns: int = 1
    cut: tuple[str, ...] = ()
    """names of the circles through which a seam runs"""
