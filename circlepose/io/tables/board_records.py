"""Boards as JSON: the names of the table's columns, nested image > board > candidate, at full precision."""

from __future__ import annotations

from circlepose._typing import FloatArray
from circlepose.io.tables.board_rows import board_candidate_fields, board_fields
from circlepose.io.tables.columns import Row
from circlepose.io.tables.json_records import image_head
from circlepose.results import BoardResult, ImageResult

BOARDS_SCHEMA = "circlepose.boards/1"


def board_image_record(result: ImageResult, *, chosen_only: bool = False) -> Row:
    """Return one image as nested values; every key is always there, None where there is nothing to say.

    With `chosen_only` a board's solutions are the one that is chosen, under its number.
    """
    boards = [_board_record(board, chosen_only=chosen_only) for board in result.boards]
    return image_head(result) | {"boards": boards}


def _board_record(board: BoardResult, *, chosen_only: bool) -> Row:
    numbers = (board.chosen,) if chosen_only else range(len(board.candidates))
    return board_fields(board) | {
        "flags": list(board.flags),
        "growth": board.growth,
        "misfits": list(board.misfits),
        "circles": [
            {
                "name": circle.name,
                "is_used": circle.is_used,
                "residual_px": circle.residual_px.tolist(),
                "sigmas": circle.sigmas,
            }
            for circle in board.circles
        ],
        "solutions": [_solution_record(board, number) for number in numbers],
    }


def _solution_record(board: BoardResult, number: int) -> Row:
    pose = board.candidates[number]
    terms = pose.terms
    return board_candidate_fields(board, number) | {
        "covariance": pose.covariance.tolist(),
        "covariance_terms": {
            "image": terms.image.tolist(),
            "camera": _matrix(terms.camera),
            "radius": _matrix(terms.radius),
        },
    }


def _matrix(matrix: FloatArray | None) -> list[list[float]] | None:
    return None if matrix is None else matrix.tolist()
