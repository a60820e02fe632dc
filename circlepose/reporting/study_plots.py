"""The studies as pictures. Needs matplotlib, which comes with the extra `report`."""

from __future__ import annotations

import io
from collections.abc import Sequence
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from circlepose.errors import UsageError
from circlepose.io.atomic import atomic_writer, refuse_foreign
from circlepose.io.marks import with_plot_mark
from circlepose.studies.gcc import PRINTED_LIMIT_MM, GccPoint
from circlepose.studies.noise import NoiseRow

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
_DPI = 150


def check_plot(path: Path, *, overwrite: bool = False) -> None:
    """Raise `UsageError` when a picture at `path` cannot be made: its ending, or matplotlib missing.

    Raises `OutputError` where a file is there that circlepose did not write, unless `overwrite`.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"--plot {path}: expected a file that ends in {', '.join(SUFFIXES)}.")
    if find_spec("matplotlib") is None:
        raise UsageError("--plot needs matplotlib, which is not installed; run: pip install 'circlepose[report]'")
    refuse_foreign(path, overwrite=overwrite)


def plot_noise(rows: Sequence[NoiseRow], path: Path, *, overwrite: bool = False) -> None:
    """Draw both standard deviations over the noise, a line per reading, into `path` (.png, .svg or .pdf).

    Raises `UsageError` as `check_plot` does, and `OutputError` where the file cannot be written.
    """
    check_plot(path, overwrite=overwrite)
    from matplotlib.figure import Figure  # noqa: PLC0415 - an extra

    figure = Figure(figsize=(10.0, 6.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    for (reading, points), group in groupby(rows, key=lambda row: (row.reading, row.points)):
        line = list(group)
        noise = [row.noise_px for row in line]
        looks = {"color": "black", "linestyle": "none", "marker": "x", "markersize": 9.0, "zorder": 3.0}
        style = looks if reading == "print" else {"marker": "."}
        label = f"{reading}; {points}" if reading != "print" else "the paper"
        left.plot(noise, [row.center_sd_mm for row in line], label=label, **style)
        right.plot(noise, [row.normal_sd_deg for row in line], **style)
    left.set_ylabel("standard deviation of the center, mm")
    right.set_ylabel("standard deviation of the normal, deg")
    for axes in (left, right):
        axes.set_xlabel("noise, px")
        axes.set_xticks(sorted({row.noise_px for row in rows}))
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=2, fontsize="small")
    save_plot(figure, path, overwrite=overwrite)


def plot_gcc(points: Sequence[GccPoint], path: Path, *, overwrite: bool = False) -> None:
    """Draw the deviation of GCC over the tilt, of right pairs and of others, into `path`; errors as `plot_noise`."""
    check_plot(path, overwrite=overwrite)
    from matplotlib.figure import Figure  # noqa: PLC0415 - an extra

    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    looks = {"boss": {"marker": "o"}, "recess": {"marker": "^"}}
    printed = {"marker": "x", "color": "black", "markersize": 9.0}
    for part in dict.fromkeys(_label(point) for point in points):
        style = {"linestyle": "none", "markersize": 5.0, "alpha": 0.8, **looks.get(part, printed)}
        among = [point for point in points if _label(point) == part]
        tilts = [point.tilt_deg for point in among]
        left.plot(tilts, [_number(point.right_mm) for point in among], label=part, **style)
        right.plot(tilts, [_number(point.other_mm) for point in among], **style)
    for limit in (-PRINTED_LIMIT_MM, PRINTED_LIMIT_MM):
        left.axhline(limit, color="black", linestyle="--", linewidth=0.8)
    left.set_title("pair of the true pose; dashed: the paper's 1 mm", fontsize="medium")
    right.set_title("other pair", fontsize="medium")
    for axes in (left, right):
        axes.set_xlabel("tilt, deg")
        axes.set_ylabel("GCC less the part's, mm")
        axes.axhline(0.0, color="black", linewidth=0.8)
        axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=3, fontsize="small")
    save_plot(figure, path, overwrite=overwrite)


def _label(point: GccPoint) -> str:
    return "the paper, Table 2" if point.part.startswith("print") else point.part


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def save_plot(figure: Figure, path: Path, *, overwrite: bool) -> None:
    """Write a figure to `path`, marked as ours, whole or not at all."""
    picture = io.BytesIO()
    figure.savefig(picture, format=path.suffix[1:].lower(), dpi=_DPI)
    with atomic_writer(path, binary=True, overwrite=overwrite) as handle:
        handle.write(with_plot_mark(picture.getvalue()))
