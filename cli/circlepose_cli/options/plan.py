"""The options of `circlepose plan`.

Nothing here may import NumPy, SciPy or OpenCV: `--help` has to be there at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from circlepose_cli.options import declared, parse
from circlepose_cli.options.groups import Parsed
from circlepose_cli.options.help import Group


class Sought(StrEnum):
    """What is sought for a wanted accuracy."""

    DISTANCE = "distance"
    RADIUS = "radius"


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanRequest:
    """Options of `circlepose plan`."""

    calib: Annotated[
        Path | None,
        typer.Option(
            "--calib", metavar="FILE", help="Calibration file, or --focal-mm.", rich_help_panel=Group.CAMERA
        ),
    ] = None
    camera_name: declared.CameraName = None
    focal_mm: Annotated[
        float | None,
        typer.Option(
            "--focal-mm",
            metavar="MM",
            help="Focal length of a lens without distortion, with --pixel-um and --image-size.",
            rich_help_panel=Group.CAMERA,
        ),
    ] = None
    pixel_um: Annotated[
        float | None,
        typer.Option("--pixel-um", metavar="UM", help="Size of a pixel.", rich_help_panel=Group.CAMERA),
    ] = None
    image_size: Annotated[
        tuple[int, int] | None,
        typer.Option(
            "--image-size", metavar="WxH", help="Width and height of the image, px.", rich_help_panel=Group.CAMERA
        ),
        Parsed(parse.size_px),
    ] = None
    camera_sigma: declared.CameraSigma = None
    target_file: Annotated[
        Path | None,
        typer.Option("--target", metavar="FILE", help="Target file.", rich_help_panel=Group.TARGET),
    ] = None
    radius_mm: declared.RadiusMm = None
    radius_sigma_mm: declared.RadiusSigmaMm = None
    distance_mm: Annotated[
        parse.Interval,
        typer.Option(
            "--distance-mm",
            metavar="A[:B]",
            help="Distance of the target, or the nearest and the farthest one.",
            show_default=False,
            rich_help_panel=Group.VIEW,
        ),
        Parsed(parse.span),
    ]
    tilt_deg: Annotated[
        parse.Interval | None,
        typer.Option(
            "--tilt-deg",
            metavar="A[:B]",
            help="Angle of its normal to the line of sight. Default: 15:60.",
            rich_help_panel=Group.VIEW,
        ),
        Parsed(parse.span),
    ] = None
    place: Annotated[
        tuple[str, ...] | None,
        typer.Option(
            "--place",
            metavar="NAME,...",
            help="Where it is in the image: middle, right, bottom, corner. Default: middle.",
            rich_help_panel=Group.VIEW,
        ),
        Parsed(parse.places),
    ] = None
    steps: Annotated[
        int,
        typer.Option("--steps", metavar="N", min=1, max=100, help="Values of a range.", rich_help_panel=Group.VIEW),
    ] = 4
    noise: Annotated[
        float,
        typer.Option(
            "--noise",
            metavar="LEVELS",
            help="Noise of a pixel: its standard deviation, of 255 gray levels.",
            rich_help_panel=Group.IMAGE,
        ),
    ] = 2.0
    blur_px: Annotated[
        float,
        typer.Option(
            "--blur-px", metavar="PX", help="Blur of the lens: sigma of a Gaussian.", rich_help_panel=Group.IMAGE
        ),
    ] = 0.7
    contrast: Annotated[
        float,
        typer.Option(
            "--contrast",
            metavar="LEVELS",
            help="Gray levels, of 255, between target and ground.",
            rich_help_panel=Group.IMAGE,
        ),
    ] = 150.0
    sigma_mm: Annotated[
        float | None,
        typer.Option(
            "--sigma-mm",
            metavar="MM",
            help="Wanted: standard deviation of the position, all axes together.",
            rich_help_panel=Group.WANTED,
        ),
        Parsed(parse.positive, typed=float),
    ] = None
    sigma_deg: Annotated[
        float | None,
        typer.Option(
            "--sigma-deg",
            metavar="DEG",
            help="Wanted: standard deviation of the normal's direction.",
            rich_help_panel=Group.WANTED,
        ),
        Parsed(parse.positive, typed=float),
    ] = None
    find: Annotated[
        Sought | None,
        typer.Option(
            "--find",
            help="What is sought for it: the farthest distance, or the smallest radius, with all other lengths of "
            "the target. Default: distance.",
            show_default=False,
            rich_help_panel=Group.WANTED,
        ),
    ] = None
    plot: Annotated[
        Path | None,
        typer.Option(
            "--plot",
            metavar="FILE",
            help="Draw the standard deviations too, as .png, .svg or .pdf; needs matplotlib.",
            rich_help_panel=Group.OUTPUT,
        ),
    ] = None
    output_format: declared.Format = None
    output: declared.Output = None
    overwrite: declared.Overwrite = False
    verbose: declared.Verbose = False
