"""What each of the larger commands is asked for: its options, declared, and the values that `runs` works with.

Nothing here may import NumPy, SciPy or OpenCV: `--help` has to be there at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from circlepose.evaluation import CandidateChoice
from circlepose.io.tables import Layout
from circlepose.solvers import Method
from circlepose_cli.options import declared, parse
from circlepose_cli.options.camera_target import CameraTargetOptions, StageOptions
from circlepose_cli.options.declared import ReportFormat, StdinChoice
from circlepose_cli.options.groups import Parsed
from circlepose_cli.options.help import Group


@dataclass(frozen=True, slots=True, kw_only=True)
class EstimateRequest:
    """Options of `circlepose estimate`."""

    inputs: Annotated[
        list[str],
        typer.Argument(
            metavar="INPUT...",
            help="Images, folders, globs, URLs of these, or - for standard input (paths, one a line, or one image).",
            show_default=False,
        ),
    ]
    stdin: Annotated[
        StdinChoice,
        typer.Option(
            "--stdin",
            help="What - stands for: paths, or one image. Default: by its first bytes.",
            rich_help_panel=Group.INPUT,
        ),
    ] = StdinChoice.AUTO
    nul: Annotated[
        bool,
        typer.Option(
            "-0",
            "--null",
            help="Paths on standard input end with NUL, as of find -print0.",
            rich_help_panel=Group.INPUT,
        ),
    ] = False
    known: CameraTargetOptions
    method: Annotated[
        Literal[Method, "all"],
        typer.Option(
            "--method",
            metavar="METHOD",
            help="How the candidate poses are computed: chen-huang, chen-huang-contour, kanatani-liu, kabuka-arenas, "
            "fu-zhou (rings), or all to compare them.",
            rich_help_panel=Group.AMBIGUITY,
        ),
    ] = "chen-huang"
    stages: StageOptions
    recursive: Annotated[
        bool,
        typer.Option(
            "--recursive",
            "-r",
            help="Take the images in subfolders too.",
            rich_help_panel=Group.INPUT,
        ),
    ] = False
    output_format: declared.Format = None
    layout: Annotated[
        Layout | None,
        typer.Option(
            "--layout",
            help="Rows: poses of circles or of boards, distances of pairs of circles, Table I of Chen & Huang, or "
            "Tables 1, 2 of Fu & Zhou. Default: boards for targets of kind board, else poses.",
            show_default=False,
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    world_board: Annotated[
        str | None,
        typer.Option(
            "--world-board",
            metavar="NAME|FILE",
            help="Target file of a board in the same image: poses are relative to it, in its frame. A NAME is "
            "NAME.yaml beside the images.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    chosen_only: Annotated[
        bool,
        typer.Option(
            "--chosen-only",
            help="Leave out the candidate poses that are not chosen.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = False
    columns: Annotated[
        str | None,
        typer.Option(
            "--columns",
            metavar="NAME,...",
            help="Columns to write, in this order; csv, tsv, parquet and table.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    reference: Annotated[
        Path | None,
        typer.Option(
            "--reference",
            metavar="FILE",
            help="With --layout table2: truth or poses, to print beside, with errors.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    output: Annotated[
        str | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE",
            help="Write to this file or URL, whole or not at all; .csv, .tsv, .json, .jsonl (each also .gz) or "
            ".parquet.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    overlay: Annotated[
        Path | None,
        typer.Option(
            "--overlay",
            metavar="DIR",
            help="Draw each result over its image, as PNG in DIR.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    overwrite: declared.Overwrite = False
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            metavar="N",
            min=1,
            help="Worker processes. Default: one a core, for many images.",
            rich_help_panel=Group.RUNNING,
        ),
    ] = None
    cluster: Annotated[
        str | None,
        typer.Option(
            "--cluster",
            metavar="ADDRESS",
            help="Measure on the cluster of this dask scheduler: tcp://host:8786.",
            rich_help_panel=Group.RUNNING,
        ),
    ] = None
    timeout: Annotated[
        float | None,
        typer.Option(
            "--timeout",
            metavar="SECONDS",
            help="Longest time for one image; the run goes on without it. Default: 120.",
            show_default=False,
            rich_help_panel=Group.RUNNING,
        ),
        Parsed(parse.positive_seconds, typed=float),
    ] = None
    resume: Annotated[
        bool,
        typer.Option(
            "--resume",
            help="Continue a run that did not finish; needs its -o FILE.",
            rich_help_panel=Group.RUNNING,
        ),
    ] = False
    quiet: declared.Quiet = False
    verbose: declared.Verbose = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ExplainRequest:
    """Options of `circlepose explain`."""

    image: Annotated[str, typer.Argument(metavar="IMAGE", help="One image, or the URL of one.", show_default=False)]
    known: CameraTargetOptions
    stages: StageOptions
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture",
            metavar="FILE",
            help="Draw the band around each rim, its residuals and the profile across the edge, as PNG.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    circle: Annotated[
        str | None,
        typer.Option(
            "--circle",
            metavar="NAME",
            help="The one circle to write and draw, such as r0c3 of a board.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    report_format: declared.Report = ReportFormat.TEXT
    overwrite: declared.Overwrite = False
    quiet: declared.Quiet = False
    verbose: declared.Verbose = False


@dataclass(frozen=True, slots=True, kw_only=True)
class InspectRequest:
    """Options of `circlepose inspect`."""

    image: Annotated[Path, typer.Argument(metavar="IMAGE", help="Photograph to look at.", show_default=False)]
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture",
            metavar="FILE",
            help="Draw the kept contours in green and the rejected ones in red.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    polarity: declared.Polarity = None
    major_px: declared.MajorPx = None
    minor_px: declared.MinorPx = None
    min_score: declared.MinScore = None
    max_residual_px: declared.MaxResidualPx = None
    rings: Annotated[
        bool,
        typer.Option(
            "--rings",
            help="Keep circles inside others of the same center, as in ring targets.",
            rich_help_panel=Group.DETECTION,
        ),
    ] = False
    report_format: declared.Report = ReportFormat.TEXT
    overwrite: declared.Overwrite = False
    verbose: declared.Verbose = False


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckRequest:
    """Options of `circlepose check`."""

    poses: Annotated[
        str,
        typer.Argument(metavar="POSES", help="Table made by estimate, or - for standard input.", show_default=False),
    ]
    against: Annotated[
        Path,
        typer.Option(
            "--against",
            metavar="FILE",
            help="A table made by estimate before, or a truth as CSV.",
            rich_help_panel=Group.COMPARISON,
        ),
    ]
    position_mm: Annotated[
        float,
        typer.Option(
            "--position-mm",
            metavar="MM",
            help="Tolerance of the center, of a board its origin.",
            rich_help_panel=Group.COMPARISON,
        ),
    ] = 0.5
    normal_deg: Annotated[
        float,
        typer.Option(
            "--normal-deg",
            metavar="DEG",
            help="Tolerance of the normal, of a board its rotation.",
            rich_help_panel=Group.COMPARISON,
        ),
    ] = 0.1
    candidate: Annotated[
        CandidateChoice,
        typer.Option(
            "--candidate",
            help="Compare the chosen candidate, or that nearest to the reference.",
            rich_help_panel=Group.COMPARISON,
        ),
    ] = "chosen"
    update: Annotated[
        bool,
        typer.Option(
            "--update",
            help="Make POSES the baseline, whatever moved; not for a truth.",
            rich_help_panel=Group.COMPARISON,
        ),
    ] = False
    output_format: Annotated[
        declared.CheckFormat | None,
        typer.Option(
            "--format",
            help="Default: table on a terminal, csv in a pipe. github: annotations and summary of GitHub Actions.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    quiet: declared.Quiet = False
    verbose: declared.Verbose = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PrintRequest:
    """Options of `circlepose print`."""

    target: Annotated[
        Path | None,
        typer.Argument(metavar="[TARGET.yaml]", help="Target file to print, unless --suggest.", show_default=False),
    ] = None
    suggest: Annotated[
        bool,
        typer.Option(
            "--suggest",
            help="Print the board that measures best on --paper, seen by --calib at --distance-mm.",
            rich_help_panel=Group.WANTED,
        ),
    ] = False
    calib: Annotated[
        Path | None,
        typer.Option(
            "--calib", metavar="FILE", help="With --suggest: calibration file.", rich_help_panel=Group.WANTED
        ),
    ] = None
    camera_name: declared.CameraName = None
    distance_mm: Annotated[
        parse.Interval | None,
        typer.Option(
            "--distance-mm",
            metavar="A[:B]",
            help="With --suggest: distance of the board, or the nearest and the farthest one.",
            rich_help_panel=Group.WANTED,
        ),
        Parsed(parse.span),
    ] = None
    output: Annotated[
        Path,
        typer.Option(
            "--output",
            "-o",
            metavar="SHEET",
            help="Sheet to write: .svg, .pdf or .dxf. Beside it goes the target of the same name, .yaml.",
            rich_help_panel=Group.OUTPUT,
        ),
    ]
    paper: Annotated[
        str | None,
        typer.Option(
            "--paper",
            metavar="SIZE",
            help="A4, A3, letter or WIDTHxHEIGHT in mm; a larger sheet is cut into tiles. Default: one sheet as "
            "large as needed.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    is_dark_on_light: Annotated[
        bool | None,
        typer.Option(
            "--dark-on-light/--light-on-dark",
            help="Circles of ink, or of paper on a ground of ink. Default: by the target's polarity, else dark.",
            show_default=False,
            rich_help_panel=Group.TARGET,
        ),
    ] = None
    copies: Annotated[
        int | None,
        typer.Option(
            "--copies",
            metavar="N",
            min=1,
            help="Discs or rings on the sheet. Default: the target's count.",
            rich_help_panel=Group.TARGET,
        ),
    ] = None
    marks: Annotated[
        bool,
        typer.Option(
            "--marks/--no-marks",
            help="Whether a board that a turn maps on itself gets a mark that settles its roll.",
            rich_help_panel=Group.TARGET,
        ),
    ] = True
    code: Annotated[
        bool,
        typer.Option(
            "--qr/--no-qr",
            help="Whether the target stands on the sheet as a QR code.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = True
    overwrite: declared.Overwrite = False
    quiet: declared.Quiet = False
    verbose: declared.Verbose = False
