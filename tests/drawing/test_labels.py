from __future__ import annotations

import numpy as np
import pytest

from circlepose.drawing.heading import Heading, LegendItem
from circlepose.drawing.labels import Label, Plan, Room, draw_labels, plan_labels
from circlepose.drawing.style import CHOSEN, Font, plain

RED = (0, 0, 255)


def ring(x: float, y: float, radius: float) -> np.ndarray:
    turn = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    return np.array([x, y]) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=-1)


def planned(rims: list[np.ndarray], sizes: tuple[float, ...], unit: float = 1.0, lines=None) -> tuple[Plan, Room]:
    picture = np.zeros((600, 800, 3), np.uint8)
    room = Room.of(picture, unit)
    for rim in rims:
        room.keep_disc(rim)
    labels = [Label((lines or (str(i),),) * len(sizes), RED, rim) for i, rim in enumerate(rims)]
    return plan_labels(picture, room, labels, sizes), room


def grid(pitch: float, radius: float) -> list[np.ndarray]:
    end = min(12 * pitch, 480)
    return [ring(x, y, radius) for y in np.arange(60, 60 + end, pitch) for x in np.arange(60, 60 + end, pitch)]


@pytest.mark.parametrize("unit", [1.0, 2.6])
@pytest.mark.parametrize(("pitch", "radius"), [(120, 40), (48, 20), (34, 15), (16, 6)])
def test_no_label_lies_on_another_on_a_rim_or_outside(pitch, radius, unit):
    rims = grid(pitch, radius)
    plan, _ = planned(rims, (0.5, 0.4, 0.3), unit)
    assert plan.placed
    assert len(plan.placed) + plan.left_out == len(rims)
    boxes = np.array([each.box for each in plan.placed])
    assert boxes.min() >= 0.0
    assert np.all(boxes[:, 2:] <= [800, 600])
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    shared = np.prod(np.maximum(high - low, 0.0), axis=-1)
    assert shared[~np.eye(len(boxes), dtype=bool)].max(initial=0.0) == 0.0
    points = np.concatenate(rims)
    on = np.all((points[:, None] > boxes[:, :2]) & (points[:, None] < boxes[:, 2:]), axis=-1)
    assert not on.any()


def test_where_there_is_room_every_label_is_large_and_beside_its_own():
    rims = grid(120, 40)
    plan, _ = planned(rims, (0.5, 0.3))
    assert (plan.level, plan.left_out) == (0, 0)
    middles = np.array([rim.mean(axis=0) for rim in rims])
    for each in plan.placed:
        box = np.array(each.box)
        gaps = np.linalg.norm(np.clip(middles, box[:2], box[2:]) - middles, axis=1)
        assert int(each.lines[0]) == int(np.argmin(gaps))


def test_a_crowd_gets_small_labels_and_those_without_room_are_counted():
    small, _ = planned(grid(34, 15), (0.9, 0.3))
    assert small.level == 1
    crowd, _ = planned(grid(16, 7), (0.9, 0.8))
    assert crowd.left_out > 0


def test_lines_about_discs_are_all_or_none():
    lines = ("instance 0: disc of radius 20 mm", "center (10.00, 20.00, 300.00) mm")
    few, _ = planned([ring(400, 300, 60)], (0.5,), lines=lines)
    assert few.level == 0
    picture = np.zeros((60, 60, 3), np.uint8)
    label = Label((lines, ("0",)), RED, ring(30, 30, 10))
    assert plan_labels(picture, Room.of(picture, 1.0), [label], (0.5, 0.3)).level == 1


def test_a_caption_hides_no_arrow_and_a_number_only_where_it_must():
    lines = ("instance 0: disc of radius 20 mm", "center (10.00, 20.00, 300.00) mm")
    rim = ring(400, 300, 60)
    arrows = [np.array([[400.0, 300.0], [400.0 + dx, 300.0 + dy]]) for dx, dy in ((0, -250), (200, 0), (150, -150))]
    for text in (lines, ("0",)):
        picture, label = np.zeros((600, 800, 3), np.uint8), Label((text,), RED, rim)
        room = Room.of(picture, 1.0)
        room.keep_disc(rim)
        room.spare_lines(arrows)
        (placed,) = plan_labels(picture, room, [label], (0.5,)).placed
        steps = np.linspace(0.0, 1.0, 200)[:, None]
        for start, end in arrows:
            points = start + steps * (end - start)
            assert not np.all((points > placed.box[:2]) & (points < placed.box[2:]), axis=1).any()


def test_labels_are_drawn_within_their_plates():
    rims = grid(120, 40)
    plan, _ = planned(rims, (0.5,))
    picture = np.full((600, 800, 3), 200, np.uint8)
    draw_labels(picture, plan)
    outside = np.ones((600, 800), bool)
    for each in plan.placed:
        left, top, right, bottom = (round(side) for side in each.box)
        outside[top:bottom, left:right] = False
    assert np.all(picture[outside] == 200)
    assert (picture[~outside] != 200).any()


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a b.png", "a b.png"),
        ("Prüfling é.png", "Prufling e.png"),
        ("Pru\u0308fling", "Prufling"),
        ("图.png", "\\u56fe.png"),
        ("ß\x1b\n", "\\xdf\\x1b\\x0a"),
        ("\udcff", "\\udcff"),
        ("🙂", "\\U0001f642"),
    ],
)
def test_what_the_font_lacks_is_escaped(text, shown):
    assert plain(text) == shown


@pytest.mark.parametrize("scale", [0.1, 0.5, 1.5])
def test_long_lines_are_wrapped(scale):
    font = Font.of_scale(scale)
    for line in ("word " * 60, "x" * 300, "a " + "y" * 100 + " b"):
        parts = font.wrapped(line.strip(), 400.0)
        assert max(font.width(part) for part in parts) <= 400
        assert "".join(parts).replace(" ", "") == line.replace(" ", "")


@pytest.mark.parametrize("width", [560, 1280, 2592])
def test_a_heading_is_as_wide_as_asked_and_grows_with_what_it_says(width):
    unit = width / 1000.0
    items = tuple(LegendItem("line", CHOSEN, f"thing {n} with a name") for n in range(9))
    short = Heading("a.png").drawn(width, unit)
    long = Heading("a.png", ("word " * 80,), items, (("instance", "center"), ("0", "x" * 900))).drawn(width, unit)
    assert short.shape[1] == long.shape[1] == width
    assert len(long) > 2 * len(short)
    assert np.all(long == CHOSEN, axis=-1).any()
    assert np.ptp(long[:, -3:].astype(int), axis=(0, 1)).max() == 0
