"""Circles that are declared to lie in one plane: one plane fitted to all, from which each gets its pose.

The plane's normal becomes that of each circle in it. How uneven the surface is, in height and in tilt, follows from
how the circles scatter. The rest of a pose follows from its own covariance: its center moves as close to the plane as
the unevenness says. A circle that disagrees with the plane keeps its own pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.camera.camera import Camera
from circlepose.disambiguation.background import background_of
from circlepose.disambiguation.observed import (
    Observed,
    deviation_covariance,
    flatness,
    inverse,
    misfits,
    moved,
    observations,
)
from circlepose.disambiguation.options import DEFAULT, DisambiguationOptions
from circlepose.disambiguation.plane_search import Fits, proposed, refined, terms, weak_information
from circlepose.flags import in_order
from circlepose.results import Candidate, CircleResult, Flag, Plane


@dataclass(frozen=True, slots=True, eq=False)
class JointPlane:
    """One plane and the m circles that were declared to lie in it."""

    circles: list[CircleResult]
    """those in the plane with its normal, the others with the flag `off_plane`"""
    plane: Plane | None
    """None where fewer than two circles agree"""


def on_joint_plane(
    circles: Sequence[CircleResult], camera: Camera, index: int, *, options: DisambiguationOptions = DEFAULT
) -> JointPlane:
    """Fit one plane to the chosen candidates, and move those that agree with it into it.

    Parameters
    ----------
    circles
        m circles of one image and method, each with a pose; mm, camera frame.
    camera
        The calibration, by which the imaged centers follow.
    index
        What `CircleResult.plane` gets.
    options
        The numbers of the fit.

    Returns
    -------
    The circles in their order. The candidate that is not chosen stays as it is. A candidate without a covariance
    moves along its line of sight, and still has none.
    """
    if len(circles) < 2:
        return JointPlane(list(circles), None)
    poses = [circle.candidates[circle.chosen] for circle in circles]
    own = np.array([deviation_covariance(each, pose, options) for each, pose in zip(circles, poses, strict=True)])
    centers, normals = (np.array([getattr(pose, name) for pose in poses]) for name in ("center", "normal"))
    loose = observations(centers[:, None], normals[:, None], (own + flatness(options))[:, None])
    start = _searched(loose, options)
    is_in = _agreeing(loose, start, options)
    if is_in.sum() < 2:
        return JointPlane([_flagged(circle) for circle in circles], None)
    fit, uneven = _fitted(centers[is_in], normals[is_in], own[is_in], start, options)
    plane = Plane(
        circles[0].method, fit.normals[0], float(fit.normals[0] @ fit.points[0]), int(np.count_nonzero(is_in))
    )
    agreeing = [pose for pose, agrees in zip(poses, is_in, strict=True) if agrees]
    placed = iter(_placed(agreeing, fit, uneven, camera))
    return JointPlane(
        [
            _with_pose(circle, next(placed), index) if agrees else _flagged(circle)
            for circle, agrees in zip(circles, is_in, strict=True)
        ],
        plane,
    )


def _searched(circles: Observed, options: DisambiguationOptions) -> Fits:
    """Return the plane that the circles agree best with."""
    anywhere = background_of(circles)
    number = len(circles.centers)
    starts = proposed(circles, np.ones(number, dtype=bool), np.zeros(number), anywhere, options)
    sample = slice(None, None, -(-number // options.most_compared))
    compared = circles.subset(sample)
    fits = refined(compared, starts, anywhere.subset(sample), options)
    worst = options.outlier_chi_square * options.search_scale**2
    best = int(np.argmin(np.sum(np.minimum(_misfits(compared, fits), worst), axis=-1)))
    return fits.subset(slice(best, best + 1))


def _misfits(circles: Observed, fits: Fits) -> FloatArray:
    """Return the misfits (h, m) of the circles to planes, whose own errors count."""
    values, slopes = circles.deviations(fits.normals, fits.points)
    spread = circles.covariances + slopes @ fits.covariances[:, None, None] @ np.swapaxes(slopes, -1, -2)
    return misfits(values, inverse(spread)[0]).sum(axis=-1)


def _agreeing(circles: Observed, fit: Fits, options: DisambiguationOptions) -> BoolArray:
    """(m,) Whether the circles lie in the plane, with errors as they are where most do."""
    squares = _misfits(circles, fit)[0]
    within = squares[squares <= options.outlier_chi_square * max(options.error_scales) ** 2]
    # The median of a chi-square is smaller than its mean.
    common = float(np.median(within)) / options.median_chi_square if len(within) else 1.0
    return np.asarray(squares <= options.outlier_chi_square * max(common, 1.0))


def _fitted(
    centers: FloatArray, normals: FloatArray, own: FloatArray, start: Fits, options: DisambiguationOptions
) -> tuple[Fits, FloatArray]:
    """Return the plane of the circles in it, with errors as they scatter, and the unevenness (3, 3) they show."""
    best, uneven, most = start, flatness(options), -np.inf
    for tilt, height in product(options.tilt_shares, options.height_shares):
        surface = np.diag([tilt, tilt, height]) * flatness(options)
        circles = observations(centers[:, None], normals[:, None], (own + surface)[:, None])
        fit = start
        for _ in range(options.fit_rounds):
            information, pull = (each.sum(axis=1) for each in terms(circles, fit, np.ones((1, len(own), 1))))
            covariance = np.linalg.inv(information + 1e-9 * weak_information(float(np.linalg.norm(start.points))))
            steps = -np.einsum("hpq,hq->hp", covariance, pull)
            fit = Fits(*moved(fit.normals, fit.points, steps), covariance)
        values, _ = circles.deviations(fit.normals, fit.points)
        misfit = float(misfits(values, circles.information).sum())
        # Restricted likelihood: the plane's own parameters are integrated out.
        likelihood = float(circles.log_peaks.sum() - 0.5 * misfit + 0.5 * np.linalg.slogdet(fit.covariances[0])[1])
        if likelihood > most:
            scatter = max(misfit / max(3 * len(own) - 3, 1), 1.0)
            best, uneven, most = replace(fit, covariances=fit.covariances * scatter), surface, likelihood
    return best, uneven


def _placed(poses: Sequence[Candidate], fit: Fits, uneven: FloatArray, camera: Camera) -> list[Candidate]:
    """Return poses moved into the plane of an `uneven` surface."""
    normal, point = fit.normals[0], fit.points[0]
    centers = np.array([pose.center for pose in poses])
    along = float(normal @ point) / (centers @ normal)
    known = [i for i, pose in enumerate(poses) if pose.covariance is not None]
    covariances: dict[int, FloatArray] = {}
    moved_centers = centers * along[:, None]
    if known:
        own = np.array([poses[i].covariance for i in known])
        normals = np.array([poses[i].normal for i in known])
        moved_centers[known], totals = _in_plane(centers[known], normals, own, fit, uneven)
        covariances = dict(zip(known, totals, strict=True))
    return [
        replace(
            pose,
            center=center,
            normal=normal,
            covariance=covariances.get(i),
            covariance_terms=None,
            imaged_center=imaged,
        )
        for i, (pose, center, imaged) in enumerate(
            zip(poses, moved_centers, camera.project(moved_centers), strict=True)
        )
    ]


def _in_plane(
    centers: FloatArray, normals: FloatArray, covariances: FloatArray, fit: Fits, uneven: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the likeliest centers (m, 3) of poses whose normal is the plane's, and their covariances (m, 5, 5).

    With deviations G x of covariance G C G' a pose moves by -C G' (G C G' + H)^-1 times them: Gauss-Markov, with the
    plane as a condition, that for the height up to its unevenness H. What is left of C is independent of the
    deviations, and so of the plane. That a normal may be another than the plane's, by the unevenness of the tilts, is
    added: the center would move, too.
    """
    slopes = np.zeros((len(centers), 3, 5))
    slopes[:, :2, 3:] = np.eye(2)
    slopes[:, 2, :3] = normals
    across = slopes @ covariances
    spread = across @ np.swapaxes(slopes, -1, -2) + uneven * np.diag([0.0, 0.0, 1.0])
    gains = np.swapaxes(inverse(spread)[0] @ across, -1, -2)
    plain = np.broadcast_to(np.eye(3), (len(centers), 1, 3, 3))
    values, by_plane = observations(centers[:, None], normals[:, None], plain).deviations(fit.normals, fit.points)
    off = values[0, :, 0, :, None]
    heights = (off - slopes @ gains @ off)[:, 2, 0]
    centers = centers - (gains[:, :3] @ off)[..., 0]
    # First order leaves them beside those heights by as much as the second.
    normal = fit.normals[0]
    centers = centers - ((centers - fit.points[0]) @ normal - heights)[:, None] * normal
    moves = np.zeros((len(centers), 5, 3))
    moves[:, :3] = -gains[:, :3] @ by_plane[0, :, 0]
    moves[:, 3:, :2] = np.eye(2)
    tilted = np.zeros((len(centers), 5, 2))
    tilted[:, :3] = gains[:, :3, :2]
    tilted[:, 3:] = np.eye(2)
    total = moves @ fit.covariances[0] @ np.swapaxes(moves, -1, -2)
    total += tilted @ uneven[:2, :2] @ np.swapaxes(tilted, -1, -2)
    total[:, :3, :3] += (covariances - gains @ across)[:, :3, :3]
    return centers, (total + np.swapaxes(total, -1, -2)) / 2.0


def _with_pose(circle: CircleResult, pose: Candidate, index: int) -> CircleResult:
    candidates = tuple(pose if i == circle.chosen else each for i, each in enumerate(circle.candidates))
    return replace(circle, candidates=candidates, plane=index)


def _flagged(circle: CircleResult) -> CircleResult:
    flags = in_order({*circle.flags, Flag.OFF_PLANE})
    return replace(circle, flags=flags)
