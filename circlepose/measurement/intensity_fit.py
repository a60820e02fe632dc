"""Measured rims -> the same, fitted to the grey levels around them, with a covariance. Many rims at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from circlepose._batching import rows
from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.imaging.float_levels import without_gaps
from circlepose.measurement.acceptance import accepted
from circlepose.measurement.edge_fit import Rim, with_edges_placed
from circlepose.photometry.binary_mask import with_mask_scaled
from circlepose.photometry.fit import fit_to_levels
from circlepose.photometry.initialization import first_information, is_curved, level_limits, start_blur
from circlepose.photometry.levels_fit import BlurPrior
from circlepose.photometry.neighbors import bands_that_meet, neighbor_intensity
from circlepose.photometry.options import DEFAULT as PHOTOMETRY
from circlepose.photometry.pixel_band import bands_around, outer_samples

_MOST_PIXELS = 22_000
_TIGHT = 0.03
"""Standard deviation of the inequality of the blur, after all rims have told of it."""
_LEAST_UNEQUAL = 0.1
"""Less is not told from texture."""
_MANY = 5
"""Rims that tell of the blur that they share."""
_LEAST_WIDTH_PX = 4.0
"""Semi-minor axis of a thin rim that was fitted as a whole, from which its levels are fitted again. On narrower ones
the freedom of the levels costs more than it gains: from 3 px on, lengths are often off by more than three sigmas."""
_SMALL_PX = 20.0
"""Semi-minor axis below which unequal blur passes for a tilt."""


def refined(grey: Image, camera: Camera, rims: Sequence[Rim]) -> list[Rim]:
    """Fit the rims to the levels of `grey` (h, w); a rim whose levels tell nothing better stays as it is.

    Pixels without a level (NaN) do not count.
    """
    whole = without_gaps(grey)
    grey = with_mask_scaled(grey, [rim.ellipse for rim in rims])
    limits = level_limits(grey)
    done = list(rims)
    unfitted = [rim.modes_covariance is None and rim.ellipse_covariance is None for rim in rims]
    open_ = [i for i, rim in enumerate(rims) if unfitted[i] or _has_two_sides(rim)]
    many = len(open_) >= _MANY
    reach = np.full(len(rims), PHOTOMETRY.band_half_width_px)
    blur = start_blur(len(rims))
    variance = np.full((len(rims), 3), np.inf)
    contrast = np.zeros(len(rims))
    small = np.array([float(rim.ellipse.semi_minor) < _SMALL_PX for rim in rims])
    ellipses = [rim.ellipse for rim in rims]
    for again in (False, True):
        sigma = np.exp(blur[:, 0])
        blurred = PHOTOMETRY.band_half_width_sigmas * sigma > 1.1 * reach
        crowded = bands_that_meet(ellipses, reach + PHOTOMETRY.band_half_width_sigmas * sigma, contrast)
        first = BlurPrior(blur * [1.0, 0.0, 0.0], first_information(len(rims)))
        expected = _expected(blur, variance) if again and many else first
        is_unequal = many and expected.mean[:, 1:].any()
        order = [i for i in open_ if not again or blurred[i] or crowded[i] or (small[i] and is_unequal)]
        if not order:
            break
        order.sort(key=lambda i: (is_curved(rims[i].ellipse), _perimeter(rims[i])))
        if again:
            reach = np.where(blurred, PHOTOMETRY.band_half_width_sigmas * sigma, reach)
        neighbours = (ellipses, sigma, contrast.copy())
        fits: dict[int, Rim] = {}
        for chunk in _chunks(order, rims, reach):
            which = np.array(chunk)
            around = [done[i].ellipse for i in chunk]
            bands = bands_around(grey, camera, around, reach[which])
            fit = fit_to_levels(
                bands,
                np.stack([done[i].cone.factor for i in chunk]),
                blur[which],
                rows(expected, which),
                np.array([_perimeter(rims[i]) for i in chunk]),
                limits,
                neighbors=neighbor_intensity(bands.pixels, which, *neighbours, reach),
                outer=outer_samples(grey, camera, around, reach[which], limits),
                is_curved=is_curved(rims[chunk[0]].ellipse),
            )
            found = accepted(grey, camera, [rims[i] for i in chunk], fit, ~crowded[which])
            fits.update(zip(chunk, found, strict=True))
            for k, i in enumerate(chunk):
                if fit.converged[k]:
                    blur[i], variance[i], contrast[i] = fit.blur[k], fit.blur_variance[k], fit.contrast_levels[k]
        for i, rim in fits.items():
            done[i] = rim
        ellipses = [rim.ellipse for rim in done]
    for i in open_:
        if done[i] is rims[i] and rims[i].modes_covariance is None:
            placed = rims[i] if rims[i].is_placed else with_edges_placed(whole, camera, rims[i])
            done[i] = replace(placed or rims[i], is_edges_only=True)
    return done


def _has_two_sides(rim: Rim) -> bool:
    """Tell whether blur leaves the sides of a rim apart, so that levels inside and outside can be shaded."""
    return float(rim.ellipse.semi_minor) > _LEAST_WIDTH_PX


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


def _expected(blur: FloatArray, variance: FloatArray) -> BlurPrior:
    """Return what the blurs of all rims say of each: unequal blur is the camera's, and much the same for all."""
    posterior = 1.0 / variance[:, 1:]
    told = np.where(posterior > 0.0, posterior - PHOTOMETRY.anisotropy_sigma**-2, 0.0).sum(axis=0)
    mean = (posterior * blur[:, 1:]).sum(axis=0) / np.maximum(told, PHOTOMETRY.anisotropy_sigma**-2)
    if np.hypot(*mean) < _LEAST_UNEQUAL:
        mean = np.zeros(2)
    count = len(blur)
    return BlurPrior(
        np.column_stack([blur[:, 0], np.tile(mean, (count, 1))]), np.tile([0.0, *[_TIGHT**-2] * 2], (count, 1))
    )
