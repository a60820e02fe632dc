"""Grey levels -> the ellipse of a thin rim (a circle seen nearly edge-on), whose sides the blur runs together.

Where the minor axis is a few times the blur, or less, there is no edge to place: the levels of both sides
overlap. So the whole blurred ellipse is fitted. Where something hides a part of it, or touches it, that part is
found by what it leaves in the residuals, and left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.geometry.ellipse import Ellipse
from circlepose.photometry.thin.model import (
    START_SIGMA_PX,
    Problem,
    State,
    levenberg_marquardt,
    pixels_around,
    prior_information,
    taper,
)
from circlepose.photometry.thin.occlusion import (
    STRETCHES,
    agreeing,
    covered_from,
    rms_of_stretches,
    stretches_of,
    structure,
    uncovered,
    with_points,
)

_GROWING_ROUNDS = ((10, 1.4), (10, 1.4), (10, 1.4))
_ROUNDS = ((12, 1.0), (6, 1.0))
"""Steps of each round, and how far it looks along the axes, in their lengths."""
_CLEANINGS = 8
_LEAST_SEEN = 0.2
_LEAST_CLEAN = 0.3
STRUCTURED = 1.3
"""`ThinEllipse.structure` from which a fit has left something in the levels that is not noise."""
THIN_PX = 14.0
"""Semi-minor axis below which the tips of an ellipse are a matter of blur."""
_THIN_RATIO = 0.15


def are_thin(ellipse: Ellipse) -> BoolArray:
    """Tell (...) which image ellipses (px) are so thin that blur joins their sides, at the tips at least."""
    return np.asarray(ellipse.semi_minor < np.minimum(THIN_PX, _THIN_RATIO * ellipse.semi_major))


@dataclass(frozen=True, slots=True, eq=False)
class ThinEllipse:
    """A blurred ellipse fitted to grey levels."""

    ellipse: Ellipse
    sigma_px: float
    """blur and pixel box"""
    contrast: float
    """grey levels, inside minus outside"""
    peak_levels: float
    """highest level that the ellipse adds or takes: the contrast, less where blur is wider than the ellipse"""
    rms_levels: float
    """rms residual"""
    structure: float
    """rms residual over that which neighbouring pixels do not share: about 1 where noise is all that is left"""
    kept: BoolArray
    """(s,) the stretches of its rim that are not covered or touched by something else"""
    taper: float
    """exponent p with which its width falls off towards the tips, (1 - (x/a)^2)^p: 1/2 of an ellipse, 0 of a bar"""
    taper_sigma: float
    covariance: FloatArray
    """(5, 5) of centre x, y, semi-major, semi-minor (px) and angle (rad), with the blur unknown"""

    @property
    def rim_used(self) -> float:
        """Share of its rim that is not covered or touched by something else."""
        return float(self.kept.mean())

    def seen_points(self, number: int) -> FloatArray:
        """Return those of `number` points of the rim, evenly spaced in the eccentric angle, that nothing covers."""
        points = self.ellipse.points(number)
        theta = np.array([*self.ellipse.center, self.ellipse.semi_major, self.ellipse.semi_minor, self.ellipse.angle])
        return np.asarray(points[self.kept[stretches_of(points, theta)]])

    @property
    def error_px(self) -> float:
        """What the noise of the levels makes of an edge's place: noise over the steepest slope."""
        return self.rms_levels * self.sigma_px * float(np.sqrt(2.0 * np.pi)) / abs(self.contrast)


def fit_thin_ellipse(
    grey: Image, start: Ellipse, *, grow: bool = False, seen: FloatArray | None = None
) -> ThinEllipse | None:
    """Fit the blurred ellipse to the levels of `grey` (h, w) around `start`; None when it does not converge there.

    With `grow` the start may be a fragment, and the first rounds look beyond its tips. Where points `seen` (n, 2)
    on its rim are known, the first rounds keep to the stretches that have some; what else of the rim nothing
    covers is then found.
    """
    theta = np.array(
        [*start.center, start.semi_major, max(float(start.semi_minor), 0.3), start.angle, START_SIGMA_PX]
    )
    if seen is None:
        return _fit(grey, theta, np.ones(STRETCHES, dtype=np.bool_), _GROWING_ROUNDS if grow else ())
    fitted = _fit(grey, theta, with_points(seen, theta))
    if fitted is not None and fitted.structure < STRUCTURED:
        return fitted
    # Close to what covers it the rim was seen, but its levels are not those of the rim alone.
    pixels = pixels_around(grey, theta, 1.0)
    if pixels is None:
        return None
    every = np.ones(len(pixels[0]), dtype=np.bool_)
    again = _fit(grey, theta, agreeing(Problem(*pixels, every, theta[:2], theta[2]), theta))
    return min((fit for fit in (fitted, again) if fit is not None), key=lambda fit: fit.structure, default=None)


def _fit(
    grey: Image, start: FloatArray, kept: BoolArray, growing: tuple[tuple[int, float], ...] = ()
) -> ThinEllipse | None:
    """Fit from parameters `start` (6,), at first to the stretches `kept` of the rim."""
    theta, center = start, start[:2]
    if kept.mean() < _LEAST_SEEN:
        return None
    # Which pixels count is settled before each round, so that no step can gain by dropping some.
    for steps, stretch in (*growing, *_ROUNDS):
        pixels = pixels_around(grey, theta, stretch)
        if pixels is None:
            return None
        problem = Problem(*pixels, kept[stretches_of(pixels[0], theta)], center, start[2])
        fitted = levenberg_marquardt(problem, theta, steps)
        if fitted is None:
            return None
        state, theta = fitted, fitted.theta
    cleaned = _cleaned(problem, state, kept)
    if cleaned is None:
        return None
    state, kept = cleaned
    theta = state.theta
    if state.contrast * state.highest_share == 0.0:
        return None
    ellipse = Ellipse.from_axes(theta[:2], theta[2:4], theta[4])
    # An angle brought back by half a turn has the stretches the other way round.
    turned = abs(float(ellipse.angle) - theta[4]) > 1.0
    information = state.jacobian.T @ state.jacobian / state.variance + prior_information(1.0)
    exponent, exponent_sigma = taper(state)
    return ThinEllipse(
        ellipse=ellipse,
        sigma_px=float(theta[5]),
        contrast=state.contrast,
        peak_levels=abs(state.contrast) * state.highest_share,
        rms_levels=state.rms,
        structure=structure(state, problem, kept),
        kept=kept[::-1] if turned else kept,
        taper=exponent,
        taper_sigma=exponent_sigma,
        covariance=np.asarray(np.linalg.pinv(information)[:5, :5], dtype=np.float64),
    )


def _cleaned(problem: Problem, state: State, kept: BoolArray) -> tuple[State, BoolArray] | None:
    """Fit again to the stretches that nothing covers, until these no longer change; also returns these."""
    stretch_of = stretches_of(problem.points, state.theta)
    clean = uncovered(state, problem, stretch_of)
    if not clean.all() and kept.all():
        # What is covered has pulled at this fit.
        clean = agreeing(problem, state.theta)
    closely = False
    for _ in range(_CLEANINGS):
        if np.array_equal(clean, kept):
            if closely:
                break
            closely = True
            clean = uncovered(state, problem, stretch_of, closely=True)
            continue
        kept = clean
        fitted = levenberg_marquardt(replace(problem, chosen=kept[stretch_of]), state.theta, _ROUNDS[0][0])
        if fitted is None:
            return None
        state = fitted
        stretch_of = stretches_of(problem.points, state.theta)
        clean = uncovered(state, problem, stretch_of, closely=closely)
    clean = kept & (rms_of_stretches(state, problem, stretch_of) <= covered_from(state, problem, stretch_of))
    return (state, kept) if clean.mean() >= _LEAST_CLEAN else None
