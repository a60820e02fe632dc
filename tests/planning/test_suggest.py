"""Boards that are proposed fit the paper and the view, and the one that measures best is taken."""

from __future__ import annotations

import numpy as np
import pytest

from circlepose.camera.camera import Camera, CameraSigma
from circlepose.errors import UsageError
from circlepose.planning.suggest import Proposal, best_of, proposals, why
from circlepose.targets.target import Target

CAMERA = Camera.create([[500.0, 0, 159.5], [0, 500.0, 119.5], [0, 0, 1]], (), (320, 240), sigma=CameraSigma(5.0, 5.0))
RANGE_MM, FIELD_MM = (300.0, 500.0), (160.0, 110.0)


@pytest.fixture(scope="module")
def tried():
    return list(proposals(CAMERA, RANGE_MM, FIELD_MM))


def test_every_board_fits_the_paper_and_the_nearest_view(tried):
    assert len(tried) > 3
    for each in tried:
        layout = each.target.layout
        size = np.ptp(layout.centers_mm[:, :2], axis=0) + 2.0 * each.target.radii_mm[0]
        assert np.all(size <= FIELD_MM)
        seen = size * 500.0 / RANGE_MM[0]
        assert np.all(np.sort(seen) <= [0.9 * 240 + 1e-6, 0.9 * 320 + 1e-6])
        assert len(layout) >= 4


def test_the_best_has_the_least_error_or_hardly_more_with_larger_circles(tried):
    best = best_of(tried)
    least = min(each.error for each in tried)
    assert best.error <= 1.05 * least
    assert all(each.target.radii_mm[0] <= best.target.radii_mm[0] for each in tried if each.error <= 1.05 * least)
    # The errors of the camera are the same for all, and would hide the difference.
    assert max(each.error for each in tried) > 1.3 * least
    said = list(why(best, tried, RANGE_MM))
    assert f"radius {best.target.radii_mm[0]:g} mm" in said[0]
    assert "times as large" in said[1]


def test_what_cannot_be_has_a_sentence():
    with pytest.raises(UsageError, match="--suggest: no board of four circles fits"):
        list(proposals(CAMERA, (50.0, 9000.0), FIELD_MM))

    class Lost:
        error = np.inf
        target = Target.circle(1.0)

    with pytest.raises(UsageError, match="--suggest: no board is found at the farthest distance"):
        best_of([Lost()])
    assert Proposal is not None
