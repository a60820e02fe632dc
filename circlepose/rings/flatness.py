"""Whether a coplanar target is flat: the height of its other circles above the largest, from the rims alone.

A flat target with the radii R and r is seen from the distance D, under the tilt T. The image of the inner circle is
off that of the outer one by (R^2 - r^2) sin T cos T/D^2 rad, to one side under the one candidate and to the other
side under the other: that decides between them. A step h moves the inner circle by h sin T/D more. So, to first
order, a target with the step h under the one candidate has the rims of a target with the step

    -2 (R^2 - r^2) cos(T)/D - h        (h > 0: the inner circle is in front, towards the camera)

under the other. A recess deeper than (R^2 - r^2) cos(T)/D is flatter under the wrong candidate than under the right
one. What decides then is of higher order in R/D: the tilt that each of the two cones has on its own.

So each candidate is also fitted with a free height, and the two fits are compared by their misfit and by their
flatness. Pure NumPy.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from circlepose.results import Failure
from circlepose.rings.evidence import RimEvidence
from circlepose.rings.joint_pose import AxisPose, JointPose, RingProblem
from circlepose.rings.options import RingOptions


def free_heights(
    rims: tuple[RimEvidence, ...], starts: Sequence[AxisPose], options: RingOptions
) -> list[JointPose | Failure]:
    """Return the joint pose near each of `starts` with nothing known of the height."""
    problem = RingProblem(rims, 0.0, np.inf, options)
    return [problem.solve(start) for start in starts]


def log_flatness(free: JointPose, flatness_sigma: float, options: RingOptions) -> float:
    """Return the log likelihood that a target flat to `flatness_sigma` has the height of `free`.

    Some targets that are declared coplanar are not, so flatness never decides between the candidates with more
    certainty than `options.step_weight`.
    """
    return float(np.logaddexp(-0.5 * _sigmas(free, flatness_sigma) ** 2, np.log(options.step_weight)))


def is_stepped(free: JointPose, flatness_sigma: float, options: RingOptions) -> bool:
    """Whether the height of `free` differs from 0 by more than its error and the flatness explain."""
    return _sigmas(free, flatness_sigma) > options.stepped_sigmas


def _sigmas(free: JointPose, flatness_sigma: float) -> float:
    error = np.hypot(free.height_sigma, flatness_sigma)
    return float(abs(free.pose.height) / max(error, np.finfo(np.float64).tiny))
