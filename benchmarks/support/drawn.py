"""Pictures of what is found, to look at."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from circlepose._typing import Image
from circlepose.imaging.gray import to_grey
from circlepose.results import CircleResult

_ENLARGED_PX = 400
"""Shorter sides are enlarged about to this."""
_COLOR = (255, 0, 255)


def drawn(path: Path, image: Image, circles: Sequence[CircleResult]) -> None:
    """Write an image with the rims found."""
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), picture_of(image, circles))


def picture_of(
    image: Image, circles: Sequence[CircleResult], scale: int | None = None, corner: tuple[int, int] = (0, 0)
) -> Image:
    """Return BGR pixels of an image with the rims found, enlarged; `corner` is where the image begins, px."""
    shown = image[..., :3] if image.ndim == 3 and image.dtype == np.uint8 else to_grey(image)
    if shown.dtype != np.uint8:
        low, high = np.percentile(shown, [0.1, 99.9])
        shown = np.clip(255.0 * (shown - low) / max(high - low, 1e-9), 0.0, 255.0).astype(np.uint8)
    if shown.ndim == 2:
        shown = cv2.cvtColor(shown, cv2.COLOR_GRAY2BGR)
    scale = scale or max(1, round(_ENLARGED_PX / min(shown.shape[:2])))
    shown = np.ascontiguousarray(shown.repeat(scale, axis=0).repeat(scale, axis=1))
    for circle in circles:
        if circle.ellipse is None:
            continue
        center = scale * (circle.ellipse.center - corner + 0.5) - 0.5
        axes = 2.0 * scale * float(circle.ellipse.semi_major), 2.0 * scale * float(circle.ellipse.semi_minor)
        box = ((float(center[0]), float(center[1])), axes, float(np.degrees(circle.ellipse.angle)))
        cv2.ellipse(shown, box, _COLOR, 1, cv2.LINE_AA)
    return shown
