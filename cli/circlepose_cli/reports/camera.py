"""What a calibration means in numbers that a person can judge: angles of view, distortion in px, doubts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from circlepose._numerics import angle_between
from circlepose._typing import FloatArray
from circlepose.camera.camera import Camera
from circlepose.io.calibration.forms.report import CAMERA_SCHEMA
from circlepose.io.calibration.reader import CameraFile
from circlepose.io.text.escaping import printable
from circlepose.targets.target import Target
from circlepose_cli.reports.target import describe_target, target_warnings

CONVENTION = "an integer pixel coordinate is a pixel's center; (0, 0) is the center of the top left pixel"
REFUSED = " (estimate refuses it without --force-calib)"
_CORNERS = ("top left", "top right", "bottom left", "bottom right")


@dataclass(frozen=True, slots=True)
class CornerShift:
    """How far the lens moves a corner pixel from where a pinhole camera would have it."""

    corner: str
    off_axis_deg: float | None
    """angle of the corner's ray to the optical axis; None where the lens model has no ray there"""
    shift_px: float | None
    """positive outwards, negative inwards; None where the lens model, or a pinhole camera, does not see the corner"""


@dataclass(frozen=True, slots=True)
class CameraReport:
    """What is said of a calibration; lengths in px, angles in deg."""

    file: str
    form: str
    model: str
    image_size_px: tuple[int, int] | None
    focal_lengths_px: tuple[float, float]
    principal_point_px: tuple[float, float]
    principal_point_offset_px: tuple[float, float] | None
    """from the image's center"""
    focal_sigma_px: float
    center_sigma_px: float
    """standard deviations of the focal lengths and of the principal point; 0 where the file does not say them"""
    camera_matrix: tuple[tuple[float, ...], ...]
    """all of it, also the skew: with it the report is a calibration itself"""
    dist_coeffs: tuple[float, ...]
    field_of_view_deg: dict[str, float | None] | None
    """horizontal, vertical, diagonal; each None where the lens model does not reach the edge"""
    corner_shifts: tuple[CornerShift, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    target: str | None = None
    """the target that the warnings are about as well, in words"""


def describe(camera_file: CameraFile, target: Target | None = None) -> CameraReport:
    """Return the report on a calibration file, and on the `target` to be measured with it."""
    camera = camera_file.camera
    matrix, size = camera.camera_matrix, camera.image_size
    principal_point = matrix[:2, 2]
    offset = None if size is None else principal_point - (np.array(size) - 1.0) / 2.0
    shifts = () if size is None else tuple(_corner_shifts(camera, size))
    report = CameraReport(
        file=str(camera_file.path),
        form=camera_file.form,
        model=camera.model,
        image_size_px=size,
        focal_lengths_px=(float(matrix[0, 0]), float(matrix[1, 1])),
        principal_point_px=_pair(principal_point),
        principal_point_offset_px=None if offset is None else _pair(offset),
        focal_sigma_px=camera.sigma.focal_px,
        center_sigma_px=camera.sigma.center_px,
        camera_matrix=tuple(map(tuple, matrix.tolist())),
        dist_coeffs=tuple(camera.dist_coeffs.tolist()),
        field_of_view_deg=None if size is None else _field_of_view(camera, size),
        corner_shifts=shifts,
        notes=camera_file.notes,
        warnings=tuple(f"{doubt.text}{REFUSED if doubt.is_grave else ''}" for doubt in camera_file.doubts),
    )
    if target is None:
        return report
    return replace(report, warnings=(*report.warnings, *target_warnings(target)), target=describe_target(target))


def _field_of_view(camera: Camera, size: tuple[int, int]) -> dict[str, float | None]:
    """Return the angles between the rays of the image's edges, under the full lens model."""
    cx, cy = camera.camera_matrix[:2, 2]
    right, bottom = size[0] - 0.5, size[1] - 0.5
    ends = np.array(
        [[[-0.5, cy], [right, cy]], [[cx, -0.5], [cx, bottom]], [[-0.5, -0.5], [right, bottom]]],
    )
    rays = camera.rays(ends)
    between = angle_between(rays[:, 0], rays[:, 1])
    # Two rays of a very wide lens enclose more than half a turn on the side of the scene.
    axis = np.array([0.0, 0.0, 1.0])
    sum_from_axis = angle_between(rays[:, 0], axis) + angle_between(rays[:, 1], axis)
    angles = np.degrees(np.where(sum_from_axis > np.pi, 2.0 * np.pi - between, between))
    return dict(zip(("horizontal", "vertical", "diagonal"), map(_finite, angles.tolist()), strict=True))


def _corner_shifts(camera: Camera, size: tuple[int, int]) -> Iterator[CornerShift]:
    right, bottom = size[0] - 1.0, size[1] - 1.0
    corners = np.array([[0.0, 0.0], [right, 0.0], [0.0, bottom], [right, bottom]])
    rays = camera.rays(corners)
    with np.errstate(divide="ignore", invalid="ignore"):
        homogeneous = np.where(rays[:, 2:] > 0.0, rays / rays[:, 2:], np.nan) @ camera.camera_matrix.T
    ideal = homogeneous[:, :2]
    principal_point = camera.camera_matrix[:2, 2]
    length = np.linalg.norm(corners - ideal, axis=1)
    outwards = np.linalg.norm(corners - principal_point, axis=1) >= np.linalg.norm(ideal - principal_point, axis=1)
    angles = np.degrees(angle_between(rays, np.array([0.0, 0.0, 1.0])))
    shifts = np.where(outwards, length, -length)
    for corner, angle, shift in zip(_CORNERS, angles.tolist(), shifts.tolist(), strict=True):
        yield CornerShift(corner, _finite(angle), _finite(shift))


def report_record(report: CameraReport) -> dict[str, Any]:
    """Return the report as plain values for JSON."""
    return {"schema": CAMERA_SCHEMA, **asdict(report), "pixel_convention": CONVENTION}


def report_text(report: CameraReport) -> str:
    """Return the report in plain words."""
    lines = [
        ("file", f"{report.file} ({report.form})"),
        ("lens model", _model(report)),
        ("image size", "unknown" if report.image_size_px is None else "{} x {} px".format(*report.image_size_px)),
        ("focal lengths", "fx {:.2f} px, fy {:.2f} px".format(*report.focal_lengths_px)),
        ("principal point", _principal_point(report)),
    ]
    if report.focal_sigma_px or report.center_sigma_px:
        known = f"focal length to {report.focal_sigma_px:g} px, principal point to {report.center_sigma_px:g} px"
        lines.append(("known to", f"{known} (one sigma)"))
    if report.field_of_view_deg is not None:
        lines.append(("field of view", ", ".join(_angles(report.field_of_view_deg))))
    lines += [
        ("distortion" if number == 0 else "", f"{shift.corner} corner {_shift(shift)}")
        for number, shift in enumerate(report.corner_shifts)
    ]
    lines.append(("pixels", CONVENTION))
    if report.target is not None:
        lines.append(("target", report.target))
    lines += [("note", note) for note in report.notes]
    lines += [("warning", warning) for warning in report.warnings]
    return "\n".join(f"{name:<16} {printable(value)}" for name, value in lines)


def _model(report: CameraReport) -> str:
    coefficients = ", ".join(f"{value:g}" for value in report.dist_coeffs)
    return f"{report.model}, {f'dist_coeffs {coefficients}' if any(report.dist_coeffs) else 'no distortion'}"


def _principal_point(report: CameraReport) -> str:
    text = "({:.2f}, {:.2f}) px".format(*report.principal_point_px)
    if report.principal_point_offset_px is None:
        return text
    dx, dy = report.principal_point_offset_px
    if max(abs(dx), abs(dy)) < 0.005:
        return f"{text}, the image's center"
    across = f"{abs(dx):.2f} px {'right' if dx >= 0.0 else 'left'}"
    along = f"{abs(dy):.2f} px {'below' if dy >= 0.0 else 'above'}"
    return f"{text}, {across} of and {along} the image's center"


def _angles(angles: dict[str, float | None]) -> Iterator[str]:
    for name, angle in angles.items():
        yield f"{name} {'beyond the lens model' if angle is None else f'{angle:.2f} deg'}"


def _shift(shift: CornerShift) -> str:
    if shift.off_axis_deg is None:
        return "beyond the lens model"
    if shift.shift_px is None:
        return f"{shift.off_axis_deg:.1f} deg off the axis, where a pinhole camera sees nothing"
    return f"moved {abs(shift.shift_px):.2f} px {'outwards' if shift.shift_px >= 0.0 else 'inwards'}"


def _pair(values: FloatArray) -> tuple[float, float]:
    return float(values[0]), float(values[1])


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None
