"""A ring target is matched, solved and measured once: the calls that one image makes."""

from __future__ import annotations

import sys
from collections import Counter

import pytest

import circlepose
from circlepose.geometry import cone
from circlepose.io.images.reader import read_image
from circlepose.io.target_file import read_target
from circlepose.measurement import poses
from circlepose.rings import matching
from circlepose.solvers import registry

COUNTED = (
    (cone, "principal_frame"),
    (registry, "solve"),
    (registry, "solve_chen_huang"),
    (matching, "match_solved"),
    (poses, "circle_results"),
)


@pytest.fixture
def calls(monkeypatch):
    """How often each counted function is called, wherever it was imported."""
    counts: Counter[str] = Counter()

    def counted(name, function):
        def call(*arguments, **options):
            counts[name] += 1
            return function(*arguments, **options)

        return call

    for module, name in COUNTED:
        function = getattr(module, name)
        for user in [user for key, user in sys.modules.items() if key.startswith("circlepose.")]:
            if vars(user).get(name) is function:
                monkeypatch.setattr(user, name, counted(name, function))
    return counts


@pytest.mark.parametrize("view", "abcd")
def test_a_coplanar_target_is_solved_once(project_root, calls, view):
    folder = project_root / "sample_images" / "coplanar"
    camera, target = circlepose.read_camera(folder / "camera.yml"), read_target(folder / "target.yaml")
    result = circlepose.estimate(read_image(folder / f"{view}.png"), camera, target)
    assert result.status == "ok"
    # All rims of an image at once: as they were detected, and as they were fitted to the gray levels.
    assert calls["principal_frame"] <= 2
    assert calls["solve"] + calls["solve_chen_huang"] <= 2
    assert calls["match_solved"] == 1
    # No result by its own rim, which the joint pose would overwrite.
    assert calls["circle_results"] == 0
