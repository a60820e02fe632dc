"""A measured rim -> results: the candidate poses of each method, their imaged centers, flags."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, replace

import numpy as np

from circlepose._numerics import angle_between
from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.flags import in_order
from circlepose.geometry.cone import ConeKind, PrincipalFrame, principal_frame
from circlepose.geometry.cone_perturbation import MODES
from circlepose.geometry.measured_cone import Cone
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.measurement.rim import EdgeRim, FittedRim, Rim, modes_covariance
from circlepose.results import Candidate, CircleResult, Failure, Flag
from circlepose.solvers.registry import Solutions, solve, solve_chen_huang
from circlepose.uncertainty.pose_covariance import pose_covariances, segment_covariance


def circle_results(
    rim: Rim,
    camera: Camera,
    methods: tuple[str, ...],
    radius_mm: float,
    instance: int,
    circle: str,
    *,
    frame: PrincipalFrame | None = None,
    options: MeasurementOptions = DEFAULT,
) -> list[CircleResult]:
    """Return the results of one rim, see `results_of_rims`; `frame` is that of its cone, where it is known."""
    frames = None
    if frame is not None:
        frames = PrincipalFrame(*(np.asarray(each)[None] for each in astuple(frame)))
    return results_of_rims([rim], camera, methods, radius_mm, [instance], circle, frames=frames, options=options)


def results_of_rims(
    rims: Sequence[Rim],
    camera: Camera,
    methods: tuple[str, ...],
    radius_mm: float,
    instances: Sequence[int],
    circle: str,
    *,
    frames: PrincipalFrame | None = None,
    options: MeasurementOptions = DEFAULT,
) -> list[CircleResult]:
    """Solve the poses of lone circles of one radius. Which candidate is right is left open.

    Parameters
    ----------
    rims
        (m) the measured rims.
    camera
        The calibration for this image size.
    methods
        Names of `circlepose.solvers.CIRCLE_METHODS`.
    radius_mm
        Radius of every circle, mm.
    instances
        (m) number of the target in the image, of each rim.
    circle
        Name of the circle in its target.
    frames
        (m, ...) of the rims' cones, where they are known already.
    options
        The numbers of the measurement.

    Returns
    -------
    A result for each rim and method, the methods of one rim together; centers in mm, camera frame. A method without
    a pose gives a result with the status `no_pose` and the reason.
    """
    if not rims:
        return []
    if frames is None:
        frames = principal_frame(np.stack([rim.cone.factor for rim in rims]))
    settled = settled_frames(rims, frames, options)
    factors = _settled_factors(rims, frames, settled)
    known = solve_chen_huang(settled, radius_mm)
    covariances = _covariances(rims, camera, frames, factors, known, radius_mm)
    imaged = camera.project(np.concatenate([solutions.centers for solutions in known]))
    starts = np.cumsum([0, *(len(solutions.centers) for solutions in known)])
    results = []
    for k, rim in enumerate(rims):
        own = slice(starts[k], starts[k + 1])
        base = result_without_pose(rim, methods[0], radius_mm, instances[k], circle)
        flags = _flags(rim, float(frames.tan_half_minor[k] / frames.tan_half_major[k]), options)
        for method in methods:
            solutions = known[k]
            if method == "chen-huang":
                candidates = _candidates(solutions, imaged[own], covariances[own])
            else:
                found = solve(method, factors[k], camera.rays(rim.points), radius_mm)
                if isinstance(found, Failure):
                    results.append(replace(base, method=method, status=found.status, reason=found.reason))
                    continue
                solutions = found
                candidates = _candidates(solutions, camera.project(solutions.centers))
                if len(methods) > 1:
                    reference = _candidates(known[k], imaged[own])
                    candidates = tuple(compared(candidate, reference) for candidate in candidates)
            one = len(candidates) == 1
            is_set = flags | {Flag.AMBIGUOUS: not one, Flag.CHORD_MENDED: solutions.mended}
            results.append(
                replace(
                    base,
                    method=method,
                    candidates=candidates,
                    ambiguity=0.0 if one else 0.5,
                    cone=measured_cone(rim, ConeKind(solutions.cone)),
                    flags=tuple(flag for flag in Flag if is_set.get(flag, False)),
                )
            )
    return results


def result_without_pose(rim: Rim, method: str, radius_mm: float, instance: int, circle: str) -> CircleResult:
    """Return what a result says of the rim itself."""
    return CircleResult(
        instance,
        circle,
        method,
        radius_mm,
        ellipse=rim.ellipse,
        residual_px=rim.cone.rms_px,
        rim_used=rim.rim_used,
        score=rim.score,
        contour=rim.points,
    )


def measured_cone(rim: Rim, kind: ConeKind) -> Cone:
    """Return the rim's viewing cone for a result, with what its pose takes it to be."""
    modes = modes_covariance(rim)
    return Cone(rim.cone.factor, kind, None if modes is None else (modes + modes.T) / 2.0)


def rim_flags(rim: Rim, frame: PrincipalFrame, options: MeasurementOptions = DEFAULT) -> tuple[Flag, ...]:
    """Return the flags of a rim by itself, whatever the method; `frame` is that of its cone."""
    is_set = _flags(rim, float(frame.tan_half_minor / frame.tan_half_major), options)
    return tuple(flag for flag in Flag if is_set.get(flag, False))


def with_doubt(results: Sequence[CircleResult], usual_score: float) -> list[CircleResult]:
    """Flag the results whose contour has a score below the usual least one."""
    return [
        replace(each, flags=in_order({*each.flags, Flag.DOUBTFUL}))
        if each.score is not None and each.score < usual_score
        else each
        for each in results
    ]


def settled_frames(
    rims: Sequence[Rim], frames: PrincipalFrame, options: MeasurementOptions = DEFAULT
) -> PrincipalFrame:
    """Return the frames of the rims' viewing cones, or of the right or degenerate cones that they may be.

    `right`: the two semi-axes agree within three standard errors. The circle then has one pose, where the fitted
    axes, which are never quite equal, would give two with a tilt of their own. `degenerate`: the semi-minor axis is
    within three standard errors of zero, and the circle is seen edge-on. `frames` (m, ...) are of the measured cones.
    """
    s, t = frames.tan_half_major, frames.tan_half_minor
    per_px = s / np.array([float(rim.ellipse.semi_major) for rim in rims])
    error = options.settle_sigmas * np.array([rim.axis_error_px for rim in rims]) * per_px
    right = s - t < error
    least_px = np.array([0.0 if isinstance(rim, EdgeRim) and rim.is_given else options.segment_px for rim in rims])
    flat = ~right & (t < np.maximum(error, least_px * per_px))
    mean = np.sqrt(s * t)
    return PrincipalFrame(frames.rotation, np.where(right, mean, s), np.where(right, mean, np.where(flat, 0.0, t)))


def _settled_factors(rims: Sequence[Rim], frames: PrincipalFrame, settled: PrincipalFrame) -> FloatArray:
    """Return the factors (m, 3, 3) of the rims' cones, of those that are not `settled` as they were measured."""
    s, t = settled.tan_half_major, settled.tan_half_minor
    is_settled = (s != frames.tan_half_major) | (t != frames.tan_half_minor)
    axes = np.stack([s, t, np.ones_like(s)], axis=-1)
    measured = np.stack([rim.cone.factor for rim in rims])
    return np.where(is_settled[:, None, None], settled.rotation * axes[:, None, :], measured)


def _covariances(
    rims: Sequence[Rim],
    camera: Camera,
    frames: PrincipalFrame,
    factors: FloatArray,
    known: Sequence[Solutions],
    radius_mm: float,
) -> list[FloatArray | None]:
    """Return the covariance of each candidate of each rim in turn; None where the rim has none, or was settled."""
    centers = np.concatenate([solutions.centers for solutions in known])
    normals = np.concatenate([solutions.normals for solutions in known])
    owner = np.repeat(np.arange(len(rims)), [len(solutions.centers) for solutions in known])
    modes = np.full((len(rims), MODES, MODES), np.nan)
    for k, rim in enumerate(rims):
        own = modes_covariance(rim)
        if own is not None and np.array_equal(factors[k], rim.cone.factor):
            modes[k] = own
    axes = frames.rotation[..., 2]
    covariances = pose_covariances(factors[owner], axes[owner], modes[owner], centers, normals, radius_mm)
    return [
        each if np.isfinite(each[0, 0]) else _of_segment(rims[i], camera, factors[i], center, normal, radius_mm)
        for each, i, center, normal in zip(covariances, owner.tolist(), centers, normals, strict=True)
    ]


def _of_segment(
    rim: Rim, camera: Camera, settled: FloatArray, center: FloatArray, normal: FloatArray, radius_mm: float
) -> FloatArray | None:
    """Return the covariance of a pose whose rim was settled to be seen edge-on and measured from its levels."""
    if not isinstance(rim, FittedRim) or rim.ellipse_covariance is None:
        return None
    if not principal_frame(settled).is_degenerate:
        return None
    return segment_covariance(camera, rim.ellipse, rim.ellipse_covariance, center, normal, radius_mm)


def _candidates(
    solutions: Solutions, imaged: FloatArray, covariances: Sequence[FloatArray | None] = (None, None)
) -> tuple[Candidate, ...]:
    candidates = [
        Candidate(center, normal, seen, covariance=covariance)
        for center, normal, seen, covariance in zip(
            solutions.centers, solutions.normals, imaged, covariances, strict=False
        )
    ]
    # Nothing ranks the two yet; the one that faces the camera's axis more goes first, so that order is stable.
    return tuple(sorted(candidates, key=lambda c: float(c.normal[2])))


def compared(candidate: Candidate, reference: Sequence[Candidate]) -> Candidate:
    """Add the differences to the corresponding candidate of Chen & Huang's: the one whose normal is nearest."""
    if not reference:
        return candidate
    nearest = max(reference, key=lambda other: float(other.normal @ candidate.normal))
    return replace(
        candidate,
        position_difference_mm=float(np.linalg.norm(nearest.center - candidate.center)),
        orientation_difference_deg=float(np.degrees(angle_between(nearest.normal, candidate.normal))),
    )


def _is_poor(rim: Rim, options: MeasurementOptions) -> bool:
    """Whether the edges of a rim depart from its ellipse by more than noise explains."""
    if rim.contour is None:
        return rim.cone.rms_px > options.poor_fit_px
    # Blur shifts the edges of a reduced image all alike.
    scatter_px = rim.cone.rms_px if rim.contour.blur_px == 0.0 else float(np.std(rim.cone.residuals_px))
    return rim.contour.ragged > 1.0 or scatter_px > np.hypot(options.poor_fit_px, rim.contour.noise_px)


def _flags(rim: Rim, axis_ratio: float, options: MeasurementOptions) -> dict[Flag, bool]:
    """Return which flags a rim has by itself, whatever the method that solves it."""
    apart_px = float(rim.ellipse.semi_major) * (1.0 - axis_ratio)
    return {
        Flag.NEAR_RIGHT: apart_px < options.near_right_sigmas * rim.axis_error_px,
        Flag.NEAR_DEGENERATE: float(rim.ellipse.semi_minor) < options.sliver_px,
        Flag.POOR_FIT: _is_poor(rim, options),
        Flag.PARTIAL_RIM: rim.rim_used < options.visible_rim_share,
        Flag.EDGES_ONLY: isinstance(rim, EdgeRim) and rim.level_fit is not None,
    }
