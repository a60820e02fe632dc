"""The noise experiment as a picture. Needs matplotlib, which comes with the extra `report`."""

from __future__ import annotations

import io
from collections.abc import Sequence
from importlib.util import find_spec
from itertools import groupby
from pathlib import Path

from circlepose.errors import UsageError
from circlepose.files.atomic import atomic_writer
from circlepose.files.marks import with_plot_mark
from circlepose.studies.noise import NoiseRow

SUFFIXES = (".png", ".svg", ".pdf")
_DPI = 150


def check_plot(path: Path) -> None:
    """Raise `UsageError` when a picture at `path` cannot be made: its ending, or matplotlib missing."""
    if path.suffix.lower() not in SUFFIXES:
        raise UsageError(f"--plot {path}: expected a file that ends in {', '.join(SUFFIXES)}.")
    if find_spec("matplotlib") is None:
        raise UsageError("--plot needs matplotlib, which is not installed; run: pip install 'circlepose[report]'")


def plot_noise(rows: Sequence[NoiseRow], path: Path, *, overwrite: bool = False) -> None:
    """Draw both standard deviations over the noise, a line per reading, into `path` (.png, .svg or .pdf).

    Raises `UsageError` as `check_plot` does, and `OutputError` where the file cannot be written.
    """
    check_plot(path)
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
    left.set_ylabel("standard deviation of the centre, mm")
    right.set_ylabel("standard deviation of the normal, deg")
    for axes in (left, right):
        axes.set_xlabel("noise, px")
        axes.set_xticks(sorted({row.noise_px for row in rows}))
        axes.set_ylim(bottom=0.0)
        axes.grid(alpha=0.3)
    figure.legend(loc="outside lower center", ncols=2, fontsize="small")
    picture = io.BytesIO()
    figure.savefig(picture, format=path.suffix[1:].lower(), dpi=_DPI)
    with atomic_writer(path, binary=True, overwrite=overwrite) as handle:
        handle.write(with_plot_mark(picture.getvalue()))
