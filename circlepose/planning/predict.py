"""What `estimate` will say of a view, and how often it will be wrong.

A picture of the view is measured as any photograph: the covariance is the fit's own, with the terms of the camera and
of the radius, and what is not found there is not found. Noise comes in pairs of opposite sign, so that what is odd in
it cancels in the mean of both.

Of two poses the one is chosen that misfits the rims less. By how much the wrong one misfits more, in chi-square, is
normal about d^2 with the standard deviation 2 d, where d is how many standard deviations of the noise the two are
apart. The mean over a pair gives d, and the choice is wrong with the probability Phi(-d / 2).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._numerics import angle_between
from circlepose._typing import FloatArray, Image
from circlepose.board_result import BoardResult
from circlepose.boards.pose import place_derivatives
from circlepose.camera.camera import Camera, circle_points
from circlepose.flags import in_order
from circlepose.pipeline import estimate
from circlepose.planning.views import USUAL, Look, PlacedTarget, View, picture_of, placed
from circlepose.results import CircleResult, CovarianceTerms, Flag, ImageResult, Status
from circlepose.synthesis.render import render_float
from circlepose.synthesis.texture import add_noise
from circlepose.targets.target import Target
from circlepose.uncertainty.systematic import shares

PAIRS = 2
"""Pairs of pictures; with one, what is reported of small discs scatters by a few percent."""
_OVERSAMPLING = 4


@dataclass(frozen=True, slots=True, eq=False)
class PosePrediction:
    """A pose as it was measured in one picture, and what is known of it."""

    covariance: FloatArray | None
    """(5, 5) of the middle (mm^2) and two tilts (rad^2), as `Candidate.covariance`; None where none is reported"""
    shares: tuple[float, float] | None
    """of the camera's and of the radius' term in the variance of the position; None where none is reported"""
    roll_deg: float | None
    """standard deviation of the rotation about the normal, of a board"""
    excess: float | None
    """chi-square by which the other candidate misfits the rims more than the true one; None where there is none"""
    apart_deg: float
    """angle between the normals of both candidates"""
    flags: tuple[Flag, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """What is to be expected of a view."""

    view: View
    found: float
    """share of the pictures in which the target was measured"""
    reason: str
    """why it was not, of the first in which it was not; or why no standard deviation is known"""
    major_px: float | None
    """full major axis of the largest circle's image; None where the camera does not see it"""
    sigma_mm: FloatArray | None
    """(3,) standard deviations of the middle along the camera's x, y and z; None where none is reported"""
    sigma_normal_deg: float | None
    """of the normal's direction: root of the sum of both tilts' variances"""
    sigma_roll_deg: float | None
    """of the rotation about the normal, of a board"""
    camera_share: float | None
    """of the camera's errors in the variance of the position; None where none is reported"""
    radius_share: float | None
    """of the radius' error in it"""
    wrong: float | None
    """probability that the rims alone choose the wrong one of two poses; None where there is one, or no gray levels
    could be fitted"""
    apart_deg: float | None
    """angle between the normals of both, 0 where there is one; None where none was measured"""
    flags: tuple[Flag, ...] = ()

    @property
    def position_mm(self) -> float | None:
        """Standard deviation of the position: root of the sum of the three variances."""
        return None if self.sigma_mm is None else float(np.linalg.norm(self.sigma_mm))


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """A line of a plan."""

    place: str
    tilt_deg: float
    target: Target
    prediction: Prediction | None
    """None where nothing is as accurate as wanted"""
    distance_mm: float | None = None
    """that was asked for; None where it was sought"""


def predict(camera: Camera, target: Target, view: View, look: Look = USUAL, *, pairs: int = PAIRS) -> Prediction:
    """Return what is to be expected where `camera` sees `target` in a view.

    Parameters
    ----------
    camera
        With its image size, and with how well it is known.
    target
        What is measured; one of it, whatever its count.
    view
        Where it is.
    look
        Noise, blur and contrast.
    pairs
        Pairs of pictures that are measured.

    Raises
    ------
    UsageError
        Where the height of a coaxial part is not known.
    """
    one = replace(target, count=1, same_plane="no") if target.kind == "circle" else replace(target, count=1)
    place = placed(one, camera, view, look)
    scene = place if isinstance(place, str) else picture_of(place, camera, look)
    if isinstance(place, str) or isinstance(scene, str):
        return _expected(view, (), 1, str(scene), None)
    clean = render_float(scene, _OVERSAMPLING)
    poses, reason = [], ""
    for seed in range(pairs):
        noise = np.zeros_like(clean)
        add_noise(noise, look.noise_levels, seed)
        for sign in (1.0, -1.0):
            # A part of an image is not what its camera takes.
            result = estimate(_photograph(clean + sign * noise), scene.camera, one, force_calibration=True)
            pose = _pose_of(result, place)
            if pose is None:
                reason = reason or result.reason or str(result.status)
            else:
                poses.append(pose)
    return _expected(view, poses, 2 * pairs, reason, _major_px(place, camera))


def _photograph(levels: FloatArray) -> Image:
    return np.rint(np.clip(levels, 0.0, 255.0)).astype(np.uint8)


def _pose_of(result: ImageResult, place: PlacedTarget) -> PosePrediction | None:
    """Return the pose of the target in a picture; None where it was not measured."""
    if result.boards:
        return _of_board(result.boards[0], result.circles, place)
    whole = [c for c in result.circles if c.candidates and Flag.LONE_CIRCLE not in c.flags]
    if result.status is not Status.OK or not whole:
        return None
    return _of_circle(whole[0], result.circles, place)


def _of_circle(circle: CircleResult, every: Sequence[CircleResult], place: PlacedTarget) -> PosePrediction:
    normals = np.stack([candidate.normal for candidate in circle.candidates])
    true = int(np.argmax(normals @ place.normal))
    best = circle.candidates[true]
    return PosePrediction(
        best.covariance,
        None if best.covariance is None else _shares(best.covariance_terms or CovarianceTerms(best.covariance)),
        None,
        _excess(every, true),
        _apart_deg(normals),
        circle.flags,
    )


def _of_board(board: BoardResult, every: Sequence[CircleResult], place: PlacedTarget) -> PosePrediction:
    part = place.part
    normals = np.stack([pose.rotation[:, 2] for pose in board.candidates])
    # A layout's roll may be any of its symmetries; all of its axes but z turn with it.
    own = part.rotation[:, 2]  # type: ignore[union-attr]
    true = int(np.argmax(normals @ own))
    best = board.candidates[true]
    chain = place_derivatives(place.middle - best.translation, place.normal)
    terms = CovarianceTerms(
        chain @ best.terms.image @ chain.T,
        *(None if term is None else chain @ term @ chain.T for term in (best.terms.camera, best.terms.radius)),
    )
    roll = float(place.normal @ best.covariance[3:, 3:] @ place.normal)
    return PosePrediction(
        terms.total,
        _shares(terms),
        math.degrees(math.sqrt(max(roll, 0.0))),
        _excess(every, true),
        _apart_deg(normals),
        board.flags,
    )


def _shares(terms: CovarianceTerms) -> tuple[float, float]:
    """Return the shares of the camera's and of the radius' term in the variance of the position."""
    of_position = {name: position for name, (position, _) in shares(terms).items()}
    return of_position["camera"], of_position["radius"]


def _excess(circles: Sequence[CircleResult], true: int) -> float | None:
    """Return by how much the other candidate misfits the rims of a target more than the true one."""
    excess = [
        _misfit(circle, 1 - true) - _misfit(circle, true)
        for circle in circles
        if len(circle.candidates) == 2
        and circle.cone is not None
        and circle.cone.modes_covariance is not None
        and Flag.NOT_IN_POSE not in circle.flags
    ]
    return sum(excess) if excess else None


def _misfit(circle: CircleResult, number: int) -> float:
    """Return the misfit of a candidate to the measured rim, chi-square."""
    assert circle.cone is not None
    assert circle.cone.modes_covariance is not None
    pose = circle.candidates[number]
    modes = circle.cone.modes_of(pose.center, pose.normal, circle.radius_mm)
    return float(modes @ np.linalg.solve(circle.cone.modes_covariance, modes))


def _apart_deg(normals: FloatArray) -> float:
    if len(normals) < 2:
        return 0.0
    return math.degrees(float(angle_between(normals[0], normals[1])))


def _major_px(place: PlacedTarget, camera: Camera) -> float | None:
    largest = max(place.part.circles, key=lambda circle: circle.radius)
    rim = camera.project(circle_points(largest.center, largest.normal, largest.radius, 90))
    lengths = np.linalg.norm(rim[:45] - rim[45:], axis=1)
    return float(np.nanmax(lengths)) if np.isfinite(lengths).any() else None


def _expected(
    view: View, poses: Sequence[PosePrediction], pictures: int, reason: str, major_px: float | None
) -> Prediction:
    """Return the mean over the pictures of a view."""
    known = sorted((pose.covariance for pose in poses if pose.covariance is not None), key=_position_variance)
    # In one of the pictures a rim may be lost.
    covariance = known[(len(known) - 1) // 2] if known else None
    if poses and not known:
        reason = reason or "measured from edges alone, which say nothing of its accuracy"
    excess = [pose.excess for pose in poses if pose.excess is not None]
    rolls = [pose.roll_deg for pose in poses if pose.roll_deg is not None]
    shares = [pose.shares for pose in poses if pose.shares is not None]
    camera, radius = np.mean(shares, axis=0).tolist() if shares else (None, None)
    flags = {flag for pose in poses for flag in pose.flags}
    return Prediction(
        view=view,
        found=len(poses) / pictures,
        reason=reason,
        major_px=major_px,
        sigma_mm=None if covariance is None else np.sqrt(covariance.diagonal()[:3]),
        sigma_normal_deg=None if covariance is None else math.degrees(math.sqrt(covariance[3, 3] + covariance[4, 4])),
        sigma_roll_deg=float(np.sqrt(np.mean(np.square(rolls)))) if rolls else None,
        camera_share=camera,
        radius_share=radius,
        wrong=_chance_of_wrong(excess) if excess else None,
        apart_deg=float(np.mean([pose.apart_deg for pose in poses])) if poses else None,
        flags=in_order(flags),
    )


def _position_variance(covariance: FloatArray) -> float:
    return float(np.trace(covariance[:3, :3]))


def _chance_of_wrong(excess: Sequence[float]) -> float:
    """Return the probability that the wrong one of two poses is chosen, from their misfits in pairs of pictures."""
    d = math.sqrt(max(float(np.mean(excess)), 0.0))
    return 0.5 * math.erfc(d / (2.0 * math.sqrt(2.0)))
