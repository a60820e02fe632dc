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
from circlepose.fitting.neighbours import bands_that_meet, light_of_neighbours
from circlepose.fitting.photometric import Expected, LevelsFit, fit_to_levels
from circlepose.fitting.setting import (
    LOOSE,
    REACH_PX,
    REACH_SIGMA,
    first_information,
    is_curved,
    level_limits,
    start_blur,
)
from circlepose.fitting.viewing_cone import ConeFit, rim_distance_px
from circlepose.measure import Rim, rim_pixels, with_edges_placed

_MOST_PIXELS = 60_000
_WORST_NOISE = 0.3
_FARTHEST_PX = 2.5
_FULL_RIM = 0.9
_FARTHEST_HIDDEN_PX = 0.05
_LEAST_AGAIN = 0.75
_LEAST_RIM = 0.2
_TIGHT = 0.03
"""Standard deviation of the inequality of the blur, after all rims have told of it."""
_LEAST_UNEQUAL = 0.1
"""Less is not told from texture."""
_ODD, _TINY_PX = 3.0, 7.0
"""Residuals so many times the image's noise are none, on a disc of a semi-minor axis below the second."""
_LEAST_SIGMAS = 2.5
"""Semi-minor axis, in blurs, below which width and blur are hard to tell apart."""
_WILD = 0.12
"""The same of any disc, where they are more than this share of the contrast."""
_NOISE_ROWS = 64
_LEAST_NOISE = 0.5
_MANY = 5
"""Rims that tell of the blur that they share."""
_SMALL_PX = 20.0
"""Semi-minor axis below which unequal blur passes for a tilt."""


def refined(grey: Image, camera: Camera, rims: Sequence[Rim]) -> list[Rim]:
    """Fit the rims to the levels of `grey` (h, w); a rim whose levels tell nothing better stays as it is."""
    limits = level_limits(grey)
    odd_noise = _ODD * noise_of(grey)
    done = list(rims)
    open_ = [i for i, rim in enumerate(rims) if rim.modes_covariance is None]
    reach = np.full(len(rims), REACH_PX)
    blur = start_blur(len(rims))
    variance = np.full((len(rims), 3), np.inf)
    contrast = np.zeros(len(rims))
    ellipses = [rim.ellipse for rim in rims]
    for again in (False, True):
        sigma = np.exp(blur[:, 0])
        blurred = REACH_SIGMA * sigma > 1.1 * reach
        crowded = bands_that_meet(ellipses, reach + REACH_SIGMA * sigma, contrast)
        small = np.array([float(rim.ellipse.semi_minor) < _SMALL_PX for rim in rims])
        order = [i for i in open_ if not again or blurred[i] or crowded[i] or (small[i] and len(open_) >= _MANY)]
        order.sort(key=lambda i: (is_curved(rims[i].ellipse), _perimeter(rims[i])))
        expected = _expected(blur, variance) if again else Expected(blur, first_information(len(rims)))
        if again:
            reach = np.where(blurred, REACH_SIGMA * sigma, reach)
        neighbours = (ellipses, sigma, contrast.copy())
        fits = {}
        for chunk in _chunks(order, rims, reach):
            bands = bands_around(grey, camera, [done[i].ellipse for i in chunk], reach[chunk])
            beside = light_of_neighbours(bands.pixels, np.array(chunk), *neighbours, reach)
            perimeter = np.array([_perimeter(rims[i]) for i in chunk])
            factors = np.stack([done[i].cone.factor for i in chunk])
            some = Expected(expected.mean[chunk], expected.information[chunk])
            fit = fit_to_levels(
                bands,
                factors,
                blur[chunk],
                some,
                perimeter,
                limits,
                beside=beside,
                is_curved=is_curved(rims[chunk[0]].ellipse),
            )
            for k, i in enumerate(chunk):
                fits[i] = _accepted(camera, rims[i], fit, k, odd_noise, lone=not crowded[i])
                if fit.converged[k]:
                    blur[i], variance[i], contrast[i] = fit.blur[k], fit.blur_variance[k], fit.contrast_levels[k]
        for i, rim in fits.items():
            done[i] = rim
        ellipses = [rim.ellipse for rim in done]
    for i in open_:
        if done[i] is rims[i]:
            done[i] = replace(with_edges_placed(grey, camera, rims[i]) or rims[i], is_edges_only=True)
    return done


def noise_of(grey: Image) -> float:
    """Return about the standard deviation of the noise in `grey` (h, w), levels, from neighbours in sampled rows."""
    rows = grey[:: max(1, grey.shape[0] // _NOISE_ROWS)].astype(np.float64)
    if rows.shape[1] < 3:
        return _LEAST_NOISE
    bends = rows[:, 1:-1] - (rows[:, :-2] + rows[:, 2:]) / 2.0
    return max(1.4826 * float(np.median(np.abs(bends))) / np.sqrt(1.5), _LEAST_NOISE)


def _perimeter(rim: Rim) -> float:
    return float(np.pi * (rim.ellipse.semi_major + rim.ellipse.semi_minor))


def _chunks(order: Sequence[int], rims: Sequence[Rim], reach: FloatArray) -> Iterator[list[int]]:
    chunk: list[int] = []
    for i in order:
        longest = 2.2 * reach[i] * _perimeter(rims[i])
        if chunk and (
            (len(chunk) + 1) * longest > _MOST_PIXELS
            or is_curved(rims[i].ellipse) != is_curved(rims[chunk[0]].ellipse)
        ):
            yield chunk
            chunk = []
        chunk.append(i)
    if chunk:
        yield chunk


def _accepted(camera: Camera, rim: Rim, fit: LevelsFit, k: int, odd_noise: float, *, lone: bool) -> Rim:
    factor = fit.factors[k]
    noise = fit.noise_levels[k] / max(abs(float(fit.contrast_levels[k])), 1e-9)
    # Of a tiny disc the levels tell no more than the edges where they are not understood.
    is_tiny = lone and float(rim.ellipse.semi_minor) < _TINY_PX
    is_odd = fit.noise_levels[k] > odd_noise and (is_tiny or noise > _WILD)
    is_blob = float(rim.ellipse.semi_minor) < _LEAST_SIGMAS * np.exp(fit.blur[k, 0])
    if not fit.converged[k] or noise >= _WORST_NOISE or is_odd or is_blob or fit.rim_used[k] <= _LEAST_RIM:
        return rim
    predicted = rim_pixels(camera, factor, 90)
    ellipse = fit_ellipse(predicted)
    # What hides a part of a rim has levels of its own, which pull: there the edges that agree have the last word.
    hidden = rim.rim_used < _FULL_RIM
    if fit.rim_used[k] < _LEAST_AGAIN * rim.rim_used:
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


def _expected(blur: FloatArray, variance: FloatArray) -> Expected:
    """Return what the blurs of all rims say of each: unequal blur is the camera's, and much the same for all."""
    posterior = 1.0 / variance[:, 1:]
    told = np.where(posterior > 0.0, posterior - LOOSE**-2, 0.0).sum(axis=0)
    mean = (posterior * blur[:, 1:]).sum(axis=0) / np.maximum(told, LOOSE**-2)
    if np.hypot(*mean) < _LEAST_UNEQUAL:
        mean = np.zeros(2)
    count = len(blur)
    return Expected(
        np.column_stack([blur[:, 0], np.tile(mean, (count, 1))]), np.tile([0.0, *[_TIGHT**-2] * 2], (count, 1))
    )
