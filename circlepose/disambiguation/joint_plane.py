"""Circles that are declared to lie in one plane: one plane fitted to all, from which each gets its pose.

The plane's normal becomes that of each circle in it. The rest of a pose follows from its own covariance: it moves to
the likeliest pose in the plane. A circle that disagrees with the plane keeps its own pose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.camera.camera import Camera
from circlepose.disambiguation.observed import (
    Observed,
    deviation_covariance,
    deviation_slopes,
    flatness,
    inverse,
    moved,
    observations,
)
from circlepose.disambiguation.options import DEFAULT, DisambiguationOptions
from circlepose.disambiguation.plane_search import Fits, proposed, refined, terms, weak_information
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
    fit = _fitted(centers[is_in], normals[is_in], own[is_in], start, options)
    plane = Plane(
        circles[0].method, fit.normals[0], float(fit.normals[0] @ fit.points[0]), int(np.count_nonzero(is_in))
    )
    placed = [
        _placed(circle, fit, camera, index) if agrees else _flagged(circle)
        for circle, agrees in zip(circles, is_in, strict=True)
    ]
    return JointPlane(placed, plane)


def _searched(circles: Observed, options: DisambiguationOptions) -> Fits:
    """Return the plane that the circles agree best with."""
    depth_mm = options.depth_share * float(np.median(np.linalg.norm(circles.centers, axis=-1)))
    number = len(circles.centers)
    starts = proposed(circles, np.ones(number, dtype=bool), np.zeros(number), depth_mm, options)
    every = -(-number // options.most_compared)
    fits = refined(circles.subset(slice(None, None, every)), starts, depth_mm, options)
    worst = options.outlier_chi_square * options.search_scale**2
    best = int(np.argmin(np.sum(np.minimum(_misfits(circles, fits), worst), axis=-1)))
    return fits.subset(slice(best, best + 1))


def _misfits(circles: Observed, fits: Fits) -> FloatArray:
    """Return the misfits (h, m) of the circles to planes, whose own errors count."""
    values, slopes = circles.deviations(fits.normals, fits.points)
    spread = circles.covariances + slopes @ fits.covariances[:, None, None] @ np.swapaxes(slopes, -1, -2)
    return np.asarray(np.einsum("hmki,hmkij,hmkj->hm", values, inverse(spread)[0], values))


def _agreeing(circles: Observed, fit: Fits, options: DisambiguationOptions) -> BoolArray:
    """(m,) Whether the circles lie in the plane, with errors as they are where most do."""
    misfits = _misfits(circles, fit)[0]
    within = misfits[misfits <= options.outlier_chi_square * max(options.error_scales) ** 2]
    # The median of a chi-square is smaller than its mean.
    common = float(np.median(within)) / options.median_chi_square if len(within) else 1.0
    return np.asarray(misfits <= options.outlier_chi_square * max(common, 1.0))


def _fitted(
    centers: FloatArray, normals: FloatArray, own: FloatArray, start: Fits, options: DisambiguationOptions
) -> Fits:
    """Return the plane of the circles in it, with as much unevenness as they show, and errors as they scatter."""
    best, most = start, -np.inf
    for share in options.flatness_shares:
        circles = observations(centers[:, None], normals[:, None], (own + share * flatness(options))[:, None])
        fit = start
        for _ in range(options.fit_rounds):
            information, pull = (each.sum(axis=1) for each in terms(circles, fit, np.ones((1, len(own), 1))))
            covariance = np.linalg.inv(information + 1e-9 * weak_information(float(np.linalg.norm(start.points))))
            steps = -np.einsum("hpq,hq->hp", covariance, pull)
            fit = Fits(*moved(fit.normals, fit.points, steps), covariance)
        values, _ = circles.deviations(fit.normals, fit.points)
        misfit = float(np.einsum("hmki,mkij,hmkj->", values, circles.information, values))
        # Restricted likelihood: the plane's own parameters are integrated out.
        likelihood = float(circles.log_peaks.sum() - 0.5 * misfit + 0.5 * np.linalg.slogdet(fit.covariances[0])[1])
        if likelihood > most:
            scatter = max(misfit / max(3 * len(own) - 3, 1), 1.0)
            best, most = replace(fit, covariances=fit.covariances * scatter), likelihood
    return best


def _placed(circle: CircleResult, fit: Fits, camera: Camera, index: int) -> CircleResult:
    """Return a circle whose chosen candidate is in the plane."""
    pose = circle.candidates[circle.chosen]
    normal, point = fit.normals[0], fit.points[0]
    if pose.covariance is None:
        along = float(normal @ point) / float(normal @ pose.center)
        center, covariance = pose.center * along, None
    else:
        center, covariance = _in_plane(pose, pose.covariance, fit)
    imaged = camera.project(center[None])[0]
    candidate = replace(
        pose, center=center, normal=normal, covariance=covariance, imaged_center=imaged, covariance_terms=None
    )
    candidates = tuple(candidate if i == circle.chosen else each for i, each in enumerate(circle.candidates))
    return replace(circle, candidates=candidates, plane=index)


def _in_plane(pose: Candidate, covariance: FloatArray, fit: Fits) -> tuple[FloatArray, FloatArray]:
    """Return the likeliest center (3,) of a pose in the plane, and its covariance (5, 5).

    With deviations G x of covariance G C G' the pose moves by -C G' (G C G')^-1 times them: Gauss-Markov, with the
    plane as a condition. What is left of C is independent of the deviations, and so of the plane.
    """
    slopes = deviation_slopes(pose.normal)
    gain = np.linalg.solve(slopes @ covariance @ slopes.T, slopes @ covariance).T
    single = observations(pose.center[None, None], pose.normal[None, None], np.eye(3)[None, None])
    values, by_plane = (each[0, 0, 0] for each in single.deviations(fit.normals, fit.points))
    normal, point = fit.normals[0], fit.points[0]
    center = pose.center - gain[:3] @ values
    # First order leaves it beside the plane by as much as the second.
    center = center - normal * float(normal @ (center - point))
    rest = covariance - gain @ slopes @ covariance
    moves = np.zeros((5, 3))
    moves[:3] = -gain[:3] @ by_plane
    moves[3:, :2] = np.eye(2)
    total = moves @ fit.covariances[0] @ moves.T
    total[:3, :3] += rest[:3, :3]
    return center, (total + total.T) / 2.0


def _flagged(circle: CircleResult) -> CircleResult:
    flags = tuple(flag for flag in Flag if flag in {*circle.flags, Flag.OFF_PLANE})
    return replace(circle, flags=flags)
