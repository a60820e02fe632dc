"""Planes that several circles of an image are found to share, with what they say of the candidates. Pure NumPy.

No plane is assumed. One is accepted where at least three circles agree in it, normals and centers, far beyond chance;
then the next is looked for among the circles that are in none. Where several planes explain the same circles, as the
mirror image does for circles seen from afar, each has the weight of its evidence.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from circlepose._typing import FloatArray, IntArray
from circlepose.disambiguation.background import Background, background_of
from circlepose.disambiguation.observed import Observed
from circlepose.disambiguation.options import DEFAULT, DisambiguationOptions
from circlepose.disambiguation.plane_evidence import Weighed, weigh
from circlepose.disambiguation.plane_search import Fits, are_same, proposed, refined


@dataclass(frozen=True, slots=True, eq=False)
class FoundPlanes:
    """K planes and the m circles that were judged by them."""

    log_probabilities: FloatArray
    """(m, 2) of the candidates; both are one half for a circle in no plane"""
    planes: IntArray
    """(m,) index of the plane that a circle is in, -1 for none"""
    normals: FloatArray
    """(K, 3) unit, towards the camera"""
    offsets: FloatArray
    """(K,) n . x of the plane's points x"""


def find_planes(circles: Observed, *, options: DisambiguationOptions = DEFAULT) -> FoundPlanes:
    """Find the planes that at least three circles each share.

    Parameters
    ----------
    circles
        m circles of two candidates, camera frame; 2 or more.
    options
        The numbers of the search.

    Returns
    -------
    The probabilities of the candidates. `exp` of the smaller one is the probability that the larger one's candidate
    is wrong.
    """
    number, anywhere = len(circles.centers), background_of(circles)
    probabilities = np.full((number, 2), 0.5)
    planes = np.full(number, -1)
    strongest = np.zeros(number)
    base = np.zeros(number)
    accepted: list[Fits] = []
    while len(accepted) < options.most_planes and np.sum(planes < 0) >= options.least_members:
        fits = _fitted(circles, planes, base, anywhere, options)
        weighed = weigh(circles, fits, base, anywhere, options)
        gains, belongs = weighed.log_gains[0], weighed.belongs[0]
        best = int(weighed.planes[0])
        members = (gains > options.least_log_support) & (belongs > 0.5)
        log_odds = np.logaddexp.reduce(weighed.log_evidence[weighed.planes == best])
        is_sure = log_odds >= options.least_log_evidence
        if not is_sure or members.sum() < options.least_members or np.all(planes[members] >= 0):
            break
        total = gains + base
        taken = (belongs > 0.5) & (total > strongest)
        probabilities[taken] = _averaged(weighed, options)[taken]
        plane = fits.subset(np.array([best]))
        index = _index_of(plane, accepted, options)
        planes[taken] = index
        strongest[taken] = total[taken]
        share = weighed.share_in[0]
        base = np.logaddexp(np.log1p(-share) + base, np.log(share) + total)
        if index == len(accepted):
            accepted.append(plane)
        elif np.sum(taken) < options.least_members:
            break
    return FoundPlanes(
        np.log(np.maximum(probabilities, 1e-300)),
        planes,
        np.reshape([plane.normals[0] for plane in accepted], (-1, 3)),
        np.array([float(plane.normals[0] @ plane.points[0]) for plane in accepted]),
    )


def _index_of(plane: Fits, accepted: list[Fits], options: DisambiguationOptions) -> int:
    """Return the index of a plane among those accepted: one that was found before, or the next."""
    # Circles with larger errors than the others of their plane come as a plane of their own.
    limit = options.same_plane_chi_square * max(options.error_scales) ** 2
    return next((i for i, each in enumerate(accepted) if are_same(plane, each, limit)[0]), len(accepted))


def _fitted(
    circles: Observed, planes: IntArray, base: FloatArray, anywhere: Background, options: DisambiguationOptions
) -> Fits:
    """Return the planes that circles in no plane propose, fitted, each once."""
    starts = proposed(circles, planes < 0, base, anywhere, options)
    every = -(-len(planes) // options.most_compared)
    sample = slice(None, None, every)
    fits = refined(circles.subset(sample), starts, anywhere.subset(sample), options)
    kept: list[int] = []
    left = np.ones(len(fits.normals), dtype=bool)
    for i in range(len(left)):
        if left[i]:
            kept.append(i)
            one = fits.subset(np.array([i]))
            left &= ~are_same(one, fits, options.same_fit_chi_square)
    fits = fits.subset(np.array(kept))
    if every == 1:
        return fits
    # What a part of the circles rules out, all of them do.
    return fits.subset(
        np.unique(weigh(circles.subset(sample), fits, base[sample], anywhere.subset(sample), options).planes)
    )


def _averaged(weighed: Weighed, options: DisambiguationOptions) -> FloatArray:
    """Return the probabilities (m, k) over all planes that explain the circles of the likeliest, and over none."""
    members = weighed.belongs > 0.5
    shared = np.sum(members & members[0], axis=1)
    smaller = np.minimum(members.sum(axis=1), members[0].sum())
    is_alternative = shared > options.shared_members * smaller
    log_weights = np.where(is_alternative, weighed.log_evidence, -np.inf)
    # Odds of 1 that there is no plane.
    weights = np.exp(log_weights - np.logaddexp(np.logaddexp.reduce(log_weights), 0.0))
    evens = 1.0 / weighed.shares.shape[-1]
    each = weighed.belongs[..., None] * weighed.shares + (1.0 - weighed.belongs[..., None]) * evens
    return np.einsum("p,pmk->mk", weights, each) + (1.0 - weights.sum()) * evens
