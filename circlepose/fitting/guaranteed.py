"""Guaranteed ellipse fit: approximate maximum likelihood that cannot leave the ellipses.

The fit that Fu & Zhou use: Szpak, Chojnacki & van den Hengel, Guaranteed ellipse fitting with a confidence region
and an uncertainty measure for centre, axes, and orientation (2015). It minimises, by Levenberg-Marquardt,

    sum w f(x)^2 / (g' S g),    g = grad f(x), S the covariance of point x

the squared first-order (Sampson) distances in standard errors, over parameters that only ellipses have. Theirs are
latent parameters of a conic whose discriminant keeps its sign, and f = x'Cx. Ours is f = |y| - 1, the same to
first order and closer to the true distance far from the rim, where y is x in the frame in which the ellipse is the
unit circle; and a step is a small affine map of that circle,

    u -> t + exp(E) u,    E = [[e0 + e1, e2], [e2, e0 - e1]],

whose *latent* parameters (t_x, t_y, e0, e1, e2) give a proper ellipse whatever they are, and are regular at
circles, where an angle is not. They are relative to the axes of the ellipse, so its size and place do not matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, frozen
from circlepose.conic import Ellipse, rim_distance
from circlepose.errors import ArgumentError
from circlepose.fitting.direct import fit_ellipse

_STEPS = 50
_DONE = 1e-9
"""Latent step, a share of the axes, below which a fit has converged: far below what any noise leaves."""
_LONGEST_STEP = 0.5
_FIRST_DAMPING = 1e-3
_LAST_DAMPING = 1e8
_ROUNDING = 1e-12


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
    """False where the steps ran out, as for points that no ellipse but a near-parabola fits"""

    @property
    def covariance(self) -> FloatArray:
        """(5, 5) of centre x, y, semi-major, semi-minor (plane unit) and angle (rad), to first order.

        Where the axes agree within their errors the angle is undetermined: its variance is then large, or
        infinite for a circle, and the latent covariance is the one to use.
        """
        return covariance_of_axes(self.ellipse, self.latent_covariance)


def fit_guaranteed(
    points: FloatArray, weights: FloatArray | None = None, covariances: FloatArray | None = None
) -> GuaranteedFit | None:
    """Fit an ellipse to `points` (n, 2), any plane unit, starting from the direct fit.

    Parameters
    ----------
    weights
        (n,) from 0 to 1: how much each point counts, for robust fits.
    covariances
        (n, 2, 2) of each point, symmetric and positive definite, up to a common factor. The same for all when left out.

    Returns
    -------
    The fit; its uncertainty is from the Fisher information, with the noise estimated from the residuals. None
    when there are fewer than 6 points (of any weight), or they coincide or lie on a line.

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
    freedom = (len(p) if weights is None else float(np.sum(weights))) - 5.0
    if start is None or start.semi_minor <= 0.0 or freedom <= 0.0:
        return None
    ellipse, converged = refine_ellipse(start, p, covariances, weights)
    residual, jacobian = _standardised(*_frame(ellipse), p, covariances, _roots(weights))
    variance = float(residual @ residual) / freedom
    return GuaranteedFit(
        ellipse=ellipse,
        residuals=frozen(rim_distance(ellipse, p)),
        noise=float(np.sqrt(variance)),
        latent_covariance=frozen(variance * np.linalg.pinv(jacobian.T @ jacobian, hermitian=True)),
        converged=converged,
    )


def refine_ellipse(
    start: Ellipse,
    points: FloatArray,
    covariances: FloatArray | None = None,
    weights: FloatArray | None = None,
    steps: int = _STEPS,
) -> tuple[Ellipse, bool]:
    """Refine the ellipse `start` to the least squared standardised distances of `points` (n, 2).

    `covariances` (n, 2, 2) and `weights` (n,) as for `fit_guaranteed`. Returns the ellipse and whether it converged
    within so many `steps`; it is never worse than `start`, which must be a proper ellipse.
    """
    linear, center = _frame(start)
    root = _roots(weights)
    residual, jacobian = _standardised(linear, center, points, covariances, root)
    cost = float(residual @ residual)
    damping, converged = 0.0, False
    for _ in range(steps):
        information = jacobian.T @ jacobian
        damped = information + damping * np.diag(np.diag(information))
        try:
            step = -np.linalg.solve(damped, jacobian.T @ residual)
        except np.linalg.LinAlgError:
            damping = max(10.0 * damping, _FIRST_DAMPING)
            continue
        longest = float(np.max(np.abs(step)))
        step = step * min(1.0, _LONGEST_STEP / max(longest, _LONGEST_STEP))
        trial_linear, trial_center = linear @ _stretch(step[2:]), center + linear @ step[:2]
        trial = _standardised(trial_linear, trial_center, points, covariances, root)
        trial_cost = float(trial[0] @ trial[0])
        if trial_cost <= cost * (1.0 + _ROUNDING):
            linear, center, cost, (residual, jacobian) = trial_linear, trial_center, trial_cost, trial
            damping = 0.1 * damping if damping > _ROUNDING else 0.0
            if longest < _DONE:
                converged = True
                break
        else:
            damping = max(10.0 * damping, _FIRST_DAMPING)
            if damping > _LAST_DAMPING:
                break
    axes, semi_axes, _ = np.linalg.svd(linear)
    return Ellipse.from_axes(center, semi_axes, np.arctan2(axes[1, 0], axes[0, 0])), converged


def covariance_of_axes(ellipse: Ellipse, latent_covariance: FloatArray) -> FloatArray:
    """Return the covariance (5, 5) of centre x, y, semi-major, semi-minor and angle (rad) from the latent one."""
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


def _stretch(e: FloatArray) -> FloatArray:
    """Return exp(E) (2, 2) of E = [[e0 + e1, e2], [e2, e0 - e1]]."""
    size = float(np.hypot(e[1], e[2]))
    ratio = np.sinh(size) / size if size > 0.0 else 1.0
    cosh, along, across = np.cosh(size), ratio * e[1], ratio * e[2]
    return np.asarray(np.exp(e[0]) * np.array([[cosh + along, across], [across, cosh - along]]))


def _standardised(
    linear: FloatArray,
    center: FloatArray,
    points: FloatArray,
    covariances: FloatArray | None,
    root_weights: FloatArray | None,
) -> tuple[FloatArray, FloatArray]:
    """Return the weighted distances (n,) in standard errors to the ellipse `linear` u + `center`, |u| = 1, and
    their exact derivatives (n, 5) by the latent parameters.

    With y = rho (c, s), f = rho - 1, g = linear^-T (c, s), h = linear^-T (-s, c), A = g'Sg and B = h'Sg:

        r = f/sqrt(A),    dr = (-(c, s).t - p + (f B/A) ((-s, c).t/rho + 2 q))/sqrt(A),

        p = e0 + e1 cos 2phi + e2 sin 2phi,    q = -e1 sin 2phi + e2 cos 2phi
    """
    inverse = np.linalg.inv(linear)
    y = (points - center) @ inverse.T
    # A point at the very centre has no direction; any does.
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
