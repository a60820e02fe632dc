"""Edges along predicted ellipses -> better ellipses, many at once: least squares in the offsets across the rim.

An ellipse is the image `center + A u` of the unit circle, u = (cos p, sin p). With A -> A (I + E), E symmetric, and
a center moved by dc, its rim moves along the normal n by n . (dc + A E u): linear in five numbers, which unlike axes
and angle are never degenerate. One linear step is enough, as edges are located anew after it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.geometry.ellipse import Ellipse, own_normals, unit_circle, wrap_half_turn

_RIDGE = 1e-9
"""px^2; added to the normal equations, so that a rim without edges has a solution; numerical."""


def fit_offsets(
    ellipse: Ellipse, offsets: FloatArray, valid: BoolArray, options: DetectionOptions = DEFAULT
) -> tuple[Ellipse, FloatArray]:
    """Move m ellipses (batch) to edges at `offsets` (m, k), px, positive outwards, at k eccentric angles.

    Returns the ellipses and the remaining offsets (m, k), to first order. Samples that are not `valid` (m, k) have no
    weight, outliers little.
    """
    samples = offsets.shape[1]
    cos, sin = unit_circle(samples)
    area = (ellipse.semi_major * ellipse.semi_minor)[:, None]
    normal_x, normal_y, per_norm = own_normals(ellipse, samples)
    growth = area * per_norm
    # In the ellipse's own frame, with its center as the origin.
    slopes = np.empty((len(offsets), 5, samples))
    slopes[:, 0], slopes[:, 1] = normal_x, normal_y
    slopes[:, 2], slopes[:, 4] = growth * (cos * cos), growth * (sin * sin)
    slopes[:, 3] = growth * (2.0 * cos * sin)
    weights = valid.astype(np.float64)
    rows, median = np.arange(len(offsets)), np.count_nonzero(valid, axis=1) // 2
    ridge = np.zeros((len(offsets), 5, 5))
    ridge[:, range(5), range(5)] = _RIDGE
    ridge[:, range(2, 5), range(2, 5)] *= np.maximum(area, 1.0)
    for _ in range(options.offset_rounds):
        weighted = slopes * weights[:, None]
        move = np.linalg.solve(weighted @ slopes.transpose(0, 2, 1) + ridge, weighted @ offsets[..., None])
        left = offsets - (move.transpose(0, 2, 1) @ slopes)[:, 0]
        ordered = np.sort(np.where(valid, np.abs(left), np.inf), axis=1)
        scale = np.maximum(options.offset_scale * ordered[rows, median], options.least_offset_scale_px)
        scale = np.minimum(scale, options.most_offset_scale_px)[:, None]
        weights = 1.0 + (left / scale) ** 2
        weights = valid / (weights * weights)
    return _moved(ellipse, np.asarray(move[..., 0])), left


def _moved(ellipse: Ellipse, move: FloatArray) -> Ellipse:
    """Return the ellipses after the step (m, 5): dc along both axes, then E as its entries xx, xy, yy."""
    dx, dy, e1, e3, e2 = move.T
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    a, b = ellipse.semi_major, ellipse.semi_minor
    # A (I + E) in the ellipse's frame; with its transpose it gives the axes.
    p, q, r, s = a * (1.0 + e1), a * e3, b * e3, b * (1.0 + e2)
    xx, xy, yy = p * p + q * q, p * r + q * s, r * r + s * s
    moved = Ellipse.from_square(
        ellipse.center + np.stack([cos * dx - sin * dy, sin * dx + cos * dy], axis=-1), xx, xy, yy
    )
    return replace(moved, angle=wrap_half_turn(ellipse.angle + moved.angle))
