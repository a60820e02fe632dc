"""What all rims of one ring target say together: their joint poses, the chosen candidate, the target's flags."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray
from circlepose.results import Failure, Flag, Status
from circlepose.rings.matching import RingMatch
from circlepose.rings.options import RingOptions
from circlepose.rings.poses import TargetPoses, target_poses
from circlepose.rings.reprojection import ambiguity
from circlepose.rings.vanishing_line import VanishingCheck, vanishing_check
from circlepose.targets.target import Target

_COAXIAL = Failure(Status.NO_POSE, "circles in different planes have no common vanishing line")


@dataclass(frozen=True, slots=True, eq=False)
class Decision:
    """Which candidate of a ring target is right, and how sure that is."""

    joint: TargetPoses | Failure
    """the poses of all rims together"""
    line: VanishingCheck | Failure
    """the candidates by the vanishing line of coplanar circles"""
    normal: FloatArray
    """(3,) of the chosen candidate"""
    ambiguity: float
    """probability that it is the wrong one"""
    is_strained: bool
    """whether a rim is off the place where the radii, or the generatrix, put it"""

    @property
    def flags(self) -> tuple[Flag, ...]:
        """The flags of the target as a whole."""
        flags = [Flag.RING_MISFIT] if self.is_strained else []
        if isinstance(self.joint, TargetPoses) and self.joint.not_flat:
            flags.append(Flag.NOT_FLAT)
        return tuple(flags)


def decide(match: RingMatch, target: Target, placed: bool, options: RingOptions) -> Decision:
    """Fit the joint poses of a target and choose its candidate by them, or else by the misfits of the matching.

    Parameters
    ----------
    match
        The rims of the target.
    target
        The ring target.
    placed
        Whether edges were located along the rims, see `target_poses`.
    options
        The numbers of ring targets.
    """
    joint = target_poses(match, target, placed=placed, options=options)
    line = vanishing_check(joint, target.flatness_mm, options=options) if target.kind == "coplanar" else _COAXIAL
    if isinstance(joint, TargetPoses):
        normal, chance = joint.poses[0].normal, joint.ambiguity
    else:
        normal, chance = _by_misfits(match, options)
    return Decision(joint, line, normal, chance, _is_strained(match, options))


def _by_misfits(match: RingMatch, options: RingOptions) -> tuple[FloatArray, float]:
    """Return the chosen normal and its ambiguity by how far edges are from where the first circle puts them."""
    noise = math.hypot(*(each.rim.cone.rms_px for each in match.rims))
    total = np.sqrt(np.sum(np.square(match.misfits_px), axis=0))
    order = np.argsort(total, kind="stable")
    chance = 0.0
    if len(order) > 1:
        chance = ambiguity(float(total[order[0]]), float(total[order[1]]), noise, options=options)
    return match.solutions.normals[order[0]], chance


def _is_strained(match: RingMatch, options: RingOptions) -> bool:
    misfits = match.misfits_px.min(axis=1)
    sizes = np.array([float(each.rim.ellipse.semi_major) for each in match.rims[1:]])
    return bool(np.any(misfits > np.maximum(options.strained_px, options.strained_share * sizes)))
