"""Target descriptions: a YAML mapping <-> `Target`."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import yaml
from pydantic import Field

from circlepose._arguments import shown
from circlepose.errors import TargetError, UsageError
from circlepose.io.atomic import atomic_writer
from circlepose.io.board_file import CircleForm, GridForm, MarkForm, layout_of, layout_to_mapping
from circlepose.io.marks import COMMENT
from circlepose.io.print_scale import EXPECTED as PRINT_SCALE
from circlepose.io.print_scale import PrintScale, print_scale_of
from circlepose.io.text.escaping import printable
from circlepose.io.text.source import Source, read_source
from circlepose.io.text.validation import Strict, parse
from circlepose.io.text.yaml import parse_yaml
from circlepose.targets import KINDS, POLARITIES, SAME_PLANE, SIDES, Direction, Kind, Polarity, SamePlane, Side
from circlepose.targets.board import BoardLayout
from circlepose.targets.hints import NORMAL_SPREAD_DEG, UP_SPREAD_DEG, DirectionHint
from circlepose.targets.target import AxisIntervals, Target

_Triple = Annotated[list[float], Field(min_length=3, max_length=3)]
_DIRECTION = "a direction [x, y, z] in the camera frame (x right, y down, z forward)"
_Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
_AXIS = "[shortest, longest] full length of that axis in px"
_IN_RADIUS_MM = {
    "diameter_mm": 0.5,
    "radius_cm": 10.0,
    "diameter_cm": 5.0,
    "radius_m": 1000.0,
    "diameter_m": 500.0,
}
_UNIT_UNSAID = ("radius", "radii", "r", "diameter", "d", "size")


class _AxisIntervals(Strict):
    major: _Pair | None = Field(None, description=_AXIS)
    minor: _Pair | None = Field(None, description=_AXIS)


class _DirectionHint(Strict):
    direction: _Triple = Field(description=_DIRECTION)
    spread_deg: float | None = Field(None, description="a positive angle in degrees")


class _TargetForm(Strict):
    kind: Kind | None = Field(None, description=f"one of {', '.join(KINDS)}")
    radius_mm: float | None = Field(None, description="one number, the radius (not the diameter) in mm")
    radii_mm: list[float] | None = Field(
        None, description="a list of radii in mm, the largest first, such as [50, 30]"
    )
    generatrix_mm: float | None = Field(None, description="one number, the length from rim to rim in mm")
    height_mm: float | None = Field(None, description="one number, the distance of the two circles' planes in mm")
    count: int | Literal["all"] = Field(1, description="a whole number of at least 1, or `all`")
    polarity: Polarity = Field("any", description=f"one of {', '.join(POLARITIES)}")
    axis_intervals_px: _AxisIntervals | None = Field(None, description="a mapping with the keys major and minor")
    depth_range_mm: _Pair | None = Field(None, description="[nearest, farthest] distance in mm")
    same_plane: bool | SamePlane | None = Field(None, description=f"one of {', '.join(SAME_PLANE)}")
    coplanar: bool | None = Field(None, description="true or false; the former name of same_plane")
    normal_hint: _DirectionHint | None = Field(None, description=f"a mapping with direction: {_DIRECTION}")
    up_hint: _DirectionHint | None = Field(None, description=f"a mapping with direction: {_DIRECTION}")
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


def read_target(source: Source) -> Target:
    """Read a target description from a YAML file.

    Parameters
    ----------
    source
        A path, the bytes of a file, or an open handle.

    Returns
    -------
    The target; lengths in mm.

    Raises
    ------
    TargetError
        One sentence: the file, the key and what is expected.
    """
    return target_from_mapping(*_mapping_of(source))


def read_drawn_target(source: Source) -> tuple[Target, PrintScale | None]:
    """Read a target description as `read_target` does, but with the lengths that are drawn, before printing.

    Returns
    -------
    The target, and the `print_scale` of the file, which is not applied.

    Raises
    ------
    TargetError
        As of `read_target`.
    """
    mapping, name, folder = _mapping_of(source)
    scale = None if (given := mapping.get("print_scale")) is None else print_scale_of(given, name)
    return target_from_mapping({key: mapping[key] for key in mapping if key != "print_scale"}, name, folder), scale


def _mapping_of(source: Source) -> tuple[Mapping[str, object], str, Path]:
    """Return what a target file says, its name and its folder."""
    text, name = read_source(source, TargetError)
    folder = Path(source).parent if isinstance(source, str | os.PathLike) else Path()
    return parse_yaml(text, name, TargetError, "radius_mm: 60"), name, folder


def target_from_mapping(mapping: Mapping[str, object], where: str, folder: Path = Path()) -> Target:
    """Return the target that a mapping describes; `where` (a file, or a key in it) begins every message.

    Files that it names are sought in `folder`.

    Keys: `kind`, `radius_mm` or `radii_mm`, `generatrix_mm` or `height_mm`, `count`, `polarity`,
    `axis_intervals_px`, `depth_range_mm`, `same_plane` (or `coplanar`, its former name), `normal_hint`, `up_hint`,
    `facing`, `radius_sigma_mm`, `flatness_sigma_mm`; of a board `grid`, `marks`, `omit`, or `circles`, `side`; and
    `shape_file`; of what is printed `print_scale`. Raises `TargetError`.
    """
    _check_units(mapping, where)
    form = parse(_TargetForm, mapping, where, TargetError)
    kind = _kind(form, where)
    scale = None if form.print_scale is None else print_scale_of(form.print_scale, where)
    radii = (form.radius_mm,) if form.radius_mm is not None else tuple(form.radii_mm or ())
    axes = form.axis_intervals_px
    try:
        if scale is not None:
            scale.refuse_ellipses()
            radii = tuple(scale.mean * radius for radius in radii)
        layout = _layout(form, scale, folder) if kind == "board" else None
        return Target(
            kind=kind,
            radii_mm=radii if layout is None else layout.radii_mm,
            generatrix_mm=_generatrix(form, radii),
            count=None if form.count == "all" else form.count,
            polarity=form.polarity,
            axis_intervals=None if axes is None else AxisIntervals(_pair(axes.major), _pair(axes.minor)),
            depth_range_mm=_pair(form.depth_range_mm),
            same_plane=_same_plane(form),
            normal_hint=_hint(form.normal_hint, NORMAL_SPREAD_DEG),
            up_hint=_hint(form.up_hint, UP_SPREAD_DEG),
            facing=_triple(form.facing) if isinstance(form.facing, list) else form.facing,
            radius_sigma_mm=form.radius_sigma_mm,
            flatness_sigma_mm=form.flatness_sigma_mm,
            layout=layout,
        )
    except TargetError as error:
        reason = str(error)
        if form.coplanar is not None:
            reason = reason.replace("same_plane:", "coplanar:", 1)
        raise TargetError(f"{where}: {reason}") from None


def target_to_mapping(target: Target) -> dict[str, object]:
    """Return the mapping from which `target_from_mapping` builds an equal target."""
    mapping: dict[str, object] = {"kind": target.kind}
    if target.layout is not None:
        mapping |= layout_to_mapping(target.layout)
    elif target.kind == "circle":
        mapping["radius_mm"] = target.radii_mm[0]
    else:
        mapping["radii_mm"] = list(target.radii_mm)
    if target.generatrix_mm is not None:
        mapping["generatrix_mm"] = target.generatrix_mm
    mapping["count"] = "all" if target.count is None else target.count
    mapping["polarity"] = target.polarity
    if target.axis_intervals is not None:
        axes = {"major": target.axis_intervals.major_px, "minor": target.axis_intervals.minor_px}
        mapping["axis_intervals_px"] = {name: list(pair) for name, pair in axes.items() if pair is not None}
    if target.depth_range_mm is not None:
        mapping["depth_range_mm"] = list(target.depth_range_mm)
    if target.same_plane != "auto":
        mapping["same_plane"] = target.same_plane
    for key, hint in (("normal_hint", target.normal_hint), ("up_hint", target.up_hint)):
        if hint is not None:
            mapping[key] = {"direction": list(hint.direction), "spread_deg": hint.spread_deg}
    if target.facing is not None:
        mapping["facing"] = target.facing if isinstance(target.facing, str) else list(target.facing)
    if target.radius_sigma_mm:
        mapping["radius_sigma_mm"] = target.radius_sigma_mm
    if target.flatness_sigma_mm is not None:
        mapping["flatness_sigma_mm"] = target.flatness_sigma_mm
    return mapping


def write_target(target: Target, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write `target` as YAML that `read_target` reads back as it was; raises `OutputError`."""
    with atomic_writer(path, overwrite=overwrite) as handle:
        handle.write(f"{COMMENT}\n")
        yaml.safe_dump(target_to_mapping(target), handle, sort_keys=False, default_flow_style=None)


def find_beside(folder: Path, stem: str) -> Path | None:
    """Return `{stem}.yaml` or `{stem}.yml` in `folder` if one is there.

    Raises `UsageError` if both are, or if what is there is no file.
    """
    found = [path for path in (folder / f"{stem}.yaml", folder / f"{stem}.yml") if os.path.lexists(path)]
    if len(found) > 1:
        raise UsageError(f"{folder}: holds both {found[0].name} and {found[1].name}; remove one of them.")
    if found and not os.path.isfile(found[0]):  # noqa: PTH113
        raise UsageError(
            f"{printable(str(found[0]))}: is {_no_file(found[0])}; put the file itself there, or remove it."
        )
    return found[0] if found else None


def _no_file(path: Path) -> str:
    """Return what is there in place of a file."""
    if not os.path.exists(path):  # noqa: PTH110
        return "a link to a file that is not there"
    if os.path.isdir(path):  # noqa: PTH112
        return "a folder"
    return "a pipe or a device"


def _check_units(mapping: Mapping[str, object], where: str) -> None:
    """Refuse lengths whose name says another unit, or none, and say what to write instead."""
    for key, value in mapping.items():
        factor = _IN_RADIUS_MM.get(key.lower())
        if factor is not None and isinstance(value, int | float) and not isinstance(value, bool):
            raise TargetError(f"{where}: {key}: the file takes a radius in mm; write radius_mm: {value * factor:g}.")
        if factor is not None or key.lower() in _UNIT_UNSAID:
            raise TargetError(
                f"{where}: {key}: does not say its unit; write radius_mm (a radius, not a diameter, in mm) "
                f"or radii_mm, such as radius_mm: 60."
            )


def _kind(form: _TargetForm, where: str) -> Kind:
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


def _layout(form: _TargetForm, scale: PrintScale | None, folder: Path) -> BoardLayout:
    return layout_of(
        radius_mm=form.radius_mm,
        grid=form.grid,
        marks=form.marks or (),
        omit=form.omit or (),
        circles=form.circles,
        side=form.side,
        shape_file=form.shape_file,
        scale=scale,
        folder=folder,
    )


def _same_plane(form: _TargetForm) -> SamePlane | bool:
    # YAML reads yes and no as true and false.
    given = form.coplanar if form.same_plane is None else form.same_plane
    return "auto" if given is None else given


def _generatrix(form: _TargetForm, radii: tuple[float, ...]) -> float | None:
    if form.height_mm is None or len(radii) != 2:
        return form.generatrix_mm
    return math.hypot(form.height_mm, radii[0] - radii[1])


def _pair(values: list[float] | None) -> tuple[float, float] | None:
    return None if values is None else (values[0], values[1])


def _triple(values: list[float]) -> Direction:
    return values[0], values[1], values[2]


def _hint(form: _DirectionHint | None, spread_deg: float) -> DirectionHint | None:
    if form is None:
        return None
    return DirectionHint(_triple(form.direction), spread_deg if form.spread_deg is None else form.spread_deg)
