"""Texts of options read to the values that they stand for. Each reader gets the option's name, for its message."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import typer

from circlepose.errors import UsageError
from circlepose.targets import SIDES, Direction, Side

if TYPE_CHECKING:
    from circlepose.results import ImageResult

PLACES = ("middle", "right", "bottom", "corner")
"""of the target in the image, as `circlepose plan` has them"""
Interval: TypeAlias = tuple[float, float]
_OPTIONS = {"set scale_calibration": "give --scale-calib", "set force_calibration": "give --force-calib"}


def with_options_named(result: ImageResult) -> ImageResult:
    """Return `result` with options in its reason in place of parameters of the library."""
    reason = result.reason
    for parameter, option in _OPTIONS.items():
        reason = reason.replace(parameter, option)
    return result if reason == result.reason else replace(result, reason=reason)


def number_of_mm(text: str) -> float:
    """Return the number of mm. Raises `BadParameter`, to which Typer adds the name of the option."""
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"expected a number of mm without its unit, such as 60, got {text!r}.") from None


def positive_seconds(option: str, seconds: float) -> float:
    """Return a positive time in s; raises `UsageError`."""
    if not 0.0 < seconds < math.inf:
        raise UsageError(f"{option}: expected a positive time in seconds, got {seconds:g}.")
    return seconds


def positive_px(option: str, length_px: float) -> float:
    """Return a positive length in px; raises `UsageError`."""
    if not 0.0 < length_px < math.inf:
        raise UsageError(f"{option}: expected a positive number of px, such as 0.3, got {length_px:g}.")
    return length_px


def score(option: str, value: float) -> float:
    """Return a score from 0 to 1; raises `UsageError`."""
    if not 0.0 <= value <= 1.0:
        raise UsageError(f"{option}: expected a score from 0 to 1, such as 0.2, got {value:g}.")
    return value


def direction(option: str, text: str) -> Direction:
    """Return the direction written as X,Y,Z; raises `UsageError`."""
    try:
        x, y, z = (float(part) for part in text.split(","))
    except ValueError:
        x = y = z = math.nan
    length = math.hypot(x, y, z)
    if not (math.isfinite(length) and length > 0.0):
        raise UsageError(
            f"{option}: expected a direction X,Y,Z in the camera frame, not all 0, such as 0,-0.5,-1, got {text!r}."
        )
    return x, y, z


def camera_sigma(option: str, text: str) -> tuple[float, float]:
    """Return the standard deviations written as FOCAL_PX,CENTER_PX; raises `UsageError`."""
    try:
        focal, center = (float(part) for part in text.split(","))
    except ValueError:
        focal = center = math.nan
    if not (0.0 <= focal < math.inf and 0.0 <= center < math.inf):
        raise UsageError(
            f"{option}: expected FOCAL_PX,CENTER_PX, standard deviations of 0 px or more, such as 0.8,0.5, "
            f"got {text!r}."
        )
    return focal, center


def facing(option: str, text: str) -> Side | Direction:
    """Return a side by its name, or the direction written as X,Y,Z; raises `UsageError`."""
    if "," in text:
        return direction(option, text)
    for side in SIDES:
        if text == side:
            return side
    raise UsageError(f"{option}: expected {', '.join(SIDES)} or a direction X,Y,Z, got {text!r}.")


def count(option: str, text: str) -> int | Literal["all"]:
    """Return a count of at least 1 or `all`; raises `UsageError`."""
    if text == "all":
        return "all"
    if text.isdecimal() and int(text) >= 1:
        return int(text)
    raise UsageError(f"{option}: expected a whole number of at least 1, or all, got {text!r}.")


def span(option: str, text: str) -> Interval:
    """Return the interval written as LOW:HIGH, or one number twice; raises `UsageError`."""
    try:
        ends = [float(part) for part in text.split(":")]
    except ValueError:
        ends = []
    low, high = (ends * 2 if len(ends) == 1 else ends) if len(ends) in (1, 2) else (math.nan, math.nan)
    if not (0.0 <= low <= high < math.inf):
        raise UsageError(
            f"{option}: expected a number or two, LOW:HIGH with 0 <= LOW <= HIGH, such as 20:60, got {text!r}."
        )
    return low, high


def positive(option: str, value: float) -> float:
    """Return a positive number; raises `UsageError`."""
    if not 0.0 < value < math.inf:
        raise UsageError(f"{option}: expected a positive number, such as 0.1, got {value:g}.")
    return value


def size_px(option: str, text: str) -> tuple[int, int]:
    """Return the width and height written as WxH; raises `UsageError`."""
    width, _, height = text.lower().partition("x")
    if not (width.isdecimal() and height.isdecimal() and int(width) > 0 and int(height) > 0):
        raise UsageError(f"{option}: expected WIDTHxHEIGHT in px, such as 1280x960, got {text!r}.")
    return int(width), int(height)


def places(option: str, text: str) -> tuple[str, ...]:
    """Return the names of places in the image; raises `UsageError`."""
    names = tuple(dict.fromkeys(part.strip() for part in text.split(",")))
    if not set(names) <= set(PLACES):
        raise UsageError(f"{option}: expected some of {', '.join(PLACES)}, such as middle,corner, got {text!r}.")
    return names


def interval(option: str, text: str) -> Interval:
    """Return the interval written as LOW:HIGH; raises `UsageError`."""
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        low = high = math.nan
    if not (math.isfinite(low) and math.isfinite(high) and 0.0 <= low < high):
        raise UsageError(
            f"{option}: expected two numbers LOW:HIGH with 0 <= LOW < HIGH, such as 300:1500, got {text!r}."
        )
    return low, high
