"""The tunable numbers of the hints on lone circles.

The source of each number is named. `statistical` is a quantile, in standard deviations or of a chi-square.
`empirical` was set by trial on rendered images and photographs, and no derivation is recorded.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class DisambiguationOptions:
    """Numbers of the hints on lone circles."""

    # A plane that several circles share.
    flatness_deg: float = 0.3
    """deg; standard deviation of a circle's normal from the common one, of boards and lenses; empirical"""
    flatness_mm: float = 0.1
    """mm; standard deviation of a circle's center from the common plane; empirical"""
    outlier_chi_square: float = 25.0
    """chi-square, 3 degrees of freedom, above which a circle is not in the plane: 2 in 100,000; statistical"""
    most_proposers: int = 200
    """circles whose candidates are proposed as the plane's normal; limits the time; empirical"""
    most_proposals: int = 24
    """normals that are refined, and as many of those that the best one rejects; empirical"""
    plane_prior: float = 1e-2
    """rad^-2; information on the tilt of the plane, and relative to the distance on its offset; empirical"""
    soft_rounds: int = 10
    """rounds in which circles off the plane have a smaller weight; empirical"""
    rounds: int = 14
    """rounds of fitting the plane; in the last ones circles off the plane have no weight; empirical"""

    # Planes that are found, not declared.
    least_members: int = 3
    """circles that a plane needs; through any two with parallel normals there may be one; exact"""
    least_log_evidence: float = 7.0
    """logarithm of a plane's odds against chance, at least: 1 in 1000 is made up; statistical"""
    least_log_support: float = 3.0
    """logarithm of the odds of a member, given the plane of the others: 1 in 20; statistical"""
    log_evidence_window: float = 12.0
    """logarithm; planes less likely than the likeliest by more do not count: 6 in a million; numerical"""
    error_scales: tuple[float, ...] = (1.0, 2.0, 4.0)
    """times the standard errors of all circles of a plane: what errors of the model add to the noise; empirical"""
    scale_shares: tuple[float, ...] = (0.6, 0.3, 0.1)
    """probability of each of `error_scales`, by photographs; empirical"""
    search_scale: float = 2.0
    """times the standard errors while planes are searched; empirical"""
    most_plane_proposers: int = 50
    """circles whose candidates are proposed as planes, of those in none; limits the time; cost"""
    most_planes_fitted: int = 12
    """proposed planes that are fitted, and as many of those that the best one rejects; cost"""
    most_compared: int = 100
    """circles that proposals are compared with and planes are fitted to; limits the time; empirical"""
    fit_rounds: int = 5
    """rounds of fitting a proposed plane; numerical"""
    same_fit_chi_square: float = 4.0
    """chi-square, 3 degrees of freedom, below which two fits have found the same plane; numerical"""
    same_plane_chi_square: float = 16.0
    """chi-square, 3 degrees of freedom, below which two planes are one: 1 in 1000 is above; statistical"""
    shared_members: float = 0.5
    """share of the members of the smaller of two planes from which they explain the same circles; empirical"""
    member_nodes: int = 12
    """values of the share of circles in a plane, over which the evidence is integrated; numerical"""
    most_planes: int = 8
    """planes in an image; limits the time; cost"""

    # One plane for circles that are declared to share it.
    median_chi_square: float = 2.366
    """median of a chi-square of 3 degrees of freedom; exact"""
    tilt_shares: tuple[float, ...] = (0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0)
    """shares of the variance of `flatness_deg`, of which the likeliest is taken for a declared plane; numerical"""
    height_shares: tuple[float, ...] = (0.0, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0, 1e4)
    """the same of `flatness_mm`; numerical"""

    # Whether a hint decides.
    least_log_likelihood: float = -12.5
    """logarithm; that of 5 standard deviations, below which a hint does not hold for a circle; statistical"""
    undecided: float = 0.45
    """probability of a wrong choice from which nothing distinguishes the candidates; empirical"""
    least_residual_px: float = 0.02
    """px; scatter of the edges of a circle without a covariance, at least; empirical"""


DEFAULT = DisambiguationOptions()
