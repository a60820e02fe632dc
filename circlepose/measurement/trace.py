"""What the stages of one estimate handed on: what `explain` reads."""

from __future__ import annotations

from dataclasses import dataclass

from circlepose._typing import Image
from circlepose.camera.camera import Camera
from circlepose.detection.contour import Contour
from circlepose.imaging.color_mixes import ColorMix
from circlepose.measurement.intensity_fit import LevelFit
from circlepose.measurement.rim import Rim
from circlepose.results import CircleResult


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """What the stages of one estimate handed on."""

    camera: Camera
    """the calibration for the size of the image"""
    channels: Image
    """the image as `to_channels` returns it"""
    levels: Image | None = None
    """(h, w) gray levels that were measured, or those of the mix of a ring target; NaN where a pixel is left out"""
    contours: tuple[Contour, ...] = ()
    """those that detection kept, most evidence first"""
    starts: tuple[Rim, ...] = ()
    """the rims before their fit to the gray levels"""
    rims: tuple[Rim, ...] = ()
    """the same rims, from which the poses follow"""
    fits: tuple[LevelFit | None, ...] = ()
    """of each rim; None where its levels were not fitted, or it was fitted as a thin ellipse"""
    mixes: tuple[ColorMix | None, ...] = ()
    """of each rim, in which it was measured; None for gray"""

    def number_of(self, circle: CircleResult) -> int | None:
        """Return the index of the rim that a result was solved from."""
        numbers = (number for number, rim in enumerate(self.rims) if rim.ellipse is circle.ellipse)
        return next(numbers, None)
