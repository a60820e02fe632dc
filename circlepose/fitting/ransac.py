"""Edge points, many of them not of the rim -> those that lie on one ellipse. RANSAC with fixed draws.

Where something hides part of a rim, its own edges run along the hidden part, smooth and close: they pull a
least-squares fit without being outliers of it. So ellipses are fitted to a few short segments of the rim, drawn at
random, and the ellipse with the most points close to it is taken (Fischler & Bolles, 1981). The draws are the same at
every call, so equal points give equal answers.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from circlepose._typing import BoolArray, FloatArray, IntArray
from circlepose.fitting.direct import Contours, fit_each, fit_ellipses
from circlepose.geometry.ellipse import Ellipse, rim_distance

_DRAWS = 120
"""Draws for one contour. With half of the rim hidden some seven of them are of the rim alone; empirical."""
_SEGMENTS = 4
"""Segments of the rim in one draw: two determine an ellipse poorly; empirical."""
_SEGMENT_SHARE = 0.07
"""Length of a segment, as a share of the points; empirical."""
_TOLERANCE = 3.0
"""Distance from the ellipse, in units of the points' own scatter, up to which a point lies on it; statistical."""
_SEED = 7


def local_scatter(points: FloatArray) -> float:
    """Return the robust standard deviation of neighboring points of a contour across it.

    Parameters
    ----------
    points
        (n, 2) in order along a closed contour, any plane unit.

    Returns
    -------
    In the same unit: the median absolute second difference across the contour, scaled to a normal distribution. A
    smooth contour of any shape adds nearly nothing to it.
    """
    middle = points - (np.roll(points, 1, axis=0) + np.roll(points, -1, axis=0)) / 2.0
    tangent = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    tangent = tangent / np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    across = middle[:, 0] * tangent[:, 1] - middle[:, 1] * tangent[:, 0]
    # Curvature adds the same small amount to every difference; the median removes it.
    return float(1.4826 * np.median(np.abs(across - np.median(across))) / np.sqrt(1.5))


def on_one_ellipse(points: FloatArray, scatter: float) -> BoolArray:
    """Return which points of one contour lie on the ellipse that most of them agree on, for measuring.

    Parameters
    ----------
    points
        (n, 2) in order along a closed contour, any plane unit.
    scatter
        Standard deviation of a point across the contour, in the same unit: see `local_scatter`.

    Returns
    -------
    (n,) whether each point is within 3 `scatter` of that ellipse. The ellipses through the draws are exact fits, as
    the scatter of a computed contour is that of rounding.
    """
    starts = np.random.default_rng(_SEED).integers(len(points), size=(1, _DRAWS, _SEGMENTS))
    usable = np.ones((1, len(points)), dtype=np.bool_)
    return _most_agreeing(points[None], usable, np.array([_TOLERANCE * scatter]), starts, _fit_exactly)[0]


def on_one_ellipse_each(points: FloatArray, usable: BoolArray, near_px: FloatArray, draws: int) -> BoolArray:
    """Return which points of each of many rims lie on the ellipse that most of them agree on, for hypotheses.

    Parameters
    ----------
    points
        (m, k, 2) px, in order along each of m closed rims.
    usable
        (m, k) the points that take part.
    near_px
        (m,) px, distance from the ellipse up to which a point lies on it.
    draws
        Draws for each rim.

    Returns
    -------
    (m, k) whether each usable point lies on that ellipse. The ellipses through the draws are fast fits.
    """
    number = np.maximum(np.count_nonzero(usable, axis=1), 1)
    starts = np.floor(np.random.default_rng(_SEED).random((draws, _SEGMENTS)) * number[:, None, None])
    return _most_agreeing(points, usable, near_px, starts.astype(np.int64), fit_each)


def _most_agreeing(
    points: FloatArray,
    usable: BoolArray,
    near: FloatArray,
    starts: IntArray,
    fit: Callable[[FloatArray], tuple[Ellipse, BoolArray]],
) -> BoolArray:
    """Return which usable points (m, k) are within `near` (m,) of the drawn ellipse with the most such points.

    `starts` (m, draws, segments) are where the drawn segments start, counted along the usable points; `fit` fits
    ellipses to drawn points (m draws, j, 2).
    """
    rims, draws, _ = starts.shape
    number = np.maximum(np.count_nonzero(usable, axis=1), 1)
    length = max(3, round(_SEGMENT_SHARE * points.shape[1]))
    chosen = (starts[..., None] + np.arange(length)) % number[:, None, None, None]
    # The usable points first, in their order.
    order = np.argsort(~usable, axis=1, kind="stable")
    rows = np.arange(rims)[:, None, None, None]
    ellipses, found = fit(points[rows, order[rows, chosen]].reshape(rims * draws, -1, 2))
    # One rim at a time limits the memory.
    agreeing = np.empty((rims, draws, points.shape[1]), np.bool_)
    for i in range(rims):
        agreeing[i] = np.abs(rim_distance(ellipses[i * draws : (i + 1) * draws], points[i])) <= near[i]
    agreeing &= usable[:, None, :] & found.reshape(rims, draws, 1)
    best = np.argmax(np.count_nonzero(agreeing, axis=2), axis=1)
    return np.asarray(agreeing[np.arange(rims), best])


def _fit_exactly(drawn: FloatArray) -> tuple[Ellipse, BoolArray]:
    """Return the exact fits to the rows of `drawn` (m, j, 2), and which were found (m,)."""
    number, size, _ = drawn.shape
    return fit_ellipses(Contours(drawn.reshape(-1, 2), np.arange(number) * size))
