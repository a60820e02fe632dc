"""Tables of boards read back: the layout `boards`, and the CSV of a truth."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence

from circlepose.errors import UsageError
from circlepose.evaluation.matching import PoseTable, Quaternion, TabledCircle, TabledPose
from circlepose.io.tables.cells import UNIT, filled, image_of, in_order, number, vector, whole
from circlepose.io.tables.columns import QUATERNION
from circlepose.io.tables.rows import TableRow
from circlepose.io.text.validation import brief
from circlepose.results import Flag, Status

_ORIGIN = ("x_mm", "y_mm", "z_mm")
_COLUMNS = ("image", "instance", "solution", "chosen", "status", *_ORIGIN, *QUATERNION)


def read_boards(
    rows: Sequence[TableRow], columns: Sequence[str], name: str, *, truth_allowed: bool = False
) -> PoseTable:
    """Return the boards of a table, which messages call `name`.

    A truth, where that is allowed, has neither the column `solution` nor `chosen`: a row per board, `image, instance`
    and the columns of origin (mm) and quaternion; `instance` may be left out.

    Raises
    ------
    UsageError
        When a column is missing or holds what it cannot mean.
    """
    is_truth = truth_allowed and not any(column in columns for column in ("solution", "chosen"))
    needed = ("image", *_ORIGIN, *QUATERNION) if is_truth else _COLUMNS
    missing = [column for column in needed if column not in columns]
    if missing:
        raise UsageError(
            f"{name}: has no column {missing[0]}; expected a table in the layout boards. If it was made "
            f"with --columns, name these too: {', '.join(missing)}."
        )
    if is_truth:
        boards = tuple(
            TabledCircle(
                image_of(row),
                whole(row, "instance") if row.text("instance") else None,
                None,
                None,
                poses=(_pose(row),),
            )
            for row in rows
        )
        return PoseTable(boards, {}, is_truth=True, of_boards=True)
    image_status: dict[str, str] = {}
    groups: defaultdict[tuple[str, int], list[TableRow]] = defaultdict(list)
    for row in rows:
        status = filled(row, "status")
        if row.text("instance"):
            groups[image_of(row), whole(row, "instance")].append(row)
        elif status == Status.OK:
            raise UsageError(f"{row.where}: instance: is empty, though status is ok.")
        else:
            image_status[image_of(row)] = status
    return PoseTable(tuple(_board(*key, group) for key, group in groups.items()), image_status, of_boards=True)


def _board(name: str, instance: int, rows: Sequence[TableRow]) -> TabledCircle:
    ordered, chosen = in_order(brief(f"{name}, board {instance}"), rows)
    is_roll_open = Flag.ROLL_AMBIGUOUS in rows[0].text("flags").split(";")
    return TabledCircle(name, instance, None, None, Status.OK, tuple(map(_pose, ordered)), chosen, is_roll_open)


def _pose(row: TableRow) -> TabledPose:
    parts = [number(row, column) for column in QUATERNION]
    known = [part for part in parts if part is not None]
    if len(known) < len(parts):
        raise UsageError(f"{row.where}: {QUATERNION[parts.index(None)]}: is empty, though there is a board.")
    length = math.hypot(*known)
    if abs(length - 1.0) > UNIT:
        raise UsageError(
            f"{row.where}: qw: expected the first of the four numbers of a unit quaternion, but its length is "
            f"{length:g}."
        )
    w, x, y, z = (part / length for part in known)
    rotation: Quaternion = (w, x, y, z)
    return TabledPose(vector(row, _ORIGIN, complete=True), None, rotation)
