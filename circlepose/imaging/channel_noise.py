"""The noise of the channels of an image, from the differences of neighboring pixels."""

from __future__ import annotations

import numpy as np

from circlepose._typing import FloatArray, Image

_ROWS, _COLUMNS = 32, 48
"""of the image, about, at which differences are taken; cost"""
_ROUNDS = 3
"""rounds in which the smaller half of the differences is selected; numerical"""
_HALF = {1: 7.01, 3: 2.457}
"""variance of normal differences over that of their smaller half, by the number of channels; exact"""


def differences_covariance(channels: Image, alpha: Image | None = None) -> FloatArray:
    """Return the covariance (c, c) of the differences of pixels two apart, of the half that edges do not reach.

    Parameters
    ----------
    channels
        (h, w, c) levels, c being 1 or 3; at least 3 x 3 px. Pixels that are NaN are left out.
    alpha
        (h, w) of the pixels; those that are fully transparent are left out.
    """
    height, width, number = channels.shape
    rows = np.linspace(0, height - 3, min(_ROWS, height - 2)).astype(np.intp)[:, None]
    columns = np.linspace(0, width - 3, min(_COLUMNS, width - 2)).astype(np.intp)
    here = channels[rows, columns].astype(np.float32)
    across, down = (channels[rows + y, columns + x].astype(np.float32) - here for y, x in ((0, 2), (2, 0)))
    steps = np.concatenate([across, down]).reshape(-1, number).astype(np.float64)
    counts = np.isfinite(steps).all(axis=1)
    if alpha is not None:
        counts &= np.concatenate([alpha[rows + y, columns + x] != 0 for y, x in ((0, 2), (2, 0))]).ravel()
        counts &= np.tile((alpha[rows, columns] != 0).ravel(), 2)
    steps = steps[counts]
    if len(steps) == 0:
        return np.zeros((number, number))
    tiny = 1e-9 * (1.0 + np.max(np.abs(steps)) ** 2) * np.eye(number)
    covariance = np.diag(np.median(np.abs(steps), axis=0) ** 2) + tiny
    for _ in range(_ROUNDS):
        distance = np.einsum("nc,nc->n", steps @ np.linalg.inv(covariance), steps)
        near = steps[distance <= np.median(distance)]
        covariance = _HALF[number] * (near.T @ near) / len(near) + tiny
    return covariance
