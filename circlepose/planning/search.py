"""Over many views; and backwards: how far away, or how small, a target may be for a wanted accuracy."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from circlepose.camera.camera import Camera
from circlepose.errors import UsageError
from circlepose.planning.predict import Prediction, predict
from circlepose.planning.views import USUAL, Look, View, scaled
from circlepose.targets.target import Target

PLACES = {"middle": (0.0, 0.0), "right": (0.8, 0.0), "bottom": (0.0, 0.8), "corner": (0.8, 0.8)}
"""Places in the image, from its middle as shares of half its width and height."""
_TOLERANCE = 1.01
"""Ratio to which a search goes."""
_COARSE = 1.3
"""Ratio of the first steps of a search; where only less than a step is as accurate as wanted it may be missed."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """The accuracy that is wanted: standard deviations; None leaves one free."""

    position_mm: float | None = None
    normal_deg: float | None = None

    def holds(self, prediction: Prediction) -> bool:
        """Whether a prediction is as accurate, and the target is found in all pictures."""
        pairs = ((self.position_mm, prediction.position_mm), (self.normal_deg, prediction.sigma_normal_deg))
        return prediction.found == 1.0 and all(
            most is None or (sigma is not None and sigma <= most) for most, sigma in pairs
        )


def place_px(camera: Camera, place: str) -> tuple[float, float]:
    """Return a place of `PLACES`, px. Raises `UsageError` for a camera without an image size."""
    if camera.image_size is None:
        raise UsageError("image_size: the camera must state its image size, width and height in px.")
    (width, height), (x, y) = camera.image_size, PLACES[place]
    return 0.5 * (width - 1) + 0.5 * width * x, 0.5 * (height - 1) + 0.5 * height * y


def steps(low: float, high: float, number: int, *, are_ratios: bool = False) -> tuple[float, ...]:
    """Return `number` values from `low` to `high`, in even steps or of one ratio; one where both are the same."""
    if low == high or number == 1:
        return (low,)
    shares = [i / (number - 1) for i in range(number)]
    if are_ratios:
        return tuple(low * (high / low) ** share for share in shares)
    return tuple(low + (high - low) * share for share in shares)


def farthest(
    camera: Camera, target: Target, view: View, range_mm: tuple[float, float], wanted: Wanted, look: Look = USUAL
) -> Prediction | None:
    """Return what is predicted at the farthest distance of a range at which a target is as accurate as wanted.

    None where it is not even at the nearest. The accuracy is taken to fall with the distance.
    """
    found = _last(
        lambda distance: predict(camera, target, replace(view, distance_mm=distance), look), range_mm, wanted
    )
    return None if found is None else found[1]


def smallest(
    camera: Camera, target: Target, view: View, factors: tuple[float, float], wanted: Wanted, look: Look = USUAL
) -> tuple[Target, Prediction] | None:
    """Return the smallest of the targets that are larger by a range of factors which is as accurate as wanted.

    None where not even the largest is. The accuracy is taken to grow with the size.
    """
    low, high = factors
    found = _last(
        lambda smaller: predict(camera, scaled(target, 1.0 / smaller), view, look), (1.0 / high, 1.0 / low), wanted
    )
    return None if found is None else (scaled(target, 1.0 / found[0]), found[1])


def _last(
    at: Callable[[float], Prediction], between: tuple[float, float], wanted: Wanted
) -> tuple[float, Prediction] | None:
    """Return the last value of an interval that is as accurate as wanted; None where none is.

    From its end in coarse steps, as the first values may fail, too: a target close by is not whole in the image.
    """
    high: float | None = None
    number = 1 + math.ceil(math.log(between[1] / between[0]) / math.log(_COARSE))
    for value in reversed(steps(*between, number, are_ratios=True)):
        found = at(value)
        if wanted.holds(found):
            break
        high = value
    else:
        return None
    low, best = value, found
    while high is not None and high / low > _TOLERANCE:
        middle = (low * high) ** 0.5
        found = at(middle)
        if wanted.holds(found):
            low, best = middle, found
        else:
            high = middle
    return low, best
