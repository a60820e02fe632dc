"""One method by its name: a fitted rim -> candidate poses, or why it has none."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.errors import ArgumentError
from circlepose.geometry.cone import PrincipalFrame, cone_kinds, principal_frame
from circlepose.results import Failure, Status
from circlepose.solvers import CIRCLE_METHODS, chen_huang, kabuka_arenas, kanatani_liu
from circlepose.solvers.chords import chords_from_contour

_SAME_POSE_RAD = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class Solutions:
    """All poses of a circle by one method: one for a right cone, two otherwise."""

    centers: FloatArray
    """(k, 3) in the unit of the radius"""
    normals: FloatArray
    """(k, 3) unit vectors towards the camera"""
    cone: str
    """value of `ConeKind`"""
    mended: bool = False
    """whether the contour route left out an outlier at one of its four points"""


def solve(method: str, factor: FloatArray, contour_rays: FloatArray, radius: float) -> Solutions | Failure:
    """Return the candidate poses of a circle of `radius` by a method of `CIRCLE_METHODS`, or why there are none.

    Parameters
    ----------
    factor
        (3, 3) factor of the fitted viewing cone.
    contour_rays
        (n, 3) unit rays of the contour, in order; used by `chen-huang-contour` only.
    radius
        Of the circle; the centres come out in its unit.
    """
    frame, mended = principal_frame(factor), False
    poses: tuple[FloatArray, FloatArray] | None
    match method:
        case "chen-huang":
            poses = chen_huang.poses_from_frame(frame, radius)
        case "chen-huang-contour":
            chords = chords_from_contour(contour_rays)
            if isinstance(chords, str):
                return Failure(Status.NO_POSE, chords)
            frame, mended = chords.frame, chords.mended
            poses = chen_huang.poses_from_frame(frame, radius)
        case "kanatani-liu":
            poses = kanatani_liu.poses_from_factor(factor, radius)
        case "kabuka-arenas":
            poses = kabuka_arenas.poses_from_factor(factor, radius)
        case _:
            raise ArgumentError(f"method: expected one of {', '.join(CIRCLE_METHODS)}, got {method!r}.")
    if poses is None:
        return Failure(Status.NO_POSE, "the circle is seen edge-on; the method needs an ellipse")
    return _distinct(*poses, cone_kinds(frame), mended)


def solve_chen_huang(frames: PrincipalFrame, radius: float) -> list[Solutions]:
    """Return the candidate poses by Chen & Huang of circles of `radius`, from the frames (m, ...) of their cones."""
    every = zip(*chen_huang.poses_from_frame(frames, radius), cone_kinds(frames), strict=True)
    return [_distinct(centers, normals, kind) for centers, normals, kind in every]


def _distinct(centers: FloatArray, normals: FloatArray, kind: object, mended: bool = False) -> Solutions:
    """Say a pose once when both candidates are the same, as for a right cone."""
    same = np.linalg.norm(normals[0] - normals[1]) < _SAME_POSE_RAD
    keep = slice(0, 1) if same else slice(0, 2)
    return Solutions(centers[keep], normals[keep], str(kind), mended)
