"""The world board of an image: a board to which the poses of other targets are relative."""

from __future__ import annotations

from dataclasses import replace

from circlepose import _arguments
from circlepose.errors import ArgumentError
from circlepose.geometry.ellipse import Ellipse
from circlepose.results import ImageResult, Status
from circlepose.targets.target import Target


def check_world_board(world_board: Target | None, target: Target) -> None:
    """Raise `ArgumentError` where a target cannot be measured relative to this one."""
    if world_board is None:
        return
    _arguments.instance_of(Target, "world_board", world_board, _arguments.HOW_TARGET)
    if world_board.kind != "board":
        raise ArgumentError(f"world_board: expected a target of kind board, got one of kind {world_board.kind}.")
    if world_board.layout == target.layout:
        raise ArgumentError("world_board: is the target itself, whose pose relative to itself is known.")


def circles_of_boards(result: ImageResult | None) -> Ellipse | None:
    """Return the circles of boards that were seen; None where there are none."""
    if result is None:
        return None
    boards = {board.instance for board in result.boards}
    seen = [each.ellipse for each in result.circles if each.instance in boards and each.ellipse is not None]
    return Ellipse.batch(seen) if seen else None


def with_world(result: ImageResult, world: ImageResult | None) -> ImageResult:
    """Return a result with the one world board of its image, or the status that says why there is none.

    `world` is the estimate of the world board by itself; None where none is asked for.
    """
    if world is None:
        return result
    if len(world.boards) == 1:
        return replace(result, world=world.boards[0])
    found = f"{len(world.boards)} of this layout are in the image" if world.boards else world.reason
    return replace(result, status=Status.NO_WORLD_BOARD, reason=f"world board: {found or world.status}")
