"""The tunable numbers of photometry: from the gray levels around a rim to its viewing cone.

The source of each number is named: `statistical` follows from a noise model, `numerical` from the arithmetic or the
pixel grid, `cost` bounds time or memory, and `empirical` was set by trial on rendered images and photographs, and no
derivation is recorded. Lengths are px of the raw image; a share is from 0 to 1. Nodes of quadratures and ridges stand
with the code that uses them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from circlepose.photometry.thin.options import ThinOptions


@dataclass(frozen=True, slots=True)
class PhotometryOptions:
    """Numbers of the fits to gray levels."""

    thin: ThinOptions = field(default_factory=ThinOptions)
    """those of rims whose two sides are joined by the blur"""

    # The band of pixels around a rim.
    band_half_width_px: float = 3.0
    """px; half-width of the band; empirical"""
    band_half_width_sigmas: float = 3.5
    """blurs; half-width of the band, the larger of both counts; statistical"""
    curved_radius_px: float = 8.0
    """px; radius of curvature below which a rim needs the curved edge spread; empirical"""
    curved_radius_sigmas: float = 10.0
    """blurs; the same, where the blur is known to be wide: the straight one errs by the inverse square; numerical"""

    # Clipped floating levels.
    clipped_share: float = 0.001
    """share of the pixels at an extreme level, from which this level is clipped; empirical"""
    clipped_ratio: float = 2.0
    """pixels at an extreme level over those of the step next to it, from which this level is clipped; empirical"""
    least_between_share: float = 0.1
    """share of the pixels between both extremes, below which nothing is clipped; empirical"""

    # Squares of four pixels on ellipses inside and outside the band.
    outer_rings: int = 2
    """rings on each side; empirical"""
    outer_ellipses: int = 4
    """ellipses in a ring; empirical"""
    outer_gap_px: float = 1.0
    """px; distance of the first ellipse from the band: half a square; numerical"""
    outer_spacing_px: float = 2.4
    """px; distance of neighboring ellipses; empirical"""
    outer_samples_per_px: float = 2.7
    """samples along an ellipse per px of the longest semi-axis; empirical"""
    outer_least_samples: int = 16
    """samples along an ellipse, at least; empirical"""
    outer_most_samples: int = 540
    """samples along an ellipse, at most; cost"""

    # The intensity prior from these squares.
    prior_least_pixels: float = 24.0
    """pixels; least number on a side of a ring; empirical"""
    prior_variance_ratio: float = 1.5
    """variance of a side over that at the rim, up to which the side is used; empirical"""
    prior_distance_square: float = 16.0
    """squared Mahalanobis distance (5 levels) between ring and rim, up to which a side is used; statistical"""

    # The prior of the levels, as standard deviations over the contrast.
    linear_shading: float = 0.2
    """of the harmonics of first order; empirical"""
    quadratic_shading: float = 0.1
    """of the harmonics of second order on a large disc; empirical"""
    large_radius_px: float = 40.0
    """px; radius of a large disc; on smaller ones quadratic shading falls with the squared radius; empirical"""
    halo: float = 0.3
    """of the halo term; empirical"""
    plain_halo: float = 1e-4
    """of the halo term in the first fit, which has a Gaussian blur only; numerical"""

    # Texture.
    texture_order: int = 6
    """order of the finest harmonic; empirical"""
    curved_texture_order: int = 9
    """the same with the curved edge spread. With 6, the center of an elongated disc has errors of two sigmas along
    the major axis, because the levels change fast across the rim; empirical"""
    texture_start: float = 0.1
    """over the contrast; standard deviation of texture before it is estimated; empirical"""
    least_texture: float = 1e-3
    """over the contrast; smallest standard deviation of texture that is tried; empirical"""
    most_texture: float = 0.1
    """over the contrast; largest standard deviation of texture that is tried; empirical"""
    texture_trials: int = 13
    """standard deviations that are tried, in a geometric series; empirical"""
    texture_log_likelihood: float = 4.0
    """gain in log likelihood from which the model has texture; statistical"""
    texture_perimeter_px: float = 80.0
    """px; perimeter above which a model with texture is tried; empirical"""

    # The blur.
    start_sigma_px: float = 0.8
    """px; blur at the start of a fit, with the pixel's box; empirical"""
    anisotropy_sigma: float = 0.03
    """standard deviation of the prior of the blur's anisotropy; empirical"""
    least_sigma_px: float = 0.25
    """px; lower bound of the blur: slightly below that of the pixel's box, 0.29; numerical"""
    most_sigma_px: float = 30.0
    """px; upper bound of the blur; empirical"""
    most_anisotropy: float = 0.6
    """bound of either parameter of the anisotropy; empirical"""

    # The fit.
    fit_rounds: int = 3
    """rounds of fitting and selecting pixels; empirical"""
    first_pixels: int = 800
    """pixels of a band in the first fit, if the band has twice this number or more; cost"""
    least_pixels: float = 40.0
    """pixels in use; least number of a valid fit; empirical"""
    steps: int = 12
    """steps of the damped Gauss-Newton iteration, at most; cost"""
    converged_gain: float = 1e-3
    """noise variances; a step with a smaller predicted gain is not taken: 3 % of a standard error; statistical"""
    longest_step: float = 0.5
    """bound of each component of a step; empirical"""
    last_step_errors: float = 0.25
    """standard errors; a step whose second-order effect is below this is accepted without evaluation; statistical"""
    first_last_step_errors: float = 1.0
    """the same in the first fit, which others follow; statistical"""
    start_damping: float = 1e-5
    """share of the diagonal; damping at the start; empirical"""
    most_damping: float = 1e5
    """share of the diagonal; damping from which the iteration has failed; numerical"""
    damping_decrease: float = 0.1
    """factor after a step that lowers the cost; empirical"""
    damping_increase: float = 30.0
    """factor after a step that does not; empirical"""
    least_raised_damping: float = 1e-3
    """share of the diagonal; least damping after a step that does not lower the cost; empirical"""

    # Segments of the rim and their outliers.
    segment_px: float = 8.0
    """px; length of a segment; empirical"""
    least_segments: int = 12
    """segments of a rim, at least; empirical"""
    most_segments: int = 72
    """segments of a rim, at most; empirical"""
    zone_sigmas: float = 2.0
    """blurs; half-width of the zone at the rim; statistical"""
    outlier_sigmas: float = 6.0
    """standard deviations of a mean square; an outlier exceeds the median by more; statistical"""
    outlier_ratio: float = 4.0
    """over the median mean square; an outlier exceeds this multiple; empirical"""
    outlier_contrast_share: float = 0.05
    """share of the contrast; the rms residual of an outlier exceeds it; empirical"""
    least_cell_pixels: int = 4
    """pixels; a cell with fewer does not count in the median; empirical"""

    # Correlation of neighboring residuals.
    joined_segments: tuple[int, ...] = (1, 2, 4)
    """neighboring segments summed, each number twice the one before; empirical"""
    fitted_segments: float = 12.0
    """a fit to n segments leaves n / (n + this) of the scatter of their scores; measured on rendered discs"""
    correlation_limit: float = 4.5
    """the correlation of n segments is significant above 1 + this / sqrt(n): three standard deviations of independent
    residuals, also on rendered discs with 3 to 72 segments; statistical"""

    # Other rims close by.
    neighbor_sigmas: float = 3.5
    """blurs; distance from a rim up to which it changes levels; statistical"""
    same_rim_px: float = 1.5
    """px; rims whose centers and axes differ by less are one edge found twice; empirical"""

    # Masks.
    mask_samples: int = 90
    """samples along each ellipse; empirical"""
    mask_offsets_px: tuple[float, ...] = (-2.0, -1.0, 0.0, 1.0, 2.0)
    """px; offsets of the sampled ellipses from the rim; empirical"""
    mask_end_share: float = 0.125
    """share of the contrast; a level this close to an extreme counts as the extreme; empirical"""
    mask_between_share: float = 0.03
    """share of the samples between the extremes, up to which an image is a mask. The sharpest image that is averaged
    over pixels has 0.2; measured on rendered discs"""
    mask_contrast: float = 255.0
    """levels; contrast to which a mask is scaled: that of 8 bits; numerical"""


DEFAULT = PhotometryOptions()
