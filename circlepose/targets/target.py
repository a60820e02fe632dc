"""What is looked for: one circle, coplanar rings, coaxial rings or a board, and how large they may appear."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

from circlepose import _arguments
from circlepose.errors import TargetError
from circlepose.targets import KINDS, POLARITIES, SAME_PLANE, Direction, Kind, Polarity, SamePlane, Side, lengths
from circlepose.targets.board import BoardLayout
from circlepose.targets.hints import DirectionHint, check_hints

FLATNESS_SHARE = 2e-3
"""Default of `flatness_sigma_mm`, as a share of the largest radius: 0.1 mm for 50 mm. Paper on a foam board that bows
by 1 mm over 300 mm has its circles of radii 50 and 30 mm 0.07 mm apart in height."""

Count: TypeAlias = int | Literal["all"] | None
"""targets per image; `all`, or None, for all that are there"""
_LONGEST_PX = 1e9


@dataclass(frozen=True, slots=True)
class AxisIntervals:
    """Accepted full lengths (not halves) of an image ellipse's axes, in px; None leaves that axis free."""

    major_px: tuple[float, float] | None = None
    minor_px: tuple[float, float] | None = None

    def holds_major(self, length_px: float) -> bool:
        """Whether a major axis of `length_px` is accepted."""
        return self.major_px is None or self.major_px[0] <= length_px <= self.major_px[1]

    def holds_minor(self, length_px: float) -> bool:
        """Whether a minor axis of `length_px` is accepted."""
        return self.minor_px is None or self.minor_px[0] <= length_px <= self.minor_px[1]

    def __post_init__(self) -> None:
        for name, interval in (("major", self.major_px), ("minor", self.minor_px)):
            if interval is not None:
                _check_interval(f"axis_intervals_px.{name}", interval, "px", largest=_LONGEST_PX)


@_arguments.with_former_names(coplanar="same_plane")
@dataclass(frozen=True, slots=True)
class Target:
    """A target: its circles' radii (mm, largest first) and what is known of its looks.

    Parameters
    ----------
    kind
        `circle` (one radius), `coplanar` (two or more concentric rings in one plane), `coaxial` (two circles on one
        axis in different planes) or `board` (circles at known places of one rigid thing).
    radii_mm
        Radii, strictly decreasing; of a board those of its layout.
    generatrix_mm
        Coaxial only: rim to rim distance in the plane of symmetry, sqrt(height^2 + (R - r)^2).
    count
        Targets per image; None, or `all`, for all that are there.
    polarity
        `dark`: the disc is darker than its surroundings; `bright`: brighter; `any`.
    axis_intervals
        Accepted axes of the (largest) circle's image.
    depth_range_mm
        Nearest and farthest depth of the center: its z in the camera frame.
    same_plane
        Kind circle only: whether the circles of an image lie in one plane, which settles their candidates. `auto`:
        planes that three or more circles share are found; `yes` (or True): all lie in one plane, and get its normal;
        `no` (or False): none is looked for. Formerly `coplanar`.
    normal_hint
        Kind circle only: where the surface's normal points, roughly, in the camera frame.
    up_hint
        Kind circle only: the surface is horizontal, and this is the vertical in the camera frame, either way.
    facing
        Kind circle only: the side of the line of sight that the surface faces; a name, or a direction (3,) in the
        camera frame. Hints add up, also with `same_plane`.
    radius_sigma_mm
        Standard deviation of the (largest) radius; 0 is exact. All lengths of a target err in proportion.
    flatness_sigma_mm
        Kind coplanar only: standard deviation of the height of the other circles' plane above the largest circle's;
        0 is exactly flat. None: `FLATNESS_SHARE` of the largest radius.
    layout
        Kind board only: its circles.
    """

    kind: Kind
    radii_mm: tuple[float, ...]
    generatrix_mm: float | None = None
    count: int | None = 1
    polarity: Polarity = "any"
    axis_intervals: AxisIntervals | None = None
    depth_range_mm: tuple[float, float] | None = None
    same_plane: SamePlane | bool = "auto"
    normal_hint: DirectionHint | None = None
    up_hint: DirectionHint | None = None
    facing: Side | Direction | None = None
    radius_sigma_mm: float = 0.0
    flatness_sigma_mm: float | None = None
    layout: BoardLayout | None = None

    def __post_init__(self) -> None:
        _arguments.one_of(KINDS, "kind", self.kind, TargetError)
        _arguments.one_of(POLARITIES, "polarity", self.polarity, TargetError)
        _check_layout(self.kind, self.layout)
        object.__setattr__(self, "radii_mm", lengths.checked_radii(self.kind, self.radii_mm))
        if self.generatrix_mm is not None:
            lengths.check_generatrix(self.kind, self.radii_mm, self.generatrix_mm)
        lengths.check_sigma("radius_sigma_mm", self.radius_sigma_mm, self.radii_mm[0])
        if self.flatness_sigma_mm is not None:
            if self.kind != "coplanar":
                raise TargetError(f"flatness_sigma_mm: only a coplanar target has one, this one is {self.kind}.")
            lengths.check_sigma("flatness_sigma_mm", self.flatness_sigma_mm, self.radii_mm[0])
        count: object = self.count
        if isinstance(count, str) and count == "all":
            object.__setattr__(self, "count", None)
        elif count is not None:
            expected = "a whole number of at least 1 or 'all'"
            if _arguments.whole("count", count, expected, TargetError) < 1:
                raise TargetError(f"count: expected {expected}, got {count}.")
        same_plane = _arguments.one_of_or_truth(SAME_PLANE, "same_plane", self.same_plane, TargetError)
        object.__setattr__(self, "same_plane", same_plane)
        if same_plane == "yes" and (self.kind != "circle" or self.count == 1):
            raise TargetError(
                "same_plane: says that several circles lie in one plane, so it needs kind: circle and a count of 2 "
                "or more, or all; rings of one target are kind: coplanar."
            )
        if not isinstance(self.axis_intervals, AxisIntervals | None):
            raise TargetError(f"axis_intervals: expected AxisIntervals, got {_arguments.shown(self.axis_intervals)}.")
        if self.depth_range_mm is not None:
            if self.kind == "board":
                raise TargetError("depth_range_mm: is of lone circles and rings; a board's circles are at any depth.")
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
        count: Count = 1,
        polarity: Polarity = "any",
        axis_intervals: AxisIntervals | None = None,
        depth_range_mm: tuple[float, float] | None = None,
        same_plane: SamePlane | bool = "auto",
        normal_hint: DirectionHint | None = None,
        up_hint: DirectionHint | None = None,
        facing: Side | Direction | None = None,
        radius_sigma_mm: float = 0.0,
    ) -> Target:
        """Return the target of lone circles of `radius_mm`; the other parameters are those of `Target`."""
        return cls(
            kind="circle",
            radii_mm=(radius_mm,),
            count=_number(count),
            polarity=polarity,
            axis_intervals=axis_intervals,
            depth_range_mm=depth_range_mm,
            same_plane=same_plane,
            normal_hint=normal_hint,
            up_hint=up_hint,
            facing=facing,
            radius_sigma_mm=radius_sigma_mm,
        )

    @classmethod
    def rings(
        cls,
        radii_mm: Sequence[float],
        *,
        count: Count = 1,
        polarity: Polarity = "any",
        axis_intervals: AxisIntervals | None = None,
        depth_range_mm: tuple[float, float] | None = None,
        radius_sigma_mm: float = 0.0,
        flatness_sigma_mm: float | None = None,
    ) -> Target:
        """Return the target of concentric circles of `radii_mm`, the largest first, in one plane: kind `coplanar`.

        The other parameters are those of `Target`.
        """
        return cls(
            kind="coplanar",
            radii_mm=lengths.radii(radii_mm),
            count=_number(count),
            polarity=polarity,
            axis_intervals=axis_intervals,
            depth_range_mm=depth_range_mm,
            radius_sigma_mm=radius_sigma_mm,
            flatness_sigma_mm=flatness_sigma_mm,
        )

    @classmethod
    def coaxial(
        cls,
        radii_mm: Sequence[float],
        *,
        generatrix_mm: float | None = None,
        height_mm: float | None = None,
        count: Count = 1,
        polarity: Polarity = "any",
        axis_intervals: AxisIntervals | None = None,
        depth_range_mm: tuple[float, float] | None = None,
        radius_sigma_mm: float = 0.0,
    ) -> Target:
        """Return the target of two circles of `radii_mm`, the larger first, on one axis: kind `coaxial`.

        Parameters
        ----------
        radii_mm
            Of the two circles, in mm.
        generatrix_mm, height_mm
            Rim to rim distance in the plane of symmetry, or the distance of the two planes; one of them, or neither
            where the part's height is not known.
        count, polarity, axis_intervals, depth_range_mm, radius_sigma_mm
            As of `Target`.
        """
        radii = lengths.radii(radii_mm)
        if height_mm is not None:
            if generatrix_mm is not None:
                raise TargetError("height_mm, generatrix_mm: give one of them, not both.")
            height = _arguments.length_mm("height_mm", height_mm, "a positive height in mm", TargetError)
            generatrix_mm = math.hypot(height, radii[0] - radii[-1])
        return cls(
            kind="coaxial",
            radii_mm=radii,
            generatrix_mm=generatrix_mm,
            count=_number(count),
            polarity=polarity,
            axis_intervals=axis_intervals,
            depth_range_mm=depth_range_mm,
            radius_sigma_mm=radius_sigma_mm,
        )

    @classmethod
    def board(
        cls,
        layout: BoardLayout,
        *,
        count: Count = 1,
        polarity: Polarity = "any",
        axis_intervals: AxisIntervals | None = None,
        radius_sigma_mm: float = 0.0,
    ) -> Target:
        """Return the target of a board with this layout; the other parameters are those of `Target`."""
        _check_layout("board", layout)
        return cls(
            kind="board",
            radii_mm=layout.radii_mm,
            count=_number(count),
            polarity=polarity,
            axis_intervals=axis_intervals,
            radius_sigma_mm=radius_sigma_mm,
            layout=layout,
        )

    @property
    def coplanar(self) -> bool:
        """Former name of `same_plane`."""
        _arguments.warn_renamed("Target.coplanar", "Target.same_plane")
        return self.same_plane == "yes"

    @property
    def circle_names(self) -> tuple[str, ...]:
        """Names of the circles in the order of `radii_mm`, as in the table's `circle` column."""
        if self.kind == "circle":
            return ("disc",)
        if self.layout is not None:
            return self.layout.names
        if self.kind == "coaxial":
            return ("big", "small")
        return ("outer", "inner", *(f"ring{i}" for i in range(2, len(self.radii_mm))))

    @property
    def flatness_mm(self) -> float:
        """`flatness_sigma_mm`, or its default."""
        default = FLATNESS_SHARE * self.radii_mm[0]
        return default if self.flatness_sigma_mm is None else self.flatness_sigma_mm


def _check_layout(kind: Kind, layout: object) -> None:
    """Refuse a board without a layout, and a layout of another kind."""
    if kind != "board" and layout is not None:
        raise TargetError(f"layout: only a board has one, this target is {kind}.")
    if kind == "board" and not isinstance(layout, BoardLayout):
        raise TargetError(f"layout: a board needs a BoardLayout, got {_arguments.shown(layout)}.")


def _number(count: Count) -> int | None:
    """Return `count` as the field holds it: None for all."""
    return None if isinstance(count, str) and count == "all" else count


def _check_interval(key: str, interval: object, unit: str, largest: float) -> None:
    expected = f"[smallest, largest] in {unit} with 0 <= smallest < largest"
    low, high = _arguments.numbers(key, interval, expected, 2, TargetError)
    if not 0.0 <= low < high:
        raise TargetError(f"{key}: expected {expected}, got [{low:g}, {high:g}].")
    if high > largest:
        raise TargetError(f"{key}: expected at most {largest:g} {unit}, got [{low:g}, {high:g}].")
