"""Zivid's intrinsics: `CameraIntrinsics` with `CameraMatrix` and `Distortion`, fitted for OpenCV's model."""

from __future__ import annotations

from collections.abc import Mapping

from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, refuse_name

_MATRIX = ("FX", "FY", "CX", "CY")
_DIST = ("K1", "K2", "P1", "P2", "K3")


def _recognizes(document: Document) -> bool:
    """Whether the entries have Zivid's `CameraMatrix` in capitals, in their group or without it."""
    matrix = _group(document.entries).get("CameraMatrix")
    return isinstance(matrix, Mapping) and "CX" in matrix


def _group(entries: Mapping[str, object]) -> Mapping[str, object]:
    group = entries.get("CameraIntrinsics", entries)
    return group if isinstance(group, Mapping) else {}


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera; a file holds one, for one resolution that it does not state."""
    where, group = document.name, _group(document.entries)
    refuse_name(camera_name, where)
    matrix = terms.matrix(
        terms.mapping(group["CameraMatrix"], where, "CameraMatrix"), where, _MATRIX, "CameraMatrix."
    )
    distortion = terms.mapping(group.get("Distortion"), where, "Distortion")
    terms.refuse_rest(distortion, _DIST, where, "of Zivid", "Distortion.")
    dist = terms.lens(distortion, where, _DIST, "Distortion.")
    camera = numbers.build_camera(where, ("CameraMatrix", matrix), ("Distortion", dist), None, "pinhole")
    return Reading(
        camera, ("Zivid's intrinsics are an approximation of its own model, for one resolution and aperture",)
    )


FORM = Form("Zivid intrinsics", _recognizes, _read)
