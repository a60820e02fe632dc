"""Discs seen nearly edge-on, with a hub and a hole: errors as large as sigma says, and nothing taken for hidden."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from circlepose.geometry.cone import plane_basis
from circlepose.pipeline import estimate
from circlepose.results import Flag
from circlepose.studies.scenes import CD_RADIUS_MM, CD_TARGET, cd_scenes
from circlepose.synthesis.render import render
from circlepose.synthesis.scene import Disc, Paint, Texture

SEEDS = 20
MOST = 1.5
"""Of rms error over sigma of 20 draws: exceeded by chance once in a thousand times."""
VIEW_B = cd_scenes()[1]


def elongated(tilt_deg, azimuth, *, disc=206.0, behind=30.0, hub=(0.375, 168.0), hole=(0.125, 34.0), **changed):
    """View (b) of Table I with another disc; hub and hole are (share of the radius, level)."""
    texture = changed.pop("texture", 3.0)
    center = VIEW_B.targets[0].center_mm
    sight = center / np.linalg.norm(center)
    tilt, (first, second) = np.radians(tilt_deg), plane_basis(sight)
    normal = -np.cos(tilt) * sight + np.sin(tilt) * (np.cos(azimuth) * first + np.sin(azimuth) * second)
    marks = tuple((CD_RADIUS_MM * share, Paint(level)) for share, level in (hub, hole))
    surface = Paint(disc, Texture(texture, 18.0, 0) if texture else None)
    background = Paint(behind, Texture(texture, 110.0, 0) if texture else None)
    target = Disc(center, normal, CD_RADIUS_MM, surface, marks=marks)
    return replace(VIEW_B, targets=(target,), background=background, **changed)


SCENES = {
    "general": elongated(84.0, 0.3),
    "bright hub": elongated(85.0, 0.8, hub=(0.5, 245.0), hole=(0.2, 34.0)),
    "low contrast": elongated(85.0, 0.4, disc=120.0, behind=70.0, hub=(0.45, 140.0), hole=(0.1, 60.0), texture=1.0),
    "blurred and noisy": elongated(85.0, 0.5, hub=(0.3, 168.0), blur_px=1.2, noise_levels=3.0),
    "plain surfaces": elongated(86.0, 1.0, hub=(0.5, 168.0), texture=0.0),
}


def drawn(scene, seed):
    """The scene with other noise and other texture."""

    def other(paint, offset):
        texture = paint.texture
        return paint if texture is None else replace(paint, texture=replace(texture, seed=offset + seed))

    disc = scene.targets[0]
    changed = replace(disc, paint=other(disc.paint, 1000))
    return replace(scene, targets=(changed,), background=other(scene.background, 5000), noise_seed=seed)


def nearest(result, truth):
    """The candidate nearest to the true normal, the flags, and the share of the rim in use."""
    (circle,) = result.circles
    return max(circle.candidates, key=lambda c: float(c.normal @ truth.normal)), circle


@pytest.mark.parametrize("name", SCENES)
def test_errors_of_elongated_discs_are_as_large_as_sigma_says(name):
    scenes = [drawn(SCENES[name], seed) for seed in range(SEEDS)]
    ratios = []
    for scene in scenes:
        candidate, circle = nearest(estimate(render(scene), scene.camera, CD_TARGET), scene.targets[0])
        ratios.append((candidate.center - scene.targets[0].center_mm) / np.sqrt(np.diag(candidate.covariance)[:3]))
        assert not {Flag.PARTIAL_RIM, Flag.POOR_FIT, Flag.EDGES_ONLY} & set(circle.flags)
    assert np.all(np.sqrt(np.mean(np.square(ratios), axis=0)) < MOST)


def test_the_view_of_the_paper_is_as_good_as_sigma_says_under_any_noise():
    """The texture is that of the sample: only the noise differs."""
    truth, errors, sigmas = VIEW_B.targets[0], [], []
    for seed in range(SEEDS):
        scene = replace(VIEW_B, noise_seed=seed)
        candidate, circle = nearest(estimate(render(scene), scene.camera, CD_TARGET), truth)
        errors.append(candidate.center - truth.center_mm)
        sigmas.append(np.sqrt(np.diag(candidate.covariance)[:3]))
        assert Flag.PARTIAL_RIM not in circle.flags
    assert np.all(np.sqrt(np.mean(np.square(np.divide(errors, sigmas)), axis=0)) < MOST)
    # In z, mm. The noise alone allows 0.03; the texture of disc and background is not known.
    assert np.sqrt(np.mean(np.square(errors), axis=0))[2] < 0.12


@pytest.mark.parametrize("shading", [0.0, 0.3])
def test_shading_along_an_elongated_disc_hides_nothing_of_it(shading):
    scene = elongated(87.0, 0.1, texture=0.0, shading=replace(VIEW_B.shading, right=shading))
    _, circle = nearest(estimate(render(scene), scene.camera, CD_TARGET), scene.targets[0])
    assert circle.rim_used > 0.95
