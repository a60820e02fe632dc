"""A picture of what extraction finds in an image, and of what it rejects."""

from __future__ import annotations

from collections import Counter
from string import ascii_lowercase

import numpy as np

from circlepose._typing import Image
from circlepose.diagnostics.inspection import Inspection
from circlepose.drawing.canvas import Pen
from circlepose.drawing.display import boxes_around, displayed, enlarged
from circlepose.drawing.heading import Heading, LegendItem
from circlepose.drawing.labels import Label, Room, draw_labels, plan_labels
from circlepose.drawing.style import CHOSEN, REJECTED, unit_of
from circlepose.drawing.words import counted
from circlepose.errors import ArgumentError

_SIZES = (0.5, 0.42, 0.5, 0.42, 0.35, 0.29, 0.24)
"""Text: number and score, then the number alone."""
_WITH_SCORE = 2
_RIM_POINTS = 360


def draw_inspection(image: Image, inspection: Inspection, name: str = "") -> Image:
    """Draw the contours that were kept in green, numbered as in the report, and those rejected in red.

    Parameters
    ----------
    image
        The one that was inspected.
    inspection
        What `inspect` returned for it.
    name
        Title of the picture.

    Returns
    -------
    The picture (height, width, 3), BGR uint8, with the image at its bottom left, enlarged where it is small.

    Raises
    ------
    ArgumentError
        When `image` has another size than the one that was inspected.
    """
    found = inspection.extraction
    shown, remark = displayed(image, boxes_around(contour.ellipse for contour in found.contours))
    size = (shown.shape[1], shown.shape[0])
    if size != inspection.image_size:
        width, height = inspection.image_size
        raise ArgumentError(
            f"image: expected the one that was inspected, of {width} x {height} px, got {size[0]} x {size[1]}."
        )
    axes = [2.0 * float(contour.ellipse.semi_minor) for contour in found.contours]
    canvas, enlargement = enlarged(shown, float(np.median(axes)) if axes else np.inf)
    unit = unit_of(canvas)
    pen, room = Pen(canvas, enlargement, unit), Room.of(canvas, unit)
    refused_rims = found.refused.points(_RIM_POINTS).reshape(-1, _RIM_POINTS, 2)
    for rim in refused_rims:
        pen.hairline(rim, REJECTED, closed=True)
    labels = []
    for number, contour in enumerate(found.contours):
        rim = contour.ellipse.points(_RIM_POINTS)
        pen.hairline(rim, CHOSEN, closed=True)
        room.keep_disc(pen.at(rim))
        full, short = (f"{number}: {contour.score:.2f}",), (str(number),)
        texts = (full,) * _WITH_SCORE + (short,) * (len(_SIZES) - _WITH_SCORE)
        labels.append(Label(texts, CHOSEN, pen.at(rim)))
    sizes = [each * unit for each in _SIZES]
    plan = plan_labels(canvas, room, labels, sizes)
    draw_labels(canvas, plan)
    room.keep_labels(plan)
    reasons = Counter(str(reason) for reason in found.refused_why)
    letters = dict(zip([reason for reason, _ in reasons.most_common()], ascii_lowercase, strict=False))
    # In the room that the numbers leave.
    why = [
        Label(((letters[str(reason)],),) * len(_SIZES), REJECTED, pen.at(rim))
        for reason, rim in zip(found.refused_why, refused_rims, strict=True)
    ]
    draw_labels(canvas, plan_labels(canvas, room, why, sizes))
    many, refused = counted(len(found.contours), "circle"), counted(len(found.refused_why), "contour")
    sentences = [f"{many} found, {refused} rejected after a close look"]
    if reasons:
        named = [f"{letters[reason]}: {many} {reason}" for reason, many in reasons.most_common()]
        sentences.append("rejected: " + "; ".join(named))
    left_out = f"{plan.left_out} of {len(labels)} labels have no room" if plan.left_out else ""
    sentences.append("; ".join(part for part in (remark, left_out) if part))
    label = "number and score" if plan.level < _WITH_SCORE else "number"
    legend = [LegendItem("line", CHOSEN, f"found, with its {label} as in the report")] if labels else []
    if len(found.refused_why):
        legend.append(LegendItem("line", REJECTED, "rejected"))
    heading = Heading(name, tuple(each for each in sentences if each), tuple(legend))
    return np.concatenate([heading.drawn(canvas.shape[1], unit), canvas])
