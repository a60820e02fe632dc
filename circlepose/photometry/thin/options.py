"""The tunable numbers of the fit of thin rims. The sources are named as in `photometry.options`."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class ThinOptions:
    """Numbers of the fit of blurred ellipses. Lengths are px of the raw image; a share is from 0 to 1."""

    # Which rims are thin.
    thin_px: float = 14.0
    """px; semi-minor axis below which the tips of an ellipse may be dominated by blur; empirical"""
    thin_ratio: float = 0.15
    """semi-minor over semi-major axis of a thin rim, at most; empirical"""

    # Pixels.
    margin_px: float = 4.0
    """px; distance of the farthest pixels from the ellipse; empirical"""
    fade: float = 0.15
    """width of the border, over the size of the region, in which weights fall to zero; empirical"""
    deep_px: float = 4.0
    """px; pixels farther inside are left out, because the edge does not change them; empirical"""
    most_pixels: int = 14_000
    """pixels of one fit, at most; cost"""

    # Model.
    start_sigma_px: float = 0.85
    """px; blur at the start and mean of its prior; empirical"""
    sigma_prior_px: float = 0.3
    """px; standard deviation of the blur's prior; empirical"""
    least_sigma_px: float = 0.35
    """px; lower bound of the blur; empirical"""
    most_sigma_px: float = 4.0
    """px; upper bound of the blur; empirical"""
    gradient_px: float = 5.0
    """px; the prior of a level gradient is that levels change little over this length; empirical"""
    least_semi_minor_px: float = 1e-3
    """px; lower bound of the semi-minor axis; numerical"""
    start_semi_minor_px: float = 0.3
    """px; lower bound of the semi-minor axis at the start; empirical"""

    # Levenberg-Marquardt.
    most_growth: float = 3.0
    """over the semi-major axis at the start; a longer ellipse has lost its object; empirical"""
    start_damping: float = 1e-3
    """share of the diagonal; damping at the start; empirical"""
    damping_decrease: float = 0.2
    """factor after a step that lowers the cost; empirical"""
    damping_increase: float = 8.0
    """factor after a step that does not; empirical"""
    most_damping: float = 1e6
    """share of the diagonal; damping at which the iteration ends; numerical"""
    converged_step: float = 1e-4
    """px; the iteration ends when center and axes change by less; numerical"""
    converged_gain: float = 1e-7
    """share of the cost; the iteration ends when the cost falls by less; numerical"""

    # Rounds.
    growing_rounds: tuple[tuple[int, float], ...] = ((10, 1.4), (10, 1.4), (10, 1.4))
    """steps, and semi-major axis of the region over that of the ellipse, for a start that is a fragment; empirical"""
    rounds: tuple[tuple[int, float], ...] = ((12, 1.0), (6, 1.0))
    """the same of the rounds of every fit; empirical"""
    cleanings: int = 8
    """rounds of leaving out segments, at most; cost"""
    least_seen: float = 0.2
    """share of the segments that have points, at least; empirical"""
    least_clean: float = 0.3
    """share of the segments in use, at least; empirical"""
    structured: float = 1.3
    """`ThinEllipse.structure` from which the residuals are more than noise; empirical"""

    # Segments.
    segments_per_side: int = 24
    """segments along either side; empirical"""
    clean_share: float = 0.2
    """quantile of the rms residuals of the segments that is typical of a clean one; empirical"""
    covered_ratio: float = 2.5
    """rms residual over the typical one, above which a segment is covered; empirical"""
    covered_share: float = 0.015
    """rms residual over the peak level, above which a segment is covered, if larger; empirical"""
    touched_ratio: float = 1.6
    """rms residual over the typical one, above which a segment is touched by what covers another; empirical"""
    least_kept: float = 0.35
    """share of the segments that is kept in any case; empirical"""
    concentrations: int = 4
    """concentration steps of the search for a consensus; empirical"""
