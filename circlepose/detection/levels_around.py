"""What the levels around a rim say: whether it bounds a region, and whether its edge is wider than the profiles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose._typing import BoolArray, FloatArray
from circlepose.detection.options import DetectionOptions
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.pyramid import Reduced
from circlepose.imaging.subpixel_edges import RimEdges, edges_along, sample


def are_hollow(
    image: Reduced, ellipse: Ellipse, edges: RimEdges, on_rim: BoolArray, options: DetectionOptions
) -> BoolArray:
    """Return (m,) which rims bound no region: small, or seen in part, with the levels of one side on the other, too.

    The line of a letter has them in its middle, or all around. Of a large rim that is seen whole, a line will do.
    """
    is_small = ellipse.semi_minor < options.chance_px
    hollow = np.zeros(len(ellipse), np.bool_)
    which = np.flatnonzero(is_small | (on_rim.mean(axis=1) < options.whole_rim))
    if len(which) == 0:
        return hollow
    own, px = ellipse[which], options.around_px
    places = [(options.middle_share, 0.0), (options.inner_share, 0.0), (1.0, px)]
    middle, inner, around = _above_rim(image, own, edges.polarity[which], on_rim.shape[1], places)
    seen = on_rim[which]
    is_inside = np.sum((inner < 0.0) & seen, axis=1) >= options.least_inside * np.maximum(seen.sum(axis=1), 1)
    of_small = (middle.mean(axis=1) > 0.0) | (np.mean(around < 0.0, axis=1) > options.around_share)
    hollow[which] = np.where(is_small[which], of_small, False) | ~(
        is_inside | (seen.mean(axis=1) >= options.whole_rim)
    )
    return hollow


def are_solid(image: Reduced, ellipse: Ellipse, polarity: FloatArray, options: DetectionOptions) -> BoolArray:
    """Return (m,) which rims are those of discs, not of the outlines of letters or the holes in them.

    Inside the levels are all on one side of the rim's, and beyond it on the other. `ellipse` (m,) in px of `image`.
    """
    places = [(options.middle_share, 0.0), (options.inner_share, 0.0), (options.beyond_share, 0.0)]
    middle, inner, beyond = _above_rim(image, ellipse, polarity, options.samples, places)
    is_inside = [np.mean(each < 0.0, axis=1) >= options.solid_share for each in (middle, inner)]
    return np.asarray(is_inside[0] & is_inside[1] & (np.mean(beyond > 0.0, axis=1) >= options.least_beyond))


def _above_rim(
    image: Reduced, ellipse: Ellipse, polarity: FloatArray, samples: int, places: Sequence[tuple[float, float]]
) -> list[FloatArray]:
    """Return for each of the `places`, a share of the axes and px added, by how much levels there are on the outside.

    (m, samples) levels, less those at the rim: negative as inside.
    """
    at_rim = sample(image.levels, ellipse.points(samples))[0]
    above = []
    for share, px in places:
        axes = share * ellipse.semi_major + px, share * ellipse.semi_minor + px
        levels = sample(image.levels, Ellipse(ellipse.center, *axes, ellipse.angle).points(samples))[0]
        above.append(polarity[:, None] * (levels - at_rim))
    return above


def are_wide(
    image: Reduced, ellipse: Ellipse, edges: RimEdges, step: FloatArray, options: DetectionOptions
) -> BoolArray:
    """Return (m,) which edges are so much higher in the next smaller image that the profiles hold only a part.

    What is too small to be located there is wide where its edge is elsewhere in it.
    """
    wide = np.zeros(len(ellipse), np.bool_)
    which = np.flatnonzero((edges.blur_px > options.wide_px) & (ellipse.semi_minor >= 2.0 * options.least_halved_px))
    if len(which):
        own = image.half.ellipse(image.full(ellipse[which]))
        half = edges_along(image.half.levels, own, options.last_half_width_px, options.samples, quick=True)
        count = np.maximum(np.count_nonzero(half.valid, axis=1), 1)
        height = np.abs(np.sum(np.where(half.valid, half.step, 0.0), axis=1)) / count
        on_it = half.valid & (np.abs(half.offset_px) <= options.rim_tolerance_px)
        may_be_located = own.semi_minor >= options.least_reduced_px
        is_elsewhere = may_be_located | (on_it.mean(axis=1) < options.whole_rim)
        wide[which] = is_elsewhere & (height > options.wide_growth * step[which])
    return wide
