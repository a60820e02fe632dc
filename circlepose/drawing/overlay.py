"""A picture of a result: what was measured, drawn over the image that it was measured in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from circlepose import _arguments
from circlepose._typing import Image
from circlepose.boards.world import is_relative, relative_to_world
from circlepose.camera.camera import Camera
from circlepose.diagnostics.boards import BoardView, board_views
from circlepose.diagnostics.explain import camera_of
from circlepose.drawing import board_overlay, board_words, words
from circlepose.drawing.board_overlay import draw_boards, draw_world, plan_names
from circlepose.drawing.canvas import Pen
from circlepose.drawing.display import boxes_around, displayed, enlarged
from circlepose.drawing.heading import Heading, LegendItem
from circlepose.drawing.labels import Label, Plan, Room, draw_labels, plan_labels
from circlepose.drawing.rims import Drawn, draw_center, draw_rims
from circlepose.drawing.style import (
    AMBIGUOUS,
    CENTER,
    CHOSEN,
    FAILED,
    OTHER,
    PANEL,
    PARTLY,
    REJECTED,
    TEXT_SIZE,
    UNUSED,
    unit_of,
)
from circlepose.errors import ArgumentError
from circlepose.results import CircleResult, ImageResult, Status

MOST_CAPTIONS = 4
"""with more targets there are only their numbers, and the poses stand above the image"""
MOST_ROWS = 12
"""with more targets the poses are only in the table of `estimate`"""
IN_WORLD = "poses relative to the world board"
_NUMBER_SIZES = (0.5, 0.42, 0.35, 0.29, 0.24)
_OFF_PX = 0.5
"""The camera is another one if it sees a center farther than this from where it was seen."""


def draw_overlay(image: Image, result: ImageResult, camera: Camera) -> Image:
    """Draw `result` over `image`.

    Drawn for each circle are the rim of the chosen pose, thin, so that one can see whether it lies on the edge; the
    imaged center; both candidates' normals, one radius long, the chosen one bold; and the number of the target, which
    is `instance` in the tables. Of a board the rims of all circles by its pose are drawn, its axes, and the names of
    circles. Above the image are its name, what was found, the poses and a legend. Small images are enlarged, dark and
    pale ones brightened. Of several methods the first is drawn.

    Parameters
    ----------
    image
        (height, width) or (height, width, 3 or 4), 8 or 16 bit or floating, raw as it was measured.
    result
        What `estimate` returned for it.
    camera
        With which it was measured.

    Returns
    -------
    The picture (height, width, 3), BGR uint8. The image is at its bottom left, enlarged by a whole factor where its
    longer side is below 1000 px.

    Raises
    ------
    ArgumentError
        On misuse, naming the parameter; also where `image` has another size than the one that was measured, or
        `camera` does not see the circles where they are.
    """
    _arguments.instance_of(ImageResult, "result", result, "of estimate or measure")
    _arguments.instance_of(Camera, "camera", camera, _arguments.HOW_CAMERA)
    if is_relative(result):
        raise ArgumentError(
            "result: expected that of estimate, in the camera frame; this one is relative to a board."
        )
    methods = list(dict.fromkeys(circle.method for circle in result.circles))
    circles = [circle for circle in result.circles if circle.method == methods[0]]
    shown, remark = displayed(image, boxes_around(circle.ellipse for circle in circles))
    size = (shown.shape[1], shown.shape[0])
    if result.image_size not in (None, size):
        raise ArgumentError(
            f"image: expected the one that was measured, of {result.image_size[0]} x {result.image_size[1]} px, "
            f"got {size[0]} x {size[1]}."
        )
    if circles:
        camera = _checked_camera(camera, size, circles, result)
    canvas, enlargement = enlarged(shown, _typical_px(circles))
    unit = unit_of(canvas)
    pen, room = Pen(canvas, enlargement, unit), Room.of(canvas, unit)
    of_world = () if result.world is None else draw_world(pen, room, result.world, camera)
    views = board_views(result)
    if views:
        return _with_boards(pen, room, views, camera, result, remark, of_world)
    drawn = [Drawn.of(circle, camera, enlargement) for circle in circles]
    draw_rims(pen, room, drawn)
    arrows = [arrow for each in drawn for arrow in each.arrows]
    for tail, head, color, units in sorted(arrows, key=lambda arrow: arrow[3]):
        pen.arrow(tail, head, color, units)
    room.spare_lines([pen.at(np.stack([tail, head])) for tail, head, _, _ in arrows])
    for each in drawn:
        draw_center(pen, each.circle)
    # What is written is what the table has.
    reported = result if result.world is None else relative_to_world(result)
    circles = [circle for circle in reported.circles if circle.method == methods[0]]
    drawn = [replace(each, circle=circle) for each, circle in zip(drawn, circles, strict=True)]
    targets = _by_target(drawn)
    plan = _plan_labels(pen, room, targets)
    draw_labels(canvas, plan)
    has_captions = len(targets) <= MOST_CAPTIONS and plan.level == 0
    others = f"the first of {len(methods)} methods" if len(methods) > 1 else ""
    frame = IN_WORLD if result.world is not None else ""
    left_out = f"{plan.left_out} of {len(targets)} numbers have no room" if plan.left_out else ""
    rows = () if has_captions else _rows(targets)
    heading = _heading(
        result,
        circles,
        (others, frame, remark, left_out),
        rows,
        (*_legend(drawn, has_numbers=not has_captions), *of_world),
    )
    return np.concatenate([heading.drawn(canvas.shape[1], unit), canvas])


def _with_boards(
    pen: Pen,
    room: Room,
    views: Sequence[BoardView],
    camera: Camera,
    result: ImageResult,
    remark: str,
    of_world: tuple[LegendItem, ...],
) -> Image:
    """Return the picture of boards."""
    drawn = draw_boards(pen, room, views, camera)
    for view in views:
        for circle, fit in zip(view.circles, view.fits, strict=True):
            if fit is not None:
                draw_center(pen, circle)
    for plan in plan_names(pen, room, drawn):
        draw_labels(pen.canvas, plan)
    boards = (result if result.world is None else relative_to_world(result)).boards
    rows = board_words.rows(boards) if 1 < len(boards) <= MOST_ROWS else ()
    frame = IN_WORLD if result.world is not None else ""
    sentences = (*_failure(result), *board_words.sentences(boards), frame, remark)
    legend = (*board_overlay.legend(drawn), LegendItem("cross", CENTER, "imaged center"), *of_world)
    color = PANEL if result.status is Status.OK else PARTLY
    heading = Heading(result.image, tuple(each for each in sentences if each), legend, rows, color)
    return np.concatenate([heading.drawn(pen.canvas.shape[1], pen.unit), pen.canvas])


def _checked_camera(
    camera: Camera, size: tuple[int, int], circles: Sequence[CircleResult], result: ImageResult
) -> Camera:
    """Return the camera of the image, which may have been resized; raise `ArgumentError` if it is another one."""
    if camera.image_size not in (None, size) and result.image_size is None:
        camera = camera.scaled_to(size)
    camera = camera_of(result, camera)
    posed = [circle.candidates[circle.chosen] for circle in circles if circle.candidates]
    if posed:
        seen = camera.project(np.stack([pose.center for pose in posed]))
        off = np.linalg.norm(seen - np.stack([pose.imaged_center for pose in posed]), axis=1)
        farthest = float(np.max(off, initial=0.0, where=np.isfinite(off)))
        if farthest > _OFF_PX:
            raise ArgumentError(
                "camera: expected the one that the image was measured with, got another: it sees a circle "
                f"{farthest:.1f} px from where `result` has it."
            )
    return camera


def _typical_px(circles: Sequence[CircleResult]) -> float:
    """Return the minor axis of the typical circle, px."""
    axes = [2.0 * float(circle.ellipse.semi_minor) for circle in circles if circle.ellipse is not None]
    return float(np.median(axes)) if axes else np.inf


def _by_target(drawn: Sequence[Drawn]) -> list[list[Drawn]]:
    targets: dict[int, list[Drawn]] = {}
    for each in drawn:
        targets.setdefault(each.circle.instance, []).append(each)
    return list(targets.values())


def _plan_labels(pen: Pen, room: Room, targets: Sequence[Sequence[Drawn]]) -> Plan:
    """Return where the captions of the targets go, or their numbers where they are many or have no room."""
    has_captions = len(targets) <= MOST_CAPTIONS
    sizes = ([TEXT_SIZE] if has_captions else []) + list(_NUMBER_SIZES)
    labels = []
    for own in targets:
        circles = [each.circle for each in own]
        points = pen.at(np.concatenate([each.rim for each in own]))
        if np.isfinite(points).all(axis=1).any():
            numbers = ((str(circles[0].instance),),) * len(_NUMBER_SIZES)
            texts = (words.caption(circles), *numbers) if has_captions else numbers
            labels.append(Label(texts, own[0].color, points))
    return plan_labels(pen.canvas, room, labels, [size * pen.unit for size in sizes])


def _legend(drawn: Sequence[Drawn], *, has_numbers: bool) -> tuple[LegendItem, ...]:
    """Return what is drawn, and nothing else."""
    colors = {each.color for each in drawn}
    items = []
    if CHOSEN in colors:
        items.append(LegendItem("line", CHOSEN, "rim of the chosen pose"))
        items.append(LegendItem("bold arrow", CHOSEN, "its normal, one radius long"))
    if AMBIGUOUS in colors:
        items.append(LegendItem("line", AMBIGUOUS, "rim where two poses are possible"))
        items.append(LegendItem("bold arrow", AMBIGUOUS, "normal of the first pose"))
    if any(len(each.arrows) > 1 for each in drawn):
        items.append(LegendItem("thin arrow", OTHER, "normal of the other pose"))
    if colors - {REJECTED}:
        items.append(LegendItem("cross", CENTER, "imaged center"))
    if any(each.hidden.any() for each in drawn):
        items.append(LegendItem("line", UNUSED, "part of the rim where the contour has a gap"))
    if REJECTED in colors:
        items.append(LegendItem("line", REJECTED, "contour without a pose"))
    if drawn and has_numbers:
        items.append(LegendItem("number", drawn[0].color, "instance in the table"))
    return tuple(items)


def _rows(targets: Sequence[Sequence[Drawn]]) -> tuple[tuple[str, ...], ...]:
    """Return the poses of a few targets as a table; nothing for many."""
    if not 0 < len(targets) <= MOST_ROWS:
        return ()
    rows = [words.row([each.circle for each in own]) for own in targets]
    # What is the same for all is said above the table.
    is_same = len({row[-1] for row in rows}) == 1
    return tuple(row[:-1] if is_same else row for row in (words.ROW_NAMES, *rows))


def _failure(result: ImageResult) -> tuple[str, ...]:
    """Return why an image failed; nothing if it did not."""
    if result.status is Status.OK:
        return ()
    return (f"{result.status}: {words.without_advice(result.reason)}" if result.reason else f"{result.status}",)


def _heading(
    result: ImageResult,
    circles: Sequence[CircleResult],
    remarks: Sequence[str],
    rows: tuple[tuple[str, ...], ...],
    legend: tuple[LegendItem, ...],
) -> Heading:
    has_failed = result.status is not Status.OK
    sentences = list(_failure(result))
    if circles:
        sentences.append(words.summary(circles))
    sentences.append("; ".join(remark for remark in remarks if remark))
    color = PANEL if not has_failed else PARTLY if any(circle.candidates for circle in circles) else FAILED
    return Heading(result.image, tuple(each for each in sentences if each), legend, rows, color)
