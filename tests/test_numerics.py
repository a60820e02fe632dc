"""Small numerics: the angle between vectors keeps its digits at all angles."""

from __future__ import annotations

import numpy as np
import pytest

from circlepose._numerics import angle_between


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-6, 0.5, np.pi / 2.0, 3.0, np.pi - 1e-6, np.pi])
def test_an_angle_keeps_its_digits_near_none_and_near_half_a_turn(angle):
    first = np.array([1.0, 0.0, 0.0])
    second = np.array([np.cos(angle), 0.6 * np.sin(angle), 0.8 * np.sin(angle)])
    assert angle_between(first, second) == pytest.approx(angle, rel=1e-9, abs=1e-15)


def test_angles_broadcast():
    axes = np.eye(3)
    angles = angle_between(axes[:, None], axes)
    np.testing.assert_allclose(angles, np.where(np.eye(3) == 1.0, 0.0, np.pi / 2.0))
