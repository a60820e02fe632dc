"""Grey levels -> viewing cones, by a blurred edge fitted to the pixels around each rim. Many rims at once.

A descent (`descent`) over the five `rim_modes` and the blur of each rim, the levels eliminated (`blurred_edge`).
Stretches of the rim whose residuals are unlike the others' (something hides or touches the rim there) are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._batching import put_rows, rows
from circlepose._typing import BoolArray, FloatArray, IntArray, RealArray
from circlepose.geometry.cone_perturbation import MODES
from circlepose.photometry.edge_spread import BLUR, curved, straight
from circlepose.photometry.gauss_newton import SHORT_FIRST, Descent, Seen, Shares, descend, with_prior
from circlepose.photometry.intensity_model import (
    FINEST,
    FINEST_CURVED,
    LINEAR,
    Equations,
    Levels,
    fit_levels,
    stiffness,
    textures,
)
from circlepose.photometry.intensity_prior import FarLevels
from circlepose.photometry.occlusion import AT_RIM, QUANTIZATION
from circlepose.photometry.pixel_band import Bands, Beyond
from circlepose.photometry.pixel_selection import Pixels
from circlepose.photometry.residual_correlation import correlation_of

_ROUNDS = 3
_FEW_PIXELS = 800
"""A band several times longer is fitted to about so many of its pixels first."""
_LEAST_PIXELS = 40
_LEAST_MOTTLED_PX = 80.0
"""Perimeter from which texture is looked for."""
_WORST_CONDITION = 1e14
_RIDGE = 1e-12
_SHOWS = 4.0
"""Log likelihood by which levels with texture are to be preferred."""
_LOOSE_TEXTURE, _TEXTURE_SIZES = 0.1, np.geomspace(1e-3, 0.1, 13)
"""Standard deviation of its levels before it is known, and those tried, as a share of the contrast."""


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """What is known of the blurs of m rims before their pixels are seen."""

    mean: FloatArray
    """(m, 3)"""
    information: FloatArray
    """(m, 3) inverse variances; 0 where nothing is known"""


@dataclass(frozen=True, slots=True, eq=False)
class LevelsFit:
    """Blurred edges fitted to the levels around m rims."""

    factors: FloatArray
    """(m, 3, 3) of the viewing cones"""
    covariance: FloatArray
    """(m, 5, 5) of the `rim_modes` of these factors, with blur and levels unknown"""
    blur: FloatArray
    """(m, 3), see `blurred_share`; the pixel's box included"""
    blur_variance: FloatArray
    """(m, 3)"""
    noise_levels: FloatArray
    """(m,) standard deviation of the residuals"""
    correlation: FloatArray
    """(m,) variance of what neighbouring residuals add up to, relative to independent ones; in the covariance"""
    contrast_levels: FloatArray
    """(m,) inside minus outside"""
    rim_used: FloatArray
    """(m,) share of the rim that is not left out"""
    converged: BoolArray
    """(m,)"""
    weight: RealArray
    """(m, k) of the pixels, in the end"""
    stiff: FloatArray
    """(m, 11) of the levels, see `blurred_edge.stiffness`"""


def fit_to_levels(
    bands: Bands,
    factors: FloatArray,
    blur: FloatArray,
    expected: Expected,
    perimeter_px: FloatArray,
    limits: tuple[float, float] = (-np.inf, np.inf),
    *,
    beside: FloatArray | None = None,
    beyond: Beyond | None = None,
    is_curved: bool = False,
) -> LevelsFit:
    """Fit the cones of m rims, starting at `factors` (m, 3, 3) and `blur` (m, 3), of which something is `expected`.

    `perimeter_px` (m,) of the rims; levels at the `limits` are clipped, and say only that the light was beyond.
    `beside` (m, k) is what other rims close by add to the levels; pixels `beyond` the bands, inside and outside, pin
    the levels. With `is_curved` the curvature of the rims is met exactly, which takes longer.
    """
    shares = curved if is_curved else straight
    pixels = Pixels.of(bands, perimeter_px, limits, beside)
    bands = Bands(pixels.levels, bands.weight.copy(), bands.rays, bands.pixels)
    radius_px = perimeter_px / (2.0 * np.pi)
    if beside is not None:
        # What others add is not known that well: it may be uneven, as shading is on a large disc.
        radius_px = np.where(np.any(beside != 0.0, axis=1), np.inf, radius_px)
    told, bands, stretch, is_doubtful = _untextured(pixels, bands, factors, blur, expected, radius_px, shares, beyond)
    which = np.flatnonzero(told.converged & is_doubtful & (perimeter_px > _LEAST_MOTTLED_PX))
    if len(which):
        again, better = _textured(*rows((told, bands, expected, stretch, pixels.stretches), which), shares)
        put_rows(told, which[better], again)
    return told


def _untextured(
    pixels: Pixels,
    bands: Bands,
    factors: FloatArray,
    blur: FloatArray,
    expected: Expected,
    radius_px: FloatArray,
    shares: Shares,
    beyond: Beyond | None,
) -> tuple[LevelsFit, Bands, IntArray, BoolArray]:
    """Fit the rims with shading alone, in turn with which pixels tell.

    Returns also the bands with the weights in the end, the stretch (m, k) of each pixel, and where texture is likely.
    """
    seen, stiff = _plain_edge(bands, factors, blur, expected, radius_px, shares)
    state = fit_levels(seen.columns, stiff)
    weight = bands.weight.copy()
    now, left_out, stretch = pixels.telling(slice(None), seen, state, weight)
    which = np.flatnonzero(np.any(now != weight, axis=1))
    weight[which] = now[which]
    bands = bands.weighted(weight)
    variance = _variance(state.square, bands)
    if len(which):
        some = rows(bands, which)
        left = rows(seen, which).weighted(some)
        fewer = fit_levels(left.columns, stiff[which])
        variance[which] = _variance(fewer.square, some)
        stiff[which] = stiffness(variance[which], fewer.contrast, radius_px[which])
        put_rows((seen, state), which, (left, fit_levels(left.columns, stiff[which])))
    prior = variance[:, None] * expected.information
    start = state, state.normal_equations()
    far = None
    if beyond is not None:
        far = FarLevels.of(beyond, seen.factors, _levels_ahead(*start, prior, variance), variance)
        start = state.joined_with(far, start[1])
    fit = descend(bands, seen, shares, stiff, prior, expected.mean, far, start=start)
    # What is seen takes most of the memory: not twice.
    del state, start
    # Only rims of which something was left out look different now. (What is in `weight`, that is in `bands`.)
    for _ in range(_ROUNDS - 1 if len(which) else 0):
        now, left_out[which], stretch[which] = pixels.telling(which, fit.seen, fit.state, weight)
        changed = np.flatnonzero(np.any(now != weight[which], axis=1))
        if len(changed) == 0:
            break
        which = which[changed]
        weight[which] = now[changed]
        some = rows(bands, which)
        variance[which] = _variance(np.sum((fit.state.residual[which] * some.weight) ** 2, axis=1), some)
        stiff[which] = stiffness(variance[which], fit.state.contrast[which], radius_px[which])
        prior[which] = variance[which, None] * expected.information[which]
        setting = rows((stiff, prior, expected.mean, far), which)
        put_rows(fit, which, descend(some, rows(fit.seen, which).weighted(some), shares, *setting))
    rim_used = 1.0 - np.array([row[:n, AT_RIM].mean() for row, n in zip(left_out, pixels.stretches, strict=True)])
    told = _told(fit, bands, expected, stretch, pixels.stretches, rim_used, stiff)
    is_doubtful = told.correlation > 1.0
    return told, bands, stretch, is_doubtful if far is None else is_doubtful | ~far.goes_on


def _plain_edge(
    bands: Bands, factors: FloatArray, blur: FloatArray, expected: Expected, radius_px: FloatArray, shares: Shares
) -> tuple[Seen, FloatArray]:
    """Fit edges that are only blurred, as what departs from that could be taken for blur.

    On as many pixels as that needs; then the rims are seen by all. Returns also how stiff levels are from then on,
    (m, 11).
    """
    step = bands.levels.shape[1] // _FEW_PIXELS
    few = bands.thinned(step) if step > 1 else bands
    seen = Seen.of(few, factors, blur, shares)
    square, contrast = seen.columns.noise_and_contrast()
    variance = _variance(square, few)
    stiff = stiffness(variance, contrast, radius_px, plain=True)
    prior = variance[:, None] * expected.information
    fit = descend(few, seen, shares, stiff, prior, expected.mean, short=SHORT_FIRST)
    stiff = stiffness(_variance(fit.square, few), fit.state.contrast, radius_px)
    factors, blur, is_seen, seen = fit.factors, fit.blur, few is bands and fit.is_seen, fit.seen
    # What is seen takes most of the memory: not twice.
    del fit
    if not is_seen:
        del seen
        seen = Seen.of(bands, factors, blur, shares)
    return seen, stiff


def _textured(
    told: LevelsFit, bands: Bands, expected: Expected, stretch: IntArray, stretches: IntArray, shares: Shares
) -> tuple[LevelsFit, IntArray]:
    """Fit those rims again, with levels for texture of a size that shows in them; and tell which these are.

    What varies near the rim, inside and outside, would else be taken for an edge a little elsewhere. What is left out
    stays so: texture would explain a card over the rim, too.
    """
    finest = FINEST_CURVED if shares is curved else FINEST
    seen = Seen.of(bands, told.factors, told.blur, shares, finest=finest)
    kept = told.stiff.shape[1] // 2
    unknown = (told.noise_levels / (_LOOSE_TEXTURE * np.abs(told.contrast_levels))) ** 2
    loose = np.tile(unknown[:, None], textures(finest))
    stiff = np.concatenate([told.stiff[:, :kept], loose, told.stiff[:, kept:-1], loose, told.stiff[:, -1:]], axis=1)
    state = fit_levels(seen.columns, stiff)
    variance = _variance(state.square, bands, stiff.shape[1])
    prior = variance[:, None] * expected.information
    levels, covariance = _levels_ahead(state, state.normal_equations(), prior, variance)
    side = stiff.shape[1] // 2
    extra = np.r_[kept:side, side + kept : stiff.shape[1] - 1]
    sizes = np.abs(told.contrast_levels)[:, None] * _TEXTURE_SIZES
    texture, gain = _likeliest(levels[:, extra], covariance[:, extra[:, None], extra], sizes)
    stiff[:, kept:side] = stiff[:, side + kept : -1] = (variance / texture**2)[:, None]
    shows = np.flatnonzero(gain > _SHOWS)
    if len(shows) == 0:
        return rows(told, shows), shows
    if len(shows) < len(gain):
        told, bands, expected = rows((told, bands, expected), shows)
        stretch, stretches, stiff, prior = rows((stretch, stretches, stiff, prior), shows)
        seen = Seen.of(bands, told.factors, told.blur, shares, finest=finest)
    fit = descend(bands, seen, shares, stiff, prior, expected.mean)
    again = _told(fit, bands, expected, stretch, stretches, told.rim_used, told.stiff)
    converged = np.flatnonzero(again.converged)
    return rows(again, converged), shows[converged]


def _likeliest(levels: FloatArray, covariance: FloatArray, sizes: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return (m,) which of the `sizes` (m, n) of texture is the likeliest, and the log likelihood over that of none.

    From levels (m, l) that were measured with `covariance` (m, l, l).
    """
    spread, turn = np.linalg.eigh(covariance)
    square = (np.swapaxes(turn, -1, -2) @ levels[..., None])[..., 0] ** 2
    variances = np.maximum(spread, 1e-12)[:, None] + np.column_stack([np.zeros(len(sizes)), sizes])[..., None] ** 2
    likelihood = -0.5 * np.sum(np.log(variances) + square[:, None] / variances, axis=-1)
    best = np.argmax(likelihood[:, 1:], axis=1)
    rows = np.arange(len(sizes))
    return sizes[rows, best], likelihood[rows, 1 + best] - likelihood[:, 0]


def _told(
    fit: Descent,
    bands: Bands,
    expected: Expected,
    stretch: IntArray,
    stretches: IntArray,
    rim_used: FloatArray,
    stiff: FloatArray,
) -> LevelsFit:
    """Return a fit with what its residuals say of it; `stretch` (m, k) of each pixel, of `stretches` (m,)."""
    state = fit.state
    projected = state.projected_slopes(fit.equations)
    residual = state.residual + (fit.ahead.astype(projected.dtype)[:, None] @ projected)[:, 0]
    variance = _variance(np.einsum("mk,mk->m", residual, residual), bands)
    matrix = with_prior(fit.equations.matrix, variance[:, None] * expected.information)
    spread = np.linalg.eigvalsh(matrix)
    told = (np.sum(bands.weight, axis=1) >= _LEAST_PIXELS) & (spread[:, -1] < _WORST_CONDITION * spread[:, 0])
    matrix = np.where(told[:, None, None], matrix, np.eye(MODES + BLUR))
    inverse = np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    correlation = correlation_of(projected, residual, stretch, stretches, inverse, variance)
    covariance = inverse * variance[:, None, None]
    return LevelsFit(
        factors=fit.factors,
        covariance=covariance[:, :MODES, :MODES] * correlation[:, None, None],
        blur=fit.blur,
        blur_variance=np.einsum("mii->mi", covariance)[:, MODES:],
        noise_levels=np.sqrt(variance),
        correlation=correlation,
        contrast_levels=state.contrast,
        rim_used=rim_used,
        converged=fit.converged & told,
        weight=bands.weight,
        stiff=stiff,
    )


def _levels_ahead(
    state: Levels, equations: Equations, prior: FloatArray, variance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the levels (m, l) where the next step leads, and their covariance (m, l, l), the rim unknown."""
    matrix = with_prior(equations.matrix, prior)
    # Of a rim that has no pixels nothing is known.
    ridge = _RIDGE * np.trace(matrix, axis1=1, axis2=2) + _RIDGE
    inverse = np.linalg.inv(matrix + ridge[:, None, None] * np.eye(matrix.shape[1]))
    change = equations.made_up @ (inverse @ equations.gradient[..., None])
    covariance = np.linalg.inv(state.gram) + equations.made_up @ inverse @ equations.made_up.transpose(0, 2, 1)
    return state.levels + change[..., 0], covariance * variance[:, None, None]


def _variance(square: FloatArray, bands: Bands, levels: int = LINEAR) -> FloatArray:
    """Return the variance (m,) of the pixels about a model of so many `levels`, from the sum of squares (m,)."""
    counted = np.sum(bands.weight, axis=1)
    return np.maximum(square / np.maximum(counted - levels - MODES - BLUR, 1.0), QUANTIZATION)
