"""What the options on target and camera say, parsed: from texts to `TargetOverrides`."""

from __future__ import annotations

import math
from typing import Literal

from circlepose.errors import UsageError
from circlepose_cli.options.declared import PolarityChoice, SideChoice, TargetOverrides, Vector


def target_overrides(
    *,
    count: str | None,
    polarity: PolarityChoice | None,
    depth_range_mm: str | None,
    major_px: str | None,
    minor_px: str | None,
    coplanar: bool | None,
    normal: str | None,
    normal_spread_deg: float | None,
    up: str | None,
    up_spread_deg: float | None,
    facing: str | None,
    radius_sigma_mm: float | None,
    camera_sigma: str | None,
) -> TargetOverrides:
    """Return what the options of these names say, as they were typed; raises `UsageError`."""
    return TargetOverrides(
        count=parse_count(count),
        polarity=polarity,
        depth_range_mm=parse_interval("--depth-range-mm", depth_range_mm),
        major_px=parse_interval("--major-px", major_px),
        minor_px=parse_interval("--minor-px", minor_px),
        coplanar=coplanar,
        normal=parse_vector("--normal", normal),
        normal_spread_deg=normal_spread_deg,
        up=parse_vector("--up", up),
        up_spread_deg=up_spread_deg,
        facing=parse_facing(facing),
        radius_sigma_mm=radius_sigma_mm,
        camera_sigma=parse_camera_sigma(camera_sigma),
    )


def parse_vector(option: str, text: str | None) -> Vector | None:
    """Return the direction written as X,Y,Z; raises `UsageError`."""
    if text is None:
        return None
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


def parse_camera_sigma(text: str | None) -> tuple[float, float] | None:
    """Return the standard deviations written as FOCAL_PX,CENTER_PX; raises `UsageError`."""
    if text is None:
        return None
    try:
        focal, center = (float(part) for part in text.split(","))
    except ValueError:
        focal = center = math.nan
    if not (0.0 <= focal < math.inf and 0.0 <= center < math.inf):
        raise UsageError(
            "--camera-sigma: expected FOCAL_PX,CENTER_PX, standard deviations of 0 px or more, such as 0.8,0.5, "
            f"got {text!r}."
        )
    return focal, center


def parse_facing(text: str | None) -> SideChoice | Vector | None:
    """Return a side by its name, or the direction written as X,Y,Z; raises `UsageError`."""
    if text is None or "," in text:
        return parse_vector("--facing", text)
    if text in set(SideChoice):
        return SideChoice(text)
    raise UsageError(f"--facing: expected {', '.join(SideChoice)} or a direction X,Y,Z, got {text!r}.")


def parse_count(text: str | None) -> int | Literal["all"] | None:
    """Return a count of at least 1 or `all`; raises `UsageError`."""
    if text is None:
        return None
    if text == "all":
        return "all"
    if text.isdecimal() and int(text) >= 1:
        return int(text)
    raise UsageError(f"--count: expected a whole number of at least 1, or all, got {text!r}.")


def parse_interval(option: str, text: str | None) -> tuple[float, float] | None:
    """Return the interval written as LOW:HIGH; raises `UsageError`."""
    if text is None:
        return None
    try:
        low, high = (float(part) for part in text.split(":"))
    except ValueError:
        low = high = math.nan
    if not (math.isfinite(low) and math.isfinite(high) and 0.0 <= low < high):
        raise UsageError(
            f"{option}: expected two numbers LOW:HIGH with 0 <= LOW < HIGH, such as 300:1500, got {text!r}."
        )
    return low, high
