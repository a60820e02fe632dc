"""Whether a fit to grey levels is believed: then the rim is the fit's, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray, Image
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_fit import ConeFit
from circlepose.fitting.cone_projection import image_ellipses, residuals_px
from circlepose.geometry.conic import Ellipse, rim_distance
from circlepose.measurement.edge_fit import Rim
from circlepose.photometry.levels_fit import LevelsFit

_WORST_NOISE = 0.3
"""Standard deviation of the residuals, as a share of the contrast."""
_ODD, _TINY_PX, _TINY_CROWDED_PX = 3.0, 7.0, 4.5
"""Residuals so many times the image's noise are none, on a disc of a semi-minor axis below the second, or the third
where others come into its band: their light is known in part, and what of it is not explains such residuals."""
_WILD = 0.12
"""The same of any disc, where they are more than this share of the contrast."""
_LEAST_SIGMAS = 2.5
"""Semi-minor axis, in blurs, below which width and blur are hard to tell apart."""
_LEAST_RIM, _LEAST_AGAIN = 0.2, 0.75
"""Share of the rim in use; and of that which the edges had in use."""
_FULL_RIM = 0.9
_FARTHEST_PX, _FARTHEST_HIDDEN_PX = 2.5, 0.05
"""From the rim of the edges; and where a part of that is hidden."""
_PLACES = 48
_NOISE_ROWS, _NOISE_COLUMNS = 64, 128
_LEAST_NOISE = 0.5


def accepted(grey: Image, camera: Camera, rims: Sequence[Rim], fit: LevelsFit, lone: BoolArray) -> list[Rim]:
    """Return the m rims as their `fit` to the levels of `grey` (h, w) has them, or as they are if it is not believed.

    Where a rim is not `lone` (m,), others are in its band.
    """
    done = list(rims)
    believed = np.flatnonzero(_are_believed(grey, rims, fit, lone))
    if len(believed) == 0:
        return done
    factors = fit.factors[believed]
    ellipses, found = image_ellipses(camera, factors)
    # What hides a part of a rim has levels of its own, which pull: there the edges that agree have the last word.
    hidden = np.array([_is_hidden(rims[k], float(fit.rim_used[k])) for k in believed.tolist()])
    before = Ellipse.batch([rims[k].ellipse for k in believed.tolist()])
    farthest = np.max(np.abs(rim_distance(before, ellipses.points(_PLACES))), axis=1)
    found &= farthest <= np.where(hidden, _FARTHEST_HIDDEN_PX, _FARTHEST_PX)
    residuals = residuals_px(camera, factors, ellipses, [rims[k].points for k in believed.tolist()])
    for j, k in enumerate(believed.tolist()):
        if not found[j]:
            continue
        second = np.sqrt(np.trace(fit.covariance[k, 3:, 3:]) / 2.0)
        points, off = rims[k].points, residuals[j]
        if rims[k].modes_covariance is not None:
            # The points were those of its own ellipse: no edges, from which to be off.
            points, off = ellipses[j].points(len(points)), rims[k].cone.residuals_px
        done[k] = replace(
            rims[k],
            cone=ConeFit(factors[j], off),
            points=points,
            ellipse=ellipses[j],
            rim_used=float(fit.rim_used[k]),
            polarity=-1 if fit.contrast_levels[k] > 0.0 else 1,
            axis_error_px=float(2.0 * second * ellipses[j].semi_major),
            modes_covariance=fit.covariance[k],
        )
    return done


def _is_hidden(rim: Rim, used_again: float) -> bool:
    """Tell whether a part of a rim is hidden; a thin rim fitted as a whole leaves out what is only shaded, too."""
    return rim.rim_used < _FULL_RIM and (rim.modes_covariance is None or used_again < _FULL_RIM)


def _are_believed(grey: Image, rims: Sequence[Rim], fit: LevelsFit, lone: BoolArray) -> BoolArray:
    minor = np.array([float(rim.ellipse.semi_minor) for rim in rims])
    before: FloatArray = np.array([rim.rim_used for rim in rims])
    share = fit.noise_levels / np.maximum(np.abs(fit.contrast_levels), 1e-9)
    # Of a tiny disc the levels tell no more than the edges where they are not understood.
    odd = (minor < np.where(lone, _TINY_PX, _TINY_CROWDED_PX)) | (share > _WILD)
    if odd.any():
        odd &= fit.noise_levels > _ODD * noise_of(grey)
    blob = minor < _LEAST_SIGMAS * np.exp(fit.blur[:, 0])
    seen = (fit.rim_used > _LEAST_RIM) & (fit.rim_used >= _LEAST_AGAIN * before)
    return np.asarray(fit.converged & (share < _WORST_NOISE) & ~odd & ~blob & seen)


def noise_of(grey: Image) -> float:
    """Return about the standard deviation of the noise in `grey` (h, w), levels, from neighbours in sampled rows."""
    height, width = grey.shape
    if width < 3:
        return _LEAST_NOISE
    down, across = max(1, height // _NOISE_ROWS), max(1, width // _NOISE_COLUMNS)
    left, middle, right = (grey[::down, i : width - 2 + i : across].astype(np.float32) for i in range(3))
    bends = middle - (left + right) / 2.0
    return max(1.4826 * float(np.nanmedian(np.abs(bends))) / np.sqrt(1.5), _LEAST_NOISE)
