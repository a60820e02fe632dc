"""Guaranteed ellipse fit: approximate maximum likelihood that cannot leave the ellipses.

The fit that Fu & Zhou use: Szpak, Chojnacki & van den Hengel, Guaranteed ellipse fitting with a confidence region
and an uncertainty measure for center, axes, and orientation (2015). It minimizes, by Levenberg-Marquardt,

    sum w f(x)^2 / (g' S g),    g = grad f(x), S the covariance of point x

the squared first-order (Sampson) distances in standard errors, over latent parameters that only ellipses have.
The parameters differ from theirs. In the frame in which the current ellipse is the unit circle, y'y = 1, the next is

    y'(I - 2E) y - 2 t'y = 1,    E = [[e0 + e1, e2], [e2, e0 - e1]], I - 2E positive definite

with *latent* parameters (t_x, t_y, e0, e1, e2): to first order the center moves by t and the axes grow by E,
relative to the axes. So size and position do not matter, and circles, of which the angle is undetermined, are no
special case. Steps are straight in the conic's coefficients, as are the valleys of the cost for short arcs. And
f = |y| - 1 instead of x'Cx: the same to first order, and closer to the true distance far from the rim.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, frozen
from circlepose.errors import ArgumentError
from circlepose.fitting.direct import fit_ellipse
from circlepose.geometry.ellipse import Ellipse, rim_distance

LATENT_CONICS = np.array(
    [
        [[0.0, 0.0, -1.0], [0.0, 0.0, 0.0], [-1.0, 0.0, 0.0]],
        [[0.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, -1.0, 0.0]],
        np.diag([-2.0, -2.0, 0.0]),
        np.diag([-2.0, 2.0, 0.0]),
        [[0.0, -2.0, 0.0], [-2.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    ]
)
"""(5, 3, 3) the derivative of the conic diag(1, 1, -1) of the unit circle by each latent parameter."""
_STEPS = 50
"""Steps at most; empirical."""
_DONE = 1e-7
"""Latent step, a share of the axes, below which a fit has converged; far below any noise; numerical."""
_NEAREST_PARABOLA = 0.9
"""Share of the way to a parabola that one step may go; numerical."""
_FIRST_DAMPING = 1e-3
"""Damping after the first step that fails; the start is undamped, as the direct fit is close; empirical."""
_LAST_DAMPING = 1e8
"""Damping at which the fit stops without convergence; numerical."""
_ROUNDING = 1e-12
"""Relative increase of the cost that is rounding; numerical."""
_LONGEST = 1e3
"""Semi-major axis, in extents of the points, from which the best ellipse is no better than a parabola; numerical."""


@dataclass(frozen=True, slots=True, eq=False)
class GuaranteedFit:
    """An ellipse fitted to points, with its uncertainty."""

    ellipse: Ellipse
    residuals: FloatArray
    """(n,) signed first-order distance to the rim in the plane's unit, negative inside"""
    noise: float
    """standard error of a point across the rim, in the plane's unit; where covariances of the points were given:
    the factor by which their standard errors must be multiplied to explain the residuals"""
    latent_covariance: FloatArray
    """(5, 5) of the latent parameters, for t and E along the ellipse's major and minor axis; unit 1"""
    converged: bool
    """False where there is no best ellipse: the steps ran out, or led towards a parabola"""

    @property
    def covariance(self) -> FloatArray:
        """(5, 5) of center x, y, semi-major, semi-minor (plane unit) and angle (rad), to first order.

        Where the axes agree within their errors the angle is undetermined, its variance very large, and the
        latent covariance is the one to use.
        """
        return covariance_of_axes(self.ellipse, self.latent_covariance)


def fit_guaranteed(
    points: FloatArray, weights: FloatArray | None = None, covariances: FloatArray | None = None
) -> GuaranteedFit | None:
    """Fit an ellipse by approximate maximum likelihood, starting from the direct fit.

    Parameters
    ----------
    points
        (n, 2) in any plane unit.
    weights
        (n,) from 0 to 1, of the squared residuals, for robust fits; 1 by default.
    covariances
        (n, 2, 2) of each point, symmetric and positive definite, up to a common factor; equal and isotropic by
        default.

    Returns
    -------
    The fit. Its uncertainty follows from the Fisher information, with the noise estimated from the residuals. None
    with fewer than 6 points (of any weight), or where they coincide or lie on a line.

    Raises
    ------
    ArgumentError
        When shapes do not match.
    """
    p = np.asarray(points, dtype=np.float64)
    if p.ndim != 2 or p.shape[1] != 2:
        raise ArgumentError(f"points: expected shape (n, 2), got {p.shape}.")
    if weights is not None and np.shape(weights) != (len(p),):
        raise ArgumentError(f"weights: expected one for each of {len(p)} points, got shape {np.shape(weights)}.")
    if covariances is not None and np.shape(covariances) != (len(p), 2, 2):
        raise ArgumentError(f"covariances: expected shape ({len(p)}, 2, 2), got {np.shape(covariances)}.")
    start = fit_ellipse(p, weights)
    if start is None or start.semi_minor <= 0.0 or (weights is not None and np.sum(weights) <= 5.0):
        return None
    ellipse, converged = refine_ellipse(start, p, covariances, weights)
    noise, latent_covariance = uncertainty(ellipse, p, covariances, weights)
    near_parabola = ellipse.semi_major > _LONGEST * np.max(np.ptp(p, axis=0))
    return GuaranteedFit(
        ellipse=ellipse,
        residuals=frozen(rim_distance(ellipse, p)),
        noise=noise,
        latent_covariance=frozen(latent_covariance),
        converged=converged and not bool(near_parabola),
    )


def refine_ellipse(
    start: Ellipse,
    points: FloatArray,
    covariances: FloatArray | None = None,
    weights: FloatArray | None = None,
    steps: int = _STEPS,
) -> tuple[Ellipse, bool]:
    """Refine an ellipse to the least sum of squared Sampson distances in standard errors.

    Parameters
    ----------
    start
        A single ellipse, not a segment.
    points, covariances, weights
        (n, 2), (n, 2, 2) and (n,), as for `fit_guaranteed`.
    steps
        Steps of Levenberg-Marquardt at most.

    Returns
    -------
    The ellipse, never worse than `start`, and whether it converged.
    """
    linear, center = _frame(start)
    root = _roots(weights)
    residual, jacobian = _standardized(linear, center, points, covariances, root)
    cost = float(residual @ residual)
    damping, converged = 0.0, False
    for _ in range(steps):
        information = jacobian.T @ jacobian
        damped = information + damping * np.diag(np.diag(information))
        try:
            step = np.asarray(-np.linalg.solve(damped, jacobian.T @ residual), dtype=np.float64)
        except np.linalg.LinAlgError:
            damping = max(10.0 * damping, _FIRST_DAMPING)
            continue
        trial_linear, trial_center = _moved(linear, center, step)
        if float(np.max(np.abs(step))) < _DONE:
            linear, center, converged = trial_linear, trial_center, True
            break
        trial = _standardized(trial_linear, trial_center, points, covariances, root)
        trial_cost = float(trial[0] @ trial[0])
        if trial_cost <= cost * (1.0 + _ROUNDING):
            linear, center, cost, (residual, jacobian) = trial_linear, trial_center, trial_cost, trial
            damping = 0.1 * damping if damping > _ROUNDING else 0.0
        else:
            damping = max(10.0 * damping, _FIRST_DAMPING)
            if damping > _LAST_DAMPING:
                break
    axes, semi_axes, _ = np.linalg.svd(linear)
    return Ellipse.from_axes(center, semi_axes, np.arctan2(axes[1, 0], axes[0, 0])), converged


def uncertainty(
    ellipse: Ellipse,
    points: FloatArray,
    covariances: FloatArray | None = None,
    weights: FloatArray | None = None,
) -> tuple[float, FloatArray]:
    """Return the noise, estimated from the residuals, and the covariance of the latent parameters.

    Parameters
    ----------
    ellipse
        The result of `refine_ellipse`.
    points, covariances, weights
        (n, 2), (n, 2, 2) and (n,), as for `fit_guaranteed`; the weights add up to more than 5.

    Returns
    -------
    The noise, see `GuaranteedFit.noise`, and the covariance (5, 5), unit 1: the inverse Fisher information. It is of
    first order, and too small where a short arc leaves the axes uncertain by more than some 5 %.
    """
    residual, jacobian = _standardized(*_frame(ellipse), points, covariances, _roots(weights))
    number = len(points) if weights is None else float(np.sum(weights))
    variance = float(residual @ residual) / (number - 5.0)
    # Through QR, which keeps more digits than J'J.
    triangle = np.linalg.qr(jacobian, mode="r")
    if np.any(np.diag(triangle) == 0.0):
        return float(np.sqrt(variance)), np.full((5, 5), np.inf)
    inverse = np.linalg.inv(triangle)
    return float(np.sqrt(variance)), np.asarray(variance * inverse @ inverse.T)


def covariance_of_axes(ellipse: Ellipse, latent_covariance: FloatArray) -> FloatArray:
    """Return the covariance of an ellipse's parameters from that of the latent ones.

    Parameters
    ----------
    ellipse
        A single one, at which the latent parameters are taken.
    latent_covariance
        (5, 5), see `GuaranteedFit`.

    Returns
    -------
    (5, 5) of center x, y, semi-major, semi-minor (plane unit) and angle (rad), to first order.
    """
    a, b = float(ellipse.semi_major), float(ellipse.semi_minor)
    change = np.zeros((5, 5))
    change[:2, :2] = ellipse.factor[:2, :2]
    change[2, 2:4] = a, a
    change[3, 2:4] = b, -b
    # A shear turns the axes the faster the less they differ.
    change[4, 4] = 2.0 * a * b / max((a - b) * (a + b), np.finfo(np.float64).eps * a * a)
    return change @ latent_covariance @ change.T


def _frame(ellipse: Ellipse) -> tuple[FloatArray, FloatArray]:
    factor = ellipse.factor
    return factor[:2, :2], factor[:2, 2]


def _roots(weights: FloatArray | None) -> FloatArray | None:
    return None if weights is None else np.sqrt(weights)


def _moved(linear: FloatArray, center: FloatArray, step: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the ellipse (its `linear` part and `center`) that is the latent `step` (5,) away.

    A step that would end outside the ellipses, which a parabola bounds, is cut short of them.
    """
    t0, t1, e0, e1, e2 = map(float, step)
    shrink = min(1.0, _NEAREST_PARABOLA / max(2.0 * (e0 + math.hypot(e1, e2)), _NEAREST_PARABOLA))
    t0, t1, e0, e1, e2 = (shrink * value for value in (t0, t1, e0, e1, e2))
    # Cholesky factor of I - 2E, by hand: this runs for each step of each rim.
    l00 = math.sqrt(1.0 - 2.0 * (e0 + e1))
    l10 = -2.0 * e2 / l00
    l11 = math.sqrt(1.0 - 2.0 * (e0 - e1) - l10 * l10)
    root = np.array([[1.0 / l00, -l10 / (l00 * l11)], [0.0, 1.0 / l11]])
    half = np.array([t0 / l00, (t1 - l10 * t0 / l00) / l11])
    return linear @ root * math.sqrt(1.0 + float(half @ half)), center + linear @ (root @ half)


def _standardized(
    linear: FloatArray,
    center: FloatArray,
    points: FloatArray,
    covariances: FloatArray | None,
    root_weights: FloatArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Return the weighted distances (n,) in standard errors and their derivatives (n, 5) by the latent parameters.

    The ellipse is `linear` u + `center`, |u| = 1. With y = rho (c, s), f = rho - 1, g = linear^-T (c, s),
    h = linear^-T (-s, c), A = g'Sg and B = h'Sg:

        r = f/sqrt(A),    dr = (-(c, s).t - p + (f B/A) ((-s, c).t/rho + 2 q))/sqrt(A),

        p = e0 + e1 cos 2phi + e2 sin 2phi,    q = -e1 sin 2phi + e2 cos 2phi
    """
    inverse = np.linalg.inv(linear)
    y = (points - center) @ inverse.T
    # A point at the center has no direction; any will do.
    rho = np.maximum(np.hypot(y[:, 0], y[:, 1]), 1e-12)
    unit = y / rho[:, None]
    c, s = unit[:, 0], unit[:, 1]
    g = unit @ inverse
    h = np.stack([-s, c], axis=-1) @ inverse
    spread = g if covariances is None else np.einsum("nij,nj->ni", covariances, g)
    variance = g[:, 0] * spread[:, 0] + g[:, 1] * spread[:, 1]
    cross = h[:, 0] * spread[:, 0] + h[:, 1] * spread[:, 1]
    scale = 1.0 / np.sqrt(variance) if root_weights is None else root_weights / np.sqrt(variance)
    f = rho - 1.0
    bend = f * cross / variance
    cos2, sin2 = (c - s) * (c + s), 2.0 * c * s
    jacobian = np.stack(
        [
            -c - bend * s / rho,
            -s + bend * c / rho,
            np.full_like(c, -1.0),
            -cos2 - 2.0 * bend * sin2,
            -sin2 + 2.0 * bend * cos2,
        ],
        axis=-1,
    )
    return f * scale, jacobian * scale[:, None]
