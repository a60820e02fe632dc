"""The world board of an image: a board to which the poses of other targets are relative."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose import _arguments
from circlepose.camera.camera import Camera
from circlepose.errors import ArgumentError
from circlepose.fitting.cone_projection import image_ellipses
from circlepose.geometry.cone import factor_from_circle
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
    if world_board.count != 1:
        given = world_board.count or "all"
        raise ArgumentError(f"world_board: is one board in each image, but its count is {given}; leave that out.")
    if world_board.layout == target.layout:
        raise ArgumentError("world_board: is the target itself, whose pose relative to itself is known.")


def circles_of_boards(result: ImageResult | None, camera: Camera) -> Ellipse | None:
    """Return where the circles of boards are seen, and where those are that were not; None without boards."""
    if result is None or not result.boards:
        return None
    boards = {board.instance for board in result.boards}
    own = [each for each in result.circles if each.instance in boards and each.pose is not None]
    poses = [each.candidates[each.chosen] for each in own]
    factors = factor_from_circle(
        np.array([pose.center for pose in poses]),
        np.array([pose.normal for pose in poses]),
        np.array([each.radius_mm for each in own]),
    )
    expected, found = image_ellipses(camera, factors)
    seen = [
        expected[i] if each.ellipse is None else each.ellipse
        for i, each in enumerate(own)
        if each.ellipse is not None or found[i]
    ]
    return Ellipse.batch(seen)


def with_world(result: ImageResult, world: ImageResult | None) -> ImageResult:
    """Return a result with the one world board of its image, or without poses the status that says why there is none.

    `world` is the estimate of the world board by itself; None where none is asked for.
    """
    if world is None:
        return result
    if len(world.boards) == 1:
        return replace(result, world=world.boards[0])
    found = f"{len(world.boards)} of this layout are in the image" if world.boards else world.reason
    reason = f"world board: {found or world.status}"
    return replace(result, status=Status.NO_WORLD_BOARD, reason=reason, circles=(), boards=(), planes=())
