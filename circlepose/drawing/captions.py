"""Text on pictures: plates beside what they describe, placed without covering each other; a heading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TypeAlias

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image

Color: TypeAlias = tuple[int, int, int]
"""blue, green, red"""

_FONT = cv2.FONT_HERSHEY_SIMPLEX
_TEXT: Color = (245, 245, 245)
_PLATE: Color = (25, 22, 20)
_PLATE_OPACITY = 0.72
_UNIT_GRID = np.array(list(product(np.linspace(0.0, 1.0, 12), repeat=2)))


Box: TypeAlias = tuple[float, float, float, float]
"""left, top, right, bottom in picture px"""


@dataclass(frozen=True, slots=True)
class Caption:
    """Lines of text about something that occupies `extent`."""

    lines: tuple[str, ...]
    color: Color
    extent: Box


@dataclass(frozen=True, slots=True)
class _Font:
    scale: float
    weight: int
    line_height: float
    margin: float

    @classmethod
    def of_scale(cls, scale: float) -> _Font:
        scale = max(scale, 0.3)
        return cls(scale, max(1, round(scale * 1.3)), 36.0 * scale, 12.0 * scale)

    def width(self, line: str) -> int:
        return int(cv2.getTextSize(line, _FONT, self.scale, self.weight)[0][0])

    def plate(self, lines: Sequence[str]) -> tuple[float, float]:
        """Return width and height of the plate under `lines`."""
        width = max(self.width(line) for line in lines) + 2.5 * self.margin
        return width, len(lines) * self.line_height + 2.0 * self.margin

    def write(self, canvas: Image, lines: Sequence[str], left: float, top: float) -> None:
        """Write `lines` with the corner of their plate at (left, top)."""
        for number, line in enumerate(lines):
            baseline = top + self.margin + (number + 0.74) * self.line_height
            at = (round(left + self.margin), round(baseline))
            cv2.putText(canvas, line, at, _FONT, self.scale, _TEXT, self.weight, cv2.LINE_AA)


def place(canvas: Image, captions: Sequence[Caption], *, text_scale: float, stay_near: bool = False) -> None:
    """Draw `captions` on `canvas` (h, w, 3), clear of each other and of all extents as far as there is room.

    Each is put near its extent; where that is taken anywhere else, with a line to it, unless it has to `stay_near`.
    """
    font = _Font.of_scale(text_scale)
    extents = np.array([caption.extent for caption in captions]).reshape(-1, 4)
    plates = np.empty((0, 4))
    for number, caption in enumerate(captions):
        size = font.plate(caption.lines)
        corners = _corners_around(size, extents[number], font.margin)
        room = np.maximum([canvas.shape[1] - size[0], canvas.shape[0] - size[1]], 0.0)
        if not stay_near:
            corners = np.concatenate([corners, _UNIT_GRID * room])
        corners = np.clip(corners, 0.0, room)
        box = _best_box(np.concatenate([corners, corners + size], axis=1), number, extents, plates, font)
        plates = np.concatenate([plates, box[None]])
    for caption, plate in zip(captions, plates, strict=True):
        _draw_leader(canvas, caption, plate, font)
    edge = max(2, round(4.0 * font.scale))
    for caption, plate in zip(captions, plates, strict=True):
        left, top, right, bottom = np.round(plate).astype(int).tolist()
        area = canvas[max(top, 0) : bottom, max(left, 0) : right]
        area[...] = np.round(area * (1.0 - _PLATE_OPACITY) + np.array(_PLATE) * _PLATE_OPACITY)
        cv2.rectangle(canvas, (left, top), (left + edge, bottom), caption.color, cv2.FILLED)
        font.write(canvas, caption.lines, left + edge, top)


def _best_box(boxes: FloatArray, number: int, extents: FloatArray, plates: FloatArray, font: _Font) -> FloatArray:
    """Return the one of `boxes` (n, 4) that covers least and is nearest to extent `number`."""
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2.0
    nearest = np.clip(middle, extents[number, :2], extents[number, 2:])
    gap = np.linalg.norm(np.clip(nearest, boxes[:, :2], boxes[:, 2:]) - nearest, axis=1)
    off_center = np.abs(middle - (extents[number, :2] + extents[number, 2:]) / 2.0).sum(axis=1)
    covered = 20.0 * _overlaps(boxes, plates) + 4.0 * _overlaps(boxes, extents)
    return np.asarray(boxes[np.argmin(covered + font.line_height * (gap + 0.2 * off_center))])


def _corners_around(size: tuple[float, float], extent: FloatArray, gap: float) -> FloatArray:
    """Return upper left corners (n, 2) of plates of `size` above, beside, below and over `extent` (4,)."""
    width, height = size
    left, top, right, bottom = extent.tolist()
    lefts = (right + gap, left - gap - width, (left + right - width) / 2.0, left, right - width)
    tops = (top - gap - height, bottom + gap, (top + bottom - height) / 2.0, top, bottom - height)
    return np.array(list(product(lefts, tops)))


def _overlaps(boxes: FloatArray, others: FloatArray) -> FloatArray:
    """Return the area (n,) that each of `boxes` (n, 4) shares with all `others` (m, 4)."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    return np.asarray(np.prod(np.maximum(high - low, 0.0), axis=-1).sum(axis=-1))


def _draw_leader(canvas: Image, caption: Caption, plate: FloatArray, font: _Font) -> None:
    """Join a plate to what it describes where they are apart."""
    extent = np.array(caption.extent)
    start = np.clip((extent[:2] + extent[2:]) / 2.0, plate[:2], plate[2:])
    end = np.clip(start, extent[:2], extent[2:])
    if np.linalg.norm(start - end) > 2.0 * font.margin:
        ends = [tuple(np.round(point).astype(int).tolist()) for point in (start, end)]
        cv2.line(canvas, ends[0], ends[1], caption.color, font.weight, cv2.LINE_AA)


def strip(width: int, texts: Sequence[tuple[str, float]], color: Color) -> Image:
    """Return a strip (height, width, 3) with `texts`, each with its scale, wrapped where they are too long."""
    margin = _Font.of_scale(texts[0][1]).margin
    rows = []
    for line, scale in texts:
        font = _Font.of_scale(scale)
        # A file name may hold bytes that are no text.
        shown = line.encode("utf-8", "backslashreplace").decode("utf-8")
        lines = _wrap(shown, font, width - 2.0 * margin)
        row = np.full((round((len(lines) + 0.6) * font.line_height), width, 3), color, dtype=np.uint8)
        font.write(row, lines, margin - font.margin, 0.3 * font.line_height - font.margin)
        rows.append(row)
    return np.concatenate(rows)


def _wrap(line: str, font: _Font, width: float) -> list[str]:
    lines = [""]
    for word in line.split(" "):
        longer = f"{lines[-1]} {word}" if lines[-1] else word
        if lines[-1] and font.width(longer) > width:
            lines.append(word)
        else:
            lines[-1] = longer
    return lines
