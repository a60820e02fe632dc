"""Agisoft Metashape and PhotoScan: the XML of a calibration, or of a project's cameras; and that of Agisoft Lens.

The center of the top left pixel is (0.5, 0.5). Today's files (f) state the principal point from the image's center,
and their p1 is OpenCV's p2. Former ones (fx, fy, skew) state it from the corner, and their p1 is OpenCV's.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias
from xml.etree import ElementTree

from circlepose._arguments import shown
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose, refuse_name
from circlepose.io.calibration.terms import rows

_Numbers: TypeAlias = Mapping[str, float]
_SIGNATURE = re.compile(
    r"(?:<\?xml[^>]{0,200}\?>)?\s{0,20}(?:<!--.{0,2000}?-->\s{0,20})?<(calibration|document)\b", re.DOTALL
)
_TERM = re.compile(r"f|fx|fy|cx|cy|skew|[bkps]\d{1,2}")
_KNOWN = {"f", "fx", "fy", "cx", "cy", "skew", "b1", "b2", "k1", "k2", "k3", "k4", "p1", "p2", "p3", "p4"}
_AGAIN = "optimize the cameras again without it, or export undistorted images with their calibration"


@dataclass(frozen=True, slots=True)
class _Lens:
    """One calibration of the file."""

    node: ElementTree.Element
    size: tuple[object, object]
    """width and height as they stand"""
    projection: str


def _recognizes(document: Document) -> bool:
    """Whether the text is XML with `<calibration>` at its root, or a Metashape document with sensors."""
    text = document.text
    start = None if text is None else _SIGNATURE.match(text.lstrip())
    if start is None or text is None:
        return False
    return start[1] == "calibration" or "<sensor" in text


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a calibration, or of the sensor `camera_name` (its label or id) of a document."""
    where = document.name
    root = _parse((document.text or "").lstrip(), where)
    if root.tag == "calibration":
        refuse_name(camera_name, where)
        return _reading(_lens(root, root, where), where, ())
    sensors = _sensors(root)
    if not sensors:
        raise CalibrationError(f"{where}: holds no sensor with a calibration; align the cameras, then export again.")
    name, notes = choose(list(sensors), camera_name, where)
    return _reading(_lens(*sensors[name], where), f"{where}: {name[:80]}", notes)


def _parse(text: str, where: str) -> ElementTree.Element:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise CalibrationError(f"{where}: declares a document type or entities, which are not read; remove them.")
    try:
        return ElementTree.fromstring(text)
    except ElementTree.ParseError as reason:
        raise CalibrationError(f"{where}: is not valid XML ({reason}).") from None
    except (RecursionError, ValueError, LookupError):
        raise CalibrationError(f"{where}: is not XML that can be read; export it again.") from None


def _sensors(root: ElementTree.Element) -> dict[str, tuple[ElementTree.Element, ElementTree.Element]]:
    """Return (calibration, sensor) by label; of two calibrations the adjusted one."""
    found: dict[str, tuple[ElementTree.Element, ElementTree.Element]] = {}
    for sensor in root.iter("sensor"):
        calibrations = sensor.findall("calibration")
        adjusted = [each for each in calibrations if each.get("class") == "adjusted"]
        if not calibrations:
            continue
        label = sensor.get("label") or sensor.get("id") or "sensor"
        if label in found:
            label = f"{label} {sensor.get('id') or len(found)}"
        found[label] = ((adjusted or calibrations)[0], sensor)
    return found


def _lens(node: ElementTree.Element, sensor: ElementTree.Element, where: str) -> _Lens:
    resolution = next(
        (each for each in (node.find("resolution"), sensor.find("resolution")) if each is not None), None
    )
    if resolution is not None:
        size: tuple[object, object] = (resolution.get("width"), resolution.get("height"))
    else:
        size = (node.findtext("width"), node.findtext("height"))
    projection = node.findtext("projection") or node.get("type") or sensor.get("type") or "frame"
    if None in size:
        raise CalibrationError(f"{where}: width, height: are missing; export the calibration again.")
    return _Lens(node, size, projection.strip())


def _reading(lens: _Lens, where: str, notes: tuple[str, ...]) -> Reading:
    terms = _terms(lens.node, where)
    width, height = (_number(each, where, "width, height") for each in lens.size)
    size = numbers.image_size(width, height, where, "width, height")
    if lens.projection not in ("frame", "fisheye", "equidistant_fisheye"):
        raise CalibrationError(
            f"{where}: projection: is {shown(lens.projection)}; only frame and (equidistant) fisheye cameras are "
            "supported, so set the camera type to one of these and align again."
        )
    if "f" in terms:
        if terms.get("skew") or "fx" in terms or "fy" in terms:
            raise CalibrationError(
                f"{where}: f: stands beside fx, fy or skew, of a former version; keep one of them."
            )
        return _of_today(terms, size, where, notes, is_fisheye=lens.projection != "frame")
    if "fx" not in terms or "fy" not in terms:
        raise CalibrationError(f"{where}: f: is missing, the focal length in px; export the calibration again.")
    if lens.projection != "frame":
        raise CalibrationError(f"{where}: projection: fx and fy of a former version are supported for frame alone.")
    return _of_former(terms, size, where, notes)


def _of_today(
    terms: _Numbers, size: tuple[int, int], where: str, notes: tuple[str, ...], *, is_fisheye: bool
) -> Reading:
    _refuse(terms, ("p3", "p4"), where)
    f, cx, cy, b1, b2 = (terms.get(key, 0.0) for key in ("f", "cx", "cy", "b1", "b2"))
    k1, k2, k3, k4, p1, p2 = (terms.get(key, 0.0) for key in ("k1", "k2", "k3", "k4", "p1", "p2"))
    dx, dy = 0.5 * size[0] - 0.5, 0.5 * size[1] - 0.5
    matrix = rows(f + b1, f, cx + dx, cy + dy, b2)
    notes += (
        f"cx, cy moved by ({dx:.12g}, {dy:.12g}) px: Metashape states them from the image's center, and the center "
        "of its top left pixel is (0.5, 0.5)",
    )
    if b1 or b2:
        notes += ("b1 is part of fx, and b2 is the skew",)
    if is_fisheye:
        _refuse(terms, ("p1", "p2"), where)
        dist = [k1, k2, k3, k4]
    else:
        _refuse(terms, ("k4",), where)
        dist = [k1, k2, p2, p1, k3]
        if p1 or p2:
            notes += ("p1 and p2 exchanged: Metashape's p1 is OpenCV's p2",)
    model = "fisheye" if is_fisheye else "pinhole"
    camera = numbers.build_camera(where, ("f, cx, cy", matrix), ("k1 to k4, p1, p2", dist), size, model)  # type: ignore[arg-type]
    return Reading(camera, notes)


def _of_former(terms: _Numbers, size: tuple[int, int], where: str, notes: tuple[str, ...]) -> Reading:
    _refuse(terms, ("b1", "b2", "k4", "p3", "p4"), where)
    fx, fy, cx, cy, skew = (terms.get(key, 0.0) for key in ("fx", "fy", "cx", "cy", "skew"))
    dist = [terms.get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3")]
    matrix = rows(fx, fy, cx - 0.5, cy - 0.5, skew)
    camera = numbers.build_camera(where, ("fx, fy, cx, cy", matrix), ("k1 to k3, p1, p2", dist), size, "pinhole")
    return Reading(camera, (*notes, "cx, cy moved by -0.5 px: the center of Agisoft's top left pixel is (0.5, 0.5)"))


def _refuse(terms: _Numbers, keys: tuple[str, ...], where: str) -> None:
    for key in keys:
        if terms.get(key):
            raise CalibrationError(
                f"{where}: {key}: is {terms[key]:g}, a term that OpenCV's lens models do not have; {_AGAIN}."
            )


def _terms(node: ElementTree.Element, where: str) -> dict[str, float]:
    """Return the numbers of a calibration by name; refuse one that is given twice, or of which nothing is known."""
    found: dict[str, float] = {}
    for child in node:
        if not _TERM.fullmatch(child.tag):
            continue
        if child.tag in found:
            raise CalibrationError(f"{where}: {child.tag}: is given twice; remove one.")
        found[child.tag] = _number(child.text, where, child.tag)
        if child.tag not in _KNOWN:
            _refuse(found, (child.tag,), where)
    return found


def _number(value: object, where: str, key: str) -> float:
    try:
        return float(str(value).strip())
    except ValueError:
        raise CalibrationError(f"{where}: {key}: expected a number, got {shown(value)}.") from None


FORM = Form("Metashape", _recognizes, _read)
