"""The small print of a sheet, and the comments of the target file beside it."""

from __future__ import annotations

import numpy as np

from circlepose._version import __version__
from circlepose.sheets.letters import plain_letters
from circlepose.targets.board import BoardLayout
from circlepose.targets.target import Target

_STRAIGHT = 1e-6


def described(target: Target, copies: int) -> str:
    """Return in words what a target is, such as `disc of radius 60 mm`."""
    layout = target.layout
    if layout is None:
        radii = ", ".join(f"{radius:g}" for radius in target.radii_mm)
        noun = "disc" if target.kind == "circle" else "ring"
        several = f"{copies} {noun}s" if copies > 1 else noun
        return f"{several} of {'radius' if len(target.radii_mm) == 1 else 'radii'} {radii} mm"
    grid, sizes = layout.grid, layout.radius_mm
    if grid is None:
        low, high = sizes.min(), sizes.max()
        words = f"radius {low:g} mm" if low == high else f"radii from {low:g} to {high:g} mm"
        return f"board of {len(layout)} circles of {words}"
    radius = f"radius {layout.usual_radius_mm:g} mm"
    return (
        f"board of {grid.rows} x {grid.columns} circles of {radius}, {grid.pattern}, spacing {grid.spacing_mm:g} mm"
    )


def small_print(
    name: str, target: Target, copies: int, *, is_dark_on_light: bool, target_file: str, scale: tuple[float, float]
) -> tuple[str, ...]:
    """Return the sentences of a sheet.

    Parameters
    ----------
    name
        Of the file that was printed.
    target
        As it is drawn.
    copies
        Discs or rings on the sheet.
    is_dark_on_light
        Whether the circles are of ink.
    target_file
        The name of the target file beside the sheet.
    scale
        By which lengths in x and y are drawn.
    """
    ink = "dark on light" if is_dark_on_light else "light on dark"
    sentences = [
        f"{name}: {described(target, copies)}, {ink}.",
        "Print at 100 % (actual size, no fitting to the page), then measure both bars with a ruler.",
        f"Where they are not as long as stated, write measured / stated into {target_file}, such as "
        "print_scale: {x: 1.0021, y: 1.0015}.",
    ]
    if target.layout is not None and (frame := frame_words(target.layout)):
        sentences.append(frame)
    if scale != (1.0, 1.0):
        x, y = (f"{1.0 / each:.6g}" for each in scale)
        sentences.append(f"Drawn for a printer that makes x {x} and y {y} times as long.")
    sentences.append(f"circlepose {__version__}")
    return tuple(map(plain_letters, sentences))


def frame_words(layout: BoardLayout) -> str:
    """Return how the board's x and y lie on its sheet; empty where they do not lie along its sides."""
    seen = layout.seen_from_behind if layout.side == "back" else layout
    right, down = seen.front_axes
    if abs(abs(right[0]) - 1.0) > _STRAIGHT or abs(abs(down[1]) - 1.0) > _STRAIGHT:
        return ""
    origin = np.flatnonzero(np.linalg.norm(layout.centers_mm, axis=1) < _STRAIGHT)
    where = f", origin in circle {layout.names[int(origin[0])]}" if len(origin) else ""
    return f"Frame of the board: x to the right, y {'down' if down[1] > 0.0 else 'up'}{where}."


def names_words(target: Target, unmarked: BoardLayout | None) -> list[str]:
    """Return the names of the circles of a target, and which of them are marks, in lines."""
    layout = target.layout
    if layout is None:
        names = ", ".join(
            f"{name} of radius {radius:g} mm"
            for name, radius in zip(target.circle_names, target.radii_mm, strict=True)
        )
        return [f"Circles: {names}."]
    lines = [f"Circles: {layout.names[0]} to {layout.names[-1]}."]
    if layout.grid is not None:
        lines = [f"Circles: {layout.names[0]} to {layout.names[-1]}; r1c2 is row 1, column 2, counted from 0."]
    usual = layout.usual_radius_mm
    marks = [
        (circle.name, circle.radii_mm)
        for circle, before in zip(layout.circles, (unmarked or layout).circles, strict=True)
        if circle.radii_mm != before.radii_mm
    ]
    lines += [
        f"{name} is a mark of radius {radii[0]:g} mm instead of {usual:g} mm: it settles the roll."
        for name, radii in marks
    ]
    return lines
