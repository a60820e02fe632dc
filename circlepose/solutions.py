"""A measured rim -> results: the candidate poses of each method, their imaged centres, flags."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose.camera import Camera
from circlepose.cone import ConeKind, principal_frame
from circlepose.measure import Rim
from circlepose.pose import Candidate, CircleResult, Flag, Status
from circlepose.solvers.solve import Solutions, solve

_NEAR_RIGHT = 4.0
"""The tilt is ill-determined while the semi-axes differ by less than so many standard errors."""
_SLIVER_PX = 2.0
_POOR_FIT_PX = 0.35
_FULL_RIM = 0.9


def circle_results(
    rim: Rim, camera: Camera, methods: tuple[str, ...], radius_mm: float, instance: int, circle: str
) -> list[CircleResult]:
    """Return a result for each method, the candidates of a lone circle: nothing says yet which is right."""
    rays = camera.rays(rim.points)
    reference = solve("chen-huang", rim.cone.factor, rays, radius_mm)
    results = []
    for method in methods:
        solutions = solve(method, rim.cone.factor, rays, radius_mm)
        base = CircleResult(
            instance,
            circle,
            method,
            radius_mm,
            ellipse=rim.ellipse,
            residual_px=rim.cone.rms_px,
            rim_used=rim.rim_used,
            contour=rim.points,
        )
        if isinstance(solutions, str):
            results.append(replace(base, status=Status.NO_POSE, reason=solutions))
            continue
        compared = reference if len(methods) > 1 and method != "chen-huang" else None
        candidates = _candidates(solutions, camera, compared)
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


def _flags(rim: Rim, one: bool, mended: bool) -> tuple[Flag, ...]:
    flags = [] if one else [Flag.AMBIGUOUS]
    frame = principal_frame(rim.cone.factor)
    semi_minor = float(rim.ellipse.semi_minor)
    error = rim.cone.rms_px / np.sqrt(len(rim.points) / 4.0)
    local = float(rim.ellipse.semi_major) * float(1.0 - frame.tan_half_minor / frame.tan_half_major)
    if local < _NEAR_RIGHT * error:
        flags.append(Flag.NEAR_RIGHT)
    if semi_minor < _SLIVER_PX:
        flags.append(Flag.NEAR_DEGENERATE)
    if rim.cone.rms_px > _POOR_FIT_PX:
        flags.append(Flag.POOR_FIT)
    if mended:
        flags.append(Flag.CHORD_MENDED)
    if rim.rim_used < _FULL_RIM:
        flags.append(Flag.PARTIAL_RIM)
    return tuple(flags)
