"""The tunable numbers of ring targets: matching, guided search, joint pose, cues.

The source of each number is named. `statistical` is a quantile, in standard deviations or of a chi-square.
`numerical` follows from the arithmetic. `empirical` was set by trial on rendered images and photographs, and no
derivation is recorded.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from circlepose.measurement.options import MeasurementOptions


@dataclass(frozen=True, slots=True)
class RingOptions:
    """Numbers of ring targets. Lengths in px are of the raw image; a share is from 0 to 1."""

    measurement: MeasurementOptions = field(default_factory=MeasurementOptions)
    """those of the rims and poses of single circles; `estimate` takes its own here"""

    # Which rims belong together.
    match_share: float = 0.08
    """share of the semi-major axis; rms distance from the prediction up to which a rim matches; empirical"""
    match_px: float = 1.5
    """px; the same distance for small rims; empirical"""
    largest_ratio: float = 1.3
    """semi-major axis of another circle's image over that of the largest circle, at most; empirical"""
    highest_radii: float = 3.0
    """largest radii; largest height of a coaxial target without a generatrix; empirical"""
    heights_tried: int = 61
    """heights at which such a circle is first tried; empirical"""
    heights_tried_again: int = 11
    """heights in each of two finer rounds; empirical"""
    edges_tried: int = 24
    """edges used in the first of these rounds; empirical"""
    strained_share: float = 0.02
    """share of the semi-major axis; a rim farther from its prediction has the flag `ring_misfit`; empirical"""
    strained_px: float = 1.0
    """px; the same distance for small rims; empirical"""

    # The search for circles that detection missed.
    search_spacing_px: float = 1.5
    """px; distance of neighboring samples along a predicted rim; empirical"""
    search_samples: tuple[int, int] = (60, 360)
    """samples along a predicted rim, at least and at most; empirical"""
    search_half_width_px: float = 2.0
    """px; half-width of the search across a predicted rim, at least; empirical"""
    search_half_width_share: float = 0.03
    """share of the mean radius of the predicted rim; the same for large rims; empirical"""
    other_rim_px: float = 4.0
    """px; edges closer than this to a known rim belong to that rim; empirical"""
    most_searching_rims: int = 12
    """rims outside any target that predict others, the most evident first; empirical"""
    same_rim_px: float = 1.0
    """px; two rims whose centers and semi-axes differ by less are one; empirical"""
    least_found_share: float = 0.2
    """share of the predicted rim that must have edges; empirical"""
    least_found_samples: int = 14
    """samples that must have edges; empirical"""
    agreeing_px: float = 0.5
    """px; distance from the fitted rim within which an edge agrees with it; empirical"""
    least_run: int = 7
    """neighboring samples that must agree; texture and noise make shorter runs; empirical"""
    smooth_px: float = 0.18
    """px; largest rms distance of the edges on a small part of a rim, texture has 0.2 and more; empirical"""
    rough_share: float = 0.5
    """share of the rim from which rougher edges are accepted; empirical"""
    search_rounds: int = 5
    """Gauss-Newton steps for the center, with a shrinking tolerance; empirical"""
    search_edge_px: float = 0.1
    """px; standard deviation of an edge in that fit; empirical"""
    center_share: float = 0.02
    """share of the radius; standard deviation of a predicted center, from radii and heights; empirical"""
    farthest_sigmas: float = 3.0
    """standard deviations; largest distance of a found center from its prediction; statistical"""

    # What a rim says of its cone.
    independent_edges: float = 12.0
    """edges; errors are correlated along a rim, so its edges count as this many at most; empirical"""
    least_scatter_px: float = 0.02
    """px; standard deviation of an edge, at least; empirical"""
    common_error_px3: float = 10.0
    """px^3; common error of all edges of a rim times the squared semi-minor axis, from rendered views; empirical"""
    most_common_error_px: float = 0.5
    """px; common error of all edges of a rim, at most; empirical"""
    contradicted_chi_square: float = 0.5
    """chi-square per mode of the edges, above which they contradict a fit to the gray levels; empirical"""
    beside_px: float = 6.0
    """px; coaxial rims that come closer disturb each other; empirical"""
    beside_edge_ratio: float = 2.0
    """common error of edges beside another rim, over that of edges alone; empirical"""
    beside_levels_px: float = 0.02
    """px; additional standard deviation of each mode of a fit to gray levels beside another rim; empirical"""
    beside_contradicted_px: float = 0.08
    """px; distance of the edges that contradicts such a fit; empirical"""

    # The joint pose.
    radius_share: float = 2e-3
    """share; standard deviation of another radius, and of a height, relative to the largest circle; empirical"""
    place_share: float = 1e-4
    """largest radii; standard deviation of another circle's center in each direction; empirical"""
    same_sigmas: float = 1.0
    """standard deviations; two optima that are closer are one; statistical"""
    step_weight: float = 0.02
    """likelihood of a step of any height over that of a flat target: some declared coplanar are not; empirical"""
    stepped_sigmas: float = 4.0
    """standard deviations of the height, above which a target is not flat: 1 of 16,000 flat ones; statistical"""

    # Which candidate is right.
    misfit_edges: float = 6.0
    """independent edges behind the rms distance from a prediction, used where no joint pose fits; empirical"""
    misfit_noise_px: float = 0.02
    """px; noise of these edges, at least; empirical"""
    undecided: float = 0.45
    """probability of a wrong choice from which nothing distinguishes the candidates; empirical"""
    alone_ambiguity: float = 0.01
    """probability of a wrong choice below which a cue alone settles it; statistical"""
    fu_zhou_ambiguity: float = 0.05
    """the same for the method `fu-zhou`; above `step_weight`, the least that a flat target can have; statistical"""
    contradicted_cue: float = 20.0
    """chi-square, 2 degrees of freedom, from which a cue contradicts a candidate: 1 of 22,000; statistical"""
    least_contradicted_ambiguity: float = 0.05
    """least ambiguity of a choice that the vanishing line contradicts; empirical"""

    # Why no rims make a complete target.
    concentric_split: float = 0.02
    """split of the double eigenvalue: centers a tenth of the radius apart at a ratio of radii of 0.6; numerical"""
    most_diagnosed_rims: int = 12
    """rims that are compared, the most evident first; empirical"""
    most_ratios: int = 3
    """ratios of radii that the message shows; empirical"""


DEFAULT = RingOptions()
