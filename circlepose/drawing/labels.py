"""Labels beside what they name, none of them on a rim, an arrow or another label; left out where there is no room."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.drawing.canvas import filled, polylines
from circlepose.drawing.style import Box, Color, Font

_TURNS = np.radians([-45.0, 0.0, -90.0, -135.0, 180.0, 45.0, 90.0, 135.0, -22.5, -67.5, -112.5, -157.5, 157.5, 22.5])
"""directions from a rim in which there may be room, the best first; right is 0, down is 90"""
_DIRECTIONS = np.stack([np.cos(_TURNS), np.sin(_TURNS)], axis=-1)
_UNIT_GRID = np.array(list(product(np.linspace(0.0, 1.0, 16), repeat=2)))
_DISC, _ARROW = 60, 240
_COVERED, _ASTRAY, _LATER = 3.0, 2.0, 0.05
"""What a place costs, in lengths of a label's side: to lie on a disc; to be nearer to the center of another; to be
the next in the order of directions."""
_FARTHEST = 2.5
"""Lengths of a label's longer side that it may be away from its rim."""
_NEARLY_ALL = 0.8
_SHORT_CELLS = 6
"""A shorter leader crosses nothing; at the end of a longer one there is its own rim."""


@dataclass(frozen=True, slots=True)
class Label:
    """What is written about the rims at `points` (n, 2), picture px."""

    texts: tuple[tuple[str, ...], ...]
    """lines of each level, the longest first"""
    color: Color
    points: FloatArray


@dataclass(frozen=True, slots=True)
class Placed:
    """A label and its plate."""

    label: Label
    lines: tuple[str, ...]
    font: Font
    box: Box


@dataclass(frozen=True, slots=True)
class Plan:
    """Where labels go."""

    level: int
    """of the texts of nearly all labels, 0 the longest; those without room at it are of a higher one"""
    placed: tuple[Placed, ...]
    left_out: int
    """labels without room"""


@dataclass(frozen=True, slots=True)
class Room:
    """What of a picture is taken, in cells of `cell` px."""

    taken: Image
    """(rows, columns) where nothing may lie: rims, labels"""
    worth: Image
    """(rows, columns) what would better stay free: `_DISC` in a disc, `_ARROW` on an arrow"""
    cell: int

    @classmethod
    def of(cls, picture: Image, unit: float) -> Room:
        """Return the room of an empty picture."""
        cell = max(1, round(unit))
        shape = (-(-picture.shape[0] // cell), -(-picture.shape[1] // cell))
        return cls(np.zeros(shape, np.uint8), np.zeros(shape, np.uint8), cell)

    def copied(self) -> Room:
        """Return the same room, to try labels in."""
        return Room(self.taken.copy(), self.worth, self.cell)

    def keep_disc(self, outline: FloatArray) -> None:
        """Keep a closed line through picture points (n, 2) free, and its inside as far as can be."""
        polylines(self.taken, [np.concatenate([outline, outline[:1]]) / self.cell], 255, 1)
        filled(self.worth, outline / self.cell, _DISC)

    def spare_lines(self, paths: Sequence[FloatArray]) -> None:
        """Keep lines through picture points (n, 2) free as far as can be; after all discs."""
        polylines(self.worth, [path / self.cell for path in paths], _ARROW, 3)

    def keep_labels(self, plan: Plan) -> None:
        """Keep planned labels free."""
        for each in plan.placed:
            self.taken[self.cells(np.array([each.box]))[0]] = 1

    def cells(self, boxes: FloatArray) -> list[tuple[slice, slice]]:
        """Return the rows and columns that each of `boxes` (n, 4), within the picture, touches."""
        low, high = np.floor(boxes[:, :2] / self.cell), np.ceil(boxes[:, 2:] / self.cell)
        sides = np.concatenate([low, high], axis=1).astype(int).tolist()
        return [(slice(top, bottom), slice(left, right)) for left, top, right, bottom in sides]


def plan_labels(picture: Image, room: Room, labels: Sequence[Label], sizes: Sequence[float]) -> Plan:
    """Return where `labels` go in `picture`.

    They are of the first level at which nearly all have room; of several lines, all. Those that have none there are
    of a higher level.

    Parameters
    ----------
    picture
        (h, w, 3).
    room
        Of it.
    labels
        In the order in which they are placed.
    sizes
        Scale of the text at each level.
    """
    placed: tuple[Placed, ...] = ()
    level = 0
    for level, size in enumerate(sizes):
        trial = room.copied()
        most_missed = _missed(labels, level, is_last=level == len(sizes) - 1)
        found = _at_level(picture, trial, labels, level, Font.of_scale(size), most_missed)
        if found is not None:
            placed, room = found, trial
            break
    for smaller in range(level + 1, len(sizes)):
        done = {id(each.label) for each in placed}
        missing = [label for label in labels if id(label) not in done]
        placed += _at_level(picture, room, missing, smaller, Font.of_scale(sizes[smaller]), len(missing)) or ()
    return Plan(level, placed, len(labels) - len(placed))


def _missed(labels: Sequence[Label], level: int, *, is_last: bool) -> int:
    """Return how many labels may be without room at a level that is used."""
    if is_last:
        return len(labels)
    return 0 if any(len(label.texts[level]) > 1 for label in labels) else int((1.0 - _NEARLY_ALL) * len(labels))


def draw_labels(picture: Image, plan: Plan) -> None:
    """Draw planned labels, each joined to its rim where it is apart from it."""
    for each in plan.placed:
        _draw_leader(picture, each)
    for each in plan.placed:
        each.font.plated(picture, each.lines, each.box, each.label.color)


def _at_level(
    picture: Image, room: Room, labels: Sequence[Label], level: int, font: Font, most_missed: int
) -> tuple[Placed, ...] | None:
    """Return the labels that have room, which is taken from `room`; None where more than so many have none."""
    placed: list[Placed] = []
    middles = np.array([_middle(label.points) for label in labels]).reshape(-1, 2)
    for number, label in enumerate(labels):
        lines = label.texts[level]
        own = font if len(lines) > 1 else font.tight
        size = np.ceil(own.plate(lines))
        corners = _corners(label.points, size, max(own.margin / 4.0, 2.0 * room.cell + 1.0))
        space = np.array([picture.shape[1], picture.shape[0]]) - size
        if len(lines) > 1:
            corners = np.concatenate([corners, _UNIT_GRID * np.maximum(space, 0.0)])
        corners = np.round(corners)
        cost = _cost(corners, size, label.points, middles, number)
        inside = np.all((corners >= 0.0) & (corners <= space), axis=1) & np.isfinite(cost)
        box = _best_box(corners[inside], size, cost[inside], room, label.points, over_arrows=len(lines) == 1)
        if box is not None:
            room.taken[room.cells(box[None])[0]] = 1
            polylines(room.taken, [_leader(box, label.points) / room.cell], 255, 1)
            left, top, right, bottom = box.tolist()
            placed.append(Placed(label, lines, own, (left, top, right, bottom)))
        elif number + 1 - len(placed) > most_missed:
            return None
    return tuple(placed)


def _cost(corners: FloatArray, size: FloatArray, points: FloatArray, middles: FloatArray, number: int) -> FloatArray:
    """Return what the places at `corners` (n, 2) cost the label `number`, px; inf for those too far away."""
    low, high = np.nanmin(points, axis=0), np.nanmax(points, axis=0)
    center = np.clip(corners + size / 2.0, low, high)
    far = np.linalg.norm(np.clip(center, corners, corners + size) - center, axis=1)
    # None farther from it than this is nearer to a place beside it.
    reach = 2.0 * float(np.max(high - low) + size.max()) + (0.0 if len(corners) < len(_UNIT_GRID) else np.inf)
    apart = np.linalg.norm(middles - middles[number], axis=1)
    others = middles[(apart <= reach) & (np.arange(len(middles)) != number)]
    gaps, (own,) = _gaps(corners, size, others), _gaps(corners, size, middles[number : number + 1])
    side = float(size[1])
    order = np.minimum(np.arange(len(corners)), 2 * len(_DIRECTIONS))
    cost = far + side * (_ASTRAY * (gaps.min(axis=0, initial=np.inf) <= own) + _LATER * order)
    return np.where(far <= _FARTHEST * float(size.max()), cost, np.inf)


def _gaps(corners: FloatArray, size: FloatArray, points: FloatArray) -> FloatArray:
    """Return the distances (m, n) of `points` (m, 2) to boxes of `size` at `corners` (n, 2)."""
    nearest = np.clip(points[:, None], corners, corners + size)
    return np.asarray(np.linalg.norm(nearest - points[:, None], axis=-1))


def _best_box(
    corners: FloatArray, size: FloatArray, cost: FloatArray, room: Room, points: FloatArray, *, over_arrows: bool
) -> FloatArray | None:
    """Return the box at one of `corners` (n, 2) that lies on nothing, costs little and hides little."""
    boxes = np.concatenate([corners, corners + size], axis=1)
    order = np.argsort(cost, kind="stable")
    best, least = None, np.inf
    for box, cells, own in zip(boxes[order], room.cells(boxes[order]), cost[order].tolist(), strict=True):
        if own >= least:
            break
        part = room.worth[cells]
        if room.taken[cells].any() or (not over_arrows and bool((part > _DISC).any())):
            continue
        hidden = _COVERED * float(size[1]) * float(part.mean()) / _DISC
        if own + hidden < least and not _crosses(_leader(box, points), room):
            best, least = box, own + hidden
    return best


def _leader(box: FloatArray, points: FloatArray) -> FloatArray:
    """Return the ends (2, 2) of the shortest line from `box` (4,) to one of `points` (n, 2)."""
    on_box = np.clip(points, box[:2], box[2:])
    nearest = int(np.nanargmin(np.linalg.norm(on_box - points, axis=1)))
    return np.stack([on_box[nearest], points[nearest]])


def _crosses(leader: FloatArray, room: Room) -> bool:
    """Whether something lies across a leader (2, 2), but for the rim at its end."""
    start, end = leader / room.cell
    steps = int(np.linalg.norm(end - start))
    if steps < _SHORT_CELLS:
        return False
    columns, rows = (start + np.linspace(0.0, 1.0 - _SHORT_CELLS / (steps + 1), steps)[:, None] * (end - start)).T
    inside = (columns >= 0) & (rows >= 0) & (columns < room.taken.shape[1]) & (rows < room.taken.shape[0])
    return bool(room.taken[rows[inside].astype(int), columns[inside].astype(int)].any())


def _middle(points: FloatArray) -> FloatArray:
    return np.asarray((np.nanmin(points, axis=0) + np.nanmax(points, axis=0)) / 2.0)


def _corners(points: FloatArray, size: FloatArray, gap: float) -> FloatArray:
    """Return upper left corners (n, 2) of plates outside of the rims at `points`, inside, and in the middle."""
    known = points[np.all(np.isfinite(points), axis=1)]
    center = _middle(known)
    half = np.abs(_DIRECTIONS) @ size / 2.0
    outer = np.max((known - center) @ _DIRECTIONS.T, axis=0) + half + gap
    inner = float(np.min(np.linalg.norm(known - center, axis=1))) - np.linalg.norm(size) / 2.0 - gap
    middles = [center + outer[:, None] * _DIRECTIONS]
    if inner > 0.0:
        middles.append(center + inner * _DIRECTIONS)
    middles.append(center[None])
    return np.concatenate(middles) - size / 2.0


def _draw_leader(picture: Image, placed: Placed) -> None:
    line = _leader(np.array(placed.box), placed.label.points)
    if np.linalg.norm(line[1] - line[0]) > 3.0 * placed.font.margin:
        polylines(picture, [line], placed.label.color, placed.font.weight)
