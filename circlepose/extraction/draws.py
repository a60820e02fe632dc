"""Edge points of many rims at once, of which a good part is not the rim's -> those that lie on one ellipse.

As `fitting.consensus`, for many rims and with the rough fit: ellipses are drawn through a few short stretches of
each rim, and the one on which most points lie is taken.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.conic import rim_distance
from circlepose.fitting.quick_fit import fit_each

_STRETCHES = 4
_STRETCH_SHARE = 0.07
_SEED = 7


def on_one_ellipse(points: FloatArray, usable: BoolArray, near_px: FloatArray, draws: int) -> BoolArray:
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
