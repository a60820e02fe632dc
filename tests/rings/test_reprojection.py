"""How near a second circle's edges are to where a candidate pose puts it, and what that says of the candidates."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.camera.camera import Camera, circle_contour
from circlepose.fitting.observations import rim_distance_px
from circlepose.geometry.cone import factor_from_circle
from circlepose.rings.reprojection import ambiguity, misfits_px
from tests.support.cases import circle_case, circle_cases

CAMERA = Camera.create([[900.0, 0, 639.5], [0, 900.0, 479.5], [0, 0, 1]], (-0.1, 0.02, 0.0, 0.0), (1280, 960))


def edges_of(case):
    contour = circle_contour(CAMERA, case.center, case.normal, case.radius, 60)
    return CAMERA.rays_with_jacobian(contour)


@given(circle_cases(20.0, st.floats(0.0, 80.0)), st.floats(-0.2, 0.2))
def test_the_distance_is_that_of_the_rim(case, share):
    rays, jacobians = edges_of(case)
    centers = case.center + np.array([0.0, share, -share])[:, None] * case.radius * case.normal
    misfits = misfits_px(centers, case.normal, case.radius, rays, jacobians)
    for center, misfit in zip(centers, misfits, strict=True):
        distance = rim_distance_px(factor_from_circle(center, case.normal, case.radius), rays, jacobians)
        assert misfit == pytest.approx(float(np.sqrt(np.mean(distance**2))), rel=1e-9, abs=1e-6)
    assert misfits[0] < 1e-4


def test_a_circle_seen_edge_on_has_no_rim():
    case = circle_case(30.0, 600.0, 5.0, 20.0, 30.0, 0.0)
    rays, jacobians = edges_of(case)
    across = np.cross(case.center, case.normal)
    across = across / np.linalg.norm(across)
    centers = np.stack([case.center, np.cross(across, case.normal) * 600.0])
    assert np.isinf(misfits_px(centers, case.normal, 30.0, rays, jacobians)).tolist() == [False, True]


@given(st.floats(0.0, 5.0), st.floats(0.0, 5.0), st.floats(0.01, 1.0))
def test_the_ambiguity_is_a_probability_of_at_most_a_half(first, second, noise):
    chosen, other = sorted((first, second))
    chance = ambiguity(chosen, other, noise)
    assert 0.0 <= chance <= 0.5
    assert ambiguity(chosen, other + 0.1, noise) <= chance
    assert ambiguity(chosen, chosen, noise) == 0.5
