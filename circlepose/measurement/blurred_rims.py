"""Fits to the gray levels around rims of any blur: those that are wide, in the image reduced until they are not.

Where the blur is several px, the mean of several pixels holds all that each of them does, and the fit is faster. The
cone is the same, as the camera is reduced with the image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose._typing import Image
from circlepose.camera.camera import Camera
from circlepose.imaging.pyramid import Reduced, to_full_size, to_reduced
from circlepose.measurement.intensity_fit import LevelFit, LevelFits, fit_levels
from circlepose.measurement.options import DEFAULT, MeasurementOptions
from circlepose.measurement.rim import Rim, blur_px


def fit_all_levels(
    gray: Image,
    camera: Camera,
    rims: Sequence[Rim],
    *,
    whole: Image | None = None,
    full_scale: int | None = None,
    keep_fits: bool = False,
    options: MeasurementOptions = DEFAULT,
) -> LevelFits:
    """Fit rims to the gray levels around them; parameters and result as of `fit_levels`.

    No fit is kept of a rim that was fitted in a reduced image. Neighbors count where they have the same scale.
    """
    scales = [_scale(rim) for rim in rims]
    full = Reduced(gray)
    done: list[Rim] = list(rims)
    kept: list[LevelFit | None] = [None] * len(rims)
    for scale in sorted(set(scales)):
        which = [i for i, own in enumerate(scales) if own == scale]
        image = full.reduced_to(scale)
        small = [_reduced(rims[i], image) for i in which]
        fits = fit_levels(
            image.levels,
            camera if scale == 1 else camera.reduced_by(scale),
            small,
            whole=whole if scale == 1 else None,
            full_scale=full_scale,
            keep_fits=keep_fits and scale == 1,
            options=options,
        )
        for i, rim, fit in zip(which, fits.rims, fits.fits, strict=True):
            done[i], kept[i] = _in_full_size(rim, image, rims[i]), fit
    return LevelFits(done, kept)


def _scale(rim: Rim) -> int:
    """Return the scale, a power of two, at which the blur of a rim's contour is 1 to 2 px."""
    return 1 << int(np.log2(max(blur_px(rim), 1.0)))


def _reduced(rim: Rim, image: Reduced) -> Rim:
    """Return a rim in px of a reduced image."""
    scale = image.scale
    if scale == 1 or rim.contour is None:
        return rim
    return replace(
        rim,
        ellipse=image.ellipse(rim.ellipse),
        points=to_reduced(rim.points, scale),
        cone=replace(rim.cone, residuals_px=rim.cone.residuals_px / scale),
        axis_error_px=rim.axis_error_px / scale,
        contour=replace(rim.contour, blur_px=rim.contour.blur_px / scale),
    )


def _in_full_size(rim: Rim, image: Reduced, before: Rim) -> Rim:
    """Return a rim, in px of a reduced image, in those of the full one."""
    scale = image.scale
    if scale == 1:
        return rim
    return replace(
        rim,
        ellipse=image.full(rim.ellipse),
        points=to_full_size(rim.points, scale),
        cone=replace(rim.cone, residuals_px=rim.cone.residuals_px * scale),
        axis_error_px=rim.axis_error_px * scale,
        contour=before.contour,
    )
