"""The noise experiment of Chen & Huang done again: feature points + Gaussian noise -> spread of the pose.

The exact pixels of the feature points get independent Gaussian noise, of standard deviation `noise_px` in x and in
y, and the pose is computed from them. Over the repeats, with mean center c and mean direction m of the normal,

    center_sd_mm = sqrt(mean |c_i - c|^2)      normal_sd_deg = sqrt(mean angle(n_i, m)^2)

that is, all three coordinates, and both tilts, in one number. The paper says neither in which view the points
lie nor which definition its numbers have, so the experiment is done for several readings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.special import ndtri

from circlepose._numerics import cross
from circlepose._typing import FloatArray, frozen
from circlepose.camera.camera import Camera, circle_contour
from circlepose.errors import ArgumentError
from circlepose.fitting.cone_fit import fit_cone
from circlepose.geometry.cone import PrincipalFrame, factor_from_circle, principal_frame
from circlepose.solvers.chen_huang import poses_from_frame
from circlepose.solvers.chords import chords_from_contour
from circlepose.studies.nearness import angle_deg
from circlepose.studies.published import NOISE, NOISE_REPEATS
from circlepose.studies.scenes import CD_RADIUS_MM, cd_pose, chen_huang_camera

Points = Literal["p, q, b, c", "whole contour", "chords found anew"]


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """One way to read what the paper leaves open."""

    name: str
    points: Points
    """what is perturbed: the paper's four points; or all of the contour, which gives a viewing cone by
    `fitting.viewing_cone.fit_cone`, or p, q, b, c by `solvers.chords.chords_from_contour`"""
    camera: Camera
    center: FloatArray
    """(3,) mm"""
    normal: FloatArray
    """(3,) unit, towards the camera"""
    per_coordinate: bool = True
    """the noise's standard deviation is that of each coordinate; else of the distance, so 1/sqrt(2) of it in each"""


@dataclass(frozen=True, slots=True)
class NoiseRow:
    """The spread of the pose for one reading and noise."""

    reading: str
    points: Points
    noise_px: float
    center_sd_mm: float
    normal_sd_deg: float
    center_bias_mm: float | None = None
    """distance of the mean center from the truth; None for what is printed"""
    normal_bias_deg: float | None = None
    no_pose: int | None = None
    """perturbations that gave none: they are left out"""


def readings() -> tuple[Reading, ...]:
    """Return the readings: view (a) with the paper's points and with ours, then what else could be meant."""
    square = chen_huang_camera()
    center, normal = cd_pose("a")
    unit = frozen(normal / np.linalg.norm(normal))
    view_a = Reading("view a", "p, q, b, c", square, center, unit)
    center_b, normal_b = cd_pose("b")
    tilt = math.radians(17.0)
    return (
        view_a,
        replace(view_a, points="whole contour"),
        replace(view_a, points="chords found anew"),
        replace(view_a, name="view a, px 0.01 mm wide, 0.01212 high", camera=chen_huang_camera(fx=3160.0)),
        replace(view_a, name="view a, px 0.01212 mm wide, 0.01 high", camera=chen_huang_camera(fy=3160.0)),
        replace(view_a, name="view a, noise is that of the distance", per_coordinate=False),
        replace(view_a, name="view b", center=center_b, normal=frozen(normal_b / np.linalg.norm(normal_b))),
        replace(
            view_a,
            name="1180 mm ahead, tilted 17 deg",
            center=frozen([0.0, 0.0, 1180.0]),
            normal=frozen([0.0, -math.sin(tilt), -math.cos(tilt)]),
        ),
    )


def printed_noise_rows() -> tuple[NoiseRow, ...]:
    """Return what the paper prints."""
    return tuple(
        NoiseRow("print", "p, q, b, c", each.noise_px, each.center_sd_mm, each.normal_sd_deg) for each in NOISE
    )


def noise_rows(
    repeats: int = NOISE_REPEATS, seed: int = 0, chosen: Sequence[Reading] | None = None
) -> Iterator[NoiseRow]:
    """Yield a row per reading (default: all) and noise of 1, 2 and 3 px, from `repeats` perturbations each.

    All readings of the same points get the same random numbers. Raises `ArgumentError` for less than 2 repeats, or
    where less than 2 of them have a pose.
    """
    if repeats < 2:
        raise ArgumentError(f"repeats: expected at least 2, a spread needs them, got {repeats}.")
    for reading in readings() if chosen is None else chosen:
        for number, each in enumerate(NOISE):
            generator = np.random.Generator(np.random.PCG64([seed, number]))
            yield noise_row(reading, each.noise_px, repeats, generator)


def noise_row(reading: Reading, noise_px: float, repeats: int, generator: np.random.Generator) -> NoiseRow:
    """Return the spread of the pose over `repeats` perturbations of `noise_px`."""
    frames = _four_point_frames if reading.points == "p, q, b, c" else _contour_frames
    sigma = noise_px if reading.per_coordinate else noise_px / math.sqrt(2.0)
    centers, normals = poses_from_frame(frames(reading, sigma, repeats, generator), CD_RADIUS_MM)
    if len(centers) < 2:
        raise ArgumentError(f"noise_px: {noise_px:g} px of noise leaves no pose to take the spread of.")
    # Of the two candidates, the one nearest to the truth.
    best = np.argmax(normals @ reading.normal, axis=-1)[:, None, None]
    center = np.take_along_axis(centers, best, axis=1)[:, 0]
    normal = np.take_along_axis(normals, best, axis=1)[:, 0]
    mean_center, mean_normal = center.mean(axis=0), normal.mean(axis=0)
    return NoiseRow(
        reading.name,
        reading.points,
        noise_px,
        center_sd_mm=float(np.sqrt(np.mean(np.sum((center - mean_center) ** 2, axis=-1)))),
        normal_sd_deg=float(np.sqrt(np.mean(angle_deg(normal, mean_normal) ** 2))),
        center_bias_mm=float(np.linalg.norm(mean_center - reading.center)),
        normal_bias_deg=float(angle_deg(mean_normal, reading.normal)),
        no_pose=repeats - len(centers),
    )


def feature_pixels(reading: Reading) -> FloatArray:
    """Return the exact pixels (4, 2) of the paper's points p, q, b and c."""
    frame = principal_frame(factor_from_circle(reading.center, reading.normal, CD_RADIUS_MM))
    s, t = float(frame.tan_half_major), float(frame.tan_half_minor)
    ends = np.array([[s, 0.0, 1.0], [-s, 0.0, 1.0], [0.0, t, 1.0], [0.0, -t, 1.0]])
    return reading.camera.project(ends @ frame.rotation.T)


def frames_from_points(camera: Camera, pixels: FloatArray) -> PrincipalFrame:
    """Return the principal frames (...) that pixels p, q, b, c (..., 4, 2) span, as in sections II and III.

    w along the bisector of p and q, v = p x q, s = tan(pGq/2), t = tan(bGc/2). A t above s, which no circle has,
    is taken as s.
    """
    p, q, b, c = np.moveaxis(camera.rays(pixels), -2, 0)
    w = p + q
    w = w / np.linalg.norm(w, axis=-1, keepdims=True)
    v = cross(p, q)
    v = v / np.linalg.norm(v, axis=-1, keepdims=True)
    s, t = _tan_half(p, q), _tan_half(b, c)
    return PrincipalFrame(np.stack([cross(v, w), v, w], axis=-1), s, np.minimum(t, s))


def contour_pixels(reading: Reading) -> FloatArray:
    """Return the rim's pixels (n, 2), evenly spaced on the circle, as many as its image is px long."""
    rim = circle_contour(reading.camera, reading.center, reading.normal, CD_RADIUS_MM, 720)
    length = np.linalg.norm(np.roll(rim, -1, axis=0) - rim, axis=-1).sum()
    return circle_contour(reading.camera, reading.center, reading.normal, CD_RADIUS_MM, round(float(length)))


def _four_point_frames(
    reading: Reading, sigma: float, repeats: int, generator: np.random.Generator
) -> PrincipalFrame:
    noise = sigma * _normal_numbers(generator, (repeats, 4, 2))
    return frames_from_points(reading.camera, feature_pixels(reading) + noise)


def _contour_frames(reading: Reading, sigma: float, repeats: int, generator: np.random.Generator) -> PrincipalFrame:
    exact = contour_pixels(reading)
    frames = []
    for _ in range(repeats):
        pixels = exact + sigma * _normal_numbers(generator, exact.shape)
        if reading.points == "whole contour":
            fit = fit_cone(reading.camera, pixels)
            frame = None if fit is None else principal_frame(fit.factor)
        else:
            chords = chords_from_contour(reading.camera.rays(pixels), sub_pixel=False)
            frame = None if isinstance(chords, str) else chords.frame
        if frame is not None:
            frames.append(frame)
    return PrincipalFrame(
        np.array([frame.rotation for frame in frames]).reshape(-1, 3, 3),
        np.array([frame.tan_half_major for frame in frames]),
        np.array([frame.tan_half_minor for frame in frames]),
    )


def _tan_half(first: FloatArray, second: FloatArray) -> FloatArray:
    """Return the tangent (...) of half the angle between unit rays (..., 3)."""
    return np.asarray(np.linalg.norm(first - second, axis=-1) / np.linalg.norm(first + second, axis=-1))


def _normal_numbers(generator: np.random.Generator, shape: tuple[int, ...]) -> FloatArray:
    """Return standard normal numbers; uniform ones, unlike normal ones, are the same in all versions of NumPy."""
    return np.asarray(ndtri(generator.random(shape) + 2.0**-54))
