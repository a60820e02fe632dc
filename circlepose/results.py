"""Results: candidate poses, circles and images."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from circlepose._typing import FloatArray
from circlepose.board_result import BoardResult
from circlepose.flags import FLAG_MEANING, SETTLED_BY_MEANING, STATUS_MEANING, Failure, Flag, SettledBy, Status
from circlepose.geometry.cone import ConeKind, circle_frame, plane_basis
from circlepose.geometry.ellipse import Ellipse
from circlepose.geometry.measured_cone import Cone

__all__ = [
    "FLAG_MEANING",
    "SETTLED_BY_MEANING",
    "STATUS_MEANING",
    "BoardResult",
    "Candidate",
    "CircleResult",
    "CovarianceTerms",
    "Failure",
    "Flag",
    "ImageResult",
    "NestedRim",
    "Plane",
    "SettledBy",
    "Status",
]


@dataclass(frozen=True, slots=True, eq=False)
class CovarianceTerms:
    """What a pose's covariance is the sum of, by cause; each (5, 5) as `Candidate.covariance`, None if exact."""

    image: FloatArray
    """noise of the image; independent from circle to circle"""
    camera: FloatArray | None = None
    """error of the focal length and the principal point; the same error in every image of the camera"""
    radius: FloatArray | None = None
    """error of the radius; the same error in every image of the target"""
    camera_moves: FloatArray | None = None
    """(5, 3) how the pose moves with one standard deviation of the focal length, of the principal point's x and of
    its y; `camera` is `camera_moves @ camera_moves.T`. Poses by one camera move together, each by its own moves"""

    @property
    def total(self) -> FloatArray:
        """The sum of all terms, (5, 5)."""
        return sum((term for term in (self.camera, self.radius) if term is not None), self.image)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Candidate:
    """One possible pose of a circle, in the camera frame."""

    center: FloatArray
    """(3,) mm"""
    normal: FloatArray
    """(3,) unit vector towards the camera: normal . center <= 0"""
    imaged_center: FloatArray
    """(2,) px, raw distorted image: where the circle's center is seen (not the ellipse's center)"""
    generatrix_mm: float | None = None
    """coaxial targets: rim to rim distance with the other circle's paired candidate, at the end near the camera"""
    generatrix_ends_mm: FloatArray | None = None
    """(2,) the same at the nearer and at the farther end"""
    generatrix_ends_sigma_mm: FloatArray | None = None
    """(2,) their standard deviations; None where the circles' own poses have no covariance"""
    height_mm: float | None = None
    """ring targets: how far the other circles are in front of the largest, along the normal, in this pose; of
    coplanar ones as measured without the assumption that they are flat"""
    height_sigma_mm: float | None = None
    """its standard deviation"""
    vanishing_distance_deg: float | None = None
    """coplanar targets: angle of this normal to the one from the vanishing line"""
    vanishing_distance_sigmas: float | None = None
    """the same in standard deviations, of both normals together: root of a chi-square of two degrees of freedom;
    None where this candidate has no covariance"""
    covariance: FloatArray | None = None
    """(5, 5) of center (mm^2) and two tilts (rad^2) of the normal, towards `tilt_axes`; of all
    terms together; None where none can be vouched for"""
    covariance_terms: CovarianceTerms | None = None
    """the terms, where another than the image's noise is known"""
    position_difference_mm: float | None = None
    """distance of the center from Chen & Huang's, where several methods were run"""
    orientation_difference_deg: float | None = None
    """angle of the normal to Chen & Huang's, where several methods were run"""

    @property
    def transform(self) -> FloatArray:
        """(4, 4) from the circle's frame to the camera's, mm: rotation and center.

        The circle's frame has its origin in the center and z along `normal`. A circle has no roll of its own; the
        rule is: where the normal is the camera's -z, x is the camera's x and y its -y (up). Any other frame is that
        one turned by the smallest rotation that takes its z to `normal`, so that it changes smoothly with the normal.
        """
        transform = np.eye(4)
        transform[:3, :3] = circle_frame(self.normal)
        transform[:3, 3] = self.center
        return transform

    @property
    def sigma_mm(self) -> FloatArray | None:
        """(3,) standard deviations of the center along x, y and z, mm; None without a covariance."""
        if self.covariance is None:
            return None
        return np.array([_root(variance) for variance in self.covariance.diagonal()[:3].tolist()])

    @property
    def sigma_deg(self) -> float | None:
        """Standard deviation of the normal's direction, deg: root of the sum of both tilts' variances."""
        if self.covariance is None:
            return None
        return math.degrees(_root(sum(self.covariance.diagonal()[3:].tolist())))

    @property
    def tilt_axes(self) -> FloatArray:
        """(2, 3) unit vectors towards which the two tilts of `covariance` turn the normal."""
        return np.stack(plane_basis(self.normal))

    def __repr__(self) -> str:
        return f"Candidate({self._numbers()})"

    def _numbers(self) -> str:
        """Return center and normal with their standard deviations, each with its unit."""
        center = f"center {_vector(self.center, 3)} mm"
        normal = f"normal {_vector(self.normal, 5)}"
        if self.sigma_mm is None:
            return f"{center}, {normal}"
        return f"{center} +- {_vector(self.sigma_mm, 3)} mm, {normal} +- {self.sigma_deg:.3g} deg"


def _root(variance: float) -> float:
    """Return the standard deviation; NaN where rounding left a variance below 0."""
    return math.sqrt(variance) if variance >= 0.0 else math.nan


def _vector(values: FloatArray, decimals: int) -> str:
    return f"({', '.join(f'{value:.{decimals}f}' for value in values.tolist())})"


@dataclass(frozen=True, slots=True, eq=False)
class NestedRim:
    """One of several concentric rims, of which one is the circle's."""

    ellipse: Ellipse
    """in the raw distorted image, px, as it was detected"""
    polarity: int
    """+1: darker inside, -1: brighter inside"""
    distance_mm: float | None
    """of the circle's center from the camera, were this its rim; None where it cannot be measured"""
    is_admitted: bool
    """whether it could be the target's rim; else it has no pose, or one outside the depth range"""
    is_taken: bool
    """whether it is the one that was measured"""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class CircleResult:
    """One circle of one target in one image, measured by one method."""

    instance: int
    """number of the target in the image, from 0"""
    circle: str
    """name of the circle in the target: disc; outer, inner, ring2 ...; big, small"""
    method: str
    radius_mm: float
    candidates: tuple[Candidate, ...] = ()
    """one or two, the better first; empty unless the status is ok"""
    chosen: int = 0
    """index of the candidate to use"""
    ambiguity: float = 0.5
    """probability that the chosen candidate is the wrong one"""
    settled_by: SettledBy = SettledBy.NONE
    """what settled the choice of the candidate"""
    plane: int | None = None
    """index in `ImageResult.planes` of the plane that the chosen candidate lies in with other circles; else None"""
    vanishing_normal: FloatArray | None = None
    """(3,) coplanar targets: unit normal from the vanishing line of two circles, independent of the joint fit"""
    vanishing_sigma_deg: float | None = None
    """its standard deviation: root of the sum of both tilts' variances"""
    generatrix_expected_mm: float | None = None
    """coaxial targets: the generatrix that was given"""
    cone: Cone | None = None
    """of the rim as measured, the same for both candidates; None where it was not measured or has no pose"""
    ellipse: Ellipse | None = None
    """of the rim in the raw distorted image, px"""
    residual_px: float | None = None
    """rms distance of the contour from the fitted rim, px"""
    rim_used: float | None = None
    """share of the rim, 0 to 1, whose edge the pose rests on; the rest is hidden, cut off or without contrast"""
    score: float | None = None
    """how surely the contour is a circle's rim, 0 to 1; None where the rim was looked for at a known place"""
    contour: FloatArray | None = None
    """(n, 2) px, the contour in use"""
    color_mix: Mapping[str, float] | None = None
    """weights by channel of the color mix whose levels were measured; None for the gray levels"""
    flags: tuple[Flag, ...] = ()
    nested_rims: tuple[NestedRim, ...] = ()
    """the concentric rims that were seen, largest first, where there are several and one is to be chosen"""
    status: Status = Status.OK
    reason: str = ""

    @property
    def pose(self) -> Candidate | None:
        """The chosen candidate; None where there is no pose, and `reason` says why."""
        return self.candidates[self.chosen] if self.candidates else None

    @property
    def cone_kind(self) -> ConeKind | None:
        """Viewing condition: right, elliptical or degenerate; the column and key `cone` of the tables."""
        return None if self.cone is None else self.cone.kind

    def __repr__(self) -> str:
        head = f"CircleResult({self.instance} {self.circle}, radius {self.radius_mm:g} mm"
        pose = self.pose
        if pose is None:
            return f"{head}, {self.status}: {self.reason})"
        remarks = "".join(f", {flag}" for flag in self.flags)
        return f"{head}, {pose._numbers()}, ambiguity {self.ambiguity:.2g}{remarks})"


@dataclass(frozen=True, slots=True, eq=False)
class Plane:
    """A plane that several lone circles of an image share, found or declared, in the camera frame."""

    method: str
    """method of the poses"""
    normal: FloatArray
    """(3,) unit vector n towards the camera"""
    offset_mm: float
    """n . x of the plane's points x; its distance from the camera is the negative"""
    circles: int
    """how many circles lie in it"""


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ImageResult:
    """All that was measured in one image, or why nothing was."""

    image: str
    """name under which the image is reported"""
    status: Status = Status.OK
    reason: str = ""
    """one sentence for a person; empty when the status is ok"""
    circles: tuple[CircleResult, ...] = ()
    image_size: tuple[int, int] | None = None
    """(width, height) px"""
    rejected: Mapping[str, int] = field(default_factory=dict)
    """how many contours were not used, by reason"""
    boards: tuple[BoardResult, ...] = ()
    """of a board target: one pose from many circles each"""
    remark: str = ""
    """what else is to be said of the image: that its file has more pages, that it is a raw mosaic or interlaced, that
    there seem to be more boards than were asked for"""
    planes: tuple[Plane, ...] = ()
    """the planes that lone circles share; see `CircleResult.plane`"""
    world: BoardResult | None = None
    """the world board, which `relative_to_world` takes as the frame; all of this result is in the camera frame"""

    def __repr__(self) -> str:
        size = "" if self.image_size is None else f", {self.image_size[0]} x {self.image_size[1]} px"
        reason = f": {self.reason}" if self.reason else ""
        found = f", {len(self.circles)} circle{'' if len(self.circles) == 1 else 's'}" if self.circles else ""
        return f"ImageResult({self.image!r}{size}, {self.status}{reason}{found})"
