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

    # Whether a hint decides.
    least_log_likelihood: float = -12.5
    """logarithm; that of 5 standard deviations, below which a hint does not hold for a circle; statistical"""
    undecided: float = 0.45
    """probability of a wrong choice from which nothing distinguishes the candidates; empirical"""
    least_residual_px: float = 0.02
    """px; scatter of the edges of a circle without a covariance, at least; empirical"""


DEFAULT = DisambiguationOptions()
