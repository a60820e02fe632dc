"""What is on a page, in mm: x to the right and y down from the top left corner of the paper."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

_WIDTHS = {
    222: "ijl",
    191: "'",
    260: "|",
    278: " !,./:;I[\\]ft",
    333: "()-`r",
    334: "{}",
    355: '"',
    389: "*",
    469: "^",
    500: "Jcksvxyz",
    556: "#$0123456789?L_abdeghnopqu",
    584: "+<=>~",
    611: "FTZ",
    667: "&ABEKPSVXY",
    722: "CDHNRUw",
    778: "GOQ",
    833: "Mm",
    889: "%",
    944: "W",
    1015: "@",
}
"""advance widths of Helvetica, in thousandths of the size"""
_WIDTH_OF = {letter: width for width, letters in _WIDTHS.items() for letter in letters}
_WIDEST = max(_WIDTHS)


@dataclass(frozen=True, slots=True)
class Rings:
    """Concentric circles: the largest is filled with ink, or with paper on a ground of ink, the next the other way."""

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
        """x of the right side."""
        return self.x_mm + self.width_mm

    @property
    def bottom_mm(self) -> float:
        """y of the lower side."""
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
    """A line of Helvetica."""

    x_mm: float
    y_mm: float
    """where the base line begins"""
    size_mm: float
    letters: str
    is_upright: bool = False
    """whether it runs upwards"""

    @property
    def length_mm(self) -> float:
        """How long the line is."""
        return text_length(self.letters, self.size_mm)


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


def text_length(letters: str, size_mm: float) -> float:
    """Return the length in mm of a line of Helvetica."""
    return size_mm * sum(_WIDTH_OF.get(letter, _WIDEST) for letter in letters) / 1000.0


def plain_letters(text: str) -> str:
    """Return `text` with ? in place of each character that is no printable one of ASCII."""
    return "".join(letter if letter in _WIDTH_OF else "?" for letter in text)


def wrapped(words: Iterable[str], length_mm: float, size_mm: float) -> list[str]:
    """Return `words` as lines that are no longer than `length_mm`, but for a single word that is."""
    lines: list[str] = []
    for word in words:
        longer = f"{lines[-1]} {word}" if lines else word
        if lines and text_length(longer, size_mm) <= length_mm:
            lines[-1] = longer
        else:
            lines.append(word)
    return lines
