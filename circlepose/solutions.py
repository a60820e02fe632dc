"""A measured rim -> results: the candidate poses of each method, their imaged centres, flags."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera import Camera
from circlepose.cone import ConeKind, principal_frame
from circlepose.covariance import pose_covariance
from circlepose.measure import Rim
from circlepose.pose import Candidate, CircleResult, Flag, Status
from circlepose.solvers.solve import Solutions, solve

_SIGMAS = 3.0
"""Standard errors by which two semi-axes must differ, or one from 0, to be told apart."""
_SEGMENT_PX = 0.35
"""Semi-minor axis below which levels cannot tell a thin disc of high contrast from a thicker one of low contrast."""
_NEAR_RIGHT = 8.0
"""The tilt is ill-determined while the semi-axes differ by less than so many standard errors."""
_SLIVER_PX = 2.0
_POOR_FIT_PX = 0.35
_FULL_RIM = 0.9


def circle_results(
    rim: Rim,
    camera: Camera,
    methods: tuple[str, ...],
    radius_mm: float,
    instance: int,
    circle: str,
    *,
    chen_huang: Solutions | None = None,
) -> list[CircleResult]:
    """Return a result for each method, the candidates of a lone circle: nothing says yet which is right.

    `chen_huang` are the solutions by that method of the rim's settled factor, where they are known already.
    """
    rays = camera.rays(rim.points)
    factor = settled_factor(rim)
    reference: Solutions | str | None = chen_huang
    if reference is None and (len(methods) > 1 or methods == ("chen-huang",)):
        reference = solve("chen-huang", factor, rays, radius_mm)
    results = []
    for method in methods:
        known = reference if method == "chen-huang" else None
        solutions = solve(method, factor, rays, radius_mm) if known is None else known
        base = CircleResult(
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
        if isinstance(solutions, str):
            results.append(replace(base, status=Status.NO_POSE, reason=solutions))
            continue
        compared = None if method == "chen-huang" or len(methods) == 1 else reference
        candidates = _candidates(solutions, camera, compared)
        if method == "chen-huang" and factor is rim.cone.factor:
            candidates = tuple(_with_covariance(candidate, rim, radius_mm) for candidate in candidates)
        one = len(candidates) == 1
        results.append(
            replace(
                base,
                candidates=candidates,
                ambiguity=0.0 if one else 0.5,
                cone=ConeKind(solutions.cone),
                flags=_flags(rim, one, solutions.mended),
            )
        )
    return results


def settled_factor(rim: Rim) -> FloatArray:
    """Return the viewing cone's factor (3, 3), right or degenerate where the edges tell no difference from that.

    Within its error a circle seen along its axis is a right cone with one pose, where the fitted axes, never quite
    equal, would give two with a tilt of their own; and a segment is edge-on, whatever width noise gives it.
    """
    frame = principal_frame(rim.cone.factor)
    s, t = float(frame.tan_half_major), float(frame.tan_half_minor)
    per_px = s / float(rim.ellipse.semi_major)
    error = _SIGMAS * rim.axis_error_px * per_px
    if s - t < error:
        mean = np.sqrt(s * t)
        return np.asarray(frame.rotation * np.array([mean, mean, 1.0]))
    if t < max(error, _SEGMENT_PX * per_px):
        return np.asarray(frame.rotation * np.array([s, 0.0, 1.0]))
    return rim.cone.factor


def _candidates(solutions: Solutions, camera: Camera, reference: Solutions | str | None) -> tuple[Candidate, ...]:
    candidates = []
    for center, normal in zip(solutions.centers, solutions.normals, strict=True):
        position = orientation = None
        if isinstance(reference, Solutions):
            # Differences are to the like candidate: the one whose normal is nearest.
            nearest = int(np.argmax(reference.normals @ normal))
            position = float(np.linalg.norm(reference.centers[nearest] - center))
            chord = float(np.linalg.norm(reference.normals[nearest] - normal))
            orientation = float(np.degrees(2.0 * np.arcsin(min(1.0, chord / 2.0))))
        candidates.append(
            Candidate(
                center,
                normal,
                camera.project(center),
                position_difference_mm=position,
                orientation_difference_deg=orientation,
            )
        )
    # Nothing ranks the two yet; the one that faces the camera's axis more goes first, so that order is stable.
    return tuple(sorted(candidates, key=lambda c: float(c.normal[2])))


def _with_covariance(candidate: Candidate, rim: Rim, radius_mm: float) -> Candidate:
    """Add the covariance of a pose that has the rim's own cone, where the rim's is known."""
    if rim.modes_covariance is None:
        return candidate
    covariance = pose_covariance(rim.cone.factor, rim.modes_covariance, candidate.center, candidate.normal, radius_mm)
    return replace(candidate, covariance=covariance)


def _flags(rim: Rim, one: bool, mended: bool) -> tuple[Flag, ...]:
    flags = [] if one else [Flag.AMBIGUOUS]
    frame = principal_frame(rim.cone.factor)
    semi_minor = float(rim.ellipse.semi_minor)
    local = float(rim.ellipse.semi_major) * float(1.0 - frame.tan_half_minor / frame.tan_half_major)
    if local < _NEAR_RIGHT * rim.axis_error_px:
        flags.append(Flag.NEAR_RIGHT)
    if semi_minor < _SLIVER_PX:
        flags.append(Flag.NEAR_DEGENERATE)
    if rim.cone.rms_px > _POOR_FIT_PX:
        flags.append(Flag.POOR_FIT)
    if mended:
        flags.append(Flag.CHORD_MENDED)
    if rim.rim_used < _FULL_RIM:
        flags.append(Flag.PARTIAL_RIM)
    if rim.is_edges_only:
        flags.append(Flag.EDGES_ONLY)
    return tuple(flags)
