"""The tunable numbers of boards."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class BoardOptions:
    """Numbers of the lattice, of its place on the board and of the pose."""

    # Which circles are neighbors: distances as each circle's own image measures them.
    neighbor_tolerance: float = 0.25
    """share of the distance of neighbors; perspective and the noise of small dots; empirical"""
    alike_ratio: float = 1.5
    """ratio of sizes up to which two circles measure their distance together; empirical"""
    turn_tolerance_deg: float = 16.0
    """departure of a neighbor from the directions of the lattice around a circle; empirical"""
    least_neighbors: int = 2
    """of a circle with which a lattice begins; statistical"""
    step_tolerance: float = 0.35
    """share of a step; distance of a circle from where its neighbors put it; empirical"""
    fit_steps: float = 2.3
    """steps; the circles that put the next one; perspective is nearly affine over so few; empirical"""
    most_ellipses: int = 4000
    """of an image, most evidence first; cost"""

    # Where on the board the circles of a lattice are.
    foreign_log: float = -6.2
    """log probability of a circle on the lattice that the layout does not have; empirical"""
    hidden_log: float = -3.0
    """log probability of a group of neighbors that is not found within the image; empirical"""
    unlike_log: float = -12.0
    """log probability of a circle of clearly another size than the layout's; empirical"""
    unlike_ring_log: float = -7.0
    """log probability of a ring that is none, or looks like none; empirical"""
    clear_size: float = 0.4
    """departure from the nearest size of the layout over that from the next, where it is clear; empirical"""
    between_share: float = 0.2
    """share of circles as large that may lie among those of the layout; empirical"""
    as_large: float = 1.25
    """ratio of sizes up to which a circle is as large as those near it; empirical"""
    decisive_log: float = 6.9
    """log odds, at least, of the best place over every other: 1 in 1000; statistical"""
    size_noise: float = 0.02
    """share of the size; its error, at least; empirical"""
    size_rounds: int = 8
    """of the fit of sizes without marks; numerical"""
    ring_contrast: float = 0.35
    """contrast of a ring's middle over that of its rim, at least; empirical"""
    most_places: int = 64
    """places that are compared, most circles first; cost"""
    most_foreign: int = 2
    """circles on the lattice that the layout need not have; more are a row of it; empirical"""
    foreign_share: float = 0.1
    """the same as a share of all, the larger of both counts; empirical"""
    printed_share: float = 0.02
    """the same of circles that are as large as the layout's; empirical"""
    telling_sigmas: float = 20.0
    """standard deviations of a rim; circles that misfit by more do not speak for a list; empirical"""
    chance_log: float = -4.6
    """log probability of a rim where a wrong pose puts a circle; empirical"""
    rim_log: float = 60.0
    """log likelihood that a circle's rim gains where it is; none where it misfits by thousands of deviations;
    empirical"""
    least_share: float = 0.5
    """share of the circles of a lattice that must be the layout's; empirical"""

    # Layouts that are no lattice.
    most_rims: int = 40
    """rims of which pairs are tried, most evidence first; cost"""
    most_pairs: int = 600
    """pairs of the layout's circles, those close together first; cost"""
    pair_length: float = 0.06
    """share; error of a distance between circles, each placed by its own size; empirical"""
    pair_tilt: float = 0.15
    """error of the cosine between two directions; empirical"""
    most_pair_misfit: float = 12.0
    """squared errors of a pair, in these units; statistical"""
    most_hypotheses: int = 3000
    """poses that are judged by all circles; cost"""
    poses_at_once: int = 500
    """of these; cost"""
    most_assignments: int = 6
    """of which the pose is fitted; cost"""
    rough_reach: float = 1.2
    """semi-major axes; distance of a rim from where a rough pose puts a circle; empirical"""

    # The pose.
    most_chi_square: float = 25.0
    """of a rim's five modes, scaled; one above it does not count in the pose: 1e-4 by chance; statistical"""
    far_radii: float = 0.3
    """radii; distance of a start from the rims from which it is moved to their centers first; empirical"""
    growth_chi_square: float = 30.0
    """by how much less the rims misfit, at least, where their radii are not as stated; statistical"""
    least_growing: int = 3
    """circles from which their distances are believed rather than their radii; empirical"""
    rounds: int = 6
    """of fitting the pose and assigning rims; numerical"""
    least_mismatch_px: float = 1.0
    """px; rms distance of the circles from their places, below which a layout fits; empirical"""
    mismatch_share: float = 0.1
    """the same as a share of the circles' semi-minor axes, the larger of both counts; empirical"""
    most_growth: float = 0.2
    """share by which the radii may differ from those stated; empirical"""
    least_used: float = 0.5
    """share of the circles that must fit; empirical"""
    same_sigmas: float = 3.0
    """standard deviations; two poses closer than this are one; statistical"""
    least_on_lattice: int = 4
    """circles of a lattice from which it is placed; statistical"""
    least_diagnosed: int = 4
    """circles of a layout from which a lattice is expected; empirical"""
    least_reach_px: float = 1.0
    """px; added to the distance of a circle from its place; empirical"""
    misfit_growth: float = 0.02
    """share by which the radii are not as stated, from which the board is flagged; empirical"""
    least_ambiguity: float = 1e-9
    """probability of the other tilt below which it is no candidate; statistical"""
    misfit_reach: float = 2.0
    """semi-major axes; distance from a circle's place up to which a rim may be that circle; empirical"""
    visibly_off_px: float = 1.5
    """px; departure of a circle's place or size up to which an image may be bent; empirical"""
    visibly_larger: float = 0.1
    """share of the size by which a circle is visibly larger, or smaller, than stated; empirical"""
    undecided: float = 0.45
    """probability of the other tilt from which the pose is ambiguous; empirical"""
    reach_radii: float = 0.5
    """radii; distance from its predicted place up to which a circle is the layout's; empirical"""


DEFAULT = BoardOptions()
