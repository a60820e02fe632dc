"""Tables of poses read back: CSV, JSON or JSON lines of the `poses` layout, and the CSV of a truth."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

from circlepose._arguments import shown
from circlepose.errors import UsageError
from circlepose.evaluation.matching import PoseTable, TabledCircle, TabledPose, Vector
from circlepose.io.tables.rows import Form, TableRow, read_rows
from circlepose.io.text.source import MAX_TABLE_BYTES, unpacked
from circlepose.io.text.validation import brief
from circlepose.results import Status

_CENTER = ("center_x_mm", "center_y_mm", "center_z_mm")
_NORMAL = ("normal_x", "normal_y", "normal_z")
_ALIASES = (
    (_CENTER, (_CENTER, ("x", "y", "z"), ("cx", "cy", "cz"))),
    (_NORMAL, (_NORMAL, ("nx", "ny", "nz"))),
)
_POSES_ONLY = ("method", "solution")
"""columns that only a table of poses has, not a truth"""
_POSES_COLUMNS = ("image", "instance", "circle", "method", "solution", "chosen", "status", *_CENTER, *_NORMAL)
_UNIT = 1e-3
"""How far the length of a normal may be from 1: files have six or more decimals."""
_AWAY = 1e-3
"""Cosine up to which a normal may lean away from the camera: at 0 the circle is seen edge-on."""


@dataclass(frozen=True, slots=True)
class PoseFile:
    """A table as it was read."""

    name: str
    form: Form
    content: bytes
    table: PoseTable


def read_pose_file(content: bytes, name: str, *, truth_allowed: bool = False) -> PoseFile:
    """Return the table in `content`, the bytes of a file that messages call `name`.

    The form is seen from the content. A truth, where that is allowed, is a CSV without the columns `method` and
    `solution`: a row per circle, `image, instance, circle` and the columns of center (mm) and normal, which may be
    called `x, y, z` or `cx, cy, cz` and `nx, ny, nz`; `instance` and `circle` may be left out. An empty cell is
    an unknown number.

    Raises
    ------
    UsageError
        When it is no such table, has no rows, or a column is missing or holds what it cannot mean.
    """
    content = unpacked(content, name, UsageError, MAX_TABLE_BYTES)
    form, columns, rows = read_rows(content, name)
    if not any(column in columns for column in _POSES_ONLY):
        # Two candidates a circle are no truth: a table that --columns made too narrow.
        if truth_allowed and "chosen" not in columns:
            return PoseFile(name, form, content, _truth(rows, _renaming(columns, name)))
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


def _truth(rows: Sequence[TableRow], names: dict[str, str]) -> PoseTable:
    circles = tuple(
        TabledCircle(
            image=_image(row),
            instance=_whole(row, "instance") if row.text("instance") else None,
            circle=row.text("circle") or None,
            method=None,
            poses=(_pose(row, names, complete=False),),
        )
        for row in rows
    )
    return PoseTable(circles, {}, is_truth=True)


def _poses(rows: Sequence[TableRow]) -> PoseTable:
    image_status: dict[str, str] = {}
    groups: defaultdict[tuple[str, int, str, str], list[TableRow]] = defaultdict(list)
    for row in rows:
        image, status = _image(row), _filled(row, "status")
        if row.text("circle"):
            groups[image, _whole(row, "instance"), _filled(row, "circle"), _filled(row, "method")].append(row)
        elif status == Status.OK:
            raise UsageError(f"{row.where}: circle: is empty, though status is ok.")
        elif image_status.setdefault(image, status) != status:
            raise UsageError(
                f"{row.where}: status: is {brief(status)}, but {brief(image)} had "
                f"{brief(image_status[image])} before."
            )
    circles = tuple(_circle(*key, group) for key, group in groups.items())
    return PoseTable(circles, image_status)


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
    by_number: dict[int, TableRow] = {}
    for row in rows:
        number = _whole(row, "solution")
        if number in by_number:
            raise UsageError(f"{row.where}: solution: {where} has number {number} twice; are two tables joined?")
        by_number[number] = row
    ordered = [by_number[number] for number in sorted(by_number)]
    chosen = [place for place, row in enumerate(ordered) if _is_chosen(row)]
    if len(chosen) != 1:
        raise UsageError(f"{rows[0].where}: chosen: {where} has {len(chosen)} chosen candidates; expected one.")
    names = {column: column for column in (*_CENTER, *_NORMAL)}
    poses = tuple(_pose(row, names, complete=True) for row in ordered)
    return TabledCircle(image, instance, circle, method, status, poses, chosen[0])


def _pose(row: TableRow, names: dict[str, str], *, complete: bool) -> TabledPose:
    """Return the pose of a row; `complete` refuses unknown numbers."""
    center = _vector(row, [names[column] for column in _CENTER], complete=complete)
    normal = _vector(row, [names[column] for column in _NORMAL], complete=complete)
    if normal is not None:
        length = math.hypot(*normal)
        if abs(length - 1.0) > _UNIT:
            raise UsageError(
                f"{row.where}: {names['normal_x']}: expected the first of the three numbers of a unit vector, but "
                f"its length is {length:g}."
            )
        normal = (normal[0] / length, normal[1] / length, normal[2] / length)
        if center is not None and _points_away(normal, center):
            raise UsageError(
                f"{row.where}: {names['normal_x']}: the normal points away from the camera; turn it round, "
                "and see that center and normal are in the camera's frame."
            )
    return TabledPose(center, normal)


def _points_away(normal: Vector, center: Vector) -> bool:
    along = sum(n * c for n, c in zip(normal, center, strict=True))
    return along > _AWAY * math.hypot(*center)


def _vector(row: TableRow, columns: Sequence[str], *, complete: bool) -> Vector | None:
    x, y, z = (_number(row, column) for column in columns)
    if x is not None and y is not None and z is not None:
        return x, y, z
    empty = next(column for column, value in zip(columns, (x, y, z), strict=True) if value is None)
    if complete:
        raise UsageError(f"{row.where}: {empty}: is empty, though status is ok.")
    if any(value is not None for value in (x, y, z)):
        raise UsageError(f"{row.where}: {empty}: is empty, but not all of {', '.join(columns)} are.")
    return None


def _number(row: TableRow, column: str) -> float | None:
    if not row.text(column):
        return None
    value = _parsed(row, column)
    if not math.isfinite(value):
        raise UsageError(f"{row.where}: {column}: expected a number or an empty cell, got {shown(row.text(column))}.")
    return value


def _whole(row: TableRow, column: str) -> int:
    value = _parsed(row, column)
    if not (value >= 0.0 and value.is_integer()):
        raise UsageError(f"{row.where}: {column}: expected a whole number from 0, got {shown(row.text(column))}.")
    return int(value)


def _parsed(row: TableRow, column: str) -> float:
    """Return a cell as a number, NaN if it is not one."""
    try:
        return float(row.text(column))
    except ValueError:
        return math.nan


def _is_chosen(row: TableRow) -> bool:
    text = row.text("chosen").strip().lower()
    if text not in {"true", "false"}:
        raise UsageError(f"{row.where}: chosen: expected true or false, got {shown(row.text('chosen'))}.")
    return text == "true"


def _image(row: TableRow) -> str:
    return _filled(row, "image")


def _filled(row: TableRow, column: str) -> str:
    text = row.text(column)
    if not text:
        raise UsageError(f"{row.where}: {column}: is empty.")
    return text
