"""Projective maps from plane to plane, by the direct linear transformation. Pure NumPy."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray


def projected(source: FloatArray, target: FloatArray, points: FloatArray) -> FloatArray:
    """Return `points` (j, 2) by the projective map that takes `source` (k, 2) to `target` (k, 2).

    NaN behind the camera. The map is affine with fewer than 6 points, or those of one line or two.
    """
    homography = fitted_homography(source, target)
    mapped = np.column_stack([points, np.ones(len(points))]) @ homography.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(mapped[:, 2:] > 1e-9, mapped[:, :2] / mapped[:, 2:], np.nan)


def homography_rows(x: FloatArray, y: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """Return (2k, 9) the equations of k pairs of points (x, y), (u, v) for a homography's elements, row by row."""
    one, zero = np.ones_like(x), np.zeros_like(x)
    return np.concatenate(
        [
            np.column_stack([x, y, one, zero, zero, zero, -u * x, -u * y, -u]),
            np.column_stack([zero, zero, zero, x, y, one, -v * x, -v * y, -v]),
        ]
    )


def fitted_homography(source: FloatArray, target: FloatArray) -> FloatArray:
    """Return (3, 3) the least-squares homography from `source` (k, 2) to `target` (k, 2), positive on the source."""
    to_source, to_target = _centered(source), _centered(target)
    x, y = (source @ to_source[:2, :2].T + to_source[:2, 2]).T
    u, v = (target @ to_target[:2, :2].T + to_target[:2, 2]).T
    one = np.ones_like(x)
    affine = np.linalg.lstsq(np.column_stack([x, y, one]), np.column_stack([u, v]), rcond=None)[0]
    local = np.vstack([affine.T, [0.0, 0.0, 1.0]])
    if len(x) >= 6:
        rows = homography_rows(x, y, u, v)
        _, values, vectors = np.linalg.svd(rows, full_matrices=False)
        found = vectors[-1].reshape(3, 3)
        depth = found[2] @ np.stack([x, y, one])
        # Points of one or two lines leave a second solution.
        if values[-2] > 1e-3 * values[0] and (np.all(depth > 0.0) or np.all(depth < 0.0)):
            local = found * np.sign(depth[0])
    return np.asarray(np.linalg.inv(to_target) @ local @ to_source)


def _centered(points: FloatArray) -> FloatArray:
    """Return (3, 3) the map that brings `points` (k, 2) to the mean 0 and about the extent 1."""
    middle, extent = points.mean(axis=0), max(float(np.ptp(points, axis=0).max()), 1e-9)
    return np.array(
        [[1.0 / extent, 0.0, -middle[0] / extent], [0.0, 1.0 / extent, -middle[1] / extent], [0.0, 0.0, 1.0]]
    )
