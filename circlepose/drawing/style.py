"""One look for all pictures: colors by meaning, and text whose size follows the picture's."""

from __future__ import annotations

import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import cv2
import numpy as np

from circlepose._typing import Image

Color: TypeAlias = tuple[int, int, int]
"""blue, green, red"""
Box: TypeAlias = tuple[float, float, float, float]
"""left, top, right, bottom in picture px"""

# Distinct by hue and lightness, also on gray photographs.
CHOSEN: Color = (60, 220, 60)
"""what is used: the chosen pose, a contour that is kept"""
AMBIGUOUS: Color = (0, 215, 255)
"""the chosen pose where another is as likely"""
OTHER: Color = (232, 224, 214)
"""the other candidate"""
UNUSED: Color = (255, 80, 255)
"""along the rim, but not used"""
BESIDE: Color = (205, 95, 150)
"""beside the rim, and not used"""
CLIPPED: Color = (0, 140, 255)
"""clipped levels"""
REJECTED: Color = (70, 70, 255)
"""without a pose; a contour that is rejected"""
MISFIT: Color = (0, 140, 255)
"""a circle of a board that does not fit its pose"""
AXES: tuple[Color, Color, Color] = ((70, 70, 255), (60, 220, 60), (255, 130, 50))
"""of a frame: x, y, z"""
LIMIT: Color = (230, 150, 60)
"""limits: of the band of pixels that is looked at; of one sigma"""
CENTER: Color = (255, 255, 255)
SHADOW: Color = (20, 20, 20)
TEXT: Color = (245, 245, 245)
PLATE: Color = (25, 22, 20)
PANEL: Color = (60, 50, 40)
PARTLY: Color = (30, 90, 140)
FAILED: Color = (50, 40, 120)

PLATE_OPACITY = 0.72
TITLE_SIZE, TEXT_SIZE, SMALL_SIZE = 0.62, 0.5, 0.44
"""scales of text in a picture of 1000 px; in larger ones all is larger"""
LEAST_WIDTH = 560.0
"""Width of a picture in units, or text has no room; empirical."""

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_LEAST_SCALE = 0.3
_SCALES_STROKES = int(cv2.__version__.split(".")[0]) >= 5
"""Since 5 OpenCV's font has outlines, whose strokes become wider with the letters; a weight above 1 is bold."""


def unit_of(picture: Image) -> float:
    """Return the unit of lines and text, in picture px: a thousandth of the picture's longer side."""
    return max(picture.shape[:2]) / 1000.0


def plain(text: str) -> str:
    r"""Return `text` in ASCII, which is all that OpenCV's font has: accents are dropped, the rest is `\uNNNN`."""
    return "".join(_plain_character(c) for c in unicodedata.normalize("NFC", text))


def _plain_character(character: str) -> str:
    if character.isascii() and character.isprintable():
        return character
    bare = "".join(c for c in unicodedata.normalize("NFKD", character) if not unicodedata.combining(c))
    if bare and bare.isascii() and bare.isprintable():
        return bare
    code = ord(character)
    return f"\\x{code:02x}" if code < 256 else f"\\u{code:04x}" if code < 65536 else f"\\U{code:08x}"


@dataclass(frozen=True, slots=True)
class Font:
    """Text of one size; `line_height` and `margin` are picture px."""

    scale: float
    weight: int
    line_height: float
    margin: float

    @classmethod
    def of_scale(cls, scale: float) -> Font:
        """Return the font of this scale of OpenCV, or of the least that can be read."""
        scale = max(scale, _LEAST_SCALE)
        return cls(scale, 1 if _SCALES_STROKES else max(1, round(scale * 1.3)), 36.0 * scale, 10.0 * scale)

    @property
    def tight(self) -> Font:
        """The font with little space around its letters, for numbers."""
        return Font(self.scale, self.weight, 24.0 * self.scale, 8.0 * self.scale)

    def width(self, line: str) -> int:
        """Return the width of a line, px."""
        return int(cv2.getTextSize(line, _FONT, self.scale, self.weight)[0][0])

    def fitting(self, lines: Sequence[str], width: float) -> Font:
        """Return the font in which the longest of `lines` is no wider than `width` px."""
        longest = max((self.width(line) for line in lines), default=0)
        return self if longest <= width else Font.of_scale(self.scale * width / longest)

    def plate(self, lines: Sequence[str]) -> tuple[float, float]:
        """Return width and height of the plate under `lines`."""
        width = max(self.width(line) for line in lines) + 2.0 * self.margin
        return width, len(lines) * self.line_height + self.margin

    def write(self, canvas: Image, lines: Sequence[str], left: float, top: float, color: Color = TEXT) -> None:
        """Write `lines` with the corner of their plate at (left, top)."""
        for number, line in enumerate(lines):
            baseline = top + self.margin / 2.0 + (number + 0.5) * self.line_height + 9.0 * self.scale
            at = (round(left + self.margin), round(baseline))
            cv2.putText(canvas, line, at, _FONT, self.scale, color, self.weight, cv2.LINE_AA)

    def plated(self, canvas: Image, lines: Sequence[str], box: Box, color: Color = PLATE) -> None:
        """Write `lines` on a dark plate that fills `box`, with an edge of `color` on the left."""
        left, top, right, bottom = (round(side) for side in box)
        area = canvas[max(top, 0) : bottom, max(left, 0) : right]
        area[...] = np.round(area * (1.0 - PLATE_OPACITY) + np.array(PLATE) * PLATE_OPACITY)
        canvas[max(top, 0) : bottom, max(left, 0) : left + max(2, round(3.0 * self.scale))] = color
        self.write(canvas, lines, left, top)

    def wrapped(self, line: str, width: float) -> list[str]:
        """Return `line` in parts no wider than `width` px, broken at spaces, or else within a word."""
        lines = [""]
        for word in line.split(" "):
            longer = f"{lines[-1]} {word}" if lines[-1] else word
            if self.width(longer) <= width:
                lines[-1] = longer
                continue
            first, *more = self._broken(word, width)
            lines = [*lines, first, *more] if lines[-1] else [first, *more]
        return lines

    def _broken(self, word: str, width: float) -> list[str]:
        parts = [""]
        for character in word:
            if parts[-1] and self.width(parts[-1] + character) > width:
                parts.append(character)
            else:
                parts[-1] += character
        return parts
