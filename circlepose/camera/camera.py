"""The calibrated camera: pixels <-> rays under the full lens model, with derivatives. Pure NumPy.

Camera frame of OpenCV: x right, y down, z forward. An integer pixel coordinate is a pixel's center.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal, Self

import numpy as np

from circlepose import _arguments
from circlepose._typing import FloatArray, frozen
from circlepose.camera import lens
from circlepose.errors import CalibrationError
from circlepose.geometry.cone import factor_from_circle
from circlepose.geometry.ellipse import unit_circle

LensModel = Literal["pinhole", "fisheye"]
_LARGEST = 1e9
"""No image, focal length (px) or coefficient is larger, nor a focal length shorter than its inverse; sums of products
of such numbers do not overflow."""
LENS_MODELS: tuple[LensModel, ...] = ("pinhole", "fisheye")


@dataclass(frozen=True, slots=True)
class CameraSigma:
    """How well a camera is known: standard deviations, px; 0 is exact. Raises `CalibrationError`."""

    focal_px: float = 0.0
    """of the focal length; fx and fy err in common, in proportion"""
    center_px: float = 0.0
    """of the principal point, along each axis"""

    def __post_init__(self) -> None:
        for name, value in (("focal_sigma_px", self.focal_px), ("center_sigma_px", self.center_px)):
            expected = f"a standard deviation of 0 to {_LARGEST:g} px"
            if not 0.0 <= _arguments.number(name, value, expected, CalibrationError) <= _LARGEST:
                raise CalibrationError(f"{name}: expected {expected}, got {value:g}.")


EXACT = CameraSigma()


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """Intrinsics and lens model of one camera. Build it with `Camera.create`, which takes any array-like.

    Cameras of the same numbers are equal. Raises `CalibrationError` on what cannot be a camera.
    """

    camera_matrix: FloatArray
    """(3, 3) px, upper triangular, last row 0 0 1"""
    dist_coeffs: FloatArray
    """(n,) OpenCV's order; pinhole 0, 4, 5, 8, 12 or 14, fisheye 4"""
    image_size: tuple[int, int] | None = None
    """(width, height) px that the calibration holds for; None when the file does not say"""
    model: LensModel = "pinhole"
    sigma: CameraSigma = EXACT
    """how well the camera matrix is known"""

    @classmethod
    def create(
        cls,
        camera_matrix: object,
        dist_coeffs: object = (),
        image_size: tuple[int, int] | None = None,
        model: LensModel = "pinhole",
        sigma: CameraSigma = EXACT,
    ) -> Self:
        """Check the numbers and return the camera; raises `CalibrationError` on what cannot be a camera."""
        matrix = _arguments.float_array("camera_matrix", camera_matrix, "3 x 3 numbers", CalibrationError)
        if matrix.shape == (3, 3) and matrix[2, 2] not in (0.0, 1.0):
            with np.errstate(over="ignore", invalid="ignore"):
                matrix = matrix / matrix[2, 2]
        if dist_coeffs is None:
            raise CalibrationError(
                "dist_coeffs: expected numbers, got None; leave it out for a lens without distortion."
            )
        coefficients = _arguments.float_array("dist_coeffs", dist_coeffs, "numbers", CalibrationError).ravel()
        return cls(frozen(matrix), frozen(coefficients), image_size, model, sigma)

    def __post_init__(self) -> None:
        given: dict[str, object] = {name: getattr(self, name) for name in ("camera_matrix", "dist_coeffs", "sigma")}
        _arguments.one_of(LENS_MODELS, "model", self.model, CalibrationError)
        for name in ("camera_matrix", "dist_coeffs"):
            if not isinstance(given[name], np.ndarray):
                raise CalibrationError(
                    f"{name}: expected an array, got {_arguments.shown(given[name])}; Camera.create converts lists."
                )
        _check_matrix(self.camera_matrix)
        _check_coefficients(self.dist_coeffs, self.model)
        if self.image_size is not None:
            object.__setattr__(self, "image_size", _checked_size(self.image_size))
        if not isinstance(given["sigma"], CameraSigma):
            raise CalibrationError(f"sigma: expected a CameraSigma, got {_arguments.shown(self.sigma)}.")

    def __eq__(self, other: object) -> bool:
        """Whether all numbers are the same, as those of two reads of one calibration are."""
        return self._values() == other._values() if isinstance(other, Camera) else NotImplemented

    def __hash__(self) -> int:
        return hash(self._values())

    def _values(self) -> tuple[object, ...]:
        """Return all that makes this camera what it is, as plain values."""
        numbers = (tuple(self.camera_matrix.ravel().tolist()), tuple(self.dist_coeffs.tolist()))
        return *numbers, self.image_size, self.model, self.sigma

    @property
    def is_free_of_distortion(self) -> bool:
        """Whether straight lines are straight in the image, and circles' images ellipses."""
        return self.model == "pinhole" and not self.dist_coeffs.any()

    def project(self, points: FloatArray) -> FloatArray:
        """Project camera-frame `points` (..., 3) to pixels (..., 2); NaN behind or beyond the lens model.

        Raises `ArgumentError` on what is no such array.
        """
        if self.model == "fisheye":
            return self.project_with_jacobian(points)[0]
        u, v = lens.project_pinhole(_points(points), self.dist_coeffs)
        (fx, skew, cx), (_, fy, cy), _ = self.camera_matrix.tolist()
        return np.stack([fx * u + (skew * v + cx), fy * v + cy], axis=-1)

    def project_with_jacobian(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Project camera-frame `points` (..., 3); returns pixels (..., 2) and d pixel / d point (..., 2, 3)."""
        distort = lens.distort_fisheye if self.model == "fisheye" else lens.distort_pinhole
        plane, jacobian = distort(_points(points), self.dist_coeffs)
        linear = self.camera_matrix[:2, :2]
        return plane @ linear.T + self.camera_matrix[:2, 2], linear @ jacobian

    def rays(self, pixels: FloatArray) -> FloatArray:
        """Return the viewing rays (..., 3), unit length, of `pixels` (..., 2); NaN outside the lens model.

        Raises `ArgumentError` on what is no such array.
        """
        u, v = self._distorted(_pixels(pixels))
        if self.model == "fisheye":
            return lens.undistort_fisheye(np.stack([u, v], axis=-1), self.dist_coeffs)
        x, y, _ = lens.undistort_pinhole(u, v, self.dist_coeffs)
        rays = np.empty((*x.shape, 3))
        rays[..., 2] = 1.0 / np.sqrt(x * x + y * y + 1.0)
        rays[..., 0], rays[..., 1] = x * rays[..., 2], y * rays[..., 2]
        return rays

    def rays_with_jacobian(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the unit rays (..., 3) of `pixels` (..., 2) and their derivative d ray / d pixel (..., 3, 2)."""
        pixels = _pixels(pixels)
        if self.model == "pinhole":
            return self._pinhole_rays(pixels)
        rays = self.rays(pixels)
        _, jacobian = self.project_with_jacobian(rays)
        # A pixel does not move when a point moves along its ray, so the pseudo-inverse is tangent to the sphere.
        transposed = np.swapaxes(jacobian, -1, -2)
        gram = jacobian @ transposed
        a, b, d = gram[..., 0, 0], gram[..., 0, 1], gram[..., 1, 1]
        adjugate = np.stack([np.stack([d, -b], axis=-1), np.stack([-b, a], axis=-1)], axis=-2)
        # Where the lens model folds, a pixel has no one ray.
        with np.errstate(divide="ignore", invalid="ignore"):
            return rays, transposed @ adjugate / (a * d - b * b)[..., None, None]

    def sights(self, pixels: FloatArray) -> FloatArray:
        """Return (3, 3, ...) the rays of `pixels` (..., 2), of any length, and their slopes in the pixel's x and y.

        The first index is the ray's component, the second what it is of. NaN outside the lens model.
        """
        pixels = _pixels(pixels)
        sights = np.empty((3, 3, *pixels.shape[:-1]))
        if self.model == "fisheye":
            rays, jacobians = self.rays_with_jacobian(pixels)
            sights[:, 0] = np.moveaxis(rays, -1, 0)
            sights[:, 1:] = np.moveaxis(jacobians, (-2, -1), (0, 1))
            return sights
        x, y, slopes = lens.undistort_pinhole(*self._distorted(pixels), self.dist_coeffs)
        sights[0, 0], sights[1, 0], sights[2, 0], sights[2, 1:] = x, y, 1.0, 0.0
        for j, (to_u, to_v) in enumerate(self._to_plane()):
            sights[0, 1 + j] = slopes[0] * to_u + slopes[1] * to_v
            sights[1, 1 + j] = slopes[2] * to_u + slopes[3] * to_v
        return sights

    def _pinhole_rays(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        (x, *x_slopes), (y, *y_slopes), _ = self.sights(pixels)
        # Component by component: loops over the last axis, of two or three, would take ten times longer.
        per_length = 1.0 / np.sqrt(x * x + y * y + 1.0)
        rays = np.stack([x * per_length, y * per_length, per_length])
        jacobians = np.empty((3, 2, *x.shape))
        for j, (x_slope, y_slope) in enumerate(zip(x_slopes, y_slopes, strict=True)):
            along = x_slope * rays[0] + y_slope * rays[1]
            jacobians[0, j] = (x_slope - rays[0] * along) * per_length
            jacobians[1, j] = (y_slope - rays[1] * along) * per_length
            jacobians[2, j] = -rays[2] * along * per_length
        return np.moveaxis(rays, 0, -1), np.moveaxis(jacobians, (0, 1), (-2, -1))

    def _to_plane(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the derivatives of a point of the distorted plane to the pixel's x, and to its y."""
        (fx, skew, _), (_, fy, _), _ = self.camera_matrix.tolist()
        return (1.0 / fx, 0.0), (-skew / (fx * fy), 1.0 / fy)

    def _distorted(self, pixels: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the coordinates (...) of the distorted plane at `pixels` (..., 2)."""
        (fx, skew, cx), (_, fy, cy), _ = self.camera_matrix.tolist()
        v = (pixels[..., 1] - cy) * (1.0 / fy)
        u = (pixels[..., 0] - cx) * (1.0 / fx)
        return (u - (skew / fx) * v if skew else u), v

    def scaled_to(self, image_size: tuple[int, int]) -> Self:
        """Return the camera of the same lens whose images were resized to `image_size` (width, height).

        Pixel centers are integers, so the image's corner is at -0.5: c' = (c + 0.5) s - 0.5. Raises
        `CalibrationError` on what is no image size.
        """
        if self.image_size is None:
            raise CalibrationError("image_size: the calibration does not say its image size, so it cannot be scaled.")
        image_size = _checked_size(image_size)
        scale = np.array([image_size[0] / self.image_size[0], image_size[1] / self.image_size[1]])
        matrix = self.camera_matrix.copy()
        matrix[:2, :2] *= scale[:, None]
        matrix[:2, 2] = (matrix[:2, 2] + 0.5) * scale - 0.5
        mean = float(np.sqrt(np.prod(scale)))
        sigma = CameraSigma(self.sigma.focal_px * mean, self.sigma.center_px * mean)
        return replace(self, camera_matrix=frozen(matrix), image_size=image_size, sigma=sigma)

    def reduced_by(self, scale: int) -> Self:
        """Return the camera of the same lens whose images have `scale` px averaged each way; see `scaled_to`."""
        matrix = self.camera_matrix.copy()
        matrix[:2, :2] /= scale
        matrix[:2, 2] = (matrix[:2, 2] + 0.5) / scale - 0.5
        sigma = CameraSigma(self.sigma.focal_px / scale, self.sigma.center_px / scale)
        return replace(self, camera_matrix=frozen(matrix), image_size=None, sigma=sigma)


def circle_points(center: FloatArray, normal: FloatArray, radius: float, number: int = 360) -> FloatArray:
    """Return `number` rim points (..., number, 3) of circles with `center` and `normal` (..., 3), in mm."""
    unit = np.stack([*unit_circle(number), np.ones(number)], axis=-1)
    return np.einsum("...ij,kj->...ki", factor_from_circle(center, normal, radius), unit)


def circle_contour(
    camera: Camera, center: FloatArray, normal: FloatArray, radius: float, number: int = 360
) -> FloatArray:
    """Return the rim (..., number, 2) in the raw, distorted image; NaN where the camera cannot see."""
    return camera.project(circle_points(center, normal, radius, number))


def _points(points: object) -> FloatArray:
    return _arguments.vectors("points", points, "three numbers for each point, (..., 3)", 3)


def _pixels(pixels: object) -> FloatArray:
    return _arguments.vectors("pixels", pixels, "two numbers for each pixel, (..., 2)", 2)


def _checked_size(size: object) -> tuple[int, int]:
    expected = "a positive width and height in whole px"
    width, height = _arguments.numbers("image_size", size, expected, 2, CalibrationError)
    if not (width.is_integer() and height.is_integer() and min(width, height) >= 1.0):
        raise CalibrationError(f"image_size: expected {expected}, got {_arguments.shown(size)}.")
    _check_largest("image_size", np.array([width, height]))
    return int(width), int(height)


def _check_matrix(matrix: FloatArray) -> None:
    if matrix.dtype != np.float64:
        raise CalibrationError(f"camera_matrix: expected float64, got {matrix.dtype}; Camera.create converts.")
    if matrix.shape != (3, 3):
        raise CalibrationError(f"camera_matrix: expected 3 x 3 numbers, got shape {matrix.shape}.")
    if not np.all(np.isfinite(matrix)):
        raise CalibrationError("camera_matrix: has entries that are not finite numbers.")
    if matrix[2, 2] != 1.0 or np.any(matrix[2, :2] != 0.0) or matrix[1, 0] != 0.0:
        raise CalibrationError("camera_matrix: expected [[fx, s, cx], [0, fy, cy], [0, 0, 1]].")
    if matrix[0, 0] <= 0.0 or matrix[1, 1] <= 0.0:
        raise CalibrationError(
            f"camera_matrix: is singular or mirrored; focal lengths fx and fy must be positive px, "
            f"got {matrix[0, 0]:g} and {matrix[1, 1]:g}."
        )
    shortest = float(min(matrix[0, 0], matrix[1, 1]))
    if shortest < 1.0 / _LARGEST:
        raise CalibrationError(f"camera_matrix: a focal length of {shortest:g} px cannot be meant.")
    _check_largest("camera_matrix", matrix)


def _check_largest(name: str, values: FloatArray) -> None:
    largest = float(np.abs(values).max(initial=0.0))
    if largest > _LARGEST:
        raise CalibrationError(f"{name}: holds a number as large as {largest:g}, which cannot be meant.")


def _check_coefficients(coefficients: FloatArray, model: LensModel) -> None:
    if coefficients.ndim != 1 or coefficients.dtype != np.float64:
        raise CalibrationError(
            f"dist_coeffs: expected (n,) float64, got {coefficients.dtype} of shape {coefficients.shape}."
        )
    allowed = lens.PINHOLE_COUNTS if model == "pinhole" else (lens.FISHEYE_COUNT,)
    if len(coefficients) not in allowed:
        counts = ", ".join(str(n) for n in allowed)
        raise CalibrationError(f"dist_coeffs: a {model} camera has {counts} coefficients, got {len(coefficients)}.")
    if not np.all(np.isfinite(coefficients)):
        raise CalibrationError("dist_coeffs: has entries that are not finite numbers.")
    _check_largest("dist_coeffs", coefficients)
