"""The tunable numbers of edge chains and arcs.

The source of each number is named: `statistical` follows from a noise model, `numerical` from the arithmetic or the
pixel grid, `cost` bounds time or memory, and `empirical` was set by trial on rendered images and photographs. Lengths
are px of the image at hand, which may be a reduced one; a share is from 0 to 1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class EdgeOptions:
    """Numbers of the edges that contours start from."""

    # Canny edges.
    blur_px: float = 0.8
    """px; sigma of the blur, enough against pixel noise; more joins discs that nearly touch; empirical"""
    blur_size: int = 5
    """px; side of the kernel of that blur; numerical"""
    quiet_share: float = 0.25
    """share of the pixels that is taken to show noise and texture only; empirical"""
    noise_factor: float = 9.5
    """high threshold over the gradient that the quiet pixels stay below; 6 medians of white noise; statistical"""
    least_gradient: float = 14.0
    """L1 Sobel units (8 per level and px); least high threshold, that of noise of one level: below it rounding and
    compression have edges; statistical"""
    hysteresis: float = 0.4
    """low threshold over the high one; empirical"""
    unexplained_gradient: float = 20.0
    """L1 Sobel units; least high threshold of the edges for which the next finer image is searched: a line 1 px wide
    there, 5 levels high; numerical"""

    # Arcs of chains.
    arc_span: int = 6
    """points on either side over which the turning of a chain is measured; empirical"""
    corner_rad: float = math.radians(22.0)
    """rad; a corner turns by more than this, plus the next; empirical"""
    corner_turns: float = 1.5
    """times the turning of a circle as long as the chain; empirical"""
    bend_rad: float = math.radians(14.0)
    """rad; turning that the pixel grid alone does not cause; numerical"""
    shortest_chain: int = 60
    """points in the shortest chain that is cut into arcs; empirical"""
    shortest_arc: int = 20
    """points in the shortest arc; empirical"""
    twin_px: float = 2.0
    """px; arcs with middles closer than this may be two sides of one edge; numerical"""
    twin_share: float = 0.1
    """relative difference in length up to which they are; empirical"""

    # Arcs of one rim.
    most_arcs: int = 100
    """arcs of one image tried in pairs, the longest; pairs grow with the square; cost"""
    most_arc_groups: int = 200
    """pairs that are completed to groups, the fullest; cost"""
    least_bulge: float = 0.02
    """sagitta over chord below which an arc is a straight line; empirical"""
    least_chord_px: float = 15.0
    """px; shorter chords are not tested for bulging unless the arc is twice as long; empirical"""
    pair_px: float = 0.8
    """px; rms distance from the common ellipse up to which two arcs agree; empirical"""
    pair_share: float = 0.004
    """the same as a share of its semi-major axis, the larger of both counts; empirical"""
    least_pair_cover: float = 0.2
    """share of the perimeter that two arcs must cover; empirical"""
    least_group_cover: float = 0.35
    """share of the perimeter that all arcs of a group must cover; empirical"""
    most_group_cover: float = 2.3
    """the same at most: both borders of one edge may count, hence some twice the rim; empirical"""
    group_px: float = 2.0
    """px; distance from a pair's ellipse up to which a further arc is of its group; empirical"""
    group_share: float = 0.04
    """the same as a share of the semi-major axis, the larger of both counts; empirical"""

    # Region borders that coincide with edges.
    border_thresholds: int = 16
    """thresholds at which regions are sought; cost"""
    least_border_on_edge: float = 0.5
    """share of a border that must lie on edges; empirical"""
    nest_px: float = 3.0
    """px; borders whose boxes differ by less are of one nest; empirical"""
    nest_share: float = 0.06
    """the same as a share of the box's longer side, the larger of both counts; empirical"""


DEFAULT = EdgeOptions()
