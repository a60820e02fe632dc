"""Options that several commands have, and the choices that are the command line's own.

Nothing here may import NumPy, SciPy or OpenCV: `--help` has to be there at once.
"""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, TypeAlias

import typer

from circlepose.targets import Polarity as PolarityName
from circlepose_cli.options.groups import Parsed
from circlepose_cli.options.help import Group
from circlepose_cli.options.parse import Interval, camera_sigma, interval, number_of_mm, positive_px, score


class FormatChoice(StrEnum):
    """Forms of the output."""

    CSV = "csv"
    TSV = "tsv"
    JSON = "json"
    JSONL = "jsonl"
    PARQUET = "parquet"
    TABLE = "table"


class CheckFormat(StrEnum):
    """Forms of a comparison: those of `FormatChoice`, and that for GitHub Actions."""

    CSV = "csv"
    TSV = "tsv"
    JSON = "json"
    JSONL = "jsonl"
    PARQUET = "parquet"
    TABLE = "table"
    GITHUB = "github"


class StdinChoice(StrEnum):
    """What comes on standard input."""

    AUTO = "auto"
    PATHS = "paths"
    IMAGE = "image"


class ReportFormat(StrEnum):
    """Forms of a report on one thing."""

    TEXT = "text"
    JSON = "json"


CameraName: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--camera-name",
        metavar="NAME",
        help="Which camera of a calibration file with several, such as cam1.",
        rich_help_panel=Group.CAMERA,
    ),
]
CameraSigma: TypeAlias = Annotated[
    tuple[float, float] | None,
    typer.Option(
        "--camera-sigma",
        metavar="FOCAL_PX,CENTER_PX",
        help="How well the camera is known: standard deviations of its focal length and principal point, in px.",
        rich_help_panel=Group.CAMERA,
    ),
    Parsed(camera_sigma),
]
RadiusMm: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--radius-mm",
        metavar="R",
        parser=number_of_mm,
        help="The target is one circle of this radius in mm (not its diameter).",
        rich_help_panel=Group.TARGET,
    ),
]
RadiusSigmaMm: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--radius-sigma-mm",
        metavar="MM",
        parser=number_of_mm,
        help="How well the radius is known: its standard deviation.",
        rich_help_panel=Group.TARGET,
    ),
]
Polarity: TypeAlias = Annotated[
    PolarityName | None,
    typer.Option(
        "--polarity",
        help="Whether the disc is darker or brighter than its surroundings.",
        rich_help_panel=Group.DETECTION,
    ),
]
MajorPx: TypeAlias = Annotated[
    Interval | None,
    typer.Option(
        "--major-px",
        metavar="LOW:HIGH",
        help="Accepted full length of the ellipse's major axis, in px.",
        rich_help_panel=Group.DETECTION,
    ),
    Parsed(interval),
]
MinorPx: TypeAlias = Annotated[
    Interval | None,
    typer.Option(
        "--minor-px",
        metavar="LOW:HIGH",
        help="Accepted full length of the ellipse's minor axis, in px.",
        rich_help_panel=Group.DETECTION,
    ),
    Parsed(interval),
]
MinScore: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--min-score",
        metavar="S",
        help="Least score of a circle, 0 to 1: less takes doubtful ones too. Default: 0.32.",
        rich_help_panel=Group.DETECTION,
    ),
    Parsed(score, typed=float),
]
MaxResidualPx: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--max-residual-px",
        metavar="R",
        help="Leave out rims whose edges are farther than this from an ellipse, rms px.",
        rich_help_panel=Group.DETECTION,
    ),
    Parsed(positive_px, typed=float),
]
Format: TypeAlias = Annotated[
    FormatChoice | None,
    typer.Option(
        "--format",
        help="Default: table on a terminal, csv in a pipe, by the ending of -o FILE.",
        rich_help_panel=Group.OUTPUT,
    ),
]
Report: TypeAlias = Annotated[
    ReportFormat,
    typer.Option(
        "--format",
        help="Plain words, or JSON.",
        rich_help_panel=Group.OUTPUT,
    ),
]
Output: TypeAlias = Annotated[
    Path | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="Write to this file, whole or not at all, not to standard output.",
        rich_help_panel=Group.OUTPUT,
    ),
]
Overwrite: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--overwrite",
        help="Replace files that circlepose did not write, too.",
        rich_help_panel=Group.OUTPUT,
    ),
]
Quiet: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--quiet",
        "-q",
        help="Print only the error that ends the run.",
        rich_help_panel=Group.RUNNING,
    ),
]
Verbose: TypeAlias = Annotated[
    bool,
    typer.Option(
        "--verbose",
        "-v",
        help="Print what is used and rejected, and tracebacks of bugs.",
        rich_help_panel=Group.RUNNING,
    ),
]
