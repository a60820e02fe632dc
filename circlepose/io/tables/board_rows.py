"""Results as rows of the layout `boards`: one per image, board and candidate pose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from circlepose.io.tables.columns import QUATERNION, Row
from circlepose.results import BoardResult, ImageResult, Status

BOARD_COLUMN_MEANING: Mapping[str, str] = {
    "image": "name of the image",
    "instance": "number of the board in the image, from 0",
    "solution": "number of the candidate pose; 0 is the better",
    "chosen": "true for the candidate to use",
    "status": "ok, or why there is no pose",
    "x_mm": "origin of the board in the camera frame, to the right",
    "y_mm": "origin of the board in the camera frame, downwards",
    "z_mm": "origin of the board in the camera frame, forwards",
    "qw": "rotation from the board's frame to the camera's, a unit quaternion; qw is not negative",
    "qx": "see qw",
    "qy": "see qw",
    "qz": "see qw",
    "circles_used": "number of circles that the pose rests on",
    "circles_in_layout": "number of circles of the board",
    "rms_px": "rms distance of the imaged centers from where the pose puts them",
    "sigma_x_mm": "standard deviation of x_mm",
    "sigma_y_mm": "standard deviation of y_mm",
    "sigma_z_mm": "standard deviation of z_mm",
    "sigma_rx_deg": "standard deviation of the rotation about the camera's x axis, through the board's origin",
    "sigma_ry_deg": "the same about the camera's y axis",
    "sigma_rz_deg": "the same about the camera's z axis",
    "ambiguity": "probability that the chosen candidate is the wrong one; of the tilt alone, not of the roll",
    "flags": "remarks on a pose that stands, joined with ;",
}
BOARD_COLUMNS: tuple[str, ...] = tuple(BOARD_COLUMN_MEANING)


def board_rows(result: ImageResult) -> Iterator[Row]:
    """Yield the rows of one image in the layout `boards`; a key that is absent or None is an empty cell.

    An image without a board has one row of name and status; so does one with too few, after those that were found.
    """
    for board in result.boards:
        shared = {"image": result.image, "status": Status.OK, **board_fields(board)}
        for number in range(len(board.candidates)):
            yield shared | board_candidate_fields(board, number)
    if not result.boards or result.status is not Status.OK:
        yield {"image": result.image, "status": result.status}


def board_fields(board: BoardResult) -> Row:
    """Return what both candidates of a board share, by column name."""
    return {
        "instance": board.instance,
        "circles_used": board.circles_used,
        "circles_in_layout": board.circles_in_layout,
        "ambiguity": board.ambiguity,
        "flags": ";".join(board.flags),
    }


def board_candidate_fields(board: BoardResult, number: int) -> Row:
    """Return what belongs to one candidate of a board, by column name."""
    pose = board.candidates[number]
    fields: Row = {"solution": number, "chosen": number == board.chosen, "rms_px": pose.rms_px}
    fields |= zip(("x_mm", "y_mm", "z_mm"), pose.translation.tolist(), strict=True)
    fields |= zip(QUATERNION, pose.quaternion.tolist(), strict=True)
    fields |= zip(("sigma_x_mm", "sigma_y_mm", "sigma_z_mm"), pose.sigma_mm.tolist(), strict=True)
    fields |= zip(("sigma_rx_deg", "sigma_ry_deg", "sigma_rz_deg"), pose.sigma_deg.tolist(), strict=True)
    return fields
