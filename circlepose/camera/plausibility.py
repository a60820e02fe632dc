"""What a calibration cannot mean, judged by its numbers alone, or beside the size of an image. Pure NumPy.

Each bound is a property of lenses and cameras. What no camera has is grave: it is refused unless the user insists.
What is rare is only reported.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.camera.image_size import Size

WIDEST_PINHOLE_DEG = 150.0
"""Field of view along the diagonal. The widest lenses without distortion have 135 deg; a wider one has barrel
distortion, so that its image ends closer to the center than tan(75 deg) focal lengths."""
_WIDE_PINHOLE_DEG = 130.0
WIDEST_FISHEYE_DEG = 360.0
"""Field of view along the shorter side. The widest fisheye lenses have 280 deg, in a circle that fills the side; no
ray comes from more than half a turn off the axis."""
_REFUSED_OFFSET = 0.45
"""Offset of the principal point from the image's center, as a share of its size, where the calibration states that
size: from here on it is at the border or outside, as of a part cut from an image's corner, or of another size."""
_FOREIGN_OFFSET = 0.2
"""The same where no size is stated, so that only the offset can show that the image has another size. Lenses are
mounted to 0.1; an image resized to 0.7 or less has more."""
_FAR_OFFSET = 0.1
"""Rare along one axis. Along both and in the same sense no camera has it, but an image resized by 0.8 has."""
_NEAR_OFFSET = 0.05
"""Most cameras have less."""
_LEAST_SIDE = 32
"""px; no image that is calibrated is smaller"""
_LARGEST_SIDE = 1e9
_UNEQUAL = 0.05
"""Difference of fx and fy that only pixels have that are not square, as few cameras have them."""
_MOST_BENT = 0.25
"""Excess of the distortion over what lenses have, as a share of the distance from the center. Lenses are between the
orthographic projection, sin(angle), and none, tan(angle), or beyond by up to 0.06."""
_BENT = 0.1
_REFUSED_RMS_PX = 2.0
_REFUSED_RMS = 0.003
"""Reprojection error from which a calibration did not succeed, in px and as a share of the diagonal, whichever is
more: the points of a target are found to 0.1 to 0.5 px; motion may add a few px in a large image."""
_POOR_RMS_PX = 1.0


@dataclass(frozen=True, slots=True)
class Doubt:
    """One thing that is wrong, or rarely right, with a calibration."""

    about: str
    """the value in question: camera_matrix, dist_coeffs, image_size or reprojection_error; of a file, its key"""
    text: str
    """what is given, what it looks like and what to do"""
    is_grave: bool
    """no camera has it"""


def doubts(camera: Camera) -> tuple[Doubt, ...]:
    """Return what is doubtful about a calibration by its own numbers, the grave first; empty for a usual camera."""
    found = _of_numbers(camera)
    return tuple(sorted(found, key=lambda doubt: not doubt.is_grave))


def misfit(camera: Camera, size: Size) -> str | None:
    """Return why the camera cannot have taken an image of `size` (width, height), or None.

    Where the calibration states its own size, that is to be `size` already; see `size_mismatch`.
    """
    found = _with_size(camera, size) if camera.image_size is None else doubts(camera)
    return next((doubt.text for doubt in found if doubt.is_grave), None)


def reprojection_doubts(rms_px: float, camera: Camera) -> tuple[Doubt, ...]:
    """Return what is doubtful about a calibration whose file states the reprojection error `rms_px`."""
    size = camera.image_size or _least_size(camera)
    if not rms_px > _POOR_RMS_PX:
        return ()
    is_grave = rms_px > max(_REFUSED_RMS_PX, _REFUSED_RMS * math.hypot(*size))
    meaning = "the calibration did not succeed" if is_grave else "the calibration is a poor one"
    text = (
        f"a reprojection error of {rms_px:.3g} px says that {meaning}; calibrate again, without the images in which "
        "the target was not found well"
    )
    return (Doubt("reprojection_error", text, is_grave),)


def _of_numbers(camera: Camera) -> Iterator[Doubt]:
    yield from _unequal(camera)
    if camera.image_size is None:
        yield Doubt(
            "image_size", "the image size is not given, so not every image of another size is refused", is_grave=False
        )
        # The principal point lies inside the image, which begins at -0.5: so much of it is known.
        yield from _field_of_view(camera, _least_size(camera), is_least=True)
        return
    yield from _with_size(camera, camera.image_size)


@lru_cache(maxsize=256)
def _with_size(camera: Camera, size: Size) -> tuple[Doubt, ...]:
    """Return the doubts about a camera whose images have `size`."""
    found: list[Doubt] = []
    with np.errstate(all="ignore"):
        for judge in (_field_of_view, _principal_point, _distortion):
            found += judge(camera, size)
            if any(doubt.is_grave for doubt in found):
                # It explains what would follow.
                break
    return tuple(found)


def _unequal(camera: Camera) -> Iterator[Doubt]:
    fx, fy = float(camera.camera_matrix[0, 0]), float(camera.camera_matrix[1, 1])
    share = abs(fx - fy) / min(fx, fy)
    if share > _UNEQUAL:
        text = f"fx and fy differ by {100.0 * share:.1f} %; few cameras have pixels that are not square"
        yield Doubt("camera_matrix", text, is_grave=False)


def _least_size(camera: Camera) -> Size:
    """Return the least size of an image that has the principal point in its middle."""
    cx, cy = (min(max(place, 0.0), _LARGEST_SIDE) for place in camera.camera_matrix[:2, 2].tolist())
    return round(2.0 * cx + 1.0), round(2.0 * cy + 1.0)


def _field_of_view(camera: Camera, size: Size, *, is_least: bool = False) -> Iterator[Doubt]:
    """Judge the focal length by the field of view that it gives an image of `size`.

    A focal length in mm, as printed on lenses, is some hundred times shorter than in px: it would see half the world.
    """
    (fx, _, _), (_, fy, _) = camera.camera_matrix[:2].tolist()
    half_width, half_height = 0.5 * size[0] / fx, 0.5 * size[1] / fy
    said = f"a focal length of {_pair(fx, fy)} px" + ("" if is_least else f" in an image of {size[0]} x {size[1]} px")
    if camera.model == "fisheye":
        angle = 2.0 * math.degrees(min(half_width, half_height))
        if angle > WIDEST_FISHEYE_DEG:
            yield Doubt("camera_matrix", _in_mm(said, angle, "is more than a whole turn"), is_grave=True)
        return
    angle = 2.0 * math.degrees(math.atan(math.hypot(half_width, half_height)))
    if angle > WIDEST_PINHOLE_DEG:
        yield Doubt("camera_matrix", _in_mm(said, angle, "only a fisheye lens has"), is_grave=True)
    elif angle > _WIDE_PINHOLE_DEG and not camera.dist_coeffs.any():
        yield Doubt(
            "camera_matrix", f"{said} sees {angle:.0f} deg across; few lenses do. Is it in px?", is_grave=False
        )


def _in_mm(said: str, angle_deg: float, remark: str) -> str:
    return (
        f"{said} would see {angle_deg:.5g} deg across, which {remark}: it looks like a focal length in mm, or as a "
        "share of the image's width; give it in px, that is in mm divided by the size of a pixel in mm"
    )


def _principal_point(camera: Camera, size: Size) -> Iterator[Doubt]:
    offset = _offset(camera, size)
    share = float(np.abs(offset).max())
    place = "the principal point ({:g}, {:g}) px".format(*camera.camera_matrix[:2, 2])
    if not _is_foreign(camera, size):
        if share > _FAR_OFFSET:
            text = f"{place} is {_percent(share)} of the image's size away from its center"
            yield Doubt("camera_matrix", text, is_grave=False)
        return
    yield Doubt(
        "camera_matrix",
        f"{place} is {_percent(share)} of the size of an image of {size[0]} x {size[1]} px away from its center: "
        f"{_looks_like(camera, size)}",
        is_grave=True,
    )


def _offset(camera: Camera, size: Size) -> FloatArray:
    """Return how far the principal point (2,) is from the center of an image, as shares of its width and height."""
    return (camera.camera_matrix[:2, 2] - (np.array(size) - 1.0) / 2.0) / np.array(size)


def _is_foreign(camera: Camera, size: Size) -> bool:
    """Whether the principal point is where no uncropped image of that size has it."""
    offset = _offset(camera, size)
    share = float(np.abs(offset).max())
    if camera.image_size is not None:
        return share > _REFUSED_OFFSET
    along_both = bool(np.all(offset > _FAR_OFFSET) or np.all(offset < -_FAR_OFFSET))
    return share > _FOREIGN_OFFSET or along_both or (share > _FAR_OFFSET and _is_turned(camera, size))


def _is_turned(camera: Camera, size: Size) -> bool:
    return bool(np.all(np.abs(_offset(camera, size[::-1])) < _NEAR_OFFSET))


def _looks_like(camera: Camera, size: Size) -> str:
    """Return what the calibration of a foreign principal point is likely to be of, and what to do."""
    likely = _least_size(camera)
    if max(likely) < _LEAST_SIDE:
        return (
            "it looks left at 0, given in mm, or given from the image's center; give it in px from the center of the "
            "top left pixel"
        )
    if _is_turned(camera, size):
        return "the image looks turned by 90 deg; use it as the camera stored it"
    if min(likely) > 1 and _proportion(likely, size) < 1.1:
        return (
            f"it looks like the calibration of images of another resolution, about {likely[0]} x {likely[1]} px; "
            "calibrate with images of this one, or multiply fx, fy, cx and cy"
        )
    return (
        "the image looks cropped from a larger one, or taken by another camera; use the whole image, or take the "
        "part's left and top off cx and cy"
    )


def _proportion(first: Size, second: Size) -> float:
    """Return by what factor the proportions of two sizes differ, 1 or more."""
    ratio = first[0] * second[1] / (first[1] * second[0])
    return max(ratio, 1.0 / ratio)


def _distortion(camera: Camera, size: Size) -> Iterator[Doubt]:
    """Judge the lens by the rays of the image's border."""
    border = _border(size)
    rays = camera.rays(border)
    if np.isnan(camera.rays(_inner_points(camera, size))).any():
        yield Doubt(
            "dist_coeffs",
            "the lens model folds inside the image: from some distance to the center on, it has no ray; "
            f"coefficients {_some(camera.dist_coeffs)} have wrong signs, another order or are of another lens model",
            is_grave=True,
        )
        return
    lost = np.isnan(rays).any(axis=-1)
    if lost.any():
        text = "the distortion cannot be inverted in the image's corners or at its border; nothing is measured there"
        yield Doubt("dist_coeffs", text, is_grave=False)
    if camera.model == "fisheye" or not camera.dist_coeffs.any():
        return
    beyond = _beyond_lenses(camera, border[~lost], rays[~lost])
    if beyond > _BENT:
        yield Doubt(
            "dist_coeffs",
            f"at the image's border the distortion moves points by {_percent(beyond)} of their distance from the "
            f"center more than lenses do; coefficients {_some(camera.dist_coeffs)} do not describe a lens there",
            is_grave=beyond > _MOST_BENT,
        )


def _beyond_lenses(camera: Camera, pixels: FloatArray, rays: FloatArray) -> float:
    """Return how far at most `pixels` (n, 2) of `rays` (n, 3) are from where lenses put them; see `_MOST_BENT`."""
    undistorted = np.hypot(rays[:, 0], rays[:, 1]) / rays[:, 2]
    linear = replace(camera, dist_coeffs=np.zeros(0))
    seen = linear.rays(pixels)
    distorted = np.hypot(seen[:, 0], seen[:, 1]) / seen[:, 2]
    ratio = distorted / np.maximum(undistorted, 1e-12)
    return float(np.max(np.maximum(ratio - 1.0, rays[:, 2] - ratio), initial=0.0))


def _border(size: Size, number: int = 8) -> FloatArray:
    """Return points (4 `number`, 2) along the image's border, with its corners and the middles of its sides."""
    along = np.linspace(0.0, 1.0, number, endpoint=False)
    zeros, ones = np.zeros(number), np.ones(number)
    corners = [[along, zeros], [ones, along], [1.0 - along, ones], [zeros, 1.0 - along]]
    shares = np.concatenate([np.stack(each, axis=-1) for each in corners])
    return shares * (np.array(size) - 1.0)


def _inner_points(camera: Camera, size: Size) -> FloatArray:
    """Return points (8, 2) of a circle that every calibration covers with its lens model.

    It touches the image's nearer sides. For a fisheye, whose image may be a circle in a dark frame, it is half as
    large.
    """
    angle = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    center = (np.array(size) - 1.0) / 2.0
    radius = (0.5 if camera.model == "fisheye" else 1.0) * float(center.min())
    return center + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def _pair(first: float, second: float) -> str:
    return f"{first:g}" if first == second else f"{first:g} and {second:g}"


def _percent(share: float) -> str:
    return f"{100.0 * min(share, 1e4):.0f} %"


def _some(values: FloatArray) -> str:
    return ", ".join(f"{value:.3g}" for value in values.tolist())
