"""Tables of poses read back: CSV, JSON or JSON lines of the layouts `poses` and `boards`, and the CSV of a truth."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace

from circlepose.errors import UsageError
from circlepose.evaluation.matching import PoseTable, TabledCircle, TabledPose, Vector
from circlepose.io.tables.board_reader import read_boards
from circlepose.io.tables.cells import UNIT, filled, image_of, in_order, vector, whole
from circlepose.io.tables.rows import PAIRS_OF_CIRCLES, Form, TableRow, read_rows
from circlepose.io.text.source import MAX_TABLE_BYTES, unpacked
from circlepose.io.text.validation import brief
from circlepose.results import Flag, Status

_CENTER = ("center_x_mm", "center_y_mm", "center_z_mm")
_NORMAL = ("normal_x", "normal_y", "normal_z")
_ALIASES = (
    (_CENTER, (_CENTER, ("x", "y", "z"), ("cx", "cy", "cz"))),
    (_NORMAL, (_NORMAL, ("nx", "ny", "nz"))),
)
_POSES_ONLY = ("method", "solution")
"""columns that only a table of poses has, not a truth"""
_POSES_COLUMNS = ("image", "instance", "circle", "method", "solution", "chosen", "status", *_CENTER, *_NORMAL)
_AWAY = 1e-3
"""Cosine up to which a normal may lean away from the camera: at 0 the circle is seen edge-on."""


@dataclass(frozen=True, slots=True)
class PoseFile:
    """A table as it was read."""

    name: str
    form: Form
    content: bytes
    table: PoseTable


def read_pose_file(
    content: bytes, name: str, *, truth_allowed: bool = False, beside: PoseTable | None = None
) -> PoseFile:
    """Return the table in `content`, the bytes of a file that messages call `name`.

    The form is seen from the content. A truth, where that is allowed, is a CSV without the columns `method` and
    `solution`: a row per circle, `image, instance, circle` and the columns of center (mm) and normal, which may be
    called `x, y, z` or `cx, cy, cz` and `nx, ny, nz`; `instance` and `circle` may be left out. An empty cell is
    an unknown number. A table of boards, which has the column `qw`, is read as `board_reader.read_boards` says.
    `beside` is the table that it is to be compared with.

    Raises
    ------
    UsageError
        When it is no such table, has no rows, or a column is missing or holds what it cannot mean; or where one of
        two tables that were measured is relative to a world board and the other is not.
    """
    file = _read(content, name, truth_allowed=truth_allowed, is_relative=beside is not None and beside.is_relative)
    if beside is not None and not file.table.is_truth and file.table.is_relative != beside.is_relative:
        ours, theirs = ("the camera's frame", "that of a world board")
        if file.table.is_relative:
            ours, theirs = theirs, ours
        raise UsageError(f"{name}: its poses are in {ours}, those compared with it in {theirs}.")
    return file


def _read(content: bytes, name: str, *, truth_allowed: bool, is_relative: bool) -> PoseFile:
    """Return the table; a truth may be in the frame of a world board where what it is compared with `is_relative`."""
    content = unpacked(content, name, UsageError, MAX_TABLE_BYTES)
    form, columns, rows = read_rows(content, name)
    if "distance_mm" in columns and "first" in columns:
        raise UsageError(f"{name}: {PAIRS_OF_CIRCLES}")
    if "qw" in columns:
        table = read_boards(rows, columns, name, truth_allowed=truth_allowed)
        return PoseFile(name, form, content, replace(table, is_relative=_are_relative(rows)))
    if not any(column in columns for column in _POSES_ONLY):
        # Two candidates a circle are no truth: a table that --columns made too narrow.
        if truth_allowed and "chosen" not in columns:
            return PoseFile(name, form, content, _truth(rows, _renaming(columns, name), is_relative=is_relative))
        raise UsageError(
            f"{name}: has no column {' and no column '.join(_POSES_ONLY)}; expected a table made by "
            "`circlepose estimate` in the layout poses, without --columns or with these too."
        )
    missing = [column for column in _POSES_COLUMNS if column not in columns]
    if missing:
        raise UsageError(
            f"{name}: has no column {missing[0]}; expected a table in the layout poses. If it was made "
            f"with --columns, name these too: {', '.join(missing)}."
        )
    return PoseFile(name, form, content, _poses(rows))


def _are_relative(rows: Sequence[TableRow]) -> bool:
    return any(_is_relative(row) for row in rows)


def _is_relative(row: TableRow) -> bool:
    return Flag.RELATIVE_TO_BOARD in row.text("flags").split(";")


def _renaming(columns: Sequence[str], name: str) -> dict[str, str]:
    """Return, for each column of a truth, how this one calls it."""
    names: dict[str, str] = {}
    for ours, choices in _ALIASES:
        theirs = next((choice for choice in choices if any(column in columns for column in choice)), ours)
        missing = [column for column in theirs if column not in columns]
        if missing:
            raise UsageError(f"{name}: has no column {missing[0]}; expected a table of poses or a truth.")
        names |= dict(zip(ours, theirs, strict=True))
    return names


def _truth(rows: Sequence[TableRow], names: dict[str, str], *, is_relative: bool) -> PoseTable:
    circles = tuple(
        TabledCircle(
            image=image_of(row),
            instance=whole(row, "instance") if row.text("instance") else None,
            circle=row.text("circle") or None,
            method=None,
            poses=(_pose(row, names, complete=False, is_relative=is_relative),),
        )
        for row in rows
    )
    return PoseTable(circles, {}, is_truth=True, is_relative=is_relative)


def _poses(rows: Sequence[TableRow]) -> PoseTable:
    image_status: dict[str, str] = {}
    groups: defaultdict[tuple[str, int, str, str], list[TableRow]] = defaultdict(list)
    for row in rows:
        image, status = image_of(row), filled(row, "status")
        if row.text("circle"):
            groups[image, whole(row, "instance"), filled(row, "circle"), filled(row, "method")].append(row)
        elif status == Status.OK:
            raise UsageError(f"{row.where}: circle: is empty, though status is ok.")
        elif image_status.setdefault(image, status) != status:
            raise UsageError(
                f"{row.where}: status: is {brief(status)}, but {brief(image)} had "
                f"{brief(image_status[image])} before."
            )
    circles = tuple(_circle(*key, group) for key, group in groups.items())
    return PoseTable(circles, image_status, is_relative=_are_relative(rows))


def _circle(image: str, instance: int, circle: str, method: str, rows: Sequence[TableRow]) -> TabledCircle:
    """Return the circle whose candidates are `rows`."""
    status = rows[0].text("status")
    where = brief(f"{image}, {circle} {instance}, {method}")
    if any(row.text("status") != status for row in rows):
        raise UsageError(f"{rows[1].where}: status: {where} has two different ones.")
    if status != Status.OK:
        if len(rows) > 1:
            raise UsageError(f"{rows[1].where}: {where} is there twice, with status {brief(status)}.")
        return TabledCircle(image, instance, circle, method, status)
    ordered, chosen = in_order(where, rows)
    names = {column: column for column in (*_CENTER, *_NORMAL)}
    poses = tuple(_pose(row, names, complete=True, is_relative=_is_relative(row)) for row in ordered)
    return TabledCircle(image, instance, circle, method, status, poses, chosen)


def _pose(row: TableRow, names: dict[str, str], *, complete: bool, is_relative: bool) -> TabledPose:
    """Return the pose of a row; `complete` refuses unknown numbers. `is_relative`: a normal may have any side."""
    center = vector(row, [names[column] for column in _CENTER], complete=complete)
    normal = vector(row, [names[column] for column in _NORMAL], complete=complete)
    if normal is not None:
        length = math.hypot(*normal)
        if abs(length - 1.0) > UNIT:
            raise UsageError(
                f"{row.where}: {names['normal_x']}: expected the first of the three numbers of a unit vector, but "
                f"its length is {length:g}."
            )
        normal = (normal[0] / length, normal[1] / length, normal[2] / length)
        if center is not None and not is_relative and _points_away(normal, center):
            raise UsageError(
                f"{row.where}: {names['normal_x']}: the normal points away from the camera; turn it round, "
                "and see that center and normal are in the camera's frame."
            )
    return TabledPose(center, normal)


def _points_away(normal: Vector, center: Vector) -> bool:
    along = sum(n * c for n, c in zip(normal, center, strict=True))
    return along > _AWAY * math.hypot(*center)
