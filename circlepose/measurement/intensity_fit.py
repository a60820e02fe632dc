"""Rims -> the same rims fitted to the gray levels around them, with a covariance. Many rims at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from circlepose._batching import rows
from circlepose._typing import FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.fitting.edge_covariance import edge_covariance
from circlepose.fitting.observations import Observations
from circlepose.imaging.float_levels import without_gaps
from circlepose.measurement.acceptance import accepted
from circlepose.measurement.edge_fit import with_edges_located
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.measurement.rim import EdgeRim, FittedRim, Rim, blur_px
from circlepose.photometry.binary_mask import with_mask_scaled
from circlepose.photometry.fit import fit_to_levels
from circlepose.photometry.initialization import (
    first_information,
    is_curved,
    level_limits,
    start_blur,
)
from circlepose.photometry.levels_fit import BlurPrior, LevelsFit
from circlepose.photometry.neighbors import bands_that_meet, neighbor_intensity
from circlepose.photometry.pixel_band import Bands, bands_around, outer_samples
from circlepose.results import Failure


@dataclass(frozen=True, slots=True, eq=False)
class LevelFit:
    """The last fit to the gray levels around one rim, and the pixels that it used. First axes have length 1."""

    is_curved: bool
    """whether the curvature of the rim is part of the model"""
    half_width_px: float
    """of the band, to either side of the rim"""
    bands: Bands
    """(1, k) the pixels, with their own levels"""
    fit: LevelsFit
    neighbors: FloatArray
    """(1, k) levels that the rims of neighbors add"""
    limits: tuple[float, float]
    """levels at which the image is clipped"""
    is_accepted: bool
    """whether the rim is that of the fit"""


@dataclass(frozen=True, slots=True, eq=False)
class LevelFits:
    """Rims after their fit to the gray levels."""

    rims: list[Rim]
    fits: list[LevelFit | None]
    """of each rim; None where none was made, or none was to be kept"""


def refined(gray: Image, camera: Camera, rims: Sequence[Rim], *, options: MeasurementOptions = DEFAULT) -> list[Rim]:
    """Return the rims of `fit_levels`."""
    return fit_levels(gray, camera, rims, options=options).rims


def fit_levels(
    gray: Image,
    camera: Camera,
    rims: Sequence[Rim],
    *,
    whole: Image | None = None,
    full_scale: int | None = None,
    keep_fits: bool = False,
    options: MeasurementOptions = DEFAULT,
) -> LevelFits:
    """Fit rims to the gray levels around them.

    Parameters
    ----------
    gray
        (h, w) levels; NaN where a pixel has none.
    camera
        The calibration for this image size.
    rims
        The rims at which the fits begin.
    whole
        (h, w) the levels without gaps; by default those of the nearest pixels fill these.
    full_scale
        The highest level that the image can have, where `gray` is of a wider type.
    keep_fits
        Whether to return the fits with their pixels, some 100 kB a rim.
    options
        The numbers of the measurement.

    Returns
    -------
    The rims in the same order. A rim whose fit is rejected is that of its edges, with the reason.
    """
    photometry = options.photometry
    if whole is None:
        whole = without_gaps(gray)
    scaled = with_mask_scaled(gray, [rim.ellipse for rim in rims], options=photometry)
    limits = level_limits(scaled, None if scaled is not gray else full_scale, options=photometry)
    gray = scaled
    done: list[FittedRim | Failure | None] = [None] * len(rims)
    kept: list[LevelFit | None] = [None] * len(rims)
    chosen = [i for i, rim in enumerate(rims) if isinstance(rim, EdgeRim) or _has_two_sides(rim, options)]
    are_many = len(chosen) >= options.least_rims_for_blur
    known_px = np.array([blur_px(rim) for rim in rims])
    blur = start_blur(known_px, options=photometry)
    half_width = np.maximum(
        photometry.band_half_width_px, photometry.band_half_width_sigmas * np.exp(blur[:, 0]) * (known_px > 0.0)
    )
    curved = [
        is_curved(rim.ellipse, float(width), options=photometry) for rim, width in zip(rims, known_px, strict=True)
    ]
    variance = np.full((len(rims), 3), np.inf)
    contrast = np.zeros(len(rims))
    is_small = np.array([float(rim.ellipse.semi_minor) < options.small_px for rim in rims])
    ellipses = [rim.ellipse for rim in rims]
    for turn in range(3 if np.any(known_px > 0.0) else 2):
        again = turn > 0
        sigma = np.exp(blur[:, 0])
        is_blurred = photometry.band_half_width_sigmas * sigma > 1.1 * half_width
        is_crowded = bands_that_meet(
            ellipses, half_width + photometry.band_half_width_sigmas * sigma, contrast, options=photometry
        )
        prior = BlurPrior(blur * [1.0, 0.0, 0.0], first_information(len(rims), options=photometry))
        if again and are_many:
            prior = _shared_blur(blur, variance, options)
        is_unequal = are_many and prior.mean[:, 1:].any()
        order = [i for i in chosen if not again or is_blurred[i] or is_crowded[i] or (is_small[i] and is_unequal)]
        if turn == 2:
            # A wide blur is far from where the first fit starts.
            order = [i for i in chosen if known_px[i] > 0.0]
        if not order:
            break
        order.sort(key=lambda i: (curved[i], _perimeter(rims[i])))
        if again:
            half_width = np.where(is_blurred, photometry.band_half_width_sigmas * sigma, half_width)
        neighbors = (ellipses, sigma, contrast.copy())
        latest = _current(rims, done)
        for chunk in _chunks(order, rims, curved, half_width, options):
            which = np.array(chunk)
            around = [latest[i].ellipse for i in chunk]
            bands = bands_around(gray, camera, around, half_width[which])
            beside = neighbor_intensity(bands.pixels, which, *neighbors, half_width, options=photometry)
            fit = fit_to_levels(
                bands,
                np.stack([latest[i].cone.factor for i in chunk]),
                blur[which],
                rows(prior, which),
                np.array([_perimeter(rims[i]) for i in chunk]),
                limits,
                neighbors=beside,
                outer=outer_samples(gray, camera, around, half_width[which], limits, options=photometry),
                is_curved=curved[chunk[0]],
                options=photometry,
            )
            found = accepted(gray, camera, [rims[i] for i in chunk], fit, ~is_crowded[which], options)
            for k, i in enumerate(chunk):
                done[i] = found[k]
                if keep_fits:
                    kept[i] = LevelFit(
                        curved[i],
                        float(half_width[i]),
                        *_without_padding(k, bands, fit, beside),
                        limits,
                        is_accepted=isinstance(found[k], FittedRim),
                    )
                if fit.converged[k]:
                    blur[i], variance[i], contrast[i] = fit.blur[k], fit.blur_variance[k], fit.contrast_levels[k]
        ellipses = [rim.ellipse for rim in _current(rims, done)]
    return LevelFits(
        [_after_fit(whole, camera, rim, fitted, options) for rim, fitted in zip(rims, done, strict=True)], kept
    )


def _current(rims: Sequence[Rim], done: Sequence[FittedRim | Failure | None]) -> list[Rim]:
    """Return the rims as they were fitted last; those without an accepted fit as they were."""
    return [fitted if isinstance(fitted, FittedRim) else rim for rim, fitted in zip(rims, done, strict=True)]


def _after_fit(
    levels: Image, camera: Camera, rim: Rim, fitted: FittedRim | Failure | None, options: MeasurementOptions
) -> Rim:
    """Return the rim after its fit; where that was rejected, an edge rim on edges located along it."""
    if isinstance(fitted, FittedRim):
        return fitted
    if fitted is None or isinstance(rim, FittedRim):
        return rim
    is_settled = rim.is_located_anew or blur_px(rim) > 0.0
    located = rim if is_settled else with_edges_located(levels, camera, rim, options=options)
    edges = rim if isinstance(located, Failure) else located
    covariance = None
    if rim.contour is not None and rim.contour.ragged > options.least_ragged:
        seen = Observations.of(camera, edges.points)
        covariance = edge_covariance(edges.cone.factor, seen.rays, seen.jacobians)
    return replace(edges, level_fit=fitted, modes_covariance=covariance)


def _without_padding(
    number: int, bands: Bands, fit: LevelsFit, neighbors: FloatArray
) -> tuple[Bands, LevelsFit, FloatArray]:
    """Return what belongs to rim `number` of a batch, without the pixels that pad it."""
    counted = np.flatnonzero(bands.weight[number])
    end = int(counted[-1]) + 1 if len(counted) else 0
    row = slice(number, number + 1)
    own = Bands(bands.levels[row, :end], bands.weight[row, :end], bands.rays[row, ..., :end], bands.pixels[row, :end])
    return own, replace(rows(fit, row), weight=fit.weight[row, :end]), neighbors[row, :end]


def _has_two_sides(rim: Rim, options: MeasurementOptions) -> bool:
    """Whether blur leaves the sides of a thin rim apart, so that levels inside and outside can be shaded."""
    return float(rim.ellipse.semi_minor) > options.least_refit_px


def _perimeter(rim: Rim) -> float:
    return float(rim.ellipse.perimeter)


def _chunks(
    order: Sequence[int],
    rims: Sequence[Rim],
    curved: Sequence[bool],
    half_width: FloatArray,
    options: MeasurementOptions,
) -> Iterator[list[int]]:
    """Yield the rims of `order` in parts that are fitted at once: of one kind, and not too many pixels."""
    chunk: list[int] = []
    for i in order:
        longest = 2.2 * half_width[i] * _perimeter(rims[i])
        if chunk and ((len(chunk) + 1) * longest > options.most_pixels or curved[i] != curved[chunk[0]]):
            yield chunk
            chunk = []
        chunk.append(i)
    if chunk:
        yield chunk


def _shared_blur(blur: FloatArray, variance: FloatArray, options: MeasurementOptions) -> BlurPrior:
    """Return a prior for each blur from all of them: unequal blur is the camera's, and much the same for all."""
    posterior = 1.0 / variance[:, 1:]
    information = np.where(posterior > 0.0, posterior - options.photometry.anisotropy_sigma**-2, 0.0).sum(axis=0)
    mean = (posterior * blur[:, 1:]).sum(axis=0) / np.maximum(information, options.photometry.anisotropy_sigma**-2)
    if np.hypot(*mean) < options.least_blur_inequality:
        mean = np.zeros(2)
    count = len(blur)
    return BlurPrior(
        np.column_stack([blur[:, 0], np.tile(mean, (count, 1))]),
        np.tile([0.0, *[options.shared_blur_sigma**-2] * 2], (count, 1)),
    )
