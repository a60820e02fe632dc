"""Edge points of which a good part is not the rim's -> those that lie on one ellipse.

Where something hides part of a rim, its own edges stand along the hidden part, smooth and close: they pull a
fit without standing out from it. So ellipses are drawn through a few short stretches of the rim at a time, and
the one on which most points lie as closely as neighbouring points agree with each other is taken.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.fitting.direct import Contours, fit_ellipses
from circlepose.fitting.direct_batch import fit_each
from circlepose.geometry.ellipse import rim_distance

_DRAWS = 120
_STRETCHES = 4
_STRETCH_SHARE = 0.07
_TOLERANCE = 3.0
"""In units of the points' own scatter."""
_SEED = 7


def local_scatter(points: FloatArray) -> float:
    """Return how far neighbouring points (n, 2) of a contour stray from each other across it, robustly.

    From second differences, which a smooth contour hardly has, whatever its shape.
    """
    middle = points - (np.roll(points, 1, axis=0) + np.roll(points, -1, axis=0)) / 2.0
    tangent = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    tangent = tangent / np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    across = middle[:, 0] * tangent[:, 1] - middle[:, 1] * tangent[:, 0]
    # Curvature gives every difference the same small share, which the median takes out.
    return float(1.4826 * np.median(np.abs(across - np.median(across))) / np.sqrt(1.5))


def on_one_ellipse(points: FloatArray, scatter: float) -> BoolArray:
    """Tell which of the contour's `points` (n, 2), in order, lie on the ellipse that most agree on, (n,).

    The draws are the same at every call, so that equal points give equal answers.
    """
    number = len(points)
    length = max(3, round(_STRETCH_SHARE * number))
    generator = np.random.default_rng(_SEED)
    starts = generator.integers(number, size=(_DRAWS, _STRETCHES))
    chosen = (starts[:, :, None] + np.arange(length)) % number
    drawn = points[chosen.reshape(_DRAWS, -1)]
    size = drawn.shape[1]
    ellipses, found = fit_ellipses(Contours(drawn.reshape(-1, 2), np.arange(_DRAWS) * size))
    near = np.abs(rim_distance(ellipses, np.broadcast_to(points, (_DRAWS, *points.shape)))) <= _TOLERANCE * scatter
    votes = np.where(found, near.sum(axis=1), 0)
    return np.asarray(near[int(np.argmax(votes))])


def on_one_ellipse_each(points: FloatArray, usable: BoolArray, near_px: FloatArray, draws: int) -> BoolArray:
    """Tell (m, k) which `usable` (m, k) ones of the `points` (m, k, 2) of m rims, in order, lie on one ellipse.

    Closer than `near_px` (m,). The draws are the same at every call, so that equal points give equal answers.
    """
    rims, places = usable.shape
    number = np.maximum(np.count_nonzero(usable, axis=1), 1)
    length = max(3, round(_STRETCH_SHARE * float(number.max())))
    starts = np.floor(np.random.default_rng(_SEED).random((draws, _STRETCHES)) * number[:, None, None])
    chosen = (starts[..., None].astype(np.int64) + np.arange(length)) % number[:, None, None, None]
    # The usable ones first, in their order.
    order = np.argsort(~usable, axis=1, kind="stable")
    rows = np.arange(rims)[:, None, None, None]
    drawn = points[rows, order[rows, chosen]].reshape(rims * draws, -1, 2)
    ellipses, found = fit_each(drawn)
    # Of one rim at a time, which bounds the memory.
    near = np.empty((rims, draws, places), np.bool_)
    for i in range(rims):
        near[i] = np.abs(rim_distance(ellipses[i * draws : (i + 1) * draws], points[i])) <= near_px[i]
    near &= usable[:, None, :] & found.reshape(rims, draws, 1)
    best = np.argmax(np.count_nonzero(near, axis=2), axis=1)
    return np.asarray(near[np.arange(rims), best])
