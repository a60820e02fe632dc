"""Rims -> results of a board target: each board's pose, and each of its circles by that pose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import Image
from circlepose.board_result import BoardCircleFit, BoardPose, BoardResult
from circlepose.boards.constellation import Sighting
from circlepose.boards.fit import BoardFit
from circlepose.boards.marks import are_rings
from circlepose.boards.match import find_boards
from circlepose.boards.options import DEFAULT, BoardOptions
from circlepose.boards.pose import BoardRims, circle_derivatives, circles_at
from circlepose.boards.refinement import FoundBoard
from circlepose.boards.scene import Scene
from circlepose.boards.uncertainty import board_terms
from circlepose.camera.camera import Camera
from circlepose.flags import in_order
from circlepose.geometry.cone import plane_basis
from circlepose.geometry.cone_perturbation import MODES
from circlepose.geometry.ellipse import Ellipse
from circlepose.measurement.rim import Rim
from circlepose.results import Candidate, CircleResult, CovarianceTerms, Flag, SettledBy, Status
from circlepose.targets.board import BoardLayout
from circlepose.targets.target import Target
from circlepose.uncertainty.systematic import radius_term


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredBoards:
    """The boards of an image, or why there are none."""

    boards: tuple[BoardResult, ...]
    circles: tuple[CircleResult, ...]
    """all circles of the boards by their poses; without a board the lone circles"""
    status: Status = Status.OK
    reason: str = ""
    remark: str = ""
    """that there seem to be more than were asked for"""


def measure_boards(
    rims: Sequence[Rim],
    lone: Sequence[CircleResult],
    camera: Camera,
    target: Target,
    levels: Image,
    *,
    options: BoardOptions = DEFAULT,
) -> MeasuredBoards:
    """Find the boards of an image among its circles.

    Parameters
    ----------
    rims
        All rims of the image, most evidence first.
    lone
        The results of each by itself, for a circle of the usual radius.
    camera
        The calibration, for this image size.
    target
        Of kind board.
    levels
        (h, w) gray levels that were measured; NaN where a pixel is left out.
    options
        The numbers of boards.
    """
    layout = target.layout
    assert layout is not None
    solved = [i for i, circle in enumerate(lone) if circle.candidates]
    if len(solved) < 2:
        found = "no circle was" if not solved else "one circle alone was"
        status = Status.TOO_FEW_CIRCLES if solved else Status.NO_CIRCLE
        return MeasuredBoards((), tuple(lone), status, f"{found} found; a board's pose needs two or more")
    both = [(lone[i].candidates * 2)[:2] for i in solved]
    usual = layout.usual_radius_mm
    seen = Sighting(
        Ellipse.batch([rims[i].ellipse for i in solved]),
        np.array([[candidate.center / usual for candidate in pair] for pair in both]),
        np.array([[candidate.normal for candidate in pair] for pair in both]),
    )
    image_size = (int(levels.shape[1]), int(levels.shape[0]))
    is_ring = are_rings(levels, seen.ellipse, layout, options)
    scene = Scene([rims[i] for i in solved], camera, image_size, seen, is_ring)
    matches = find_boards(scene, layout, target.count, options)
    if not matches.boards:
        reason = matches.refusals[0] if matches.refusals else f"none of {len(solved)} circles fit the layout together"
        return MeasuredBoards((), tuple(lone), Status.LAYOUT_MISMATCH, reason)
    boards, circles = [], []
    relative = target.radius_sigma_mm / target.radii_mm[0]
    for number, board in enumerate(matches.boards):
        own_rims = scene.board_rims(board.layout, board.members, board.circles)
        result = _board_result(number, board, own_rims, camera, relative, options)
        boards.append(result)
        circles += _circles(result, board, [lone[solved[i]] for i in board.members.tolist()], camera, relative)
    status, reason = Status.OK, ""
    if target.count is not None and len(boards) < target.count:
        status = Status.TOO_FEW_CIRCLES
        reason = "; ".join([f"{len(boards)} of {target.count} boards found", *matches.refusals[:1]])
    return MeasuredBoards(tuple(boards), tuple(circles), status, reason, _of_others(matches.left_on_lattice, target))


def _of_others(number: int, target: Target) -> str:
    """Return what to do about `number` circles on a lattice that no board has."""
    if number == 0 or target.count is None:
        return ""
    asked = "one board was" if target.count == 1 else f"{target.count} boards were"
    return (
        f"{number} more circles lie on a lattice like the layout's; {asked} asked for: if they are another one, "
        f"give count: {target.count + 1}, or all"
    )


def _board_result(
    number: int, board: FoundBoard, rims: BoardRims, camera: Camera, relative: float, options: BoardOptions
) -> BoardResult:
    candidates = tuple(
        _board_pose(fit, rms_px, rims, camera, relative) for fit, rms_px in zip(board.fits, board.rms_px, strict=True)
    )
    best = board.fits[0]
    circles = tuple(
        BoardCircleFit(
            name=board.layout.circles[circle].name,
            is_used=bool(used),
            residual_px=offset,
            sigmas=float(np.sqrt(chi_square / MODES)),
        )
        for circle, used, offset, chi_square in zip(
            board.circles.tolist(), best.used, board.offsets_px[0], best.chi_square.tolist(), strict=True
        )
    )
    misfits = _misfits(board, circles, options)
    is_set = {
        Flag.AMBIGUOUS: board.ambiguity >= options.undecided,
        Flag.ROLL_AMBIGUOUS: board.is_roll_open,
        Flag.RADIUS_MISFIT: abs(best.growth) >= options.misfit_growth,
        Flag.CIRCLES_MISFIT: bool(misfits),
    }
    return BoardResult(
        instance=number,
        candidates=candidates,
        ambiguity=board.ambiguity,
        circles=circles,
        circles_in_layout=len(board.layout),
        flags=tuple(flag for flag in Flag if is_set.get(flag, False)),
        growth=best.growth,
        misfits=misfits,
    )


def _misfits(board: FoundBoard, circles: Sequence[BoardCircleFit], options: BoardOptions) -> tuple[str, ...]:
    """Return the circles that are seen, but not where the layout puts them, in its order.

    Where all misfit together none is far off the common pose.
    """
    off = {board.layout.circles[i].name for i in board.misfits}
    if board.fits[0].excess > options.telling_sigmas**2:
        off |= {circle.name for circle in circles if circle.sigmas > options.telling_sigmas}
    return tuple(name for name in board.layout.names if name in off)


def _board_pose(fit: BoardFit, rms_px: float, rims: BoardRims, camera: Camera, relative: float) -> BoardPose:
    terms = board_terms(fit.excess * fit.covariance, camera, rims[fit.used].grown(fit.growth), fit.pose, relative)
    return BoardPose(fit.pose.rotation, fit.pose.translation, terms.total, terms, rms_px)


def _circles(
    result: BoardResult, board: FoundBoard, measured: Sequence[CircleResult], camera: Camera, relative: float
) -> list[CircleResult]:
    """Return each circle of a board's layout by the board's pose, with what its own rim says where it was seen."""
    layout = board.layout
    own = dict(zip(board.circles.tolist(), measured, strict=True))
    used = dict(zip(board.circles.tolist(), board.fits[0].used.tolist(), strict=True))
    every = _all_rims(layout)
    candidates = [
        _circle_candidates(every, fit, pose, camera, relative)
        for fit, pose in zip(board.fits, result.candidates, strict=True)
    ]
    settled = SettledBy.NONE if Flag.AMBIGUOUS in result.flags or len(board.fits) == 1 else SettledBy.JOINT_FIT
    circles = []
    for i, circle in enumerate(layout.circles):
        base = own.get(i) or CircleResult(result.instance, circle.name, measured[0].method, circle.radii_mm[0])
        flags = {flag for flag in base.flags if flag is not Flag.AMBIGUOUS} | set(result.flags)
        if not used.get(i, False):
            flags.add(Flag.NOT_IN_POSE)
        circles.append(
            replace(
                base,
                instance=result.instance,
                circle=circle.name,
                radius_mm=circle.radii_mm[0],
                candidates=tuple(each[i] for each in candidates),
                chosen=0,
                ambiguity=result.ambiguity,
                settled_by=settled,
                flags=in_order(flags),
                status=Status.OK,
                reason="",
            )
        )
    return circles


def _all_rims(layout: BoardLayout) -> BoardRims:
    """Return the circles of a layout as rims of which nothing was measured."""
    number = len(layout)
    nothing = np.zeros((number, MODES, MODES))
    return BoardRims(
        layout.centers_mm, layout.normals, layout.radius_mm, np.zeros((number, 3, 3)), nothing[:, 0], nothing
    )


def _circle_candidates(
    rims: BoardRims, fit: BoardFit, pose: BoardPose, camera: Camera, relative: float
) -> list[Candidate]:
    """Return each circle by the board's pose; `relative` is the standard deviation of all lengths as a share."""
    centers, normals, _ = circles_at(rims, fit.pose)
    chains = circle_derivatives(rims, fit.pose)
    with np.errstate(all="ignore"):
        imaged = camera.project(centers)
    terms = pose.terms

    found = []
    for center, normal, chain, place in zip(centers, normals, chains, imaged, strict=True):
        facing = normal
        if normal @ center > 0.0:
            facing = -normal
            # The tilts turn another normal, towards other vectors.
            turn = -np.stack(plane_basis(facing)) @ np.stack(plane_basis(normal)).T
            chain[3:] = turn @ chain[3:]
        moves = None if terms.camera_moves is None else chain @ terms.camera_moves
        own = CovarianceTerms(
            chain @ terms.image @ chain.T,
            camera=None if moves is None else moves @ moves.T,
            # The layout grows with its distance, so that each circle moves along its own line of sight.
            radius=None if terms.radius is None else radius_term(center, relative),
            camera_moves=moves,
        )
        has_terms = terms.camera is not None or terms.radius is not None
        found.append(
            Candidate(center, facing, place, covariance=own.total, covariance_terms=own if has_terms else None)
        )
    return found
