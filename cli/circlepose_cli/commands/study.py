"""`circlepose study`: the papers' experiments done again, beside the numbers that they print."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from circlepose_cli.console import process
from circlepose_cli.console.following import followed
from circlepose_cli.options import declared

Seed = Annotated[int, typer.Option("--seed", metavar="N", min=0, help="Seed of the random numbers.")]
study = typer.Typer(
    name="study",
    help="Redo the papers' experiments.",
    rich_markup_mode=None,
    add_completion=False,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_help(context: typer.Context, wanted: bool) -> None:
    if wanted:
        typer.echo(context.get_help())
        raise typer.Exit


# As in `app`: Typer's own help option imports Pydantic before it comes to a command's help.
@study.callback(add_help_option=False)
def _options(
    help_wanted: Annotated[
        bool, typer.Option("--help", "-h", help="Show this message and end.", is_eager=True, callback=_print_help)
    ] = False,
) -> None:
    pass


@study.command()
def table1(
    output_format: declared.Format = None,
    output: declared.Output = None,
    overwrite: declared.Overwrite = False,
    verbose: declared.Verbose = False,
) -> None:
    """Table I of Chen & Huang 1999.

    A compact disc in three views (general, elongated, touched by an object), rendered at the printed poses, by
    their method and the two that they compare with.
    """
    process.begin(verbose=verbose)
    from circlepose.studies.table1 import table1_rows  # noqa: PLC0415 - needs NumPy and OpenCV
    from circlepose_cli.output.sheets import write_sheet  # noqa: PLC0415
    from circlepose_cli.reports.study import table1_sheet  # noqa: PLC0415

    write_sheet(table1_sheet(table1_rows()), output_format, output, overwrite=overwrite)


@study.command()
def noise(
    repeats: Annotated[int, typer.Option("--repeats", metavar="N", min=2, help="Perturbations of each kind.")] = 1000,
    seed: Seed = 0,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Draw the spreads too, as .png, .svg or .pdf; needs matplotlib."),
    ] = None,
    output_format: declared.Format = None,
    output: declared.Output = None,
    overwrite: declared.Overwrite = False,
    verbose: declared.Verbose = False,
) -> None:
    """Noise experiment of Chen & Huang 1999.

    Standard deviations of center and normal under Gaussian noise of 1, 2 and 3 px on the feature points, for
    several readings of what the paper leaves open.
    """
    process.begin(verbose=verbose)
    from circlepose.studies.noise import noise_rows, printed_noise_rows, readings  # noqa: PLC0415 - needs NumPy and OpenCV
    from circlepose.studies.published import NOISE  # noqa: PLC0415
    from circlepose_cli.output.sheets import write_sheet  # noqa: PLC0415
    from circlepose_cli.reports.study import noise_sheet  # noqa: PLC0415

    _check_plot(plot, output, overwrite=overwrite)
    total = len(readings()) * len(NOISE)
    rows = (*printed_noise_rows(), *followed(noise_rows(repeats, seed), total, "perturbing"))
    if plot is not None:
        from circlepose.reporting.study_plots import plot_noise  # noqa: PLC0415

        plot_noise(rows, plot, overwrite=overwrite)
    write_sheet(noise_sheet(rows, repeats, seed), output_format, output, overwrite=overwrite)


@study.command()
def table2(
    output_format: declared.Format = None,
    output: declared.Output = None,
    overwrite: declared.Overwrite = False,
    verbose: declared.Verbose = False,
) -> None:
    """Tables 1 and 2 of Fu & Zhou 2019.

    Concentric circles, coplanar and coaxial, rendered at the calibrated poses: both candidates and the one chosen.
    """
    process.begin(verbose=verbose)
    from circlepose.studies.table2 import table2_rows  # noqa: PLC0415 - needs NumPy and OpenCV
    from circlepose_cli.output.sheets import write_sheet  # noqa: PLC0415
    from circlepose_cli.reports.study import table2_sheet  # noqa: PLC0415

    write_sheet(table2_sheet(table2_rows()), output_format, output, overwrite=overwrite)


@study.command()
def gcc(
    scenes: Annotated[int, typer.Option("--scenes", metavar="N", min=1, help="Scenes of each part.")] = 30,
    seed: Seed = 0,
    plot: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Draw each scene too, as .png, .svg or .pdf; needs matplotlib."),
    ] = None,
    output_format: declared.Format = None,
    output: declared.Output = None,
    overwrite: declared.Overwrite = False,
    verbose: declared.Verbose = False,
) -> None:
    """Deviation of GCC, Figure 9 of Fu & Zhou 2019.

    How far the generatrix of the right pair of candidates, and of the other one, is from the part's: bosses and
    recesses rendered at random poses.
    """
    process.begin(verbose=verbose)
    from circlepose.studies.gcc import PARTS, gcc_points, gcc_rows, printed_points  # noqa: PLC0415 - needs NumPy
    from circlepose_cli.output.sheets import write_sheet  # noqa: PLC0415
    from circlepose_cli.reports.study import gcc_sheet  # noqa: PLC0415

    _check_plot(plot, output, overwrite=overwrite)
    points = (*printed_points(), *followed(gcc_points(scenes, seed), scenes * len(PARTS), "rendering"))
    if plot is not None:
        from circlepose.reporting.study_plots import plot_gcc  # noqa: PLC0415

        plot_gcc(points, plot, overwrite=overwrite)
    write_sheet(gcc_sheet(gcc_rows(points), seed), output_format, output, overwrite=overwrite)


def _check_plot(plot: Path | None, output: Path | None, *, overwrite: bool) -> None:
    """Raise `UsageError` where the picture cannot be made, or would be written over the table."""
    if plot is None:
        return
    from circlepose.io.output_conflicts import refuse_one_place  # noqa: PLC0415
    from circlepose.reporting.study_plots import check_plot  # noqa: PLC0415
    from circlepose_cli.output.destination import output_place  # noqa: PLC0415

    refuse_one_place([("--plot", plot), ("-o", output_place(output))])
    check_plot(plot, overwrite=overwrite)
