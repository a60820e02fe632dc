"""Edges along predicted ellipses -> better ellipses, many at once: least squares in the offsets across the rim.

An ellipse is the image `center + A u` of the unit circle, u = (cos p, sin p). With A -> A (I + E), E symmetric, and
a moved centre its rim moves across itself, along the normal n, by n . (dc + A E u): linear in five numbers, which
unlike axes and angle are never degenerate. One linear step is enough, as edges are placed anew after it.
"""

from __future__ import annotations

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.conic import Ellipse, wrap_half_turn

_ROUNDS = 3
_SCALES = (0.1, 1.0)
"""Least and largest scale (px) of the weights that let go of stray edges."""
_RIDGE = 1e-9


def fit_offsets(ellipse: Ellipse, offsets: FloatArray, valid: BoolArray) -> tuple[Ellipse, FloatArray]:
    """Move m ellipses (batch) by what `offsets` (m, k) px, positive outwards, at k eccentric angles ask for.

    Returns them and what is left of the offsets (m, k), to first order. Places not `valid` (m, k) count nothing,
    those that stand apart from the others little.
    """
    places = offsets.shape[1]
    eccentric = np.linspace(0.0, 2.0 * np.pi, places, endpoint=False)
    cos, sin = np.cos(eccentric), np.sin(eccentric)
    a, b = ellipse.semi_major[:, None], ellipse.semi_minor[:, None]
    norm = np.maximum(np.hypot(b * cos, a * sin), 1e-12)
    stretch = a * b / norm
    # In the ellipse's own frame, centred on it.
    slopes = np.stack(
        [b * cos / norm, a * sin / norm, stretch * (cos * cos), stretch * (2.0 * cos * sin), stretch * (sin * sin)],
        axis=-1,
    )
    weights = valid.astype(np.float64)
    rows, median = np.arange(len(offsets)), np.count_nonzero(valid, axis=1) // 2
    size = np.maximum(a * b, 1.0)[:, 0]
    ridge = _RIDGE * np.stack([np.ones_like(size)] * 2 + [size] * 3, axis=-1)[:, :, None] * np.eye(5)
    for _ in range(_ROUNDS):
        weighted = np.swapaxes(slopes * weights[..., None], 1, 2)
        move = np.linalg.solve(weighted @ slopes + ridge, weighted @ offsets[..., None])
        left = offsets - (slopes @ move)[..., 0]
        ordered = np.sort(np.where(valid, np.abs(left), np.inf), axis=1)
        scale = np.clip(1.5 * ordered[rows, median], *_SCALES)[:, None]
        weights = valid / (1.0 + (left / scale) ** 2) ** 2
    return _moved(ellipse, move[..., 0]), left


def _moved(ellipse: Ellipse, move: FloatArray) -> Ellipse:
    dx, dy, e1, e3, e2 = move.T
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    a, b = ellipse.semi_major, ellipse.semi_minor
    # A (I + E) in the ellipse's frame; with its transpose it gives the axes.
    p, q, r, s = a * (1.0 + e1), a * e3, b * e3, b * (1.0 + e2)
    xx, xy, yy = p * p + q * q, p * r + q * s, r * r + s * s
    middle, half = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, xy)
    return Ellipse(
        center=ellipse.center + np.stack([cos * dx - sin * dy, sin * dx + cos * dy], axis=-1),
        semi_major=np.sqrt(middle + half),
        semi_minor=np.sqrt(np.maximum(middle - half, 1e-12)),
        angle=wrap_half_turn(ellipse.angle + 0.5 * np.arctan2(2.0 * xy, xx - yy)),
    )
