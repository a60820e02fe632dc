"""What is looked for: one circle, coplanar rings or coaxial rings, and how large they may appear."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from circlepose.errors import TargetError
from circlepose.target_hints import Direction, DirectionHint, Side, check_hints

FLATNESS_SHARE = 2e-3
"""Default of `flatness_sigma_mm`, as a share of the largest radius: 0.1 mm for 50 mm. Paper on a foam board that bows
by 1 mm over 300 mm has its circles of radii 50 and 30 mm 0.07 mm apart in height."""

Kind = Literal["circle", "coplanar", "coaxial"]
Polarity = Literal["any", "dark", "bright"]
KINDS: tuple[Kind, ...] = ("circle", "coplanar", "coaxial")
POLARITIES: tuple[Polarity, ...] = ("any", "dark", "bright")


@dataclass(frozen=True, slots=True)
class AxisIntervals:
    """Accepted full lengths (not halves) of an image ellipse's axes, in px; None leaves that axis free."""

    major_px: tuple[float, float] | None = None
    minor_px: tuple[float, float] | None = None

    def holds_major(self, length_px: float) -> bool:
        """Tell whether a major axis of `length_px` is accepted."""
        return self.major_px is None or self.major_px[0] <= length_px <= self.major_px[1]

    def holds_minor(self, length_px: float) -> bool:
        """Tell whether a minor axis of `length_px` is accepted."""
        return self.minor_px is None or self.minor_px[0] <= length_px <= self.minor_px[1]

    def __post_init__(self) -> None:
        for name, interval in (("major", self.major_px), ("minor", self.minor_px)):
            if interval is not None:
                _check_interval(f"axis_intervals_px.{name}", interval, "px", lowest_allowed=0.0)


@dataclass(frozen=True, slots=True)
class Target:
    """A target: its circles' radii (mm, largest first) and what is known of its looks.

    Parameters
    ----------
    kind
        `circle` (one radius), `coplanar` (two or more concentric rings in one plane) or `coaxial`
        (two circles on one axis in different planes).
    radii_mm
        Radii, strictly decreasing.
    generatrix_mm
        Coaxial only: rim to rim distance in the plane of symmetry, sqrt(height^2 + (R - r)^2).
    count
        Targets per image; None for all that are there.
    polarity
        `dark`: the disc is darker than its surroundings; `bright`: brighter; `any`.
    axis_intervals
        Accepted axes of the (largest) circle's image.
    depth_range_mm
        Nearest and farthest depth of the centre: its z in the camera frame.
    coplanar
        Kind circle only: all circles found in an image lie in one plane, which tells their candidates apart.
    normal_hint
        Kind circle only: where the surface's normal points, roughly, in the camera frame.
    up_hint
        Kind circle only: the surface is horizontal, and this is the vertical in the camera frame, either way.
    facing
        Kind circle only: the side of the line of sight that the surface faces; a name, or a direction (3,) in the
        camera frame. Hints add up, also with `coplanar`.
    radius_sigma_mm
        Standard deviation of the (largest) radius; 0 is exact. All lengths of a target err in proportion.
    flatness_sigma_mm
        Kind coplanar only: standard deviation of the height of the other circles' plane above the largest circle's;
        0 is exactly flat. None: `FLATNESS_SHARE` of the largest radius.
    """

    kind: Kind
    radii_mm: tuple[float, ...]
    generatrix_mm: float | None = None
    count: int | None = 1
    polarity: Polarity = "any"
    axis_intervals: AxisIntervals | None = None
    depth_range_mm: tuple[float, float] | None = None
    coplanar: bool = False
    normal_hint: DirectionHint | None = None
    up_hint: DirectionHint | None = None
    facing: Side | Direction | None = None
    radius_sigma_mm: float = 0.0
    flatness_sigma_mm: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise TargetError(f"kind: expected one of {', '.join(KINDS)}, got {self.kind!r}.")
        if self.polarity not in POLARITIES:
            raise TargetError(f"polarity: expected one of {', '.join(POLARITIES)}, got {self.polarity!r}.")
        self._check_radii()
        self._check_generatrix()
        if not 0.0 <= self.radius_sigma_mm < self.radii_mm[0]:
            raise TargetError(
                "radius_sigma_mm: expected a standard deviation in mm, 0 or more and less than the radius of "
                f"{self.radii_mm[0]:g} mm, got {self.radius_sigma_mm:g}."
            )
        self._check_flatness()
        if self.count is not None and self.count < 1:
            raise TargetError(f"count: expected a whole number of at least 1 or 'all', got {self.count}.")
        if self.coplanar and (self.kind != "circle" or self.count == 1):
            raise TargetError(
                "coplanar: says that several circles lie in one plane, so it needs kind: circle and a count of 2 or "
                "more, or all; rings of one target are kind: coplanar."
            )
        if self.depth_range_mm is not None:
            _check_interval("depth_range_mm", self.depth_range_mm, "mm", lowest_allowed=0.0)
        for key in ("normal_hint", "up_hint", "facing"):
            if getattr(self, key) is not None and self.kind != "circle":
                raise TargetError(
                    f"{key}: is a hint for lone circles, kind: circle; this target is {self.kind}, whose circles "
                    "settle each other's ambiguity."
                )
        check_hints(self.normal_hint, self.up_hint, self.facing)

    @classmethod
    def circle(
        cls,
        radius_mm: float,
        *,
        count: int | None = 1,
        polarity: Polarity = "any",
        axis_intervals: AxisIntervals | None = None,
        depth_range_mm: tuple[float, float] | None = None,
    ) -> Target:
        """Return the target of one circle of `radius_mm`."""
        return cls(
            kind="circle",
            radii_mm=(float(radius_mm),),
            count=count,
            polarity=polarity,
            axis_intervals=axis_intervals,
            depth_range_mm=depth_range_mm,
        )

    @property
    def circle_names(self) -> tuple[str, ...]:
        """Names of the circles in the order of `radii_mm`, as in the table's `circle` column."""
        if self.kind == "circle":
            return ("disc",)
        if self.kind == "coaxial":
            return ("big", "small")
        return ("outer", "inner", *(f"ring{i}" for i in range(2, len(self.radii_mm))))

    @property
    def flatness_mm(self) -> float:
        """`flatness_sigma_mm`, or its default."""
        default = FLATNESS_SHARE * self.radii_mm[0]
        return default if self.flatness_sigma_mm is None else self.flatness_sigma_mm

    def _check_flatness(self) -> None:
        if self.flatness_sigma_mm is None:
            return
        if self.kind != "coplanar":
            raise TargetError(f"flatness_sigma_mm: only a coplanar target has one, this one is {self.kind}.")
        if not 0.0 <= self.flatness_sigma_mm < self.radii_mm[0]:
            raise TargetError(
                "flatness_sigma_mm: expected a standard deviation in mm, 0 or more and less than the largest radius "
                f"of {self.radii_mm[0]:g} mm, got {self.flatness_sigma_mm:g}."
            )

    def _check_radii(self) -> None:
        key = "radius_mm" if self.kind == "circle" else "radii_mm"
        for radius in self.radii_mm:
            if not (math.isfinite(radius) and radius > 0.0):
                raise TargetError(f"{key}: expected a positive radius in mm (not a diameter), got {radius:g}.")
        wanted = {"circle": "one radius", "coplanar": "two or more radii", "coaxial": "two radii"}[self.kind]
        number = len(self.radii_mm)
        enough = {"circle": number == 1, "coplanar": number >= 2, "coaxial": number == 2}[self.kind]
        if not enough:
            raise TargetError(f"{key}: a target of kind {self.kind} has {wanted}, got {number}.")
        if any(a <= b for a, b in zip(self.radii_mm, self.radii_mm[1:], strict=False)):
            order = ", ".join(f"{r:g}" for r in self.radii_mm)
            raise TargetError(
                f"{key}: expected the outer radius first and each next one smaller, got [{order}]; "
                "inner and outer may be swapped or equal."
            )

    def _check_generatrix(self) -> None:
        if self.generatrix_mm is None:
            return
        if self.kind != "coaxial":
            raise TargetError(f"generatrix_mm: only a coaxial target has one, this one is {self.kind}.")
        shortest = self.radii_mm[0] - self.radii_mm[1]
        if not (math.isfinite(self.generatrix_mm) and self.generatrix_mm > shortest):
            raise TargetError(
                f"generatrix_mm: must be longer than the difference of the radii ({shortest:g} mm), "
                f"got {self.generatrix_mm:g}."
            )


def _check_interval(key: str, interval: tuple[float, float], unit: str, lowest_allowed: float) -> None:
    low, high = interval
    if not (math.isfinite(low) and math.isfinite(high) and lowest_allowed <= low < high):
        raise TargetError(
            f"{key}: expected [smallest, largest] in {unit} with {lowest_allowed:g} <= smallest < largest, "
            f"got [{low:g}, {high:g}]."
        )
