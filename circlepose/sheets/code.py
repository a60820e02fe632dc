"""The QR code of a sheet. Needs segno, which comes with the extra `print`."""

from __future__ import annotations

from importlib.util import find_spec
from itertools import groupby

from circlepose.sheets.shapes import Box

MODULE_MM = 0.5
"""Side of a module: six dots of a printer of 300 dpi."""
QUIET = 4
"""modules of bright margin, as the standard asks for"""
MOST_BYTES = 412
"""what version 15 holds with error correction M; it is 43 mm wide with its margin, and phones still read it"""


def has_segno() -> bool:
    """Whether a code can be made."""
    return find_spec("segno") is not None


def code_of(text: str) -> tuple[float, tuple[Box, ...]]:
    """Return the side, mm, of the code of `text` with its margin, and its dark parts in there."""
    import segno  # noqa: PLC0415 - an extra

    rows = segno.make_qr(text.encode(), error="m", mode="byte", boost_error=False).matrix
    boxes = []
    for y, row in enumerate(rows):
        x = 0
        for is_dark, run in groupby(row):
            number = len(list(run))
            if is_dark:
                left, top = (MODULE_MM * (QUIET + each) for each in (x, y))
                boxes.append(Box(left, top, MODULE_MM * number, MODULE_MM))
            x += number
    return MODULE_MM * (len(rows) + 2 * QUIET), tuple(boxes)
