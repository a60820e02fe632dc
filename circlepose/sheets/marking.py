"""Marks that settle the roll of a board: one of its circles is made smaller."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from circlepose.boards.symmetry import symmetries
from circlepose.targets.board import BoardLayout

MARK_RATIO = 0.75
"""Radius of a mark over that of its neighbors. Small enough that its size is clear even if the sizes seen err by 7 %
(placement asks for log odds of 6.9), large enough that it is measured with its neighbors (a ratio of up to 1.5)."""


def with_roll_settled(layout: BoardLayout) -> BoardLayout:
    """Return a layout that no turn maps on itself: where one does, a circle near the middle is made a mark.

    It is the one nearest the middle that no such turn leaves in its place: there it is in view when the board is not
    seen whole. A layout with marks is returned as it is: its owner has chosen.
    """
    if not is_roll_ambiguous(layout) or len(set(layout.radius_mm.tolist())) > 1 or layout.is_ring.any():
        return layout
    middle = layout.centers_mm.mean(axis=0)
    distance = np.linalg.norm(layout.centers_mm - middle, axis=1)
    turns = symmetries(layout)[1:]
    # Equal but for rounding is equal.
    order = np.lexsort((np.arange(len(layout)), np.round(distance, 6)))
    for i in order.tolist():
        if all(turn[i] != i for turn in turns):
            mark = replace(layout.circles[i], radii_mm=(float(f"{MARK_RATIO * layout.radius_mm[i]:.6g}"),))
            return replace(layout, circles=(*layout.circles[:i], mark, *layout.circles[i + 1 :]))
    return layout


def is_roll_ambiguous(layout: BoardLayout) -> bool:
    """Whether a turn maps the layout on itself, so that no image shows which way up it is."""
    return len(symmetries(layout)) > 1
