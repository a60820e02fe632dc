"""The part of a target file that describes a board: a grid, or a list of circles, and its measured shape."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from circlepose._arguments import shown
from circlepose.errors import TargetError
from circlepose.io.circle_list import read_circle_list
from circlepose.io.print_scale import PrintScale, printed_layout
from circlepose.io.text.source import read_source
from circlepose.io.text.validation import Strict, parse
from circlepose.targets.board import PATTERNS, BoardCircle, BoardLayout, Grid, Pattern, Place

_AT = Annotated[list[int], Field(min_length=2, max_length=2)]
_TRIPLE = Annotated[list[float], Field(min_length=3, max_length=3)]
_RADII = "a list of radii in mm, the largest first, such as [35, 20]"
_LEAST_NORMAL = 1e-6


class GridForm(Strict):
    """`grid:` of a board."""

    pattern: Pattern = Field(description=f"one of {', '.join(PATTERNS)}")
    rows: int = Field(description="a whole number of at least 1")
    columns: int = Field(description="a whole number of at least 1")
    spacing_mm: float = Field(description="one number, the distance between neighbors of a row in mm")


class MarkForm(Strict):
    """One of `marks:`."""

    at: _AT = Field(description="[row, column] of the circle, counted from 0")
    radius_mm: float | None = Field(None, description="one number, its radius in mm")
    radii_mm: list[float] | None = Field(None, description=_RADII)


class CircleForm(Strict):
    """One of `circles:`."""

    name: str | None = Field(None, description="a name of its own")
    x_mm: float = Field(description="one number, in mm")
    y_mm: float = Field(description="one number, in mm")
    z_mm: float = Field(0.0, description="one number, in mm")
    radius_mm: float | None = Field(None, description="one number, its radius in mm")
    radii_mm: list[float] | None = Field(None, description=_RADII)
    normal: _TRIPLE | None = Field(None, description="a direction [x, y, z], to the side from which it is seen")


class _Offset(Strict):
    name: str = Field(description="the name of a circle")
    x: float = Field(description="one number, in mm")
    y: float = Field(description="one number, in mm")
    z: float = Field(description="one number, in mm")


def layout_of(
    *,
    radius_mm: float | None,
    grid: GridForm | None,
    marks: Sequence[MarkForm],
    omit: Sequence[Sequence[int]],
    circles: Sequence[CircleForm] | str | None,
    side: Literal["auto", "front", "back"],
    shape_file: str | None,
    scale: PrintScale | None = None,
    folder: Path,
) -> BoardLayout:
    """Return the layout that a target file describes, printed at `scale`; files that it names are sought in `folder`.

    Raises `TargetError`, without the name of the target file in front.
    """
    if grid is None and circles is None:
        raise TargetError(
            "grid, circles: both are missing; a board needs one of them: a grid, or a list of its circles."
        )
    if grid is not None and circles is not None:
        raise TargetError(
            "grid, circles: both are given; a board has either a grid or a list of its circles: remove one."
        )
    if grid is not None:
        if radius_mm is None:
            raise TargetError("radius_mm: is missing; the circles of a grid need their radius in mm.")
        if side != "auto":
            raise TargetError("side: is of a list of circles; a grid is seen from its front.")
        lattice = Grid(grid.pattern, grid.rows, grid.columns, grid.spacing_mm)
        marked = {(mark.at[0], mark.at[1]): _radii_of(mark, None, "marks") for mark in marks}
        layout = BoardLayout.on_grid(radius_mm, lattice, marked, [(at[0], at[1]) for at in omit])
    else:
        if marks or omit:
            raise TargetError("marks, omit: go with a grid; a list has each circle as it is.")
        assert circles is not None
        forms = _read_forms(folder / circles) if isinstance(circles, str) else circles
        layout = BoardLayout(tuple(_circle(each, i, radius_mm) for i, each in enumerate(forms)), side=side)
    if scale is None:
        return layout if shape_file is None else shaped(layout, folder / shape_file)
    if shape_file is not None:
        raise TargetError("print_scale, shape_file: give one of them; the shape was measured on what was printed.")
    return printed_layout(layout, scale)


def shaped(layout: BoardLayout, path: Path) -> BoardLayout:
    """Return a layout with the shape that a calibration has found of its board.

    Raises `TargetError` where the file is none of `circlepose.calibration/1`, or of another board.
    """
    text, name = read_source(path, TargetError)
    try:
        found = json.loads(text)
    except ValueError as error:
        raise TargetError(f"{name}: is no JSON ({error}); expected what `calibrate --json` wrote.") from None
    schema = found.get("schema") if isinstance(found, dict) else None
    board = found.get("board") if isinstance(found, dict) else None
    if not isinstance(schema, str) or not schema.startswith("circlepose.calibration/") or not isinstance(board, dict):
        raise TargetError(f"{name}: expected the JSON that `calibrate --json` wrote, with its key board.")
    offsets = [parse(_Offset, each, f"{name}: board.offsets_mm", TargetError) for each in board.get("offsets_mm", [])]
    unknown = sorted({each.name for each in offsets} - set(layout.names))
    if unknown:
        raise TargetError(
            f"{name}: board.offsets_mm: the layout has no circle {unknown[0]!r}; is it another board's?"
        )
    scale = float(board.get("radius_scale", 1.0))
    by_name = {each.name: np.array([each.x, each.y, each.z]) for each in offsets}
    circles = []
    for circle in layout.circles:
        x, y, z = np.array(circle.center_mm) + by_name.get(circle.name, np.zeros(3))
        radii = tuple(scale * radius for radius in circle.radii_mm)
        circles.append(replace(circle, center_mm=(float(x), float(y), float(z)), radii_mm=radii))
    return replace(layout, circles=tuple(circles))


def layout_to_mapping(layout: BoardLayout) -> dict[str, object]:
    """Return the keys of a target file that describe a layout."""
    plain = layout.grid is not None and layout == BoardLayout.on_grid(
        layout.usual_radius_mm, layout.grid, *_marks_and_omitted(layout)
    )
    if plain:
        assert layout.grid is not None
        grid = layout.grid
        marks, omitted = _marks_and_omitted(layout)
        mapping: dict[str, object] = {
            "radius_mm": layout.usual_radius_mm,
            "grid": {
                "pattern": grid.pattern,
                "rows": grid.rows,
                "columns": grid.columns,
                "spacing_mm": grid.spacing_mm,
            },
        }
        if marks:
            mapping["marks"] = [{"at": list(at), "radii_mm": list(radii)} for at, radii in marks.items()]
        if omitted:
            mapping["omit"] = [list(at) for at in omitted]
        return mapping
    circles = [
        {
            "name": circle.name,
            **dict(zip(("x_mm", "y_mm", "z_mm"), circle.center_mm, strict=True)),
            "radii_mm": list(circle.radii_mm),
            "normal": list(circle.normal),
        }
        for circle in layout.circles
    ]
    return {"circles": circles, "side": layout.side}


def _marks_and_omitted(
    layout: BoardLayout,
) -> tuple[dict[tuple[int, int], tuple[float, ...]], list[tuple[int, int]]]:
    assert layout.grid is not None
    own = {layout.circles[i].name: layout.circles[i].radii_mm for i in range(len(layout))}
    places = [(row, column) for row in range(layout.grid.rows) for column in range(layout.grid.columns)]
    usual = (layout.usual_radius_mm,)
    marks = {at: own[f"r{at[0]}c{at[1]}"] for at in places if own.get(f"r{at[0]}c{at[1]}", usual) != usual}
    return marks, [at for at in places if f"r{at[0]}c{at[1]}" not in own]


def _circle(form: CircleForm, number: int, radius_mm: float | None) -> BoardCircle:
    radii = _radii_of(form, radius_mm, f"circles[{number}]")
    normal: Place = (0.0, 0.0, -1.0)
    if form.normal is not None:
        direction = np.array(form.normal)
        length = float(np.linalg.norm(direction))
        if length < _LEAST_NORMAL:
            raise TargetError(f"circles[{number}].normal: expected a direction, got {shown(form.normal)}.")
        x, y, z = direction / length
        normal = float(x), float(y), float(z)
    return BoardCircle(form.name or f"c{number}", (form.x_mm, form.y_mm, form.z_mm), radii, normal)


def _radii_of(form: MarkForm | CircleForm, usual_mm: float | None, key: str) -> tuple[float, ...]:
    if form.radius_mm is not None and form.radii_mm is not None:
        raise TargetError(f"{key}: radius_mm, radii_mm: give one of them, not both.")
    own = usual_mm if form.radius_mm is None else form.radius_mm
    radii = form.radii_mm if form.radii_mm is not None else [own]
    if not radii or radii[0] is None:
        raise TargetError(f"{key}: radius_mm: is missing; each circle needs its radius in mm.")
    lengths = tuple(float(radius) for radius in radii if radius is not None)
    if min(lengths) <= 0.0:
        raise TargetError(f"{key}: radius_mm: expected a positive radius in mm, got {shown(list(lengths))}.")
    return lengths


def _read_forms(path: Path) -> list[CircleForm]:
    return [parse(CircleForm, entries, where, TargetError) for where, entries in read_circle_list(path)]
