"""The keys of a target file: what each is, and which go together."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from circlepose._arguments import shown
from circlepose.errors import TargetError
from circlepose.io.board_file import CircleForm, GridForm, MarkForm
from circlepose.io.print_scale import EXPECTED as PRINT_SCALE
from circlepose.io.text.validation import Strict
from circlepose.targets import KINDS, POLARITIES, SAME_PLANE, SIDES, Kind, Polarity, SamePlane, Side

_Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
_DIRECTION = "a direction [x, y, z] in the camera frame (x right, y down, z forward)"
_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
_AXIS = "[shortest, longest] full length of that axis in px"


class AxisIntervalsForm(Strict):
    """`axis_intervals_px:` of a target."""

    major: _Pair | None = Field(None, description=_AXIS)
    minor: _Pair | None = Field(None, description=_AXIS)


class HintForm(Strict):
    """`normal_hint:` or `up_hint:` of a target."""

    direction: _Triple = Field(description=_DIRECTION)
    spread_deg: float | None = Field(None, description="a positive angle in degrees")


class TargetForm(Strict):
    """A target file."""

    kind: Kind | None = Field(None, description=f"one of {', '.join(KINDS)}")
    radius_mm: float | None = Field(None, description="one number, the radius (not the diameter) in mm")
    radii_mm: list[float] | None = Field(
        None, description="a list of radii in mm, the largest first, such as [50, 30]"
    )
    generatrix_mm: float | None = Field(None, description="one number, the length from rim to rim in mm")
    height_mm: float | None = Field(None, description="one number, the distance of the two circles' planes in mm")
    count: int | Literal["all"] = Field(1, description="a whole number of at least 1, or `all`")
    polarity: Polarity = Field("any", description=f"one of {', '.join(POLARITIES)}")
    axis_intervals_px: AxisIntervalsForm | None = Field(None, description="a mapping with the keys major and minor")
    depth_range_mm: _Pair | None = Field(None, description="[nearest, farthest] distance in mm")
    same_plane: bool | SamePlane | None = Field(None, description=f"one of {', '.join(SAME_PLANE)}")
    coplanar: bool | None = Field(None, description="true or false; the former name of same_plane")
    normal_hint: HintForm | None = Field(None, description=f"a mapping with direction: {_DIRECTION}")
    up_hint: HintForm | None = Field(None, description=f"a mapping with direction: {_DIRECTION}")
    facing: Side | _Triple | None = Field(None, description=f"{', '.join(SIDES)}, or {_DIRECTION}")
    radius_sigma_mm: float = Field(0.0, description="one number, the standard deviation of the radius in mm")
    flatness_sigma_mm: float | None = Field(
        None, description="one number, the standard deviation in mm of the height between the circles' planes"
    )
    grid: GridForm | None = Field(None, description="a mapping with pattern, rows, columns and spacing_mm")
    marks: list[MarkForm] | None = Field(None, description="a list such as [{at: [0, 3], radius_mm: 17.5}]")
    omit: list[Annotated[list[int], Field(min_length=2, max_length=2)]] | None = Field(
        None, description="a list of [row, column] such as [[2, 3]]"
    )
    circles: list[CircleForm] | str | None = Field(
        None, description="a list such as [{x_mm: 0, y_mm: 0, radius_mm: 10}], or the name of a CSV file"
    )
    shape_file: str | None = Field(None, description="the name of a JSON file that calibrate wrote")
    side: Literal["auto", "front", "back"] = Field("auto", description="one of auto, front, back")
    print_scale: float | dict[str, object] | None = Field(None, description=PRINT_SCALE)


def kind_of(form: TargetForm, where: str) -> Kind:
    """Return the kind of a target; refuse keys that do not go with it, or with each other."""
    if form.radius_mm is not None and form.radii_mm is not None:
        raise TargetError(f"{where}: radius_mm, radii_mm: give one of them, not both.")
    if form.generatrix_mm is not None and form.height_mm is not None:
        raise TargetError(f"{where}: generatrix_mm, height_mm: give one of them, not both.")
    if form.same_plane is not None and form.coplanar is not None:
        raise TargetError(f"{where}: same_plane, coplanar: are two names of one key; give same_plane alone.")
    is_board = form.grid is not None or form.circles is not None
    kind = form.kind or ("board" if is_board else "circle" if form.radii_mm is None else None)
    if kind is None:
        raise TargetError(f"{where}: kind: is missing; radii_mm goes with kind: coplanar or kind: coaxial.")
    if kind == "coaxial" and form.print_scale is not None:
        raise TargetError(f"{where}: print_scale: is of a sheet, and a coaxial target is none; state its lengths.")
    if kind == "board":
        if form.radii_mm is not None:
            raise TargetError(f"{where}: radii_mm: a board has radius_mm, and radii_mm in its marks or circles.")
        return kind
    of_boards = ("grid", "marks", "omit", "circles", "shape_file")
    wrong = [key for key in of_boards if getattr(form, key) is not None]
    if wrong:
        raise TargetError(f"{where}: {wrong[0]}: goes with kind: board, this target is of kind {kind}.")
    if kind == "circle" and form.radius_mm is None:
        raise TargetError(f"{where}: radius_mm: is missing; a circle needs its radius in mm, such as radius_mm: 60.")
    if kind != "circle" and form.radii_mm is None:
        raise TargetError(
            f"{where}: radii_mm: is missing; a {kind} target needs its radii in mm, such as radii_mm: [50, 30]."
        )
    if form.height_mm is not None and not (kind == "coaxial" and form.height_mm > 0.0):
        raise TargetError(
            f"{where}: height_mm: expected a positive height in mm of a coaxial target, "
            f"got {shown(form.height_mm)} for kind {kind}."
        )
    return kind
