from __future__ import annotations

import cv2
import numpy as np
import pytest

from circlepose.diagnostics.inspection import inspect
from circlepose.drawing import inspection as drawing
from circlepose.drawing.inspection import draw_inspection
from circlepose.drawing.style import CHOSEN, REJECTED
from circlepose.errors import ArgumentError


def board(pitch: int, radius: int, scale: int = 1) -> np.ndarray:
    """Dark discs in rows, and a triangle that is no circle."""
    image = np.full((480 * scale, 640 * scale), 190, np.uint8)
    for y in range(60, 440, pitch):
        for x in range(60, 440, pitch):
            cv2.circle(image, (x * scale, y * scale), radius * scale, 40, -1, cv2.LINE_AA)
    cv2.fillPoly(image, [np.array([[500, 100], [620, 110], [540, 220]]) * scale], 60, cv2.LINE_AA)
    noise = np.random.default_rng(0).normal(0.0, 1.0, image.shape)
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.8) + noise, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("scale", [1, 4])
def test_both_kinds_are_drawn_in_their_colors_over_an_image_large_enough(scale):
    image = board(120, 30, scale)
    picture = draw_inspection(image, inspect(image), "board.png")
    factor = 2 if scale == 1 else 1
    assert picture.shape[1] == factor * image.shape[1] >= 1000
    assert picture.shape[0] > factor * image.shape[0]
    for part in (picture[: -factor * len(image)], picture[-factor * len(image) :]):
        assert np.all(part == CHOSEN, axis=-1).any()
        assert np.all(part == REJECTED, axis=-1).any() == bool(len(inspect(image).extraction.refused_why))


@pytest.mark.parametrize(("pitch", "radius"), [(120, 30), (24, 6)])
def test_labels_of_a_dense_board_do_not_lie_on_each_other(pitch, radius, monkeypatch):
    plans, planned = [], drawing.plan_labels
    monkeypatch.setattr(drawing, "plan_labels", lambda *args: plans.append(planned(*args)) or plans[-1])
    image = board(pitch, radius)
    found = inspect(image)
    draw_inspection(image, found)
    plan, why = plans
    assert len(plan.placed) + plan.left_out == len(found.extraction.contours)
    assert len(why.placed) + why.left_out == len(found.extraction.refused_why)
    has_score = ":" in plan.placed[0].lines[0]
    assert has_score == (pitch > 100)
    boxes = np.array([each.box for each in (*plan.placed, *why.placed)])
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=-1)
    assert shared[~np.eye(len(boxes), dtype=bool)].max() == 0.0


def test_nothing_found_is_drawn_too():
    image = np.full((100, 200), 80, np.uint8)
    assert draw_inspection(image, inspect(image)).shape[1] == 1000


def test_another_image_is_refused():
    image = np.full((100, 200), 80, np.uint8)
    with pytest.raises(ArgumentError, match=r"^image: .*200 x 100 px, got 100 x 200"):
        draw_inspection(image.T, inspect(image))
