"""Table I of Chen & Huang done again: a compact disc in three views, three methods, against the exact truth.

Twice: by circlepose's own pipeline, and as it was done in 1999, from a *plain contour*, the whole-pixel border of
the thresholded image with the object that touches it still on it. Then Chen & Huang's method uses four points of
that contour and the others an algebraic ellipse fit to all of it, and the paper's two findings show: an elongated
ellipse and an outlier harm the fit, not the chords.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import cv2
import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_projection import factor_from_ellipse
from circlepose.fitting.direct import fit_ellipse
from circlepose.geometry.ellipse import Ellipse, signed_distance
from circlepose.pipeline import estimate
from circlepose.solvers import CIRCLE_METHODS, kabuka_arenas, kanatani_liu
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.solvers.chords import chords_from_contour
from circlepose.studies.nearness import angle_deg, distance_mm, nearest, triple
from circlepose.studies.published import TABLE1, PrintedMethod, Triple
from circlepose.studies.scenes import CD_RADIUS_MM, CD_TARGET, cd_scenes
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Scene

Source = Literal["print", "circlepose", "plain contour"]

OUTLIER_REACH_PX = 20.0
"""How far from the rim the plain contour goes along what touches the disc."""
_GROUPS: tuple[tuple[PrintedMethod, tuple[tuple[str, Source], ...]], ...] = (
    (
        "Our method",
        (("chen-huang", "circlepose"), ("chen-huang-contour", "circlepose"), ("chen-huang-contour", "plain contour")),
    ),
    ("K and L's method", (("kanatani-liu", "circlepose"), ("kanatani-liu", "plain contour"))),
    ("K and A's method", (("kabuka-arenas", "circlepose"), ("kabuka-arenas", "plain contour"))),
)


@dataclass(frozen=True, slots=True)
class Table1Row:
    """One method in one view; a field is None where there is nothing to say."""

    method: str
    source: Source
    image: str
    center_mm: Triple | None
    normal: Triple | None
    position_difference_mm: float | None = None
    """to Chen & Huang's method in the same view and from the same source"""
    orientation_difference_deg: float | None = None
    position_error_mm: float | None = None
    """to the exact truth; None for what is printed, whose truth is not known"""
    orientation_error_deg: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class _Pose:
    center: FloatArray
    normal: FloatArray


def table1_rows(scenes: Sequence[Scene] | None = None) -> tuple[Table1Row, ...]:
    """Return the rows of Table I, printed and measured in `scenes` (default: its three views), in its order.

    Of the two candidate poses each row holds the one nearest to the truth.
    """
    used = cd_scenes() if scenes is None else scenes
    measured = {(row.method, row.source, row.image): row for scene in used for row in _scene_rows(scene)}
    images = [scene.name for scene in used]
    rows: list[Table1Row] = []
    for name, ways in _GROUPS:
        rows += (row for row in _printed_rows() if row.method == name and row.image in images)
        rows += (measured[method, source, image] for method, source in ways for image in images)
    return tuple(rows)


def _printed_rows() -> Iterator[Table1Row]:
    for row in TABLE1:
        differences = row.position_difference_mm, row.orientation_difference_deg
        yield Table1Row(row.method, "print", row.image, row.center_mm, row.normal, *differences)


def _scene_rows(scene: Scene) -> Iterator[Table1Row]:
    (disc,) = scene.targets[0].circles
    truth = _Pose(disc.center, disc.normal)
    for source, (reference_method, poses) in _measure(scene, truth.normal).items():
        for method, pose in poses.items():
            if pose is None:
                yield Table1Row(method, source, scene.name, None, None)
                continue
            reference = None if method == reference_method else poses[reference_method]
            difference: tuple[float | None, float | None] = (None, None)
            if reference is not None:
                difference = _differences(pose, reference)
            error = _differences(pose, truth)
            center, normal = triple(pose.center), triple(pose.normal)
            yield Table1Row(method, source, scene.name, center, normal, *difference, *error)


def _differences(first: _Pose, second: _Pose) -> tuple[float, float]:
    return distance_mm(first.center, second.center), float(angle_deg(first.normal, second.normal))


_Measured: TypeAlias = dict[Source, tuple[str, dict[str, _Pose | None]]]
"""by source: the method that differences are to, and the pose by each method; None where there is none"""


def _measure(scene: Scene, true_normal: FloatArray) -> _Measured:
    image = render(scene)
    rim: Ellipse | None = None
    own: dict[str, _Pose | None] = dict.fromkeys(CIRCLE_METHODS)
    for circle in estimate(image, scene.camera, CD_TARGET, method="all").circles:
        if circle.candidates:
            rim = circle.ellipse
            centers = np.array([candidate.center for candidate in circle.candidates])
            normals = np.array([candidate.normal for candidate in circle.candidates])
            own[circle.method] = _nearest(centers, normals, true_normal)
    plain: dict[str, _Pose | None] = dict.fromkeys(("chen-huang-contour", "kanatani-liu", "kabuka-arenas"))
    if rim is not None:
        for method, poses in _plain_poses(scene.camera, plain_contour(image, rim)).items():
            plain[method] = None if poses is None else _nearest(*poses, true_normal)
    return {"circlepose": ("chen-huang", own), "plain contour": ("chen-huang-contour", plain)}


def _nearest(centers: FloatArray, normals: FloatArray, true_normal: FloatArray) -> _Pose:
    best = nearest(normals, true_normal)
    return _Pose(centers[best], normals[best])


def plain_contour(image: Image, rim: Ellipse) -> FloatArray:
    """Return the border (n, 2), whole px, of the largest bright region of `image` (h, w) uint8.

    All of it that is within `OUTLIER_REACH_PX` of the `rim`: what touches the disc stays on it as a stump.
    """
    _, bright = cv2.threshold(image, 0, 255, cv2.THRESH_BINARY + cv2.THRESH_OTSU)
    borders, _ = cv2.findContours(bright, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    points = max(borders, key=len)[:, 0, :].astype(np.float64)
    return np.asarray(points[np.abs(signed_distance(rim, points)) <= OUTLIER_REACH_PX])


def _plain_poses(camera: Camera, contour: FloatArray) -> dict[str, tuple[FloatArray, FloatArray] | None]:
    """Return the candidates of each method: by four points of `contour` (n, 2), or an algebraic fit to all of it."""
    chords = chords_from_contour(camera.rays(contour), sub_pixel=False)
    ellipse = fit_ellipse(contour)
    factor = None if ellipse is None else factor_from_ellipse(camera, ellipse)
    return {
        "chen-huang-contour": None if isinstance(chords, str) else poses_from_frame(chords.frame, CD_RADIUS_MM),
        "kanatani-liu": None if factor is None else kanatani_liu.poses_from_factor(factor, CD_RADIUS_MM),
        "kabuka-arenas": None if factor is None else kabuka_arenas.poses_from_factor(factor, CD_RADIUS_MM),
    }
