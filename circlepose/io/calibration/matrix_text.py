"""Text that is nothing but a matrix, as `numpy.savetxt` writes it, or a spreadsheet: what to write in its place."""

from __future__ import annotations

import re

_MOST_CHARACTERS = 3_000
_NUMBER = re.compile(r"[-+]?(?:\d{1,40}\.?\d{0,40}|\.\d{1,40})(?:[eE][-+]?\d{1,4})?")


def kind_of_matrix(text: str) -> str | None:
    """Return what to do, as the end of a sentence, with rows of numbers that are a camera matrix; None for others."""
    rows = _rows(text)
    if rows is None:
        return None
    if len(rows) == 1 and len(rows[0]) == 9:
        rows = [rows[0][:3], rows[0][3:6], rows[0][6:]]
    if len(rows) < 3 or any(len(row) not in (3, 4) for row in rows[:3]):
        return None
    upper = [[float(word) for word in row[:3]] for row in rows[:3]]
    (fx, _, _), (zero, fy, _), last = upper
    if not (fx > 0.0 and fy > 0.0 and zero == 0.0 and last == [0.0, 0.0, 1.0]):
        return None
    matrix = ", ".join(f"[{', '.join(f'{each!r}' for each in row)}]" for row in upper)
    return (
        "is text of no known form of a calibration; expected camera_matrix and dist_coeffs by name; write this "
        f"matrix as `camera_matrix: [{matrix}]`, and the distortion in the next line as `dist_coeffs: [k1, k2, p1, "
        "p2, k3]`, or [] if the images are undistorted"
    )


def _rows(text: str) -> list[list[str]] | None:
    if len(text) > _MOST_CHARACTERS:
        return None
    lines = [re.sub(r"[,;\t]", " ", line) for line in text.splitlines() if not line.lstrip().startswith("#")]
    rows = [words for line in lines if (words := line.split())]
    return rows if all(_NUMBER.fullmatch(word) for row in rows for word in row) else None
