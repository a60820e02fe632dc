"""The options on camera and target, as `estimate` and `explain` have them; what they change is in `setup`.

Nothing here may import NumPy, SciPy or OpenCV: `--help` has to be there at once.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from circlepose.detection import EXTRACTIONS, Extraction
from circlepose.targets import Direction, SamePlane, Side
from circlepose_cli.options import declared, parse
from circlepose_cli.options.groups import Parsed
from circlepose_cli.options.help import Group


@dataclass(frozen=True, slots=True, kw_only=True)
class CameraTargetOptions:
    """Which camera and which target hold; None leaves it to the files.

    A field with the name of a field of `Target` replaces that one.
    """

    @property
    def plane(self) -> SamePlane | None:
        """What `--same-plane` or `--coplanar` says."""
        if self.coplanar is None:
            return self.same_plane
        return "yes" if self.coplanar else "no"

    calib: Annotated[
        Path | None,
        typer.Option(
            "--calib",
            metavar="FILE",
            help="Calibration: OpenCV YAML/XML/JSON, ROS camera_info, Kalibr camchain or our own YAML. "
            "Default: the camera.yaml beside each image.",
            rich_help_panel=Group.CAMERA,
        ),
    ] = None
    camera_name: declared.CameraName = None
    target_file: Annotated[
        Path | None,
        typer.Option(
            "--target",
            metavar="FILE",
            help="Target file. Default: the target.yaml beside each image, else target: in the calibration file.",
            rich_help_panel=Group.TARGET,
        ),
    ] = None
    radius_mm: declared.RadiusMm = None
    radius_sigma_mm: declared.RadiusSigmaMm = None
    camera_sigma: declared.CameraSigma = None
    count: Annotated[
        int | Literal["all"] | None,
        typer.Option(
            "--count",
            metavar="N|all",
            help="Targets in each image. Default: what the target says, else 1.",
            rich_help_panel=Group.TARGET,
        ),
        Parsed(parse.count),
    ] = None
    polarity: declared.Polarity = None
    depth_range_mm: Annotated[
        parse.Interval | None,
        typer.Option(
            "--depth-range-mm",
            metavar="NEAR:FAR",
            help="Accept only circles whose center has its z in this interval, in mm.",
            rich_help_panel=Group.TARGET,
        ),
        Parsed(parse.interval),
    ] = None
    major_px: declared.MajorPx = None
    minor_px: declared.MinorPx = None
    same_plane: Annotated[
        SamePlane | None,
        typer.Option(
            "--same-plane",
            help="Whether the circles lie in one plane, which settles their poses: auto finds planes of three or "
            "more circles; yes: all lie in one. Default: what the target says, else auto.",
            rich_help_panel=Group.AMBIGUITY,
        ),
    ] = None
    coplanar: Annotated[
        bool | None,
        typer.Option(
            "--coplanar/--no-coplanar",
            help="Short for --same-plane yes, or no.",
            rich_help_panel=Group.AMBIGUITY,
        ),
    ] = None
    normal: Annotated[
        Direction | None,
        typer.Option(
            "--normal",
            metavar="X,Y,Z",
            help="Roughly where the circles' normals point, in the camera frame: a hint.",
            rich_help_panel=Group.AMBIGUITY,
        ),
        Parsed(parse.direction),
    ] = None
    normal_spread_deg: Annotated[
        float | None,
        typer.Option(
            "--normal-spread-deg",
            metavar="DEG",
            help="Standard deviation of --normal. Default: the target's, else 20.",
            rich_help_panel=Group.AMBIGUITY,
        ),
    ] = None
    up: Annotated[
        Direction | None,
        typer.Option(
            "--up",
            metavar="X,Y,Z",
            help="The surfaces are horizontal, and this is the vertical: a hint.",
            rich_help_panel=Group.AMBIGUITY,
        ),
        Parsed(parse.direction),
    ] = None
    up_spread_deg: Annotated[
        float | None,
        typer.Option(
            "--up-spread-deg",
            metavar="DEG",
            help="Standard deviation of --up. Default: the target's, else 10.",
            rich_help_panel=Group.AMBIGUITY,
        ),
    ] = None
    facing: Annotated[
        Side | Direction | None,
        typer.Option(
            "--facing",
            metavar="SIDE",
            help="Side that the surfaces face: left, right, up, down or X,Y,Z; a hint.",
            rich_help_panel=Group.AMBIGUITY,
        ),
        Parsed(parse.facing),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class StageOptions:
    """How an image is measured, whatever the method."""

    refine: Annotated[
        bool,
        typer.Option(
            "--refine/--no-refine",
            help="Fit edges and gray levels along the predicted rim, or the contour only.",
            rich_help_panel=Group.DETECTION,
        ),
    ] = True
    extraction: Annotated[
        Extraction,
        typer.Option(
            "--extraction",
            help="Where contours start from: connected edges, or region borders on edges.",
            rich_help_panel=Group.DETECTION,
        ),
    ] = EXTRACTIONS[0]
    min_score: declared.MinScore = None
    max_residual_px: declared.MaxResidualPx = None
    scale_calibration: Annotated[
        bool,
        typer.Option(
            "--scale-calib",
            help="Scale the calibration to images of another size.",
            rich_help_panel=Group.CAMERA,
        ),
    ] = False
    force_calibration: Annotated[
        bool,
        typer.Option(
            "--force-calib",
            help="Use a calibration although it looks wrong.",
            rich_help_panel=Group.CAMERA,
        ),
    ] = False
