"""Fu & Zhou's route as a method, and its cues in what is written: column, JSON, `explain`."""

from __future__ import annotations

import csv
import io
import json
from dataclasses import replace

import numpy as np
import pytest

import circlepose
from circlepose.errors import ArgumentError
from circlepose.io.tables.lossless import plain_result, restored_result
from circlepose.io.tables.paper_layouts import write_results
from circlepose.results import SETTLED_BY_MEANING, Flag, SettledBy, Status
from circlepose.solvers import CIRCLE_METHODS, FU_ZHOU, METHODS
from circlepose.synthesis.scene import CoaxialPart, Disc, Paint
from circlepose.targets.target import Target
from circlepose_cli.app import main
from circlepose_cli.reports.explain.text import report_text
from tests.rings.test_results import BOSS, CAMERA, CENTER, COAXIAL, COPLANAR, DARK, NORMAL, RINGS, rendered


@pytest.fixture(scope="module", params=[(COPLANAR, RINGS), (COAXIAL, BOSS)], ids=["coplanar", "coaxial"])
def measured_by_all(request):
    target, part = request.param
    image = rendered(part)
    return target, image, circlepose.estimate(image, CAMERA, target, method="all", name="a.png")


def written(result, data_format, layout="poses"):
    handle = io.StringIO()
    write_results([result], handle, data_format=data_format, layout=layout)
    return handle.getvalue()


def test_all_methods_hold_that_of_the_paper(measured_by_all):
    target, _, result = measured_by_all
    assert [c.method for c in result.circles] == [*METHODS, *METHODS]
    for circle in result.circles:
        if circle.method == FU_ZHOU:
            assert circle.status is Status.OK
            assert circle.candidates[0].normal @ NORMAL > np.cos(np.radians(1.0))
            assert circle.candidates[0].orientation_difference_deg is not None
            assert len(circle.candidates) == (1 if target.kind == "coplanar" else 2)
    for layout in ("poses", "table1", "table2"):
        assert FU_ZHOU in written(result, "csv", layout)


def test_alone_the_method_gives_what_it_gives_among_others(measured_by_all):
    target, image, result = measured_by_all
    alone = circlepose.estimate(image, CAMERA, target, method=FU_ZHOU)
    among = [circle for circle in result.circles if circle.method == FU_ZHOU]
    for one, other in zip(alone.circles, among, strict=True):
        np.testing.assert_array_equal(one.candidates[0].center, other.candidates[0].center)
        assert (one.circle, one.ambiguity, one.settled_by) == (other.circle, other.ambiguity, other.settled_by)


def test_what_settled_it_and_by_how_much_is_written(measured_by_all):
    target, image, _ = measured_by_all
    result = circlepose.estimate(image, CAMERA, target, name="a.png")
    (first, *_) = csv.DictReader(io.StringIO(written(result, "csv")))
    assert list(first)[-1] == "settled_by"
    cue = SettledBy.VANISHING_LINE if target.kind == "coplanar" else SettledBy.GENERATRIX
    assert first["settled_by"] == cue
    circle = json.loads(written(result, "json"))["images"][0]["circles"][0]
    right, wrong = circle["solutions"]
    if target.kind == "coplanar":
        assert right["vanishing_normal_distance_sigmas"] < 4.5 < wrong["vanishing_normal_distance_sigmas"]
        assert np.array(circle["vanishing_normal"]) @ NORMAL > np.cos(
            np.radians(5.0 * circle["vanishing_normal_sigma_deg"])
        )
        assert abs(right["height_mm"]) < 4.0 * np.hypot(right["height_sigma_mm"], target.flatness_mm)
    else:
        assert circle["generatrix_expected_mm"] == target.generatrix_mm
        away = np.abs(np.array(right["generatrix_ends_mm"]) - target.generatrix_mm)
        assert np.all(away < 3.0 * np.array(right["generatrix_ends_sigma_mm"]))
        near, far = wrong["generatrix_ends_mm"]
        assert abs(near - far) > 5.0


def test_explain_says_it_in_words(measured_by_all):
    target, image, _ = measured_by_all
    text = report_text(circlepose.explain(image, CAMERA, target), "c", "t")
    word = "vanishing line: normal" if target.kind == "coplanar" else "generatrix: expected 45.21 mm"
    assert word in text
    assert "settled by" in text
    assert "height of the other circles" in text


def test_stored_results_keep_the_cues_and_older_ones_are_read(measured_by_all):
    *_, result = measured_by_all
    plain = json.loads(json.dumps(plain_result(result)))
    for data_format in ("csv", "json"):
        assert written(restored_result(plain), data_format) == written(result, data_format)
    for circle in plain["circles"]:
        for key in ("settled_by", "vanishing_normal", "vanishing_sigma_deg", "generatrix_expected_mm"):
            del circle[key]
        for candidate in circle["candidates"]:
            for key in ("height_mm", "height_sigma_mm", "generatrix_ends_mm", "generatrix_ends_sigma_mm"):
                del candidate[key]
    older = restored_result(plain)
    assert all(circle.settled_by is SettledBy.NONE for circle in older.circles)


def test_a_lone_circle_has_no_such_method():
    target = Target.circle(50.0)
    image = rendered(Disc(CENTER, NORMAL, 50.0, DARK))
    with pytest.raises(ArgumentError, match="fu-zhou needs a ring target, kind: coplanar or coaxial"):
        circlepose.estimate(image, CAMERA, target, method=FU_ZHOU)
    circles = circlepose.estimate(image, CAMERA, target, method="all").circles
    assert [circle.method for circle in circles] == list(CIRCLE_METHODS)


def test_of_one_circle_of_a_ring_target_the_method_says_why_it_has_no_pose():
    image = rendered(Disc(CENTER, NORMAL, 50.0, DARK))
    (circle,) = circlepose.estimate(image, CAMERA, COPLANAR, method=FU_ZHOU).circles
    assert circle.status is Status.NO_POSE
    assert "two circles" in circle.reason
    several = circlepose.estimate(image, CAMERA, COPLANAR, method="all").circles
    assert [each.method for each in several] == list(CIRCLE_METHODS)


def test_an_unknown_generatrix_is_settled_by_ends_of_one_length():
    result = circlepose.estimate(rendered(BOSS), CAMERA, replace(COAXIAL, generatrix_mm=None), method=FU_ZHOU)
    assert result.circles[0].candidates[0].normal @ NORMAL > 0.999
    assert result.circles[0].settled_by is SettledBy.GENERATRIX


def test_the_command_line_refuses_it_for_lone_circles(project_root, capsys):
    code = main(["estimate", str(project_root / "sample_images" / "cd"), "--method", FU_ZHOU])
    err = capsys.readouterr().err
    assert code == 2
    assert "--method: fu-zhou needs a ring target" in err
    assert "Traceback" not in err


def test_a_table_without_the_column_is_still_a_baseline(project_root, tmp_path, capsys):
    stored = project_root / "sample_images" / "coplanar" / "poses.csv"
    rows = list(csv.reader(io.StringIO(stored.read_text())))
    older = tmp_path / "older.csv"
    with older.open("w", newline="") as handle:
        csv.writer(handle, lineterminator="\n").writerows(row[:-1] for row in rows)
    assert rows[0][-1] == "settled_by"
    assert main(["check", str(stored), "--against", str(older)]) == 0
    capsys.readouterr()


def test_every_value_has_a_meaning_in_the_manual(project_root):
    manual = (project_root / "docs" / "cli.md").read_text()
    assert set(SETTLED_BY_MEANING) == set(SettledBy)
    assert [value for value in SettledBy if f"`{value}`" not in manual] == []


EQUAL_LENGTHS = Target("coaxial", (45.0, 40.5), generatrix_mm=float(np.hypot(42.3, 4.5)))


def boss_of_equal_lengths(lean_deg):
    """A boss at the tilt at which the wrong pair has the right generatrix at both ends."""
    tilt, lean = np.radians(29.83), np.radians(lean_deg)
    across = np.array([np.cos(lean), np.sin(lean), 0.0])
    normal = np.sin(tilt) * across + np.array([0.0, 0.0, -np.cos(tilt)])
    center = np.array([0.0, 0.0, 225.0])
    return CoaxialPart(center, normal, (45.0, 40.5), 42.3, "boss", Paint(80.0), Paint(230.0))


@pytest.mark.parametrize("lean_deg", [20.0, 110.0, 200.0])
def test_generatrices_that_settle_nothing_leave_a_boss_ambiguous(lean_deg):
    result = circlepose.estimate(rendered(boss_of_equal_lengths(lean_deg)), CAMERA, EQUAL_LENGTHS, method=FU_ZHOU)
    assert [circle.circle for circle in result.circles] == ["big", "small"]
    for circle in result.circles:
        assert circle.ambiguity > 0.05
        assert Flag.AMBIGUOUS in circle.flags
        assert circle.settled_by is SettledBy.NONE
        assert len(circle.candidates) == 2


def test_a_choice_is_settled_or_ambiguous_and_no_probability_is_rounded_to_zero(measured_by_all):
    *_, result = measured_by_all
    for circle in result.circles:
        if circle.method == FU_ZHOU:
            assert circle.settled_by is not SettledBy.NONE
            assert Flag.AMBIGUOUS not in circle.flags
            assert 0.0 < circle.ambiguity < 0.05
