"""The tips of slivers, whose curvature is sharp on the scale of the blur: exact shares, and lengths without bias."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import ndtr

import circlepose
from benchmarks.edge_on import Slivers, better
from circlepose.camera.camera import Camera
from circlepose.fitting.cone_projection import factor_from_ellipse
from circlepose.geometry.cone_perturbation import grown
from circlepose.geometry.ellipse import Ellipse
from circlepose.photometry.edge_spread import curved_edge_spread
from circlepose.photometry.pixel_band import Bands, bands_around
from circlepose.photometry.rim_coordinates import rim_coordinates
from circlepose.synthesis.render import render

CAMERA = Camera.create([[1200.0, 0.0, 180.0], [0.0, 1200.0, 40.0], [0.0, 0.0, 1.0]], (), (361, 81))


def around(semi_major: float, semi_minor: float, angle: float = 0.05) -> tuple[Bands, np.ndarray, Ellipse]:
    """The pixels around an ellipse, in float64, and the factor of its cone."""
    ellipse = Ellipse.from_axes([180.3, 40.2], [semi_major, semi_minor], angle)
    bands = bands_around(np.zeros((81, 361)), CAMERA, [ellipse], np.array([3.0]))
    double = {name: getattr(bands, name).astype(np.float64) for name in ("levels", "weight", "rays")}
    factor = factor_from_ellipse(CAMERA, ellipse)
    assert factor is not None
    return replace(bands, **double), factor[None], ellipse


def blurred(ellipse: Ellipse, pixels: np.ndarray, sigma: float) -> np.ndarray:
    """The share by a sum over 200 columns of the ellipse, each blurred across exactly."""
    cos, sin = np.cos(ellipse.angle), np.sin(ellipse.angle)
    offset = pixels - ellipse.center
    x, y = cos * offset[:, 0] + sin * offset[:, 1], cos * offset[:, 1] - sin * offset[:, 0]
    nodes, weights = np.polynomial.legendre.leggauss(200)
    low, high = (np.arcsin(np.clip((x + side * sigma) / ellipse.semi_major, -1.0, 1.0)) for side in (-8.0, 8.0))
    u = 0.5 * (high + low)[:, None] + 0.5 * (high - low)[:, None] * nodes
    density = np.exp(-0.5 * ((x[:, None] - ellipse.semi_major * np.sin(u)) / sigma) ** 2) * np.cos(u) * weights
    density *= 0.5 * (high - low)[:, None] * ellipse.semi_major / (np.sqrt(2.0 * np.pi) * sigma)
    half = ellipse.semi_minor * np.cos(u)
    return np.sum(density * (ndtr((y[:, None] + half) / sigma) - ndtr((y[:, None] - half) / sigma)), axis=1)


@settings(max_examples=15, deadline=None)
@given(semi_major=st.floats(30.0, 160.0), semi_minor=st.floats(3.0, 15.0), sigma=st.floats(0.5, 1.1))
def test_the_share_of_a_sliver_is_exact_up_to_its_tips(semi_major, semi_minor, sigma):
    bands, factor, ellipse = around(semi_major, semi_minor)
    share = curved_edge_spread(rim_coordinates(bands, factor), np.array([[np.log(sigma), 0.0, 0.0]])).coverage[0]
    error = (share - blurred(ellipse, bands.pixels[0], sigma)) * bands.weight[0]
    assert np.max(np.abs(error)) < 3e-3
    assert np.sqrt(np.mean(error**2)) < 2e-4


@pytest.mark.parametrize(("semi_major", "semi_minor"), [(60.0, 3.2), (130.0, 4.5), (130.0, 11.5)])
def test_the_derivatives_at_tips_are_those_of_the_share(semi_major, semi_minor):
    bands, factor, _ = around(semi_major, semi_minor)
    blur, tip = np.array([[np.log(0.8), 0.0, 0.0]]), 1.0 - 2.0 / semi_major
    at = rim_coordinates(bands, factor)
    spread, near = curved_edge_spread(at, blur), np.abs(at.plane[0][0]) > tip
    step = 1e-5
    assert np.count_nonzero(near) > 20
    for i in range(8):
        changed = step * (np.arange(8) == i)[None]
        high, low = (
            curved_edge_spread(
                rim_coordinates(bands, grown(factor, side * changed[:, :5])), blur + side * changed[:, 5:]
            ).coverage[0]
            for side in (1.0, -1.0)
        )
        slopes = spread.derivatives[0, i]
        error = np.abs((high - low) / (2.0 * step) - slopes)[near]
        assert np.max(error) < 0.02 * np.max(np.abs(slopes))


@pytest.mark.parametrize(("semi_major", "tilt_deg"), [(60.0, 86.0), (130.0, 87.5), (130.0, 88.0)])
def test_slivers_are_not_measured_too_short(semi_major, tilt_deg):
    slivers = Slivers(semi_major, tilt_deg, 0.0)
    long_by = []
    for number in range(4):
        scene = slivers.scene(number, seed=3)
        (disc,) = scene.targets
        result = circlepose.estimate(render(scene), scene.camera, circlepose.Target("circle", (disc.radius_mm,)))
        candidate = better(result.circles[0].candidates, disc)
        long_by.append(semi_major * (1.0 - np.linalg.norm(candidate.center) / np.linalg.norm(disc.center_mm)))
    # Rounding to whole levels leaves about 0.01 px to each.
    assert abs(np.mean(long_by)) < 0.015
    assert np.max(np.abs(long_by)) < 0.04
