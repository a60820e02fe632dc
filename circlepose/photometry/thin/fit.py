"""Gray levels -> the ellipse of a thin rim: a circle seen nearly edge-on, whose two sides the blur joins.

Where the minor axis is a few blurs or less there is no edge to locate: the levels of both sides overlap. So the model
of a whole blurred ellipse (`thin.model`) is fitted to the levels, by least squares in six parameters: center, axes
(px), angle (rad) and blur (px). Segments that something covers or touches have large residuals, and are left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.geometry.ellipse import Ellipse
from circlepose.photometry.options import DEFAULT, PhotometryOptions
from circlepose.photometry.thin.model import (
    Problem,
    State,
    levenberg_marquardt,
    pixels_around,
    prior_information,
    taper,
)
from circlepose.photometry.thin.occlusion import (
    consensus_segments,
    covered_rms,
    segment_rms,
    segments_of,
    segments_with_points,
    structure,
    uncovered_segments,
)
from circlepose.photometry.thin.options import ThinOptions


def are_thin(ellipse: Ellipse, *, options: PhotometryOptions = DEFAULT) -> BoolArray:
    """Return (...) which image ellipses (px) are so thin that blur joins their sides, at the tips at least."""
    thin = options.thin
    return np.asarray(ellipse.semi_minor < np.minimum(thin.thin_px, thin.thin_ratio * ellipse.semi_major))


@dataclass(frozen=True, slots=True, eq=False)
class ThinEllipse:
    """A blurred ellipse fitted to gray levels."""

    ellipse: Ellipse
    """px of the raw image"""
    sigma_px: float
    """blur, with the pixel's box"""
    contrast: float
    """levels, inside minus outside"""
    peak_levels: float
    """highest level that the ellipse adds or subtracts: less than the contrast if the blur is wide"""
    rms_levels: float
    """rms residual"""
    structure: float
    """rms residual over that of its differences between neighboring pixels: about 1 if only noise is left"""
    kept: BoolArray
    """(s,) segments of the rim that nothing covers or touches"""
    taper: float
    """exponent p of the width (1 - (x/a)^2)^p towards the tips: 1/2 for an ellipse, 0 for a bar"""
    taper_sigma: float
    covariance: FloatArray
    """(5, 5) of center x, y, semi-major, semi-minor axis (px) and angle (rad), with the blur unknown"""
    options: ThinOptions
    """those of the fit"""

    @property
    def rim_used(self) -> float:
        """Share of the rim that nothing covers or touches."""
        return float(self.kept.mean())

    @property
    def is_structured(self) -> bool:
        """Whether the residuals are more than noise."""
        return not self.structure < self.options.structured

    def seen_points(self, number: int) -> FloatArray:
        """Return those of `number` points of the rim, evenly spaced in the eccentric angle, that nothing covers."""
        points = self.ellipse.points(number)
        theta = np.array([*self.ellipse.center, self.ellipse.semi_major, self.ellipse.semi_minor, self.ellipse.angle])
        return np.asarray(points[self.kept[segments_of(points, theta, self.options)]])

    @property
    def error_px(self) -> float:
        """Standard error of an edge's position due to noise: the noise over the steepest slope."""
        return self.rms_levels * self.sigma_px * float(np.sqrt(2.0 * np.pi)) / abs(self.contrast)


def fit_thin_ellipse(
    grey: Image,
    start: Ellipse,
    *,
    grow: bool = False,
    seen: FloatArray | None = None,
    options: PhotometryOptions = DEFAULT,
) -> ThinEllipse | None:
    """Fit a blurred ellipse to the levels around `start`.

    Parameters
    ----------
    grey
        (h, w) levels.
    start
        Ellipse near the rim's image, px.
    grow
        The start may be a fragment: the first rounds extend the region beyond its tips.
    seen
        (n, 2) points on the rim, px. The first rounds are limited to segments that have points; then the segments
        that nothing covers are determined from the levels.
    options
        Tunable numbers.

    Returns
    -------
    ThinEllipse or None
        None if the fit does not converge near the start.
    """
    thin = options.thin
    semi_minor = max(float(start.semi_minor), thin.start_semi_minor_px)
    theta = np.array([*start.center, start.semi_major, semi_minor, start.angle, thin.start_sigma_px])
    if seen is None:
        every = np.ones(2 * thin.segments_per_side, dtype=np.bool_)
        return _fit(grey, theta, every, thin, thin.growing_rounds if grow else ())
    fitted = _fit(grey, theta, segments_with_points(seen, theta, thin), thin)
    if fitted is not None and not fitted.is_structured:
        return fitted
    # Next to what covers the rim, a segment may have points although its levels are not those of the rim alone.
    pixels = pixels_around(grey, theta, 1.0, thin)
    if pixels is None:
        return None
    every = np.ones(len(pixels[0]), dtype=np.bool_)
    consensus = consensus_segments(Problem(*pixels, every, theta[:2], theta[2], thin), theta)
    again = _fit(grey, theta, consensus, thin)
    return min((fit for fit in (fitted, again) if fit is not None), key=lambda fit: fit.structure, default=None)


def _fit(
    grey: Image,
    start: FloatArray,
    kept: BoolArray,
    options: ThinOptions,
    growing: tuple[tuple[int, float], ...] = (),
) -> ThinEllipse | None:
    """Fit from parameters `start` (6,), at first to the segments `kept` of the rim."""
    theta, center = start, start[:2]
    if kept.mean() < options.least_seen:
        return None
    # The pixels are fixed in each round, so that no step can lower the cost by dropping pixels.
    for steps, length_factor in (*growing, *options.rounds):
        pixels = pixels_around(grey, theta, length_factor, options)
        if pixels is None:
            return None
        chosen = kept[segments_of(pixels[0], theta, options)]
        problem = Problem(*pixels, chosen, center, start[2], options)
        fitted = levenberg_marquardt(problem, theta, steps)
        if fitted is None:
            return None
        state, theta = fitted, fitted.theta
    cleaned = _cleaned(problem, state, kept)
    if cleaned is None:
        return None
    state, kept = cleaned
    theta = state.theta
    if state.contrast * state.highest_coverage == 0.0:
        return None
    ellipse = Ellipse.from_axes(theta[:2], theta[2:4], theta[4])
    # The ellipse's angle may differ from theta's by half a turn, which reverses the order of the segments.
    is_turned = abs(float(ellipse.angle) - theta[4]) > 1.0
    information = state.jacobian.T @ state.jacobian / state.variance + prior_information(1.0, options)
    exponent, exponent_sigma = taper(state, options)
    return ThinEllipse(
        ellipse=ellipse,
        sigma_px=float(theta[5]),
        contrast=state.contrast,
        peak_levels=abs(state.contrast) * state.highest_coverage,
        rms_levels=state.rms,
        structure=structure(state, problem, kept),
        kept=kept[::-1] if is_turned else kept,
        taper=exponent,
        taper_sigma=exponent_sigma,
        covariance=np.asarray(np.linalg.pinv(information)[:5, :5], dtype=np.float64),
        options=options,
    )


def _cleaned(problem: Problem, state: State, kept: BoolArray) -> tuple[State, BoolArray] | None:
    """Fit again to the segments that nothing covers, until these no longer change; also returns them."""
    options = problem.options
    segment = segments_of(problem.points, state.theta, options)
    clean = uncovered_segments(state, problem, segment)
    if not clean.all() and kept.all():
        # The covered segments have biased this fit.
        clean = consensus_segments(problem, state.theta)
    strict = False
    for _ in range(options.cleanings):
        if np.array_equal(clean, kept):
            if strict:
                break
            strict = True
            clean = uncovered_segments(state, problem, segment, strict=True)
            continue
        kept = clean
        again = replace(problem, chosen=kept[segment])
        fitted = levenberg_marquardt(again, state.theta, options.rounds[0][0])
        if fitted is None:
            return None
        state = fitted
        segment = segments_of(problem.points, state.theta, options)
        clean = uncovered_segments(state, problem, segment, strict=strict)
    clean = kept & (segment_rms(state, problem, segment) <= covered_rms(state, problem, segment))
    return (state, kept) if clean.mean() >= options.least_clean else None
