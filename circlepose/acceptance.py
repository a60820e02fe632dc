"""Whether a fit to grey levels is believed: then the rim is the fit's, with its covariance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.camera import Camera
from circlepose.conic import Ellipse, rim_distance
from circlepose.fitting.direct import Contours
from circlepose.fitting.photometric import LevelsFit
from circlepose.fitting.viewing_cone import ConeFit, rim_distances_px
from circlepose.measure import Rim, image_ellipses

_WORST_NOISE = 0.3
"""Standard deviation of the residuals, as a share of the contrast."""
_ODD, _TINY_PX = 3.0, 7.0
"""Residuals so many times the image's noise are none, on a disc of a semi-minor axis below the second."""
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


def accepted(camera: Camera, rims: Sequence[Rim], fit: LevelsFit, noise_levels: float, lone: BoolArray) -> list[Rim]:
    """Return the m rims as their `fit` has them; as they are where that is not believed.

    `noise_levels` is the image's noise; where a rim is not `lone` (m,), others are in its band.
    """
    done = list(rims)
    believed = np.flatnonzero(_are_believed(rims, fit, noise_levels, lone))
    if len(believed) == 0:
        return done
    factors = fit.factors[believed]
    ellipses, found = image_ellipses(camera, factors)
    # What hides a part of a rim has levels of its own, which pull: there the edges that agree have the last word.
    hidden = np.array([rims[k].rim_used < _FULL_RIM for k in believed.tolist()])
    before = Ellipse.batch([rims[k].ellipse for k in believed.tolist()])
    farthest = np.max(np.abs(rim_distance(before, ellipses.points(_PLACES))), axis=1)
    found &= farthest <= np.where(hidden, _FARTHEST_HIDDEN_PX, _FARTHEST_PX)
    edges = Contours.of([rims[k].points for k in believed.tolist()])
    rays, jacobians = camera.rays_with_jacobian(edges.points)
    residuals = rim_distances_px(factors, edges.owner, rays, jacobians)
    ends = np.append(edges.starts, len(residuals))
    for j, k in enumerate(believed.tolist()):
        if not found[j]:
            continue
        second = np.sqrt(np.trace(fit.covariance[k, 3:, 3:]) / 2.0)
        done[k] = replace(
            rims[k],
            cone=ConeFit(factors[j], residuals[ends[j] : ends[j + 1]]),
            ellipse=ellipses[j],
            rim_used=float(fit.rim_used[k]),
            polarity=-1 if fit.contrast_levels[k] > 0.0 else 1,
            axis_error_px=float(2.0 * second * ellipses[j].semi_major),
            modes_covariance=fit.covariance[k],
        )
    return done


def _are_believed(rims: Sequence[Rim], fit: LevelsFit, noise_levels: float, lone: BoolArray) -> BoolArray:
    minor = np.array([float(rim.ellipse.semi_minor) for rim in rims])
    before: FloatArray = np.array([rim.rim_used for rim in rims])
    share = fit.noise_levels / np.maximum(np.abs(fit.contrast_levels), 1e-9)
    # Of a tiny disc the levels tell no more than the edges where they are not understood.
    odd = (fit.noise_levels > _ODD * noise_levels) & ((lone & (minor < _TINY_PX)) | (share > _WILD))
    blob = minor < _LEAST_SIGMAS * np.exp(fit.blur[:, 0])
    seen = (fit.rim_used > _LEAST_RIM) & (fit.rim_used >= _LEAST_AGAIN * before)
    return np.asarray(fit.converged & (share < _WORST_NOISE) & ~odd & ~blob & seen)
