"""What is looked for: one circle, coplanar rings or coaxial rings, and how large they may appear."""

from __future__ import annotations

from dataclasses import dataclass

from circlepose import _arguments
from circlepose.errors import TargetError
from circlepose.targets import KINDS, POLARITIES, Direction, Kind, Polarity, Side
from circlepose.targets.hints import DirectionHint, check_hints

FLATNESS_SHARE = 2e-3
"""Default of `flatness_sigma_mm`, as a share of the largest radius: 0.1 mm for 50 mm. Paper on a foam board that bows
by 1 mm over 300 mm has its circles of radii 50 and 30 mm 0.07 mm apart in height."""

MAX_RADII = 16
"""Rings of a target. Each is looked for at each place where one may be and fitted with all others, so that the time
grows faster than the square of their number (16 take some seconds, 50 a minute). Printed targets have 2 to 8."""

_LONGEST_PX = 1e9
_RADIUS = "a positive radius in mm (not a diameter)"


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
                _check_interval(f"axis_intervals_px.{name}", interval, "px", largest=_LONGEST_PX)


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
        Targets per image; None, or `all`, for all that are there.
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
        _arguments.one_of(KINDS, "kind", self.kind, TargetError)
        _arguments.one_of(POLARITIES, "polarity", self.polarity, TargetError)
        self._check_radii()
        self._check_generatrix()
        self._check_radius_sigma()
        self._check_flatness()
        count: object = self.count
        if isinstance(count, str) and count == "all":
            object.__setattr__(self, "count", None)
        elif count is not None:
            expected = "a whole number of at least 1 or 'all'"
            if _arguments.whole("count", count, expected, TargetError) < 1:
                raise TargetError(f"count: expected {expected}, got {count}.")
        if _arguments.truth("coplanar", self.coplanar, TargetError) and (self.kind != "circle" or self.count == 1):
            raise TargetError(
                "coplanar: says that several circles lie in one plane, so it needs kind: circle and a count of 2 or "
                "more, or all; rings of one target are kind: coplanar."
            )
        if not isinstance(self.axis_intervals, AxisIntervals | None):
            raise TargetError(f"axis_intervals: expected AxisIntervals, got {_arguments.shown(self.axis_intervals)}.")
        if self.depth_range_mm is not None:
            _check_interval("depth_range_mm", self.depth_range_mm, "mm", largest=_arguments.LENGTHS_MM[1])
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
            radii_mm=(radius_mm,),
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
        expected = f"a standard deviation in mm, 0 or more and less than the radius of {self.radii_mm[0]:g} mm"
        sigma = _arguments.number("flatness_sigma_mm", self.flatness_sigma_mm, expected, TargetError)
        if not 0.0 <= sigma < self.radii_mm[0]:
            raise TargetError(f"flatness_sigma_mm: expected {expected}, got {sigma:g}.")

    def _check_radii(self) -> None:
        key = "radius_mm" if self.kind == "circle" else "radii_mm"
        parts = _arguments.parts("radii_mm", self.radii_mm, "radii in mm, such as (50.0, 30.0)", TargetError)
        radii = tuple(_arguments.length_mm(key, radius, _RADIUS, TargetError) for radius in parts)
        object.__setattr__(self, "radii_mm", radii)
        wanted = {"circle": "one radius", "coplanar": "two or more radii", "coaxial": "two radii"}[self.kind]
        number = len(self.radii_mm)
        enough = {"circle": number == 1, "coplanar": number >= 2, "coaxial": number == 2}[self.kind]
        if not enough:
            raise TargetError(f"{key}: a target of kind {self.kind} has {wanted}, got {number}.")
        if number > MAX_RADII:
            raise TargetError(
                f"{key}: a target has at most {MAX_RADII} radii, got {number}; leave out the least visible ones."
            )
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
        length = _arguments.length_mm("generatrix_mm", self.generatrix_mm, "a positive length in mm", TargetError)
        if length <= shortest:
            raise TargetError(
                f"generatrix_mm: must be longer than the difference of the radii ({shortest:g} mm), "
                f"got {self.generatrix_mm:g}."
            )

    def _check_radius_sigma(self) -> None:
        expected = f"a standard deviation in mm, 0 or more and less than the radius of {self.radii_mm[0]:g} mm"
        sigma = _arguments.number("radius_sigma_mm", self.radius_sigma_mm, expected, TargetError)
        if not 0.0 <= sigma < self.radii_mm[0]:
            raise TargetError(f"radius_sigma_mm: expected {expected}, got {sigma:g}.")


def _check_interval(key: str, interval: object, unit: str, largest: float) -> None:
    expected = f"[smallest, largest] in {unit} with 0 <= smallest < largest"
    low, high = _arguments.numbers(key, interval, expected, 2, TargetError)
    if not 0.0 <= low < high:
        raise TargetError(f"{key}: expected {expected}, got [{low:g}, {high:g}].")
    if high > largest:
        raise TargetError(f"{key}: expected at most {largest:g} {unit}, got [{low:g}, {high:g}].")
