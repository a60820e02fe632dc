"""The tunable numbers of detection: from an image to verified contours.

The source of each number is named: `statistical` follows from a noise model, `numerical` from the arithmetic or the
pixel grid, `cost` bounds time or memory, and `empirical` was set by trial on rendered images and photographs. Lengths
are px of the full image unless said otherwise; a share is from 0 to 1. The search half-widths of detection and of
measurement differ by purpose: detection starts from a rough ellipse, measurement from a verified one.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Self

from circlepose.detection.edges.options import EdgeOptions
from circlepose.photometry.options import PhotometryOptions


@dataclass(frozen=True, slots=True)
class DetectionOptions:
    """Numbers of the detection."""

    edges: EdgeOptions = field(default_factory=EdgeOptions)
    """those of edge chains and arcs"""
    photometry: PhotometryOptions = field(default_factory=PhotometryOptions)
    """those of the fits to gray levels, here of slivers"""

    # Sizes that follow from a depth range.
    smallest_major_px: float = 5.0
    """px; shortest major axis that is sought; empirical"""
    size_slack: float = 0.1
    """relative margin of the sizes that follow from a depth range; empirical"""
    far_circle_share: float = 0.8
    """distance ratio of two coaxial circles, the smaller being the farther one, at least; empirical"""

    # Hypotheses: chains of one scale, in px of the reduced image, and the ellipses that they suggest.
    shortest_chain: int = 12
    """points in the shortest chain: the border of a circle 5 px across; numerical"""
    least_extent_px: float = 8.0
    """px of a reduced image; smaller chains are left to the next finer one; empirical"""
    axis_slack_px: float = 4.0
    """px; how far an axis of a rough ellipse may be outside its interval; empirical"""
    least_fullness: float = 0.9
    """area in a closed chain over that of its moment ellipse, from which it may be an ellipse; empirical"""
    closed_rms_px: float = 0.5
    """px; rms distance of a closed chain from its ellipse that the pixel grid causes; numerical"""
    rough_rms_px: float = 1.0
    """px; rms distance of an open chain up to which it is a hypothesis; empirical"""
    rough_rms_share: float = 0.03
    """the same as a share of the minor axis, the larger of both counts; empirical"""
    close_rms_px: float = 0.6
    """px; a chain this close to its ellipse is of the ellipse alone; empirical"""
    close_rms_share: float = 0.01
    """the same as a share of the semi-major axis, the larger of both counts; empirical"""
    trim_rounds: int = 3
    """rounds of a robust fit to a chain; empirical"""
    trim_scale: float = 1.5
    """rms distances; scale of the robust weights; empirical"""
    least_trim_px: float = 0.7
    """px; the same at least; numerical"""
    least_chain_cover: float = 0.35
    """share of the perimeter that a chain on its ellipse must cover; empirical"""
    mostly_share: float = 0.6
    """share of an open chain that must lie on its ellipse; empirical"""
    nearly_all_share: float = 0.9
    """the same of a chain that is of the ellipse alone; empirical"""
    shortest_open_chain: int = 20
    """points in the shortest open chain; empirical"""
    most_open_chains: int = 400
    """open chains of one scale that are fitted, the longest; cost"""
    most_arc_points: int = 40_000
    """points of chains of one scale that are cut into arcs, the longest chains first; cost"""
    most_from_arcs: int = 80
    """hypotheses from arcs of one scale, the fullest; cost"""
    line_semi_major_px: float = 15.0
    """px; semi-major axis from which a line may be a circle seen edge-on; empirical"""
    known_share: float = 0.7
    """share of a chain on known rims from which it suggests nothing new; empirical"""
    twin_area: float = 0.25
    """relative difference in area up to which the hole in an edge is the same edge; empirical"""
    least_open_ratio: float = 0.1
    """least axis ratio of an open chain's ellipse where no circle edge-on is sought; empirical"""

    # Edges located along hypotheses.
    first_half_width_px: float = 3.5
    """px; half-width of the first search across a rough ellipse; empirical"""
    half_width_per_scale: float = 0.5
    """px; added to it per unit of the scale at which the hypothesis was found; empirical"""
    last_half_width_px: float = 2.5
    """px; half-width of the last search, and of the search along partly hidden rims; empirical"""
    samples: int = 72
    """samples along the rim at which a candidate is verified; empirical"""
    first_samples: int = 36
    """the same in the first of two passes; cost"""
    few_hypotheses: int = 8
    """up to this many hypotheses get all samples in the first pass; cost"""
    settled_offset_px: float = 1.0
    """px; with all edges this close after a full pass there is no second one; empirical"""
    least_edge_share: float = 0.27
    """share of the samples along a candidate that must have an edge; empirical"""
    small_semi_major_px: float = 12.0
    """px; semi-major axis below which no hidden part is assumed; empirical"""
    least_edge_share_small: float = 0.5
    """share of the samples along such a small candidate that must have an edge; empirical"""
    most_growth: float = 4.0
    """length of a moved ellipse over its length before, at most; empirical"""
    near_px: float = 1.0
    """px; distance of an edge from the moved ellipse up to which it supports it; empirical"""
    near_share: float = 0.01
    """the same as a share of the semi-major axis, the larger of both counts; empirical"""
    offset_rounds: int = 3
    """rounds of the robust fit to offsets across the rim; empirical"""
    offset_scale: float = 1.5
    """scale of the robust weights, in medians of the absolute offsets; empirical"""
    least_offset_scale_px: float = 0.1
    """px; the same at least; empirical"""
    most_offset_scale_px: float = 1.0
    """px; the same at most; empirical"""

    # Verification.
    least_major_px: float = 6.0
    """px; shortest major axis of a contour; empirical"""
    least_minor_px: float = 3.0
    """px; shortest minor axis where none is asked for; empirical"""
    rim_tolerance_px: float = 0.75
    """px; distance up to which an edge is of the rim; empirical"""
    rim_tolerance_share: float = 0.008
    """the same as a share of the semi-major axis, the larger of both counts; empirical"""
    close_px: float = 2.5
    """px; distance up to which an edge that is not of the rim is close to it; empirical"""
    rim_tolerance_sigmas: float = 2.5
    """scatters of an edge by noise, up to which it is of the rim, the largest counts; statistical"""
    ragged_px: float = 0.2
    """px; largest rms distance of the edges from the ellipse: pixel noise; empirical"""
    ragged_share: float = 0.004
    """share of the semi-major axis added to it: what a lens bends within a large ellipse; empirical"""
    half_ragged: float = 0.5
    """share of the largest rms distance up to which a rim is smooth; empirical"""
    least_rim: float = 0.55
    """share of the rim that must stand on the edge where it is smooth; empirical"""
    clean_rim: float = 0.8
    """the same where it is not; empirical"""
    clean_thin_rim: float = 0.95
    """the same of a thin ellipse, which any two neighboring edges resemble; empirical"""
    least_partial_rim: float = 0.42
    """the same of a rim fitted to long runs of edges, which must be smooth; empirical"""
    least_step_share: float = 0.012
    """least height of an edge, as a share of the gray range in use; empirical"""
    least_step_of_typical: float = 0.3
    """least height of a small rim's edge over the typical one of the image's circles; empirical"""
    chance_px: float = 8.0
    """px; semi-minor axis below which things are round by chance, so that a faint one beside strong ones does not
    count; empirical"""
    middle_share: float = 0.4
    """size of the ellipse on which the level in the middle of a rim is taken, over the rim's; empirical"""
    around_px: float = 3.0
    """px; distance outside a small rim at which the level around it is taken; empirical"""
    around_share: float = 0.85
    """share of the surroundings that are as what is inside, from which the rim is a line's; empirical"""
    inner_share: float = 0.7
    """size of the ellipse on which the level inside a rim seen in part is taken, over the rim's; empirical"""
    least_inside: float = 0.7
    """share of what is seen of the rim where this level is that of the inside; empirical"""
    solid_share: float = 0.95
    """share of what is inside a rim on that side of the edge, from which it is a disc's; empirical"""
    beyond_share: float = 2.0
    """size of the ellipse on which the level beyond a disc is taken, over the rim's; empirical"""
    least_beyond: float = 0.5
    """share of it on the outer side of the edge: a hole in the line of a letter has the inner one; empirical"""
    noise_step: float = 1.5
    """noises; mean height of the edges that are found along an ellipse in white noise; empirical"""
    noise_step_scatter: float = 0.9
    """noises; its standard deviation over such ellipses, times the root of their length in px; empirical"""
    noise_sigmas: float = 6.0
    """standard deviations above it, from which an edge is not noise: 1e-9 for each ellipse that is tried, so 1e-5 for
    an image with ten thousand of them; statistical"""
    stair_levels: float = 3.2
    """levels; highest step that rounding and compression make of a slope without noise; empirical"""
    stair_share: float = 0.35
    """the same as a share of the range of the image: a slope is of several steps; empirical"""
    least_corners: int = 3
    """corners of the polygons that are told from circles, at least; exact"""
    most_corners: int = 16
    """the same at most: with more, an edge errs by less than 0.8 % of the radius; empirical"""
    polygon_slack: float = 0.5
    """relative difference of the harmonic's height from a regular polygon's, at most; empirical"""
    polygon_chance: float = 1e-6
    """probability by chance of the share of the residuals that is in the one harmonic, at most; statistical"""
    least_side_px: float = 3.0
    """px; shortest side of a polygon that can be seen; numerical"""
    stray_px: float = 0.08
    """px; rms distance from the ellipse that halves the quality; empirical"""
    stray_share: float = 0.015
    """share of the semi-minor axis added to it; empirical"""
    uneven: float = 0.15
    """relative spread of the edge's height along the rim that halves the quality; empirical"""
    uneven_per_px: float = 0.02
    """1/px; added to it per px of the semi-minor axis; empirical"""
    least_quality: float = 0.3
    """least quality of a contour, 0 to 1; empirical"""
    evidence_rms_px: float = 0.5
    """px; rms distance from the ellipse that halves the evidence; empirical"""
    least_score: float = 0.32
    """least score of a contour, 0 to 1: its quality times the share of its rim; empirical"""
    asked_score: float | None = None
    """the same that a caller asks for, of all that is found; None for the least; exact"""
    ring_leniency: float = 0.5
    """factor on both for the rims of rings, which are checked against each other later; empirical"""
    hopeless_quality: float = 0.15
    """quality after the first pass below which a whole rim is dropped; empirical"""
    hopeless_partial_quality: float = 0.1
    """the same of a rim seen in part; empirical"""

    # What is round by chance among the shapes around it: see `surroundings`.
    around_semi_majors: float = 8.0
    """semi-major axes; distance up to which shapes are around a contour; empirical"""
    least_alike: float = 0.5
    """size of a shape over the contour's, from which it is of its size; empirical"""
    alike_height: float = 0.5
    """height of a shape's edge over the contour's, from which it is of its kind; empirical"""
    evident_px: float = 5.0
    """px; semi-minor axis from which the score tells discs from what is round by chance; empirical"""
    evident_score: float = 0.8
    """score from which it is a disc: 3 % of what is round by chance has it, and most discs; empirical"""
    most_noise_around: float = 0.2
    """noise over the height of an edge, above which noise has edges half as high: levels differ by five noises in
    5 x 5 px; statistical"""
    own_semi_majors: float = 1.2
    """semi-major axes; distance up to which shapes belong to the contour; empirical"""
    chance_score: float = 0.32
    """score of what is round by chance as likely as not: the least by default; exact"""
    chance_odds: float = 2.0
    """shapes that are not round for each that is by chance, where their semi-minor axis is `chance_px`; empirical"""
    least_around: float = 5.0
    """such shapes, at least, from which they are many; empirical"""

    # The look at reduced images, in px of these.
    noisy_share: float = 0.1
    """noise over the height of an edge, from which it stands out better in a reduced image; empirical"""
    wide_px: float = 0.95
    """px; measured blur from which an edge may be wider than the profiles, which show 1.1 at most; empirical"""
    wide_growth: float = 1.25
    """height of an edge in the next smaller image over that here, from which it is: that of 1.7 px; empirical"""
    rough_px: float = 15.0
    """px; semi-minor axis from which an edge that is rough by 2 % of it may be out of reach; numerical"""
    least_reduced_px: float = 3.5
    """px; semi-minor axis down to which an image is reduced for a candidate; numerical"""
    least_halved_px: float = 2.0
    """px; semi-minor axis down to which a reduced image shows whether an edge is there or elsewhere; numerical"""
    reduced_half_width_px: float = 3.5
    """px; half-width of the first search across a candidate; empirical"""

    # The end of the search from coarse to fine.
    whole_rim: float = 0.8
    """share of its rim from which a circle is seen whole, or nearly; empirical"""
    least_pixels: float = 30_000.0
    """px of the smallest image in which the search may end: in smaller ones concentric rims are one; numerical"""
    certain_px: float = 20.0
    """px of a reduced image; a circle this large is found in it; empirical"""

    # Duplicates.
    same_px: float = 1.5
    """px; centers and axes closer than this are those of one edge; empirical"""
    same_share: float = 0.03
    """the same as a share of the semi-major axis, the larger of both counts; empirical"""
    concentric_share: float = 0.1
    """distance of the centers over the semi-minor axis up to which contours are concentric; empirical"""
    alike_share: float = 0.15
    """difference of the minor axes at equal size over the semi-major axis, for shapes that are alike; empirical"""
    least_inner_ratio: float = 0.1
    """size ratio below which a contour inside another is another thing; empirical"""
    least_nested_ratio: float = 0.4
    """size ratio from which one could be taken for the other; a smaller one is a dot, a hole or a screw; empirical"""
    most_line_ratio: float = 0.9
    """size ratio from which rims of opposite polarity are the two sides of one drawn line; empirical"""

    # Rims of which a part is hidden.
    most_partial: int = 100
    """candidates of one image that are tried, most evidence first, some 3 ms each; cost"""
    partial_at_once: int = 12
    """candidates that are tried together, of one circle one only; cost"""
    most_fruitless: int = 24
    """candidates in a row without a rim, after which the rest is left; cost"""
    same_rim_share: float = 0.7
    """share of a candidate's edges that lie on another, from which it is of the same rim; empirical"""
    least_shared: float = 0.5
    """share of the edges of a rim that lie on another, from which both are of the same edges; empirical"""
    closer_ratio: float = 0.33
    """distance of the edges from it over that from the rough rim, at most, where something covers the rest: by chance
    1e-5 for a rough rim with 15 independent edges in the part; statistical"""
    least_in_runs: float = 0.3
    """share of a candidate's rim that must agree in long runs to be tried; empirical"""
    partial_draws: tuple[int, ...] = (120, 60, 40, 40, 40)
    """draws of each round; the first may start far off; cost"""
    partial_settled_px: float = 0.7
    """px; change of the ellipse below which the rounds end; empirical"""
    partial_near_px: float = 0.2
    """px; distance of an edge on the ellipse, from noise; empirical"""
    partial_near_share: float = 0.003
    """share of the semi-major axis added to it, from the lens; empirical"""
    shortest_run: int = 5
    """neighboring samples; fewer may agree by chance; statistical"""
    least_run_samples: int = 20
    """samples that must lie on the ellipse; empirical"""
    partial_refits: int = 2
    """fits to the agreeing samples in each round; empirical"""
    sharpest_px: float = 4.0
    """px; radius of curvature below which a profile across the rim meets its other side; numerical"""
    partial_edge_error_px: float = 0.1
    """px; assumed error of each edge; empirical"""
    worst_partial_major: float = 0.04
    """standard deviation of the semi-major axis over it, up to which the arcs determine it; empirical"""
    explained_px: float = 1.0
    """px; distance up to which an edge belongs to a circle seen whole; empirical"""
    most_explained: float = 0.3
    """share of a partly hidden rim that may lie on circles seen whole; empirical"""

    # Circles seen nearly edge-on: slivers.
    line_ratio: float = 0.25
    """axis ratio up to which a rough ellipse may be part of a sliver; empirical"""
    line_levels: int = 2
    """scales searched for slivers, from full size: in smaller images the two sides are one; numerical"""
    most_slivers: int = 12
    """lines of one image that are tried, the longest; cost"""
    worst_sliver_rms: float = 0.2
    """largest rms residual over the sliver's highest level; empirical"""
    sliver_samples: int = 64
    """samples along the contour of a sliver; empirical"""
    least_wide_px: float = 3.0
    """px; semi-minor axis from which the edges of both sides can be located; numerical"""
    widest_ratio: float = 0.3
    """axis ratio at most of what a line turns out to be; empirical"""
    least_side: float = 0.25
    """share of each side that must lie on the ellipse; empirical"""
    least_sides: float = 0.42
    """share of both sides that must lie on the ellipse; empirical"""
    fragment_px: float = 3.0
    """px; semi-minor axis up to which noise breaks the edge of a line into pieces; empirical"""
    line_search: float = 6.0
    """semi-major axes; how far a line is followed from its fragment; cost"""
    beside_px: float = 5.0
    """px; distance from the line at which the levels beside it are read; empirical"""
    line_smoothing: int = 15
    """samples; length of the mean along a line; empirical"""
    line_share: float = 0.4
    """share of a line's typical height down to which it goes on; empirical"""
    least_ridge: float = 0.5
    """least height of a line over its surroundings, over the difference between its two sides; empirical"""
    most_clutter: float = 0.5
    """scatter of the levels beside a line, over its height, at most; empirical"""
    length_slack: float = 1.3
    """factor by which a line may be outside the interval of lengths before it is fitted; empirical"""
    extensions: int = 4
    """fits of a line that goes on beyond the fitted tips; cost"""
    tip_slack: float = 1.06
    """length of the line over that of the fit, at most; empirical"""
    taper: float = 0.5
    """exponent with which an ellipse's width falls off to its tips: `ThinEllipse.taper`; exact"""
    taper_slack: float = 0.08
    """largest difference from it without noise; empirical"""
    taper_sigmas: float = 2.0
    """standard deviations added to it; statistical"""
    worst_taper: float = 0.07
    """standard deviation of the taper up to which a bar, 0.25 off at least, is noticed; statistical"""
    worst_partial_taper: float = 0.025
    """the same of a rim in part: leaving out segments makes an ellipse of other things; empirical"""
    least_taper_rim: float = 0.85
    """share of the rim from which a sliver counts as whole here; empirical"""
    most_structure: float = 1.6
    """largest excess of the residuals along a sliver over noise; empirical"""

    def with_least_score(self, score: float | None) -> Self:
        """Return the numbers with the least score (0 to 1) of a contour that is asked for; None leaves it."""
        return self if score is None else replace(self, asked_score=score)

    @property
    def lenient(self) -> Self:
        """The numbers without bounds on the score, its factors (quality, share of the rim) and faintness."""
        return replace(
            self,
            least_step_of_typical=0.0,
            least_score=0.0,
            least_quality=0.0,
            hopeless_quality=0.0,
            hopeless_partial_quality=0.0,
            least_rim=0.0,
            clean_rim=0.0,
        )


DEFAULT = DetectionOptions()
