"""An image -> candidates, from coarse to fine.

A reduced image shows large circles at little cost, and they are not sought again in finer ones.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field, replace

import numpy as np

from circlepose._batching import joined
from circlepose._typing import Image
from circlepose.detection import EXTRACTIONS
from circlepose.detection.chosen import Chosen, Wanted, chosen, least_evident, settled, whole
from circlepose.detection.contour import Rejection
from circlepose.detection.hypotheses import rough_ellipses
from circlepose.detection.location import located, located_in_reduced
from circlepose.detection.options import DetectionOptions
from circlepose.detection.surroundings import Surroundings
from circlepose.detection.unexplained_edges import unexplained_tiles
from circlepose.detection.verification import Candidates
from circlepose.geometry.ellipse import NO_ELLIPSES, Ellipse
from circlepose.imaging.pyramid import Reduced
from circlepose.photometry.thin.fit import are_thin


@dataclass(frozen=True, slots=True, eq=False)
class Search:
    """What was found so far."""

    found: Candidates | None = None
    """None without any"""
    chosen: Chosen = field(default_factory=lambda: Chosen([], {}))
    thin: tuple[Ellipse, ...] = ()
    """what may be circles seen edge-on, of the finer images, the coarsest first"""
    surroundings: Surroundings | None = None
    """the edges of the full image, if it was searched"""
    is_complete: bool = False
    """whether all images were searched, down to the full one"""


def search(
    full: Reduced, images: list[Image], range_: float, wanted: Wanted, extraction: str, *, lines: bool
) -> tuple[Search, Counter[Rejection]]:
    """Look for candidates from coarse to fine, until there are enough.

    Parameters
    ----------
    full
        The image in which edges are located.
    images
        Those in which they are sought, from full size on, each half as large as the one before.
    range_
        Levels between the darkest and the brightest pixel.
    wanted
        The contours looked for.
    extraction
        A name of `EXTRACTIONS`.
    lines
        Whether lines are collected, that may be circles seen edge-on.

    Returns
    -------
    What was found, and how many hypotheses were rejected for which reason.
    """
    options, enough, asked = wanted.options, wanted.enough, wanted.options.asked_score or 0.0
    state, rejected = Search(), Counter[Rejection]()
    # Of rings the other side of a wall may be so close to a known rim that only the full image shows both.
    may_pass_over = not wanted.keep_concentric and extraction == EXTRACTIONS[0]
    may_end = enough is not None and not slivers_wanted(wanted)
    for level in _order(images, options):
        if state.is_complete and enough is not None and len(state.chosen.kept) >= enough:
            break
        known = _known(images[level], state, options)
        state = replace(state, is_complete=state.is_complete or level == 0)
        may_explain = level == 0 and len(known) > 0 and may_pass_over
        tiles = unexplained_tiles(images[1], known, 2.0, options) if may_explain else None
        if tiles is not None and not tiles.any():
            continue
        hypotheses = rough_ellipses(
            images[level], 2.0**level, wanted.intervals, known, extraction, tiles, lines=lines, options=options
        )
        rough = hypotheses.ellipse
        if lines:
            are_lines = are_thin(rough, options=options.photometry)
            if level < options.line_levels:
                state = replace(state, thin=(*state.thin, rough[are_lines]))
            rough = rough[~are_lines]
        first = located(full, rough, options.first_half_width_px + options.half_width_per_scale * 2.0**level, options)
        rejected.update(hypotheses.rejected + first.rejected)
        new = [each for each in (state.found, first.found) if each is not None]
        new += located_in_reduced(full, first, wanted.why_not, options)
        state = replace(state, surroundings=hypotheses.surroundings or state.surroundings)
        if new:
            found = joined(new)
            state = replace(state, found=found, chosen=chosen(found, wanted))
        if may_end and state.found is not None and images[level].size >= options.least_pixels:
            # No circle that is missed at this scale has more evidence.
            most = np.pi * options.certain_px * 2.0**level * range_
            sure = [i for i in whole(state.found, state.chosen, options) if state.found.score[i] >= asked]
            if least_evident(state.found, sure, enough) > most:
                break
    return state, rejected


def slivers_wanted(wanted: Wanted) -> bool:
    """Return whether circles seen nearly edge-on are asked for."""
    minor_px = wanted.intervals.minor_px
    return minor_px is not None and minor_px[0] < 2.0 * wanted.options.photometry.thin.thin_px


def _order(images: list[Image], options: DetectionOptions) -> list[int]:
    """Return the levels of the search: from coarse to fine, the smallest last, which show what drowns in others."""
    last = [level for level in range(2, len(images)) if images[level].size < options.least_pixels]
    return [*reversed(range(len(images) - len(last))), *last]


def _known(image: Image, state: Search, options: DetectionOptions) -> Ellipse:
    """Return the rims that need not be looked for again in `image`.

    What the smallest images show is looked for again, as concentric rims are one in them, unless all others were
    looked at.
    """
    if state.found is None or (image.size < 4.0 * options.least_pixels and not state.is_complete):
        return NO_ELLIPSES
    return state.found.ellipse[settled(state.found, state.chosen.reasons, options)]
