"""Is a coplanar target flat? The height of its other circles above the largest, from the rims alone. Pure NumPy.

A flat target with the radii R and r is seen from the distance D, under the tilt T. The image of the inner circle is
off that of the outer one by (R^2 - r^2) sin T cos T/D^2 rad, to one side under the one candidate and to the other
side under the other: that decides between them. A step h moves the inner circle by h sin T/D more. So, to first
order, a target with the step h under the one candidate has the rims of a target with the step

    -2 (R^2 - r^2) cos(T)/D - h        (h > 0: the inner circle is in front, towards the camera)

under the other. A recess deeper than (R^2 - r^2) cos(T)/D is flatter under the wrong candidate than under the right
one. What decides then is of higher order in R/D: the tilt that each of the two cones has on its own.

So each candidate is also fitted with a free height. The two fits compete by how well they fit and by how flat they
are.
"""

from __future__ import annotations

import numpy as np

from circlepose.rings.joint_pose import AxisPose, JointPose, RimEvidence, RingProblem

STEP_WEIGHT = 0.02
"""Likelihood of a step of any height, relative to the most likely height of a flat target. Some targets that are
declared coplanar are not, so flatness never decides between the candidates with more certainty than this."""
STEPPED_SIGMAS = 4.0
"""A target is not flat from this height on, in standard errors with the flatness in it: 1 of 16,000 flat ones."""


def free_heights(rims: tuple[RimEvidence, ...], starts: list[AxisPose]) -> list[JointPose | None]:
    """Return the optimum near each of `starts` with nothing known of the height; None where there is none."""
    problem = RingProblem(rims, 0.0, np.inf)
    return [problem.solve(start) for start in starts]


def log_flatness(free: JointPose, flatness_sigma: float) -> float:
    """Return the log likelihood that a target known to be flat to `flatness_sigma` has the height of `free`."""
    return float(np.logaddexp(-0.5 * _sigmas(free, flatness_sigma) ** 2, np.log(STEP_WEIGHT)))


def is_stepped(free: JointPose, flatness_sigma: float) -> bool:
    """Tell whether the height of `free` differs from 0 by more than its error and the flatness explain."""
    return _sigmas(free, flatness_sigma) > STEPPED_SIGMAS


def _sigmas(free: JointPose, flatness_sigma: float) -> float:
    error = np.hypot(free.height_sigma, flatness_sigma)
    return float(abs(free.pose.height) / max(error, np.finfo(np.float64).tiny))
