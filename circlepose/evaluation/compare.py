"""A table of poses against another, or against the truth: which circles moved, are missing or were not there."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from circlepose.errors import ArgumentError
from circlepose.evaluation import CandidateChoice
from circlepose.evaluation.matching import (
    PoseTable,
    Quaternion,
    TabledCircle,
    TabledPose,
    Vector,
    pair_circles,
    with_common_names,
)
from circlepose.results import Status

Change = Literal["missing", "extra", "status", "flipped", "moved"]
CHANGE_MEANING: Mapping[Change, str] = {
    "missing": "in the reference only",
    "extra": "in the poses only",
    "status": "failed in one of the two only, or for another reason",
    "flipped": "the chosen candidate is outside tolerance, the other one is within",
    "moved": "center or normal are outside tolerance",
}
_LEAST_ROLL_DEG = 5.0
"""Turn of a board about its z axis, from which it may be one that maps a layout on itself: of 72 equal parts."""


@dataclass(frozen=True, slots=True)
class Tolerance:
    """How far a pose may be from its reference; infinity leaves that part unchecked."""

    position_mm: float = 0.5
    normal_deg: float = 0.1

    def __post_init__(self) -> None:
        for name, unit in (("position_mm", "mm"), ("normal_deg", "degrees")):
            value = getattr(self, name)
            if not value >= 0.0:
                raise ArgumentError(f"{name}: expected a tolerance of 0 or more {unit}, got {value:g}.")


@dataclass(frozen=True, slots=True)
class Difference:
    """One thing in which two tables disagree."""

    image: str
    instance: int | None
    circle: str | None
    method: str | None
    change: Change
    tolerances: float | None = None
    """how many tolerances it moved: the larger of the two differences, each divided by its tolerance"""
    position_difference_mm: float | None = None
    orientation_difference_deg: float | None = None
    status: str | None = None
    """None where there is no row"""
    reference_status: str | None = None


@dataclass(frozen=True, slots=True)
class Comparison:
    """What came out of a comparison."""

    compared: int
    """circles found in both tables"""
    differences: tuple[Difference, ...]
    """the worst first: what is missing, extra or of another status, then by `tolerances`"""
    largest_position_mm: float | None
    """of all circles compared, within tolerance or not; None where nothing could be compared"""
    largest_normal_deg: float | None
    notes: tuple[str, ...] = ()
    """how names were matched, where that was not as written; of how many boards the roll is not compared"""


@dataclass(frozen=True, slots=True)
class _Distance:
    """How far a pose is from its reference; None where either is unknown."""

    position_mm: float | None
    normal_deg: float | None
    tolerances: float
    is_without_roll: bool = False
    """whether it is that of two boards but for a turn about their z axes"""


def compare(
    measured: PoseTable,
    reference: PoseTable,
    tolerance: Tolerance,
    candidate: CandidateChoice = "chosen",
) -> Comparison:
    """Compare each circle of `measured` with the chosen pose of its counterpart in `reference`.

    Parameters
    ----------
    measured
        A table of poses of circles, or of boards. Of boards the origins and the rotations are compared. If the roll
        of one is open, in either table, and it is turned about its z axis, its layout may map on itself by that turn:
        then the z axes are compared, and the origins along them.
    reference
        Another one, or a truth. A truth holds for every method; if it shares no circle's name with `measured`,
        circles are matched by their centers alone.
    tolerance
        What is beyond it is a difference; so is a circle that is missing, not in the reference, or of another
        status.
    candidate
        `chosen` compares the chosen candidate. `best` compares that nearest to the reference: for lone circles,
        whose ambiguity nothing in the image settles.

    Raises
    ------
    ArgumentError
        Where one table is of boards and the other of circles.
    """
    if measured.of_boards != reference.of_boards:
        raise ArgumentError("reference: one table is of boards, the other of circles; take two of one kind.")
    reference, notes = with_common_names(measured, reference)
    paired = pair_circles(measured, reference)
    distances = [_distance(circle, other, tolerance, candidate) for circle, other in paired.pairs]
    differences = [
        *(_named(other, "missing", measured.image_status.get(other.image), other.status) for other in paired.missing),
        *(
            _named(circle, "extra", circle.status, reference.image_status.get(circle.image))
            for circle in paired.extra
        ),
    ]
    for (circle, other), distance in zip(paired.pairs, distances, strict=True):
        differences += _differences(circle, other, distance, tolerance)
    differences += _of_images(measured, reference, {difference.image for difference in differences})
    differences.sort(key=lambda each: -math.inf if each.tolerances is None else -each.tolerances)
    known = [distance for distance in distances if distance is not None]
    return Comparison(
        compared=len(paired.pairs),
        differences=tuple(differences),
        largest_position_mm=_largest([distance.position_mm for distance in known]),
        largest_normal_deg=_largest([distance.normal_deg for distance in known]),
        notes=(*notes, *_roll_notes(sum(distance.is_without_roll for distance in known))),
    )


def _distance(
    circle: TabledCircle, other: TabledCircle, tolerance: Tolerance, candidate: CandidateChoice
) -> _Distance | None:
    """Return how far the circle's chosen, or best, candidate is from its reference's chosen one."""
    if not circle.poses or not other.poses:
        return None
    poses = circle.poses if candidate == "best" else (circle.poses[circle.chosen],)
    reference = other.poses[other.chosen]
    between = _between_turned if circle.is_roll_open or other.is_roll_open else _between
    return min((between(pose, reference, tolerance) for pose in poses), key=lambda each: each.tolerances)


def _between(pose: TabledPose, other: TabledPose, tolerance: Tolerance) -> _Distance:
    position_mm = normal_deg = None
    if pose.center_mm is not None and other.center_mm is not None:
        position_mm = math.dist(pose.center_mm, other.center_mm)
    if pose.normal is not None and other.normal is not None:
        normal_deg = _angle_deg(pose.normal, other.normal)
    elif pose.rotation is not None and other.rotation is not None:
        normal_deg = _turn_deg(pose.rotation, other.rotation)
    tolerances = max(_times(position_mm, tolerance.position_mm), _times(normal_deg, tolerance.normal_deg))
    return _Distance(position_mm, normal_deg, tolerances)


def _between_turned(pose: TabledPose, other: TabledPose, tolerance: Tolerance) -> _Distance:
    """Return how far a board whose roll is open is from its reference, but for a turn of the layout."""
    as_it_is = _between(pose, other, tolerance)
    if pose.center_mm is None or other.center_mm is None or pose.rotation is None or other.rotation is None:
        return as_it_is
    if _roll_deg(pose.rotation, other.rotation) < _LEAST_ROLL_DEG:
        return as_it_is
    # Where in the board the center of the turn is, is not known; the turn moves the origin across the normal. Along
    # the mean of both normals a small tilt moves it least.
    normals = _normal(pose.rotation), _normal(other.rotation)
    mean = [a + b for a, b in zip(*normals, strict=True)]
    length = math.hypot(*mean)
    if length < 1.0:
        return as_it_is
    along = [(a - b) * m for a, b, m in zip(pose.center_mm, other.center_mm, mean, strict=True)]
    position_mm, normal_deg = abs(sum(along)) / length, _angle_deg(*normals)
    tolerances = max(_times(position_mm, tolerance.position_mm), _times(normal_deg, tolerance.normal_deg))
    return _Distance(position_mm, normal_deg, tolerances, is_without_roll=True)


def _normal(rotation: Quaternion) -> Vector:
    """Return the z axis of a board in the camera frame."""
    w, x, y, z = rotation
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)


def _roll_deg(first: Quaternion, second: Quaternion) -> float:
    """Return the angle of the turn about the z axis that is a part of the turn from one rotation to another."""
    (w, x, y, z), (a, b, c, d) = second, first
    # The parts w and z of the first in the frame of the second.
    real, about_z = w * a + x * b + y * c + z * d, w * d - x * c + y * b - z * a
    return math.degrees(2.0 * math.atan2(abs(about_z), abs(real)))


def _angle_deg(first: Vector, second: Vector) -> float:
    """Return the angle between two unit vectors; unlike by the arc cosine, exact where it is small."""
    x, y, z = second
    return math.degrees(2.0 * math.atan2(math.dist(first, second), math.dist(first, (-x, -y, -z))))


def _roll_notes(number: int) -> Iterator[str]:
    """Yield what was not compared of `number` boards."""
    if number:
        boards, are = ("1 board", "is") if number == 1 else (f"{number} boards", "are")
        yield (
            f"{boards} with the flag roll_ambiguous {are} turned about the z axis: the roll is not settled, so only "
            "the tilt is compared, and the place of the origin along the normal"
        )


def _turn_deg(first: Quaternion, second: Quaternion) -> float:
    """Return the angle between two rotations; a quaternion and its opposite are the same."""
    w, x, y, z = second
    ends = math.dist(first, second), math.dist(first, (-w, -x, -y, -z))
    return math.degrees(4.0 * math.atan2(min(ends), max(ends)))


def _times(value: float | None, limit: float) -> float:
    """Return how many limits a value is."""
    if not value:
        return 0.0
    return value / limit if limit else math.inf


def _differences(
    circle: TabledCircle, other: TabledCircle, distance: _Distance | None, tolerance: Tolerance
) -> Iterator[Difference]:
    """Yield the difference of a pair, if there is one."""
    if circle.status != other.status or bool(circle.poses) != bool(other.poses):
        yield _named(circle, "status", circle.status, other.status)
    elif distance is not None and distance.tolerances > 1.0:
        best = _distance(circle, other, tolerance, "best")
        flipped = best is not None and best.tolerances <= 1.0
        yield _named(circle, "flipped" if flipped else "moved", circle.status, other.status, distance)


def _of_images(measured: PoseTable, reference: PoseTable, named: Collection[str]) -> Iterator[Difference]:
    """Yield images whose own rows differ, unless a difference of one of their circles names the image already."""
    ours, theirs = set(measured.images), set(reference.images)
    for image in dict.fromkeys((*reference.image_status, *measured.image_status)):
        status = measured.image_status.get(image, Status.OK if image in ours else None)
        other = reference.image_status.get(image, Status.OK if image in theirs else None)
        if status != other and image not in named:
            change: Change = "missing" if status is None else "extra" if other is None else "status"
            yield Difference(image, None, None, None, change, status=status, reference_status=other)


def _named(
    circle: TabledCircle,
    change: Change,
    status: str | None,
    reference_status: str | None,
    by: _Distance | None = None,
) -> Difference:
    return Difference(
        image=circle.image,
        instance=circle.instance,
        circle=circle.circle,
        method=circle.method,
        change=change,
        tolerances=None if by is None else by.tolerances,
        position_difference_mm=None if by is None else by.position_mm,
        orientation_difference_deg=None if by is None else by.normal_deg,
        status=status,
        reference_status=reference_status,
    )


def _largest(values: list[float | None]) -> float | None:
    return max((value for value in values if value is not None), default=None)
