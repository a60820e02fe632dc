"""Ring targets in each view of an image, gray and color mixes: those of the view that shows most complete ones."""

from __future__ import annotations

from dataclasses import replace

from circlepose._typing import Image
from circlepose.camera.camera import Camera
from circlepose.geometry.ellipse import Ellipse
from circlepose.imaging.color_mixes import ColorMix
from circlepose.measurement.color_views import fit_rims_in, pixels_in
from circlepose.measurement.options import MeasurementOptions
from circlepose.measurement.selection import measure_rings
from circlepose.measurement.trace import Trace
from circlepose.results import Flag
from circlepose.rings.guided_search import with_hidden_rims
from circlepose.rings.matching import match_rings
from circlepose.rings.options import DEFAULT, RingOptions
from circlepose.rings.results import RingTargets, find_ring_targets
from circlepose.targets.target import AxisIntervals, Target


def ring_targets_in_views(
    channels: Image,
    views: tuple[ColorMix | None, ...],
    camera: Camera,
    target: Target,
    intervals: AxisIntervals,
    methods: tuple[str, ...],
    *,
    extraction: str,
    refine: bool,
    keep_fits: bool,
    others: Ellipse | None,
    numbers: MeasurementOptions,
    options: RingOptions = DEFAULT,
) -> tuple[RingTargets, Trace, str]:
    """Return the ring targets of the view that shows most complete ones, and what is special of its pixels.

    Of equal views the first, gray, counts. `others` are circles in the image that are not the target's.
    """
    of_rings = replace(options, measurement=numbers)
    best: tuple[RingTargets, Trace, str] | None = None
    most = 0
    for view in views:
        # Only the fit to the levels can do without pixels that have none.
        pixels = pixels_in(channels, view)
        gray = pixels.whole
        # In a mix, brighter and darker mean nothing.
        wanted = target if view is None else replace(target, polarity="any")
        # The polarity of a ring target is that of its largest circle.
        measured = measure_rings(gray, camera, intervals, extraction=extraction, refine=refine, options=numbers)
        if others is not None:
            measured = measured.without(others, numbers)
        matched = match_rings(measured.rims, camera, wanted, options=of_rings)
        starts = measured.rims
        if refine:
            matched = with_hidden_rims(gray, camera, matched, wanted, options=of_rings)
            starts = tuple(each.rim for each in matched.rims)
        pixels, after = fit_rims_in(pixels, camera, starts, refine=refine, keep_fits=keep_fits, options=numbers)
        found = find_ring_targets(after.rims, matched, camera, wanted, methods, placed=refine, options=of_rings)
        complete = len({c.instance for c in found.circles if Flag.LONE_CIRCLE not in c.flags})
        if best is None or complete > most:
            found = replace(found, rejected=measured.rejected + found.rejected)
            own = (view,) * len(after.rims)
            rims, fits = tuple(after.rims), tuple(after.fits)
            trace = Trace(camera, channels, pixels.own, measured.contours, starts, rims, fits, own)
            best, most = (found, trace, pixels.remark), complete
        if target.count is not None and most >= target.count:
            break
    assert best is not None
    return best
