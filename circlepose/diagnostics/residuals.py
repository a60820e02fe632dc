"""What the levels around a rim say against its pose: the model, evaluated again pixel by pixel.

For a person to look at; the fit itself is `photometry.fit`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._numerics import ROUNDING_VARIANCE
from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.geometry.conic import Ellipse
from circlepose.photometry.binary_mask import with_mask_scaled
from circlepose.photometry.edge_spread import curved_edge_spread, straight_edge_spread
from circlepose.photometry.fit import fit_to_levels
from circlepose.photometry.initialization import first_information, is_curved, level_limits, start_blur
from circlepose.photometry.intensity_model import DesignMatrix, fit_levels
from circlepose.photometry.levels_fit import BlurPrior, LevelsFit
from circlepose.photometry.neighbors import bands_that_meet, neighbor_intensity
from circlepose.photometry.options import DEFAULT as PHOTOMETRY
from circlepose.photometry.pixel_band import Bands, bands_around, outer_samples
from circlepose.photometry.rim_coordinates import rim_coordinates

_AT_RIM_SIGMA = 2.0
_FIRST_ORDER_PX = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class LevelResiduals:
    """The k pixels in a band around one rim, and the blurred edge that explains them best; levels are grey levels."""

    pixels: FloatArray
    """(k, 2)"""
    distance_px: FloatArray
    """(k,) from the rim of the pose, positive outside"""
    measured: FloatArray
    """(k,) levels"""
    model: FloatArray
    """(k,) with what other rims close by add"""
    slope: FloatArray
    """(k,) change of the model when the rim grows by 1 px there; 0 of pixels that are left out"""
    in_use: BoolArray
    """(k,) those that the fit rests on"""
    clipped: BoolArray
    """(k,) darkest or brightest that a pixel can be; left out where the light may be beyond"""
    reach_px: float
    sigma_px: float
    """blur, the pixel's own box included"""
    unequal: tuple[float, float]
    """how the blur's variance differs by direction: cos and sin of twice the angle; see `edge_spread`"""
    noise_levels: float
    """standard deviation of the residuals in use about this model"""
    contrast_levels: float
    """inside minus outside"""
    correlation: float
    """how much more the residuals of neighbours add up to than independent ones; 1 is independent"""
    rim_used: float
    """share of the rim that the levels were used of"""
    converged: bool

    @property
    def residual(self) -> FloatArray:
        """Model minus measured, (k,)."""
        return self.model - self.measured

    @property
    def crosses(self) -> BoolArray:
        """Tell (k,) what is left out at the rim itself: something hides, touches or crosses it there."""
        return ~self.in_use & ~self.clipped & (np.abs(self.distance_px) <= _AT_RIM_SIGMA * self.sigma_px)

    @property
    def beside(self) -> BoolArray:
        """Tell (k,) what is left out beside the rim: another edge, texture or a shadow."""
        return ~self.in_use & ~self.clipped & ~self.crosses


def level_residuals(
    grey: Image, camera: Camera, ellipses: Sequence[Ellipse], factors: Sequence[FloatArray]
) -> list[LevelResiduals | None]:
    """Evaluate the levels of `grey` (h, w) around rims, given by their image ellipses and the cones of their poses.

    The levels are fitted anew, and the model then put at the cone that was given: what it misses there is told. None
    of a rim whose band has next to no pixels.
    """
    grey = with_mask_scaled(grey, ellipses)
    first = [
        _fit(grey, camera, e, f, PHOTOMETRY.band_half_width_px, start_blur(1)[0], None)
        for e, f in zip(ellipses, factors, strict=True)
    ]
    # Of a rim whose levels are not understood, what it adds to those of others is not known.
    known = [fit if fit is not None and fit.converged[0] else None for _, fit in first]
    blur = np.array([start_blur(1)[0] if fit is None else fit.blur[0] for fit in known]).reshape(-1, 3)
    contrast = np.array([0.0 if fit is None else fit.contrast_levels[0] for fit in known])
    sigma = np.exp(blur[:, 0])
    reach = np.maximum(PHOTOMETRY.band_half_width_px, PHOTOMETRY.band_half_width_sigmas * sigma)
    meeting = bands_that_meet(ellipses, reach + PHOTOMETRY.band_half_width_sigmas * sigma, contrast)
    found = []
    for number, (ellipse, factor) in enumerate(zip(ellipses, factors, strict=True)):
        bands, fit = first[number]
        beside = np.zeros(bands.levels.shape)
        if meeting[number] or reach[number] > PHOTOMETRY.band_half_width_px:
            bands = bands_around(grey, camera, [ellipse], reach[[number]])
            beside = neighbor_intensity(bands.pixels, np.array([number]), ellipses, sigma, contrast, reach)
            bands, fit = _fit(grey, camera, ellipse, factor, reach[number], blur[number], beside)
        found.append(None if fit is None else _residuals(bands, fit, ellipse, factor, beside, reach[number], grey))
    return found


def edge_offsets(levels: LevelResiduals, place: FloatArray, number: int) -> tuple[FloatArray, FloatArray]:
    """Return how far outside the rim of the pose the edge is, px (number,), in equal stretches, and its error.

    `place` (k,) of each pixel along the rim, 0 to 1. NaN where too little is in use.
    """
    stretch = np.minimum((place * number).astype(np.int64), number - 1)
    used = levels.in_use
    told = np.bincount(stretch[used], (levels.slope**2)[used], number)
    pull = np.bincount(stretch[used], (-levels.residual * levels.slope)[used], number)
    enough = told > max(levels.noise_levels**2, 1e-9)
    told = np.where(enough, told, np.nan)
    return pull / told, levels.noise_levels / np.sqrt(told)


def _fit(
    grey: Image,
    camera: Camera,
    ellipse: Ellipse,
    factor: FloatArray,
    reach_px: float,
    blur: FloatArray,
    beside: FloatArray | None,
) -> tuple[Bands, LevelsFit | None]:
    reach, limits = np.array([reach_px]), level_limits(grey)
    bands = bands_around(grey, camera, [ellipse], reach)
    if float(bands.weight.sum()) < 2.0 or not np.all(np.isfinite(factor)):
        return bands, None
    perimeter = np.pi * float(ellipse.semi_major + ellipse.semi_minor)
    fit = fit_to_levels(
        bands,
        factor[None],
        blur[None],
        BlurPrior(blur[None] * [1.0, 0.0, 0.0], first_information(1)),
        np.array([perimeter]),
        limits,
        neighbors=beside,
        outer=outer_samples(grey, camera, [ellipse], reach, limits),
        is_curved=is_curved(ellipse),
    )
    return bands, fit


def _residuals(
    bands: Bands,
    fit: LevelsFit,
    ellipse: Ellipse,
    factor: FloatArray,
    beside: FloatArray,
    reach_px: float,
    grey: Image,
) -> LevelResiduals:
    low, high = level_limits(grey)
    clipped = (bands.levels[0] <= low) | (bands.levels[0] >= high)
    bands = bands.less(beside).weighted(fit.weight)
    at = rim_coordinates(bands, factor[None])
    model, slope = _model(bands, fit, fit.factors, ellipse)
    # The levels belong to the rim that they were fitted with: they would take up a third of a step aside.
    aside = (at.distance_px - rim_coordinates(bands, fit.factors).distance_px)[0]
    if fit.converged[0] and float(np.max(np.abs(aside))) < _FIRST_ORDER_PX:
        model = model - slope * aside
    else:
        model, slope = _model(bands, fit, factor[None], ellipse)
    in_use = np.asarray(fit.weight[0] > 0.0)
    model, measured = model + beside[0], np.asarray(bands.levels[0], dtype=np.float64) + beside[0]
    square = float(np.mean((model - measured)[in_use] ** 2)) if in_use.any() else 0.0
    return LevelResiduals(
        pixels=bands.pixels[0],
        distance_px=np.asarray(at.distance_px[0], dtype=np.float64),
        measured=measured,
        model=model,
        slope=slope,
        in_use=in_use,
        clipped=clipped & ~in_use,
        reach_px=float(reach_px),
        sigma_px=float(np.exp(fit.blur[0, 0])),
        unequal=(float(fit.blur[0, 1]), float(fit.blur[0, 2])),
        noise_levels=float(np.sqrt(max(square, ROUNDING_VARIANCE))),
        contrast_levels=float(fit.contrast_levels[0]),
        correlation=float(fit.correlation[0]),
        rim_used=float(fit.rim_used[0]),
        converged=bool(fit.converged[0]),
    )


def _model(bands: Bands, fit: LevelsFit, factors: FloatArray, ellipse: Ellipse) -> tuple[FloatArray, FloatArray]:
    """Return the model's levels (k,) with the rim of `factors` (1, 3, 3), and their change per px of its growth."""
    at = rim_coordinates(bands, factors)
    share = (curved_edge_spread if is_curved(ellipse) else straight_edge_spread)(at, fit.blur)
    levels = fit_levels(DesignMatrix.of(bands, at, share), fit.prior_precision)
    # The first mode is a growth of the rim as a share of its radius.
    slope = levels.slopes[0, 0] * (at.radial_across / np.maximum(at.radius, 1e-9))[0]
    return np.asarray(levels.model[0], dtype=np.float64), np.asarray(slope, dtype=np.float64)
