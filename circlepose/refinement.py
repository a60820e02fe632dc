"""Measured rims -> the same, fitted to the grey levels around them, with a covariance. Many rims at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from circlepose._typing import FloatArray, Image
from circlepose.camera import Camera
from circlepose.conic import signed_distance
from circlepose.fitting.band import bands_around
from circlepose.fitting.direct import fit_ellipse
from circlepose.fitting.photometric import LevelsFit, fit_to_levels
from circlepose.fitting.viewing_cone import ConeFit, rim_distance_px
from circlepose.measure import Rim, rim_pixels

_REACH_PX = 4.0
_REACH_SIGMA = 3.5
_START_SIGMA_PX = 0.8
_MOST_PIXELS = 60_000
_WORST_NOISE = 0.3
_FARTHEST_PX = 2.5
_FULL_RIM = 0.9
_FARTHEST_HIDDEN_PX = 0.05
_LEAST_AGAIN = 0.8
_LEAST_RIM = 0.2


def refined(grey: Image, camera: Camera, rims: Sequence[Rim]) -> list[Rim]:
    """Fit the rims to the levels of `grey` (h, w); a rim whose levels tell nothing better stays as it is."""
    done = list(rims)
    order = sorted(
        (i for i, rim in enumerate(rims) if rim.modes_covariance is None), key=lambda i: _perimeter(rims[i])
    )
    reach = np.full(len(rims), _REACH_PX)
    sigma = np.full(len(rims), _START_SIGMA_PX)
    for _ in range(2):
        blurred = []
        for chunk in _chunks(order, rims, reach):
            some = [done[i] for i in chunk]
            fit = _fit(grey, camera, some, reach[chunk], sigma[chunk])
            for k, i in enumerate(chunk):
                sigma[i] = fit.sigma_px[k]
                done[i] = _accepted(camera, rims[i], fit, k)
                if done[i] is not rims[i] and _REACH_SIGMA * sigma[i] > 1.1 * reach[i]:
                    blurred.append(i)
                    reach[i] = _REACH_SIGMA * sigma[i]
        order = blurred
    return done


def _perimeter(rim: Rim) -> float:
    return float(np.pi * (rim.ellipse.semi_major + rim.ellipse.semi_minor))


def _chunks(order: Sequence[int], rims: Sequence[Rim], reach: FloatArray) -> Iterator[list[int]]:
    chunk: list[int] = []
    for i in order:
        longest = 2.2 * reach[i] * _perimeter(rims[i])
        if chunk and (len(chunk) + 1) * longest > _MOST_PIXELS:
            yield chunk
            chunk = []
        chunk.append(i)
    if chunk:
        yield chunk


def _fit(grey: Image, camera: Camera, rims: Sequence[Rim], reach_px: FloatArray, sigma_px: FloatArray) -> LevelsFit:
    bands = bands_around(grey, camera, [rim.ellipse for rim in rims], reach_px)
    limits = (0.0, float(np.iinfo(grey.dtype).max)) if grey.dtype.kind == "u" else (-np.inf, np.inf)
    factors = np.stack([rim.cone.factor for rim in rims])
    perimeter = np.array([_perimeter(rim) for rim in rims])
    return fit_to_levels(bands, factors, sigma_px, perimeter, limits)


def _accepted(camera: Camera, rim: Rim, fit: LevelsFit, k: int) -> Rim:
    factor = fit.factors[k]
    is_noisy = fit.noise_levels[k] >= _WORST_NOISE * abs(fit.contrast_levels[k])
    if not fit.converged[k] or is_noisy or fit.rim_used[k] <= _LEAST_RIM:
        return rim
    predicted = rim_pixels(camera, factor, 90)
    ellipse = fit_ellipse(predicted)
    # What hides a part of a rim has levels of its own, which pull: there the edges that agree have the last word.
    hidden = rim.rim_used < _FULL_RIM
    if hidden and fit.rim_used[k] < _LEAST_AGAIN * rim.rim_used:
        return rim
    farthest = _FARTHEST_HIDDEN_PX if hidden else _FARTHEST_PX
    if ellipse is None or np.max(np.abs(signed_distance(rim.ellipse, predicted))) > farthest:
        return rim
    rays, jacobians = camera.rays_with_jacobian(rim.points)
    second = np.sqrt(np.trace(fit.covariance[k, 3:, 3:]) / 2.0)
    return replace(
        rim,
        cone=ConeFit(factor, rim_distance_px(factor, rays, jacobians)),
        ellipse=ellipse,
        rim_used=float(fit.rim_used[k]),
        polarity=-1 if fit.contrast_levels[k] > 0.0 else 1,
        axis_error_px=float(2.0 * second * ellipse.semi_major),
        modes_covariance=fit.covariance[k],
    )
