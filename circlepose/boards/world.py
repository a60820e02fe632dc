"""Poses relative to a board in the same image, with what both errors have in common. Pure NumPy.

With the board's pose R, t a center c is at R'(c - t), and a normal n is R'n. By the board's errors dt and w, a
rotation vector in camera axes, and those of the circle they move by R'(dc - dt + (c - t) x w) and R'(dn + n x w). The
noise of the image is independent for circle and board. The camera's error is the same, so that much of it cancels
close to the board. The scales of target and board are taken as independent: they are two prints.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose import _arguments
from circlepose._typing import FloatArray
from circlepose.board_result import BoardPose, BoardResult, BoardTerms
from circlepose.boards.pose import cross_matrix
from circlepose.errors import ArgumentError
from circlepose.flags import in_order
from circlepose.geometry.cone import plane_basis
from circlepose.results import Candidate, CircleResult, CovarianceTerms, Flag, ImageResult, Plane

_OF_FRAME = (Flag.AMBIGUOUS, Flag.ROLL_AMBIGUOUS, Flag.RADIUS_MISFIT, Flag.CIRCLES_MISFIT)
"""Flags of the world board that hold for all that is relative to it."""


def relative_to_world(result: ImageResult) -> ImageResult:
    """Return what was measured in one image in the frame of its world board.

    Parameters
    ----------
    result
        Of `estimate` or `measure` with a `world_board`. Its poses are in the camera frame.

    Returns
    -------
    The same with all centers (mm), normals, board poses and planes in the frame of `result.world`, by its chosen
    pose; with covariances of both poses together, correlated by the camera. The flags of the board are added to those
    of each pose, and its `ambiguity` to theirs. Normals still point to the side from which the circle is seen.
    Without a world board there are no poses, and the status says why.

    Raises
    ------
    ArgumentError
        Where `result` is of an estimate without a world board, or relative to it already.
    """
    _arguments.instance_of(ImageResult, "result", result, "of estimate or measure")
    world = result.world
    if is_relative(result):
        raise ArgumentError("result: is relative to its world board already.")
    if world is None:
        if result.circles:
            raise ArgumentError("result: has no world board; give estimate or measure a world_board.")
        return result
    frame = world.candidates[world.chosen]
    return replace(
        result,
        circles=tuple(_circle(circle, world, frame) for circle in result.circles),
        boards=tuple(_board(board, world, frame) for board in result.boards),
        planes=tuple(_plane(plane, frame) for plane in result.planes),
    )


def is_relative(result: ImageResult) -> bool:
    """Return whether a result is in the frame of a board, not of the camera."""
    every = [each.flags for each in result.circles] + [each.flags for each in result.boards]
    return any(Flag.RELATIVE_TO_BOARD in flags for flags in every)


def _circle(circle: CircleResult, world: BoardResult, frame: BoardPose) -> CircleResult:
    vanishing = circle.vanishing_normal
    return replace(
        circle,
        candidates=tuple(_candidate(candidate, frame) for candidate in circle.candidates),
        ambiguity=_either(circle.ambiguity, world.ambiguity) if circle.candidates else circle.ambiguity,
        vanishing_normal=None if vanishing is None else frame.rotation.T @ vanishing,
        flags=_flags(circle.flags, world) if circle.candidates else circle.flags,
    )


def _board(board: BoardResult, world: BoardResult, frame: BoardPose) -> BoardResult:
    return replace(
        board,
        candidates=tuple(_board_pose(pose, frame) for pose in board.candidates),
        ambiguity=_either(board.ambiguity, world.ambiguity),
        flags=_flags(board.flags, world),
    )


def _plane(plane: Plane, frame: BoardPose) -> Plane:
    normal = frame.rotation.T @ plane.normal
    return replace(plane, normal=normal, offset_mm=plane.offset_mm - float(plane.normal @ frame.translation))


def _either(first: float, second: float) -> float:
    """Return the probability that one or both of two independent choices are wrong."""
    return first + second - first * second


def _flags(own: tuple[Flag, ...], world: BoardResult) -> tuple[Flag, ...]:
    held = {*own, Flag.RELATIVE_TO_BOARD, *(flag for flag in world.flags if flag in _OF_FRAME)}
    return in_order(held)


def _candidate(candidate: Candidate, frame: BoardPose) -> Candidate:
    back = frame.rotation.T
    center, normal = back @ (candidate.center - frame.translation), back @ candidate.normal
    terms = None
    if candidate.covariance is not None:
        own, board = _slopes(candidate, normal, frame)
        of_circle = candidate.covariance_terms or CovarianceTerms(candidate.covariance)
        terms = CovarianceTerms(*_combined(of_circle, frame.terms, own, board))
    has_terms = terms is not None and (terms.camera is not None or terms.radius is not None)
    return replace(
        candidate,
        center=center,
        normal=normal,
        covariance=None if terms is None else terms.total,
        covariance_terms=terms if has_terms else None,
    )


def _slopes(candidate: Candidate, normal: FloatArray, frame: BoardPose) -> tuple[FloatArray, FloatArray]:
    """Return how center and tilts move, in the world's axes, with those of the circle (5, 5) and the board (5, 6)."""
    back, tilts = frame.rotation.T, np.stack(plane_basis(normal))
    own, board = np.zeros((5, 5)), np.zeros((5, 6))
    own[:3, :3] = back
    own[3:, 3:] = tilts @ back @ candidate.tilt_axes.T
    board[:3, :3] = -back
    board[:3, 3:] = back @ cross_matrix(candidate.center - frame.translation)
    board[3:, 3:] = tilts @ back @ cross_matrix(candidate.normal)
    return own, board


def _board_pose(pose: BoardPose, frame: BoardPose) -> BoardPose:
    back, apart = frame.rotation.T, pose.translation - frame.translation
    own, board = np.zeros((6, 6)), np.zeros((6, 6))
    own[:3, :3] = own[3:, 3:] = back
    board[:3, :3] = board[3:, 3:] = -back
    board[:3, 3:] = back @ cross_matrix(apart)
    terms = BoardTerms(*_combined(pose.terms, frame.terms, own, board))
    return replace(pose, rotation=back @ pose.rotation, translation=back @ apart, covariance=terms.total, terms=terms)


def _combined(
    own: CovarianceTerms | BoardTerms, board: BoardTerms, by_own: FloatArray, by_board: FloatArray
) -> tuple[FloatArray, FloatArray | None, FloatArray | None, FloatArray | None]:
    """Return the terms of what moves with a pose of its own and with the board's by these slopes, in their order."""
    moves = [
        slopes @ terms.camera_moves
        for slopes, terms in ((by_own, own), (by_board, board))
        if terms.camera_moves is not None
    ]
    radius = [
        slopes @ terms.radius @ slopes.T
        for slopes, terms in ((by_own, own), (by_board, board))
        if terms.radius is not None
    ]
    camera_moves = np.sum(moves, axis=0) if moves else None
    return (
        by_own @ own.image @ by_own.T + by_board @ board.image @ by_board.T,
        None if camera_moves is None else camera_moves @ camera_moves.T,
        np.sum(radius, axis=0) if radius else None,
        camera_moves,
    )
