"""What the commands' options mean: their choices, and the typed values that their texts become.

Nothing here may import NumPy, SciPy or OpenCV: `--help` has to be there at once.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

from circlepose.errors import UsageError


class ExtractionChoice(StrEnum):
    """Extractions by name; `circlepose.detection.EXTRACTIONS`."""

    EDGES = "edges"
    COINCIDENCE = "coincidence"


class MethodChoice(StrEnum):
    """Methods by name; `circlepose.solvers.METHODS` and `all`."""

    CHEN_HUANG = "chen-huang"
    CHEN_HUANG_CONTOUR = "chen-huang-contour"
    KANATANI_LIU = "kanatani-liu"
    KABUKA_ARENAS = "kabuka-arenas"
    FU_ZHOU = "fu-zhou"
    ALL = "all"


class PolarityChoice(StrEnum):
    """How the disc looks against its surroundings."""

    ANY = "any"
    DARK = "dark"
    BRIGHT = "bright"


class FormatChoice(StrEnum):
    """Forms of the output."""

    CSV = "csv"
    TSV = "tsv"
    JSON = "json"
    JSONL = "jsonl"
    PARQUET = "parquet"
    TABLE = "table"


class LayoutChoice(StrEnum):
    """What the rows of the output are."""

    POSES = "poses"
    TABLE1 = "table1"
    TABLE2 = "table2"


class StdinChoice(StrEnum):
    """What comes on standard input."""

    AUTO = "auto"
    PATHS = "paths"
    IMAGE = "image"


class SideChoice(StrEnum):
    """Sides that a surface can face; `circlepose.targets.hints.SIDES`."""

    LEFT = "left"
    RIGHT = "right"
    UP = "up"
    DOWN = "down"


class ReportFormat(StrEnum):
    """Forms of a report on one thing."""

    TEXT = "text"
    JSON = "json"


Vector: TypeAlias = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class TargetOverrides:
    """What the command line says of the target, and how well it and the camera are known; None leaves it to files."""

    count: int | Literal["all"] | None = None
    polarity: PolarityChoice | None = None
    depth_range_mm: tuple[float, float] | None = None
    major_px: tuple[float, float] | None = None
    minor_px: tuple[float, float] | None = None
    coplanar: bool | None = None
    normal: Vector | None = None
    normal_spread_deg: float | None = None
    up: Vector | None = None
    up_spread_deg: float | None = None
    facing: SideChoice | Vector | None = None
    radius_sigma_mm: float | None = None
    camera_sigma: tuple[float, float] | None = None
    """px, of the focal length and the principal point"""


def check_timeout(seconds: float | None) -> float | None:
    """Return a positive time in s; raises `UsageError`."""
    if seconds is not None and not 0.0 < seconds < math.inf:
        raise UsageError(f"--timeout: expected a positive time in seconds, got {seconds:g}.")
    return seconds


def _number_of_mm(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise typer.BadParameter(f"expected a number of mm without its unit, such as 60, got {text!r}.") from None


Inputs = Annotated[
    list[str],
    typer.Argument(
        metavar="INPUT...",
        help="Images, folders, globs, URLs of these, or - for standard input (paths, one a line, or one image).",
        show_default=False,
    ),
]
Stdin = Annotated[
    StdinChoice,
    typer.Option("--stdin", help="What - stands for: paths, or one image. Default: by its first bytes."),
]
Nul = Annotated[bool, typer.Option("-0", "--null", help="Paths on standard input end with NUL, as of find -print0.")]
Calib = Annotated[
    Path | None,
    typer.Option(
        "--calib",
        metavar="FILE",
        help="Calibration: OpenCV YAML/XML/JSON, ROS camera_info, Kalibr camchain or our own YAML. "
        "Default: the camera.yaml beside each image.",
    ),
]
CameraName = Annotated[
    str | None,
    typer.Option(
        "--camera-name", metavar="NAME", help="Which camera of a calibration file with several, such as cam1."
    ),
]
TargetFile = Annotated[
    Path | None,
    typer.Option(
        "--target",
        metavar="FILE",
        help="Target file. Default: the target.yaml beside each image, else target: in the calibration file.",
    ),
]
RadiusMm = Annotated[
    float | None,
    typer.Option(
        "--radius-mm",
        metavar="R",
        parser=_number_of_mm,
        help="Look for one circle of this radius in mm (not its diameter).",
    ),
]
RadiusSigmaMm = Annotated[
    float | None,
    typer.Option(
        "--radius-sigma-mm",
        metavar="MM",
        parser=_number_of_mm,
        help="How well the radius is known: its standard deviation.",
    ),
]
CameraSigma = Annotated[
    str | None,
    typer.Option(
        "--camera-sigma",
        metavar="FOCAL_PX,CENTER_PX",
        help="How well the camera is known: standard deviations of its focal length and principal point, in px.",
    ),
]
Count = Annotated[
    str | None,
    typer.Option("--count", metavar="N|all", help="Targets in each image. Default: what the target says, else 1."),
]
Polarity = Annotated[
    PolarityChoice | None,
    typer.Option("--polarity", help="Whether the disc is darker or brighter than its surroundings."),
]
DepthRange = Annotated[
    str | None,
    typer.Option(
        "--depth-range-mm", metavar="NEAR:FAR", help="Accept only circles whose centre is so deep (z), in mm."
    ),
]
MajorPx = Annotated[
    str | None,
    typer.Option("--major-px", metavar="LOW:HIGH", help="Accepted full length of the ellipse's major axis, in px."),
]
MinorPx = Annotated[
    str | None,
    typer.Option("--minor-px", metavar="LOW:HIGH", help="Accepted full length of the ellipse's minor axis, in px."),
]
Coplanar = Annotated[
    bool | None,
    typer.Option(
        "--coplanar/--no-coplanar",
        help="Whether all circles of an image lie in one plane, which tells candidates apart.",
    ),
]
Normal = Annotated[
    str | None,
    typer.Option(
        "--normal", metavar="X,Y,Z", help="Roughly where the circles' normals point, in the camera frame: a hint."
    ),
]
NormalSpread = Annotated[
    float | None,
    typer.Option("--normal-spread-deg", metavar="DEG", help="How rough --normal is; 20 unless the target says so."),
]
Up = Annotated[
    str | None,
    typer.Option("--up", metavar="X,Y,Z", help="The surfaces are horizontal, and this is the vertical: a hint."),
]
UpSpread = Annotated[
    float | None,
    typer.Option("--up-spread-deg", metavar="DEG", help="How rough --up is; 10 unless the target says so."),
]
Facing = Annotated[
    str | None,
    typer.Option(
        "--facing", metavar="SIDE", help="Side that the surfaces face: left, right, up, down or X,Y,Z; a hint."
    ),
]
Method = Annotated[
    MethodChoice, typer.Option("--method", help="How the candidate poses are computed; all compares them.")
]
Extraction = Annotated[
    ExtractionChoice,
    typer.Option("--extraction", help="Where contours start from: connected edges, or region borders on edges."),
]
Refine = Annotated[
    bool,
    typer.Option("--refine/--no-refine", help="Place the edges again along the predicted rim, and fit them."),
]
ScaleCalib = Annotated[
    bool,
    typer.Option("--scale-calib", help="Take images of another size than the calibration's as resized ones."),
]
ForceCalib = Annotated[
    bool,
    typer.Option("--force-calib", help="Use a calibration that looks wrong, as it stands."),
]
Recursive = Annotated[bool, typer.Option("--recursive", "-r", help="Take the images in subfolders too.")]
Format = Annotated[
    FormatChoice | None,
    typer.Option("--format", help="Default: table on a terminal, csv in a pipe, by the ending of -o FILE."),
]
Layout = Annotated[
    LayoutChoice,
    typer.Option("--layout", help="Rows: all candidate poses, Table I of Chen & Huang, or Tables 1, 2 of Fu & Zhou."),
]
ReferenceFile = Annotated[
    Path | None,
    typer.Option(
        "--reference", metavar="FILE", help="With --layout table2: truth or poses, to print beside, with errors."
    ),
]
Output = Annotated[
    Path | None,
    typer.Option("--output", "-o", metavar="FILE", help="Write there, whole or not at all, not to standard output."),
]
OutputPlace = Annotated[
    str | None,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE",
        help="Write there (a URL, too), whole or not at all; .csv, .tsv, .json, .jsonl (each also .gz) or .parquet.",
    ),
]
Overlay = Annotated[
    Path | None, typer.Option("--overlay", metavar="DIR", help="Draw each result over its image, as PNG in DIR.")
]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", metavar="N", min=1, help="Worker processes. Default: one a core, for many images."),
]
Cluster = Annotated[
    str | None,
    typer.Option(
        "--cluster", metavar="ADDRESS", help="Measure on the cluster of this dask scheduler: tcp://host:8786."
    ),
]
Timeout = Annotated[
    float | None,
    typer.Option(
        "--timeout",
        metavar="SECONDS",
        help="Give an image up after so long, and go on with the next. Default: 120.",
        show_default=False,
    ),
]
Resume = Annotated[
    bool,
    typer.Option("--resume", help="Go on with a run that did not come to its end: needs its -o FILE."),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace files that circlepose did not write, too.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say nothing but what ends the run.")]
Verbose = Annotated[
    bool, typer.Option("--verbose", "-v", help="Say what is used and rejected, and show tracebacks of bugs.")
]
