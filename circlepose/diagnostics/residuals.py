"""The gray levels around a rim against its pose: the model of the fit, evaluated pixel by pixel."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from circlepose._numerics import ROUNDING_VARIANCE
from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import ConeFit
from circlepose.geometry.ellipse import Ellipse
from circlepose.measurement import intensity_fit
from circlepose.measurement.intensity_fit import LevelFit
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.measurement.rim import EdgeRim
from circlepose.photometry.edge_spread import curved_edge_spread, straight_edge_spread
from circlepose.photometry.intensity_model import DesignMatrix, fit_levels
from circlepose.photometry.levels_fit import LevelsFit
from circlepose.photometry.pixel_band import Bands
from circlepose.photometry.rim_coordinates import rim_coordinates

_AT_RIM_SIGMA = 2.0
"""Blurs; a pixel this close to the rim lies at the rim itself; by eye."""
_FIRST_ORDER_PX = 0.5
"""px; distance of pose and fit up to which the model is moved to first order; by eye."""
_LEAST_PIXELS = 2.0
"""Sum of the weights below which nothing can be compared."""
_POINTS = 90


@dataclass(frozen=True, slots=True, eq=False)
class LevelResiduals:
    """The k pixels in a band around one rim, and the blurred edge that was fitted to them; levels are gray levels."""

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
    """(k,) those that the fit uses"""
    clipped: BoolArray
    """(k,) darkest or brightest that a pixel can be; left out where the intensity may be beyond"""
    half_width_px: float
    """of the band, to either side of the rim"""
    sigma_px: float
    """blur, the pixel's own box included"""
    unequal: tuple[float, float]
    """by how much the variance of the blur differs by direction: cos and sin of twice the angle"""
    noise_levels: float
    """standard deviation of the residuals in use about this model"""
    contrast_levels: float
    """inside minus outside"""
    correlation: float
    """variance of sums of neighboring residuals over that of independent ones; 1 is independent"""
    rim_used: float
    """share of the rim whose levels are used"""
    converged: bool
    is_used: bool
    """whether the rim of the estimate is that of this fit"""

    @property
    def residual(self) -> FloatArray:
        """Model minus measured, (k,)."""
        return self.model - self.measured

    @property
    def crosses(self) -> BoolArray:
        """(k,) what is left out at the rim itself: something hides, touches or crosses it there."""
        return ~self.in_use & ~self.clipped & (np.abs(self.distance_px) <= _AT_RIM_SIGMA * self.sigma_px)

    @property
    def beside(self) -> BoolArray:
        """(k,) what is left out beside the rim: another edge, texture or a shadow."""
        return ~self.in_use & ~self.clipped & ~self.crosses


def level_residuals(
    levels: Image,
    camera: Camera,
    ellipses: Sequence[Ellipse],
    factors: Sequence[FloatArray],
    *,
    options: MeasurementOptions = DEFAULT,
) -> list[LevelResiduals | None]:
    """Fit the gray levels around rims that the estimate did not fit, and compare them with poses.

    Parameters
    ----------
    levels
        (h, w) gray levels; NaN where a pixel has none.
    camera
        The calibration for this image size.
    ellipses
        (m) the rims in the raw image.
    factors
        (m) factors (3, 3) of the viewing cones of the poses.
    options
        The numbers of the measurement.

    Returns
    -------
    (m) residuals, see `residuals_of_fit`.
    """
    rims = [
        EdgeRim(ConeFit(factor, np.zeros(1)), ellipse.points(_POINTS), ellipse, 1.0, 1, 0.0)
        for ellipse, factor in zip(ellipses, factors, strict=True)
    ]
    fits = intensity_fit.fit_levels(levels, camera, rims, keep_fits=True, options=options).fits
    return [None if fit is None else residuals_of_fit(fit, factor) for fit, factor in zip(fits, factors, strict=True)]


def residuals_of_fit(fit: LevelFit, factor: FloatArray) -> LevelResiduals | None:
    """Compare the gray levels that were fitted with the model at the viewing cone of a pose.

    Parameters
    ----------
    fit
        The fit of the estimate to the levels around the rim.
    factor
        (3, 3) factor of the viewing cone of the pose, camera frame.

    Returns
    -------
    The residuals; None where next to no pixel around the rim counts.
    """
    if float(fit.bands.weight.sum()) < _LEAST_PIXELS or not np.all(np.isfinite(factor)):
        return None
    low, high = fit.limits
    clipped = (fit.bands.levels[0] <= low) | (fit.bands.levels[0] >= high)
    own, neighbors = fit.fit, fit.neighbors[0]
    bands = fit.bands.less(fit.neighbors).weighted(own.weight)
    at = rim_coordinates(bands, factor[None])
    model, slope = _model(bands, own, own.factors, is_curved=fit.is_curved)
    # The levels belong to the rim that was fitted: fitted again, they would absorb a third of a step aside.
    aside = (at.distance_px - rim_coordinates(bands, own.factors).distance_px)[0]
    if own.converged[0] and float(np.max(np.abs(aside))) < _FIRST_ORDER_PX:
        model = model - slope * aside
    else:
        model, slope = _model(bands, own, factor[None], is_curved=fit.is_curved)
    in_use = np.asarray(own.weight[0] > 0.0)
    model, measured = model + neighbors, np.asarray(bands.levels[0], dtype=np.float64) + neighbors
    square = float(np.mean((model - measured)[in_use] ** 2)) if in_use.any() else 0.0
    return LevelResiduals(
        pixels=bands.pixels[0],
        distance_px=np.asarray(at.distance_px[0], dtype=np.float64),
        measured=measured,
        model=model,
        slope=slope,
        in_use=in_use,
        clipped=clipped & ~in_use,
        half_width_px=fit.half_width_px,
        sigma_px=float(np.exp(own.blur[0, 0])),
        unequal=(float(own.blur[0, 1]), float(own.blur[0, 2])),
        noise_levels=float(np.sqrt(max(square, ROUNDING_VARIANCE))),
        contrast_levels=float(own.contrast_levels[0]),
        correlation=float(own.correlation[0]),
        rim_used=float(own.rim_used[0]),
        converged=bool(own.converged[0]),
        is_used=fit.is_accepted,
    )


def edge_offsets(residuals: LevelResiduals, place: FloatArray, number: int) -> tuple[FloatArray, FloatArray]:
    """Return how far outside the rim of the pose the edge is, in equal segments of the rim.

    Parameters
    ----------
    residuals
        Of k pixels around the rim.
    place
        (k,) position of each pixel along the rim, 0 to 1.
    number
        Of segments.

    Returns
    -------
    Offsets (number,) px and their standard errors (number,) px; NaN where too few pixels are in use.
    """
    segment = np.minimum((place * number).astype(np.int64), number - 1)
    used = residuals.in_use
    information = np.bincount(segment[used], (residuals.slope**2)[used], number)
    gradient = np.bincount(segment[used], (-residuals.residual * residuals.slope)[used], number)
    is_enough = information > max(residuals.noise_levels**2, 1e-9)
    information = np.where(is_enough, information, np.nan)
    return gradient / information, residuals.noise_levels / np.sqrt(information)


def _model(bands: Bands, fit: LevelsFit, factors: FloatArray, *, is_curved: bool) -> tuple[FloatArray, FloatArray]:
    """Return the model's levels (k,) with the rim of `factors` (1, 3, 3), and their change per px of its growth."""
    at = rim_coordinates(bands, factors)
    share = (curved_edge_spread if is_curved else straight_edge_spread)(at, fit.blur)
    levels = fit_levels(DesignMatrix.of(bands, at, share), fit.prior_precision)
    # The first mode is a growth of the rim as a share of its radius.
    slope = levels.slopes[0, 0] * (at.radial_across / np.maximum(at.radius, 1e-9))[0]
    return np.asarray(levels.model[0], dtype=np.float64), np.asarray(slope, dtype=np.float64)
