"""Fu & Zhou's own route (eq. 7 to 10) on rendered coplanar rings, beside the pose that `estimate` gives."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.papers_route import run


@pytest.fixture(scope="module")
def trials():
    return list(run(6))


def test_the_papers_route_finds_the_pose_and_the_right_candidate(trials):
    assert len(trials) == 6
    for trial in trials:
        assert trial.papers[0] < 0.6
        assert trial.papers[1] < 1.5
        assert trial.chooses


def test_all_edges_of_both_rings_in_one_cone_each_do_better_than_the_vanishing_line(trials):
    """The vanishing line rests on the small distance of the two imaged centres, the cone on the whole rim."""
    tilted = [trial for trial in trials if trial.tilt_deg > 10.0]
    ours, papers = (
        np.array([t[1] for t in errors]) for errors in zip(*((t.ours, t.papers) for t in tilted), strict=True)
    )
    assert np.median(ours) < 0.5 * np.median(papers)
