"""A plan as a picture. Needs matplotlib, which comes with the extra `report`."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from pathlib import Path

from circlepose.planning.predict import Planned
from circlepose.reporting.study_plots import check_plot, save_plot


def plot_plan(rows: Sequence[Planned], path: Path, *, overwrite: bool = False) -> None:
    """Draw the standard deviations over the distance, a line for each tilt and place, into `path`.

    Raises `UsageError` as `check_plot` does, and `OutputError` where the file cannot be written.
    """
    check_plot(path, overwrite=overwrite)
    from matplotlib.figure import Figure  # noqa: PLC0415 - an extra

    figure = Figure(figsize=(10.0, 5.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    for (place, tilt), group in groupby(rows, key=lambda row: (row.place, row.tilt_deg)):
        known = [row.prediction for row in group if row.prediction is not None and row.prediction.position_mm]
        if not known:
            continue
        distances = [each.view.distance_mm for each in known]
        label = f"{place}, {tilt:g} deg"
        left.plot(distances, [each.position_mm for each in known], marker=".", label=label)
        right.plot(distances, [each.sigma_normal_deg for each in known], marker=".")
    left.set_ylabel("standard deviation of the position, mm")
    right.set_ylabel("standard deviation of the normal, deg")
    for axes in (left, right):
        axes.set_xlabel("distance, mm")
        axes.grid(alpha=0.3, which="both")
        if axes.lines:
            axes.set_xscale("log")
            axes.set_yscale("log")
        else:
            axes.set_title("nothing to draw: see the reasons in the table", fontsize="medium")
    if left.lines:
        figure.legend(loc="outside lower center", ncols=4, fontsize="small")
    save_plot(figure, path, overwrite=overwrite)
