"""Which circle of one table is which of another: by image, circle and method, several instances by their centers."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from circlepose._typing import FloatArray
from circlepose.results import Status

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]
"""w, x, y, z of a rotation, unit"""


@dataclass(frozen=True, slots=True)
class TabledPose:
    """A candidate as a table gives it; None is what the table does not know."""

    center_mm: Vector | None
    normal: Vector | None
    """unit vector; None of a board"""
    rotation: Quaternion | None = None
    """of a board, whose origin is `center_mm`"""


@dataclass(frozen=True, slots=True)
class TabledCircle:
    """One circle of one image, by one method; or one board, without a name and a method."""

    image: str
    instance: int | None
    circle: str | None
    """None in a truth that does not name its circles"""
    method: str | None
    """None in a truth, which holds for every method"""
    status: str = Status.OK
    poses: tuple[TabledPose, ...] = ()
    chosen: int = 0
    """index of the pose to use"""
    is_roll_open: bool = False
    """of a board: whether its layout looks the same after a turn, so that its roll is one of several"""

    @property
    def center_mm(self) -> Vector | None:
        """Center of the chosen pose."""
        return self.poses[self.chosen].center_mm if self.poses else None


@dataclass(frozen=True, slots=True)
class PoseTable:
    """What a table of poses, or a truth, says."""

    circles: tuple[TabledCircle, ...]
    image_status: Mapping[str, str]
    """of images with a row of their own, which says why there are no circles or too few"""
    is_truth: bool = False
    of_boards: bool = False
    """whether its rows are boards"""
    is_relative: bool = False
    """whether its poses are in the frame of a world board"""

    @property
    def images(self) -> tuple[str, ...]:
        """Names of all images, in the order of the table."""
        return tuple(dict.fromkeys((*(circle.image for circle in self.circles), *self.image_status)))


@dataclass(frozen=True, slots=True)
class Pairing:
    """Circles of a table beside their counterparts in its reference."""

    pairs: tuple[tuple[TabledCircle, TabledCircle], ...]
    missing: tuple[TabledCircle, ...]
    """in the reference only"""
    extra: tuple[TabledCircle, ...]
    """in the table only"""


def with_common_names(measured: PoseTable, reference: PoseTable) -> tuple[PoseTable, tuple[str, ...]]:
    """Return `reference` with names that can be matched with those of `measured`, and notes on what was done.

    - If no image has the same name in both, but the names without folders are unique in each, those are matched.
    - A truth that shares no circle's name with `measured` loses its names.
    """
    images, image_note = _with_common_images(measured, reference)
    circles, circle_note = _with_common_circles(measured, images)
    return circles, tuple(filter(None, (image_note, circle_note, _method_note(measured, reference))))


def pair_circles(measured: PoseTable, reference: PoseTable) -> Pairing:
    """Return each circle of `measured` with its counterpart in `reference`.

    Several instances are paired by the centers of their chosen poses, the closest pair first, whatever the order
    of the rows.
    """
    named = any(circle.circle is not None for circle in reference.circles)
    ours = _grouped(measured.circles, named=named)
    theirs = _grouped(_for_each_method(measured, reference), named=named)
    groups = [_paired(ours[key], theirs[key]) for key in dict.fromkeys((*theirs, *ours))]
    return Pairing(
        pairs=tuple(pair for group in groups for pair in group.pairs),
        missing=tuple(circle for group in groups for circle in group.missing),
        extra=tuple(circle for group in groups for circle in group.extra),
    )


def _with_common_images(measured: PoseTable, reference: PoseTable) -> tuple[PoseTable, str]:
    if not set(measured.images).isdisjoint(reference.images):
        return reference, ""
    ours, theirs = _by_base_name(measured.images), _by_base_name(reference.images)
    if ours is None or theirs is None or ours.keys().isdisjoint(theirs):
        return reference, "no image of the poses is in the reference"
    names = {image: ours.get(base, image) for base, image in theirs.items()}
    renamed = replace(
        reference,
        circles=tuple(replace(circle, image=names[circle.image]) for circle in reference.circles),
        image_status={names[image]: status for image, status in reference.image_status.items()},
    )
    return renamed, "no image has the same path in both; images are matched by file name, without folders"


def _by_base_name(images: Iterable[str]) -> dict[str, str] | None:
    """Return images by their names without folders; None if two share one."""
    named = [(image.replace("\\", "/").rsplit("/", 1)[-1], image) for image in images]
    by_base = dict(named)
    return by_base if len(by_base) == len(named) else None


def _with_common_circles(measured: PoseTable, reference: PoseTable) -> tuple[PoseTable, str]:
    ours, theirs = ({circle.circle for circle in table.circles} for table in (measured, reference))
    if not (reference.is_truth and ours and theirs) or not ours.isdisjoint(theirs):
        return reference, ""
    unnamed = tuple(replace(circle, circle=None) for circle in reference.circles)
    return (
        replace(reference, circles=unnamed),
        "the truth does not name its circles as the poses do; circles are matched by center alone",
    )


def _method_note(measured: PoseTable, reference: PoseTable) -> str:
    ours, theirs = (sorted({c.method for c in table.circles if c.method}) for table in (measured, reference))
    if not (ours and theirs) or not set(ours).isdisjoint(theirs):
        return ""
    return f"the poses are by {', '.join(ours)}, the reference by {', '.join(theirs)}"


def _for_each_method(measured: PoseTable, reference: PoseTable) -> Iterator[TabledCircle]:
    """Yield the reference's circles; those without a method once for each that measured the image."""
    methods: defaultdict[str, dict[str | None, None]] = defaultdict(dict)
    for circle in measured.circles:
        methods[circle.image][circle.method] = None
    for circle in reference.circles:
        if circle.method is not None:
            yield circle
        else:
            yield from (replace(circle, method=method) for method in methods[circle.image] or (None,))


_Key: TypeAlias = tuple[str, str | None, str | None]


def _grouped(circles: Iterable[TabledCircle], *, named: bool) -> defaultdict[_Key, list[TabledCircle]]:
    groups: defaultdict[_Key, list[TabledCircle]] = defaultdict(list)
    for circle in circles:
        groups[circle.image, circle.circle if named else None, circle.method].append(circle)
    return groups


def _paired(ours: Sequence[TabledCircle], theirs: Sequence[TabledCircle]) -> Pairing:
    if len(ours) == len(theirs) == 1:
        return Pairing(((ours[0], theirs[0]),), (), ())
    # Sorted, so that the order of rows does not matter where two pairs are equally close.
    ours, theirs = sorted(ours, key=_rank), sorted(theirs, key=_rank)
    pairs = _closest_pairs(_gaps(ours, theirs))
    rows, columns = {row for row, _ in pairs}, {column for _, column in pairs}
    return Pairing(
        pairs=tuple((ours[row], theirs[column]) for row, column in pairs),
        missing=tuple(other for column, other in enumerate(theirs) if column not in columns),
        extra=tuple(circle for row, circle in enumerate(ours) if row not in rows),
    )


def _rank(circle: TabledCircle) -> tuple[int, Vector, str]:
    center = circle.center_mm or (math.inf, math.inf, math.inf)
    return -1 if circle.instance is None else circle.instance, center, circle.status


def _gaps(ours: Sequence[TabledCircle], theirs: Sequence[TabledCircle]) -> FloatArray:
    """Return the distances (n, m) of the centers, mm; infinite where one is unknown, 0 where both failed alike."""
    unknown = (math.nan, math.nan, math.nan)
    first, second = (
        np.array([circle.center_mm or unknown for circle in circles]).reshape(-1, 1, 3) for circles in (ours, theirs)
    )
    gaps = np.linalg.norm(first - second.swapaxes(0, 1), axis=2)
    failed, failed_too = (
        np.array(["" if circle.poses else circle.status for circle in circles]) for circles in (ours, theirs)
    )
    alike = (failed[:, None] == failed_too) & (failed[:, None] != "")
    return np.where(alike, 0.0, np.where(np.isnan(gaps), np.inf, gaps))


def _closest_pairs(gaps: FloatArray) -> list[tuple[int, int]]:
    """Return pairs of a row and a column of `gaps` (n, m), each in one pair at most, the closest first."""
    pairs: list[tuple[int, int]] = []
    rows, columns = set(range(gaps.shape[0])), set(range(gaps.shape[1]))
    for place in np.argsort(gaps, axis=None, kind="stable").tolist():
        if not rows or not columns:
            break
        row, column = divmod(place, gaps.shape[1])
        if row in rows and column in columns:
            rows.remove(row)
            columns.remove(column)
            pairs.append((row, column))
    return pairs
