"""`--min-score` and `--max-residual-px` of the commands that look for circles."""

from __future__ import annotations

import json

import cv2
import pytest

from tests.support.discs import CAMERA_YAML
from tests.test_bounds import image_of, shape


@pytest.fixture
def folder(tmp_path):
    """A photograph of a circle and of something wavy, with its camera and target."""
    image = image_of(shape(0.0, 7, (90.0, 120.0)), shape(0.4, 7, (230.0, 120.0)))
    cv2.imwrite(str(tmp_path / "a.png"), image)
    (tmp_path / "camera.yaml").write_text(CAMERA_YAML)
    (tmp_path / "target.yaml").write_text("radius_mm: 20\ncount: all\n")
    return tmp_path


def test_a_bound_on_the_residual(run, folder):
    code, out, _ = run("estimate", folder, "--format", "json", "--max-residual-px", "0.15")
    (record,) = json.loads(out)["images"]
    assert (code, len(record["circles"])) == (0, 1)
    assert record["circles"][0]["residual_px"] <= 0.15
    assert "1 found" in run("inspect", folder / "a.png", "--max-residual-px", "0.15")[1]


def test_a_bound_that_nothing_meets_is_named(run, folder):
    code, out, _ = run("explain", folder / "a.png", "--max-residual-px", "0.001")
    assert code == 3
    assert "edges farther from an ellipse than --max-residual-px" in out
    assert run("explain", folder / "a.png", "--min-score", "1")[0] == 3


def test_a_resumed_run_refuses_another_bound(run, folder):
    from circlepose.batch.journal import Journal  # noqa: PLC0415
    from circlepose.batch.measure import MeasureOptions  # noqa: PLC0415
    from circlepose.batch.resume import conditions, journal_path  # noqa: PLC0415

    output = folder / "out.csv"
    with Journal(journal_path(output), conditions(MeasureOptions()), resume=False, output="out.csv"):
        pass
    code, _, err = run("estimate", folder, "-o", output, "--resume", "--min-score", "0.2")
    assert code == 2
    assert "min_score was None and is 0.2" in err


@pytest.mark.parametrize(
    ("typed", "expected"),
    [
        ("--min-score=2", "--min-score: expected a score from 0 to 1, such as 0.2, got 2."),
        ("--max-residual-px=-1", "--max-residual-px: expected a positive number of px, such as 0.3, got -1."),
    ],
)
def test_other_bounds_are_refused(run, folder, typed, expected):
    for command in ("estimate", "explain", "inspect"):
        code, out, err = run(command, folder / "a.png", typed)
        assert (code, out) == (2, "")
        assert expected in err
