"""A sound calibration of each form: the examples of docs/calibrations, and the binary ones."""

from __future__ import annotations

import io
import re
import struct
from pathlib import Path

import numpy as np

_PAGES = Path(__file__).resolve().parents[3] / "docs" / "calibrations"
# Of a page the first example in one of these languages is a whole file.
_EXAMPLE = re.compile(r"^```(?:yaml|json|text|xml|ini|matlab)\n(.*?)^```", re.M | re.S)


def text_calibrations() -> dict[str, bytes]:
    """Return a text file of each form that its page shows, by the page's name."""
    found: dict[str, bytes] = {}
    for page in sorted(_PAGES.glob("*.md")):
        example = _EXAMPLE.search(page.read_text("utf-8"))
        if example is not None:
            found[page.stem] = example[1].encode()
    return found


def binary_calibrations() -> dict[str, bytes]:
    """Return a binary file of each form that has one."""
    matrix = np.array([[600.0, 0.0, 319.5], [0.0, 600.0, 239.5], [0.0, 0.0, 1.0]])
    arrays = {"mtx": matrix, "dist": np.array([[-0.2, 0.1, 0.0, 0.0, 0.0]]), "image_size": np.array([640, 480])}
    plain, packed = io.BytesIO(), io.BytesIO()
    np.savez(plain, allow_pickle=False, **arrays)
    np.savez_compressed(packed, allow_pickle=False, **arrays)
    cameras = struct.pack("<QiiQQ8d", 1, 1, 4, 640, 480, 600.0, 600.0, 320.0, 240.0, -0.2, 0.1, 0.0, 0.0)
    return {
        "npz": plain.getvalue(),
        "npz packed": packed.getvalue(),
        "colmap binary": cameras,
    }
