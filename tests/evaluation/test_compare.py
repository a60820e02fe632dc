from __future__ import annotations

import math
import random
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from circlepose.errors import ArgumentError
from circlepose.evaluation.compare import Tolerance, compare
from circlepose.evaluation.matching import PoseTable, TabledCircle, TabledPose

TOLERANCE = Tolerance(0.5, 0.1)
EXACT = Tolerance(0.0, 0.0)
FRONT = (0.0, 0.0, -1.0)


def tilted(degrees):
    return 0.0, math.sin(math.radians(degrees)), -math.cos(math.radians(degrees))


def circle(x=0.0, image="a.png", name="disc", instance=0, method="chen-huang", normal=FRONT, other=None, chosen=0):
    poses = [TabledPose((x, 2.0, 500.0), normal)]
    if other is not None:
        poses.append(TabledPose((x, 2.1, 500.0), other))
    return TabledCircle(image, instance, name, method, poses=tuple(poses), chosen=chosen)


def failed(status="no_pose", **names):
    return replace(circle(**names), status=status, poses=())


def table(*circles, **image_status):
    return PoseTable(circles, {name.replace("_", "."): status for name, status in image_status.items()})


def truth(*circles):
    return PoseTable(tuple(replace(each, method=None) for each in circles), {}, is_truth=True)


def told(comparison):
    return [(each.change, each.image, each.instance) for each in comparison.differences]


circles = st.builds(
    circle,
    x=st.floats(-100.0, 100.0),
    image=st.sampled_from(["a.png", "b.png"]),
    name=st.sampled_from(["big", "small"]),
    instance=st.integers(0, 3),
    normal=st.floats(-60.0, 60.0).map(tilted),
    other=st.none() | st.floats(-60.0, 60.0).map(tilted),
) | st.builds(failed, status=st.sampled_from(["no_pose", "touches_border"]), instance=st.integers(0, 3))
tables = st.lists(circles, max_size=12, unique_by=lambda c: (c.image, c.circle, c.instance)).map(lambda c: table(*c))


@given(tables, st.randoms())
def test_a_table_agrees_with_itself_in_any_order_of_rows(original, random_order):
    shuffled = list(original.circles)
    random_order.shuffle(shuffled)
    comparison = compare(table(*shuffled), original, EXACT)
    assert comparison.differences == ()
    assert comparison.compared == len(original.circles)


@given(tables, tables, st.randoms())
def test_the_order_of_rows_changes_nothing(first, second, random_order):
    def shuffled(original):
        rows = list(original.circles)
        random_order.shuffle(rows)
        return table(*rows)

    def lines(comparison):
        return sorted(map(str, comparison.differences))

    assert lines(compare(shuffled(first), shuffled(second), TOLERANCE)) == lines(compare(first, second, TOLERANCE))


@given(tables, tables)
def test_what_is_missing_one_way_is_extra_the_other_way(first, second):
    def count(comparison, change):
        return sum(each.change == change for each in comparison.differences)

    there, back = compare(first, second, TOLERANCE), compare(second, first, TOLERANCE)
    assert there.compared == back.compared
    assert count(there, "missing") == count(back, "extra")
    assert count(there, "missing") + there.compared == len(second.circles)


@given(st.floats(-60.0, 60.0), st.floats(0.0, 60.0), st.floats(0.0, 50.0))
def test_distances_are_those_moved(start, turn, shift):
    comparison = compare(
        table(circle(shift, normal=tilted(start + turn))), table(circle(normal=tilted(start))), EXACT
    )
    assert comparison.largest_position_mm == pytest.approx(shift, abs=1e-12)
    assert comparison.largest_normal_deg == pytest.approx(turn, abs=1e-12)


def test_the_worst_is_first_and_counted_in_tolerances():
    reference = table(*(circle(image=f"{i}.png") for i in range(4)), failed(image="gone.png"))
    measured = table(
        circle(0.4, image="0.png"),
        circle(0.75, image="1.png"),
        circle(2.0, image="2.png", normal=tilted(0.2)),
        circle(image="3.png", normal=tilted(0.8)),
    )
    comparison = compare(measured, reference, TOLERANCE)
    assert told(comparison) == [("missing", "gone.png", 0), *(("moved", f"{i}.png", 0) for i in (3, 2, 1))]
    assert [each.tolerances for each in comparison.differences[1:]] == pytest.approx([8.0, 4.0, 1.5])
    assert comparison.compared == 4


def test_a_tolerance_of_zero_or_infinity():
    moved = compare(table(circle(1e-9)), table(circle()), EXACT)
    assert moved.differences[0].tolerances == math.inf
    free = Tolerance(math.inf, 0.1)
    assert compare(table(circle(99.0)), table(circle()), free).differences == ()


@pytest.mark.parametrize("tolerance", [{"position_mm": -1.0}, {"normal_deg": math.nan}])
def test_tolerances_that_cannot_be_meant(tolerance):
    with pytest.raises(ArgumentError, match=next(iter(tolerance))):
        Tolerance(**tolerance)


def test_another_candidate_chosen_is_told_as_flipped():
    reference = table(circle(normal=tilted(-20.0), other=tilted(15.0)))
    measured = table(circle(normal=tilted(-20.0), other=tilted(15.0), chosen=1))
    (difference,) = compare(measured, reference, TOLERANCE).differences
    assert difference.change == "flipped"
    assert difference.orientation_difference_deg == pytest.approx(35.0)
    assert compare(measured, reference, TOLERANCE, "best").differences == ()


def test_best_takes_the_nearest_candidate_and_is_not_blind():
    reference = truth(circle(normal=tilted(15.0)))
    measured = table(circle(normal=tilted(-20.0), other=tilted(15.05)))
    assert told(compare(measured, reference, TOLERANCE)) == [("flipped", "a.png", 0)]
    assert compare(measured, reference, TOLERANCE, "best").largest_normal_deg == pytest.approx(0.05)
    strict = Tolerance(0.5, 0.01)
    assert told(compare(measured, reference, strict, "best")) == [("moved", "a.png", 0)]


def test_several_instances_are_matched_by_centre_whatever_their_numbers():
    reference = table(*(circle(100.0 * i, instance=i) for i in range(5)))
    measured = table(*(circle(100.0 * i + 0.1, instance=4 - i) for i in range(5)))
    comparison = compare(measured, reference, TOLERANCE)
    assert comparison.differences == ()
    assert comparison.largest_position_mm == pytest.approx(0.1)


def test_the_closest_pair_comes_first():
    """Had the sum of the distances to be least, the wrong circle could push all others one place on."""
    reference = table(*(circle(x, instance=i) for i, x in enumerate((0.0, 10.0, 20.0))))
    measured = table(*(circle(x, instance=i) for i, x in enumerate((10.0, 20.0, 1000.0))))
    (difference,) = compare(measured, reference, TOLERANCE).differences
    assert (difference.instance, difference.position_difference_mm) == (2, 1000.0)


def test_circles_of_different_names_are_never_matched():
    comparison = compare(table(circle(name="big")), table(circle(name="small")), TOLERANCE)
    assert told(comparison) == [("missing", "a.png", 0), ("extra", "a.png", 0)]


def test_methods_are_matched_with_their_own_baseline():
    reference = table(circle(0.0, method="chen-huang"), circle(5.0, method="kanatani-liu"))
    measured = table(circle(5.0, method="kanatani-liu"), circle(0.0, method="chen-huang"))
    assert compare(measured, reference, EXACT).differences == ()


def test_methods_that_have_nothing_in_common_are_told():
    comparison = compare(table(circle(method="kanatani-liu")), table(circle(method="chen-huang")), EXACT)
    assert comparison.notes == ("the poses are by kanatani-liu, the reference by chen-huang",)


def test_a_truth_holds_for_every_method():
    measured = table(circle(0.0, method="chen-huang"), circle(5.0, method="kanatani-liu"))
    comparison = compare(measured, truth(circle(), circle(50.0, image="b.png")), TOLERANCE)
    assert [(each.change, each.image, each.method) for each in comparison.differences] == [
        ("missing", "b.png", None),
        ("moved", "a.png", "kanatani-liu"),
    ]


def test_images_are_matched_by_file_name_only_where_no_path_matches():
    reference = table(circle(image="old/a.png"), circle(1.0, image="old/b.png"))
    measured = table(circle(image="C:\\new\\a.png"), circle(1.0, image="new/b.png"))
    comparison = compare(measured, reference, EXACT)
    assert comparison.differences == ()
    assert "file name" in comparison.notes[0]
    half = compare(table(circle(image="old/a.png"), circle(1.0, image="new/b.png")), reference, EXACT)
    assert sorted(told(half)) == [("extra", "new/b.png", 0), ("missing", "old/b.png", 0)]
    assert half.notes == ()


def test_file_names_that_are_not_unique_are_not_matched():
    reference = table(circle(image="x/a.png"), circle(image="y/a.png"))
    comparison = compare(table(circle(image="a.png")), reference, TOLERANCE)
    assert comparison.compared == 0
    assert comparison.notes == ("no image of the poses is in the reference",)


def test_rows_of_failed_images_keep_their_status_when_matched_by_file_name():
    reference = PoseTable((), {"old/a.png": "no_circle"})
    assert compare(PoseTable((), {"new/a.png": "no_circle"}), reference, EXACT).differences == ()


@pytest.mark.parametrize("names", [("t0", "t1"), (None, None)])
def test_a_truth_with_names_of_its_own_is_matched_by_centre(names):
    reference = truth(circle(0.0, name=names[0], instance=None), circle(90.0, name=names[1], instance=None))
    comparison = compare(table(circle(90.0, instance=0), circle(0.0, instance=1)), reference, EXACT)
    assert comparison.differences == ()
    assert "center alone" in comparison.notes[0]


def test_what_the_truth_does_not_know_is_not_compared():
    unknown = replace(circle(), poses=(TabledPose((0.0, 2.0, 500.0), None),))
    comparison = compare(table(circle(normal=tilted(40.0))), truth(unknown), TOLERANCE)
    assert comparison.differences == ()
    assert (comparison.largest_position_mm, comparison.largest_normal_deg) == (0.0, None)


def test_a_circle_of_unknown_centre_is_matched_with_what_is_left():
    unknown = replace(circle(), poses=(TabledPose(None, FRONT),))
    comparison = compare(table(circle(0.0), circle(50.0)), truth(unknown, circle(0.0)), TOLERANCE)
    assert (comparison.compared, comparison.differences) == (2, ())


def test_a_changed_status_is_a_difference_and_the_same_one_is_none():
    reference = table(circle(image="a.png"), failed(image="b.png"), failed(image="c.png"))
    measured = table(failed(image="a.png"), failed(image="b.png"), failed("touches_border", image="c.png"))
    comparison = compare(measured, reference, TOLERANCE)
    assert [(each.image, each.reference_status, each.status) for each in comparison.differences] == [
        ("a.png", "ok", "no_pose"),
        ("c.png", "no_pose", "touches_border"),
    ]


def test_circles_that_failed_alike_are_matched_before_others():
    reference = table(circle(0.0), failed("no_pose", instance=1))
    (difference,) = compare(table(failed("no_pose")), reference, TOLERANCE).differences
    assert (difference.change, difference.reference_status) == ("missing", "ok")


def test_a_failed_image_is_told_once_a_circle_with_its_reason():
    reference = table(circle(0.0), circle(50.0, instance=1), circle(image="b.png"))
    measured = table(circle(image="b.png"), a_png="no_circle")
    comparison = compare(measured, reference, TOLERANCE)
    assert [(each.change, each.status) for each in comparison.differences] == [("missing", "no_circle")] * 2


def test_an_image_that_no_longer_fails():
    reference = table(circle(image="b.png"), a_png="no_circle")
    (difference,) = compare(table(circle(), circle(image="b.png")), reference, TOLERANCE).differences
    assert (difference.change, difference.image, difference.reference_status) == ("extra", "a.png", "no_circle")


@pytest.mark.parametrize(
    ("ours", "theirs", "change"),
    [
        (table(circle(), a_png="too_few_circles"), table(circle()), "status"),
        (table(circle()), table(circle(), a_png="too_few_circles"), "status"),
        (table(a_png="no_circle"), table(a_png="unreadable"), "status"),
        (table(circle(), b_png="no_circle"), table(circle()), "extra"),
        (table(circle()), table(circle(), b_png="no_circle"), "missing"),
    ],
)
def test_rows_of_images_are_compared_too(ours, theirs, change):
    (difference,) = compare(ours, theirs, TOLERANCE).differences
    assert (difference.change, difference.circle) == (change, None)


def test_a_thousand_instances_take_no_time():
    places = random.Random(1).sample(range(100_000), 1000)
    reference = table(*(circle(float(x), instance=i) for i, x in enumerate(places)))
    measured = table(*(circle(x + 0.1, instance=i) for i, x in enumerate(sorted(places))))
    assert compare(measured, reference, TOLERANCE).differences == ()
