"""The numbers of detection: documented, and in force when they are given."""

from __future__ import annotations

import ast
import inspect
from dataclasses import fields, replace

import numpy as np
import pytest

from circlepose.detection.detect import find_contours
from circlepose.detection.edges.options import EdgeOptions
from circlepose.detection.options import DEFAULT, DetectionOptions
from circlepose.geometry.ellipse import Ellipse
from circlepose.targets.target import AxisIntervals

SOURCES = ("statistical", "numerical", "cost", "empirical", "exact")


def disc() -> np.ndarray:
    """A blurred dark disc with a radius of 40 px."""
    y, x = np.mgrid[:240, :320]
    return np.clip(128.0 + 60.0 * (np.hypot(x - 160.2, y - 119.7) - 40.0), 60.0, 200.0).astype(np.uint8)


def documented(kind: type) -> dict[str, str]:
    """The string under each field of a dataclass."""
    (body,) = ast.parse(inspect.getsource(kind)).body
    found = {}
    for statement, following in zip(body.body, body.body[1:], strict=False):
        if isinstance(statement, ast.AnnAssign) and isinstance(following, ast.Expr):
            found[statement.target.id] = following.value.value
    return found


@pytest.mark.parametrize("kind", [DetectionOptions, EdgeOptions])
def test_each_number_names_its_source(kind):
    texts = documented(kind)
    numbers = [field.name for field in fields(kind) if field.name not in ("edges", "photometry")]
    assert [name for name in numbers if texts.get(name, "").rpartition("; ")[2] not in SOURCES] == []


def test_numbers_that_are_given_are_in_force():
    image = disc()
    assert len(find_contours(image, AxisIntervals()).contours) == 1
    for strict in (
        replace(DEFAULT, least_score=1.1),
        replace(DEFAULT, least_step_share=1.1),
        replace(DEFAULT, least_rim=1.1, clean_rim=1.1, least_partial_rim=1.1),
        replace(DEFAULT, edges=EdgeOptions(least_gradient=1e6)),
    ):
        assert find_contours(image, AxisIntervals(), options=strict).contours == ()


def test_more_samples_give_more_points_of_the_same_circle():
    usual = find_contours(disc(), AxisIntervals()).contours[0]
    (dense,) = find_contours(disc(), AxisIntervals(), options=replace(DEFAULT, samples=144)).contours
    assert len(usual.points) <= 72 < len(dense.points) <= 144
    truth = Ellipse.from_axes([160.2, 119.7], [40.0, 40.0], 0.0)
    np.testing.assert_allclose(dense.ellipse.center, truth.center, atol=0.05)
    np.testing.assert_allclose(dense.ellipse.semi_major, truth.semi_major, atol=0.1)
