"""Regions of the image with exact rims: where in a cell each begins, and where its rim runs.

A region has two parts: its coverage of given cells, and points along its rim (which only say
which pixels need cells; the rim itself is never a polygon).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera, circle_contour
from circlepose.geometry.cone import cone_from_circle
from circlepose.synthesis.coverage import Cells, half_plane_coverage, quadratic_coverage
from circlepose.synthesis.distance import outline, signed_distance
from circlepose.synthesis.scene import Circle, CoaxialPart, Patch, Plane, Polygon, Round, Shape

_SPACING_PX = 0.5
_FIRST_POINTS = 256
_MOST_POINTS = 1 << 19


class Region(Protocol):
    """A part of the image with a rim."""

    def coverage(self, cells: Cells) -> FloatArray:
        """Return the covered fraction (...) of each cell; 0 where the camera sees nothing."""

    def rims(self, camera: Camera) -> list[FloatArray]:
        """Return closed rims as points (n, 2) px, at most half a pixel apart near the image; NaN where unseen."""


@dataclass(frozen=True, slots=True, eq=False)
class CircleRegion:
    """The image of a disc in space."""

    circle: Circle

    def coverage(self, cells: Cells) -> FloatArray:
        """Return the covered fraction from F = r'Qr, r the cell's ray."""
        center, normal = self.circle.center, self.circle.normal
        rays, jacobian = cells.rays, cells.ray_jacobian
        # Unit numbers whatever the distance: only the zero of F matters.
        scale = float(np.linalg.norm(center))
        cone = cone_from_circle(center / scale, normal, self.circle.radius / scale)
        image = rays @ cone
        value = np.einsum("...i,...i->...", rays, image)
        gradient = 2.0 * np.einsum("...i,...ij->...j", image, jacobian)
        hessian = 2.0 * np.swapaxes(jacobian, -1, -2) @ (cone @ jacobian)
        covered = quadratic_coverage(value, gradient, hessian, cells)
        # The cone is double: its other half lies behind the camera.
        ahead = (rays @ normal) * np.dot(normal, center) > 0.0
        return np.where(ahead, covered, 0.0)

    def rims(self, camera: Camera) -> list[FloatArray]:
        """Return the rim."""
        circle = self.circle
        return [_dense(camera, lambda n: circle_contour(camera, circle.center, circle.normal, circle.radius, n))]


@dataclass(frozen=True, slots=True, eq=False)
class ShapeRegion:
    """The image of a flat shape: on a plane in space, or drawn in the image."""

    shape: Shape
    plane: Plane | None

    def coverage(self, cells: Cells) -> FloatArray:
        """Return the covered fraction from the shape's signed distance."""
        if self.plane is None:
            return _flat_coverage(self.shape, cells.pixels, None, cells)
        points, jacobian = plane_coordinates(self.plane, cells)
        return _flat_coverage(self.shape, points, jacobian, cells)

    def rims(self, camera: Camera) -> list[FloatArray]:
        """Return the rim."""
        plane = self.plane
        if plane is None:
            return [_dense(camera, lambda n: outline(self.shape, n))]
        axes = np.stack([plane.right, plane.down])
        return [_dense(camera, lambda n: camera.project(plane.center + outline(self.shape, n) @ axes))]


@dataclass(frozen=True, slots=True, eq=False)
class Union:
    """All that some member covers. Exact where one member alone makes the rim."""

    members: tuple[Region, ...]

    def coverage(self, cells: Cells) -> FloatArray:
        """Return the largest of the members' fractions."""
        return np.asarray(np.max([member.coverage(cells) for member in self.members], axis=0))

    def rims(self, camera: Camera) -> list[FloatArray]:
        """Return the members' rims."""
        return [rim for member in self.members for rim in member.rims(camera)]


@dataclass(frozen=True, slots=True, eq=False)
class Intersection:
    """All that every member covers. Exact where one member alone makes the rim."""

    members: tuple[Region, ...]

    def coverage(self, cells: Cells) -> FloatArray:
        """Return the smallest of the members' fractions."""
        return np.asarray(np.min([member.coverage(cells) for member in self.members], axis=0))

    def rims(self, camera: Camera) -> list[FloatArray]:
        """Return the members' rims."""
        return [rim for member in self.members for rim in member.rims(camera)]


def patch_region(patch: Patch) -> Region:
    """Return the region of a patch; a disc on a plane gets the exact rim of a circle."""
    if isinstance(patch.shape, Round) and patch.plane is not None:
        center = patch.plane.point(patch.shape.at)
        return CircleRegion(Circle("", center, patch.plane.normal, patch.shape.radius))
    return ShapeRegion(patch.shape, patch.plane)


def solid_region(part: CoaxialPart) -> Region:
    """Return the image of a solid frustum: both discs, and the quadrilateral between its silhouette lines.

    A silhouette line is the generatrix in whose tangent plane the camera lies. With H the signed height from
    the big circle to the small one, along n, the surface's normal at azimuth e is H e - (r - R) n, so
    e . c = ((r - R) n . c - H R) / H. The two lines meet in the apex: their four ends lie in a plane.
    Without such lines the image of one disc holds that of the other.
    """
    big, small = part.circles
    discs = (CircleRegion(big), CircleRegion(small))
    height = part.height_mm if part.form == "boss" else -part.height_mm
    axial = float(np.dot(part.normal, big.center))
    in_plane = big.center - axial * part.normal
    length = float(np.linalg.norm(in_plane))
    wanted = ((small.radius - big.radius) * axial - height * big.radius) / height
    if abs(wanted) >= length:
        return Union(discs)
    first = in_plane / length
    second = np.cross(part.normal, first)
    cos = wanted / length
    sides = [cos * first + sign * np.sqrt(1.0 - cos**2) * second for sign in (1.0, -1.0)]
    corners = [
        big.center + big.radius * sides[0],
        small.center + small.radius * sides[0],
        small.center + small.radius * sides[1],
        big.center + big.radius * sides[1],
    ]
    normal = np.cross(corners[1] - corners[0], corners[3] - corners[0])
    plane = Plane.create(corners[0], normal, corners[1] - corners[0])
    flat = [((p - corners[0]) @ plane.right, (p - corners[0]) @ plane.down) for p in corners]
    return Union((*discs, ShapeRegion(Polygon(tuple((float(x), float(y)) for x, y in flat)), plane)))


def plane_coordinates(plane: Plane, cells: Cells) -> tuple[FloatArray, FloatArray]:
    """Return where the cells' rays meet `plane`: coordinates (..., 2) mm and their derivative (..., 2, 2) by px."""
    rays, normal = cells.rays, plane.normal
    slope = rays @ normal
    with np.errstate(divide="ignore", invalid="ignore"):
        depth = np.dot(plane.center, normal) / slope
        # Behind the camera, or never.
        depth = np.where((depth > 0.0) & np.isfinite(depth), depth, np.nan)
        axes = np.stack([plane.right, plane.down])
        points = (depth[..., None] * rays - plane.center) @ axes.T
        # d (depth r) = depth (I - r n' / (n . r)) dr
        shear = axes - (rays @ axes.T / slope[..., None])[..., None] * normal
        return points, depth[..., None, None] * (shear @ cells.ray_jacobian)


def _flat_coverage(shape: Shape, points: FloatArray, jacobian: FloatArray | None, cells: Cells) -> FloatArray:
    seen = np.isfinite(points[..., 0])
    if jacobian is None and isinstance(shape, Round):
        offset = points - np.array(shape.at)
        value = np.einsum("...i,...i->...", offset, offset) - shape.radius**2
        return quadratic_coverage(value, 2.0 * offset, np.broadcast_to(2.0 * np.eye(2), (*value.shape, 2, 2)), cells)
    distance, gradient = signed_distance(shape, np.where(seen[..., None], points, 0.0))
    if jacobian is not None:
        gradient = np.einsum("...i,...ij->...j", gradient, jacobian)
    steepness = np.maximum(np.linalg.norm(gradient, axis=-1), 1e-300)
    covered = half_plane_coverage(-distance / steepness, gradient / steepness[..., None], cells)
    return np.where(seen, covered, 0.0)


def _dense(camera: Camera, points_of: Callable[[int], FloatArray]) -> FloatArray:
    """Return rim points dense enough near the image that none of its pixels is passed over."""
    number = _FIRST_POINTS
    points = points_of(number)
    if camera.image_size is None:
        return points
    middle = 0.5 * np.array(camera.image_size)
    reach = float(np.linalg.norm(middle))
    while number < _MOST_POINTS:
        gaps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=-1)
        near = np.linalg.norm(points - middle, axis=-1) < reach + gaps
        longest = float(np.max(gaps[near], initial=0.0))
        if longest <= _SPACING_PX:
            break
        number = min(int(np.ceil(1.1 * number * longest / _SPACING_PX)), _MOST_POINTS)
        points = points_of(number)
    return points
