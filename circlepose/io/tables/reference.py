"""Poses that are known beforehand, or were measured otherwise, looked up for each measured circle."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Self

from circlepose._typing import FloatArray
from circlepose.errors import UsageError
from circlepose.evaluation.matching import (
    PoseTable,
    TabledCircle,
    TabledPose,
    Vector,
    pair_circles,
    with_common_names,
)
from circlepose.io.tables.reader import read_pose_file
from circlepose.io.text.source import MAX_TABLE_BYTES, read_regular
from circlepose.results import CircleResult, ImageResult

CircleKey = tuple[int, str, str]
"""instance, circle and method of a measured circle"""


@dataclass(frozen=True, slots=True)
class Reference:
    """The circles of a truth, or of a table of poses, by image."""

    is_truth: bool
    by_image: Mapping[str, tuple[TabledCircle, ...]]
    by_file_name: Mapping[str, str]
    """images whose name without folders no other has"""

    @classmethod
    def of(cls, table: PoseTable) -> Self:
        """Return the reference that `table` holds."""
        by_image: dict[str, tuple[TabledCircle, ...]] = {}
        for circle in table.circles:
            by_image[circle.image] = (*by_image.get(circle.image, ()), circle)
        number = Counter(PurePath(image).name for image in by_image)
        unique = {PurePath(image).name: image for image in by_image if number[PurePath(image).name] == 1}
        return cls(table.is_truth, by_image, unique)

    def knows(self, image: str) -> bool:
        """Return whether there is anything on `image`, by its name, or by its name without folders."""
        return image in self.by_image or PurePath(image).name in self.by_file_name

    def poses(self, result: ImageResult) -> dict[CircleKey, TabledPose]:
        """Return the reference's pose of each measured circle that has one.

        Circles are matched as by `check`: by name and method, several instances by their centers.
        """
        if not self.knows(result.image):
            return {}
        name = result.image if result.image in self.by_image else self.by_file_name[PurePath(result.image).name]
        measured = PoseTable(tuple(_tabled(result.image, circle) for circle in result.circles), {})
        known = PoseTable(self.by_image[name], {}, self.is_truth)
        known, _ = with_common_names(measured, known)
        return {
            (ours.instance or 0, ours.circle or "", ours.method or ""): theirs.poses[theirs.chosen]
            for ours, theirs in pair_circles(measured, known).pairs
            if theirs.poses
        }


def read_reference(path: Path) -> Reference:
    """Read a truth, or a table of poses, in any form that `check --against` takes; raises `UsageError`."""
    content = read_regular(str(path), UsageError, MAX_TABLE_BYTES)
    table = read_pose_file(content, str(path), truth_allowed=True).table
    if table.of_boards:
        raise UsageError(f"{path}: is a table of boards; expected one of circles.")
    return Reference.of(table)


def _tabled(image: str, circle: CircleResult) -> TabledCircle:
    poses = tuple(TabledPose(_vector(c.center), _vector(c.normal)) for c in circle.candidates)
    return TabledCircle(image, circle.instance, circle.circle, circle.method, circle.status, poses, circle.chosen)


def _vector(values: FloatArray) -> Vector:
    x, y, z = values.tolist()
    return x, y, z
