"""Target descriptions: a YAML mapping <-> `Target`."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from pathlib import Path

import yaml

from circlepose.errors import TargetError, UsageError
from circlepose.io.atomic import atomic_writer
from circlepose.io.board_file import layout_of, layout_to_mapping
from circlepose.io.length_units import check_units
from circlepose.io.marks import COMMENT
from circlepose.io.print_scale import PrintScale, print_scale_of
from circlepose.io.target_form import HintForm, TargetForm, kind_of
from circlepose.io.text.escaping import printable
from circlepose.io.text.source import Source, read_source
from circlepose.io.text.validation import parse
from circlepose.io.text.yaml import parse_yaml
from circlepose.targets import Direction, SamePlane
from circlepose.targets.board import BoardLayout
from circlepose.targets.hints import NORMAL_SPREAD_DEG, UP_SPREAD_DEG, DirectionHint
from circlepose.targets.target import AxisIntervals, Target


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
    check_units(mapping, where)
    form = parse(TargetForm, mapping, where, TargetError)
    kind = kind_of(form, where)
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


def _layout(form: TargetForm, scale: PrintScale | None, folder: Path) -> BoardLayout:
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


def _same_plane(form: TargetForm) -> SamePlane | bool:
    # YAML reads yes and no as true and false.
    given = form.coplanar if form.same_plane is None else form.same_plane
    return "auto" if given is None else given


def _generatrix(form: TargetForm, radii: tuple[float, ...]) -> float | None:
    if form.height_mm is None or len(radii) != 2:
        return form.generatrix_mm
    return math.hypot(form.height_mm, radii[0] - radii[1])


def _pair(values: list[float] | None) -> tuple[float, float] | None:
    return None if values is None else (values[0], values[1])


def _triple(values: list[float]) -> Direction:
    return values[0], values[1], values[2]


def _hint(form: HintForm | None, spread_deg: float) -> DirectionHint | None:
    if form is None:
        return None
    return DirectionHint(_triple(form.direction), spread_deg if form.spread_deg is None else form.spread_deg)
