"""Calibration files -> `Camera`, whatever tool wrote them; the form is recognized by the content, not by the name.

The camera is in OpenCV's conventions: an integer pixel coordinate is a pixel's center.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from circlepose._arguments import shown
from circlepose.camera.camera import Camera
from circlepose.camera.plausibility import Doubt, doubts, reprojection_doubts
from circlepose.errors import CalibrationError
from circlepose.io.atomic import atomic_writer
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import read_document
from circlepose.io.calibration.form import Reading
from circlepose.io.calibration.lens_models import plain
from circlepose.io.calibration.registry import form_of
from circlepose.io.calibration.writers.opencv import storage_entries
from circlepose.io.calibration.writers.storage_syntax import yaml_text
from circlepose.io.text.escaping import printable
from circlepose.io.text.source import Source

_Entries = Mapping[str, object]

# As compared: in lower case without separators.
_KEYS = {
    "camera_matrix": re.compile(r"(?:camera|intrinsic)?matrix.*|intrinsics?|mtx|[km][0-9]?|fx"),
    "dist_coeffs": re.compile(r"dist(?:ortion)?coeff?(?:icient)?s?.*|d[0-9]?"),
}
_REPROJECTION_ERROR = re.compile(
    r"(?:avg|mean|rms|total)?reproj(?:ection)?(?:err(?:or)?|rms)(?:px)?|rms(?:err(?:or)?)?(?:px)?|avgerr(?:or)?"
)


@dataclass(frozen=True, slots=True, eq=False)
class CameraFile:
    """A camera and where it came from."""

    camera: Camera
    form: str
    """name of one of `registry.FORMS`"""
    path: Path
    target: Mapping[str, object] | None = None
    """the file's `target:` as it stands, for `target_file.target_from_mapping`"""
    notes: tuple[str, ...] = ()
    """remarks for a person: what was chosen, what is missing"""
    doubts: tuple[Doubt, ...] = ()
    """what looks wrong, the grave first"""
    name: str = ""
    """what the file calls this camera, where it has names; empty where it has none"""

    def refuse_grave(self, insist: str = "set force_calibration") -> None:
        """Raise `CalibrationError` on what no camera has: file, key, what it looks like and how to `insist`."""
        for doubt in self.doubts:
            if doubt.is_grave:
                path = printable(str(self.path))
                raise CalibrationError(
                    f"{path}: {doubt.about}: {doubt.text}. To measure with it all the same, {insist}."
                )


def read_camera(source: Source) -> Camera:
    """Read the camera of a calibration file.

    Parameters
    ----------
    source
        A path, the bytes of a file, or an open handle; in a form that `read_camera_file` reads.

    Returns
    -------
    The camera; of a file of several cameras the first.

    Raises
    ------
    CalibrationError
        One sentence: the file, the key, what is expected and what to do.
    """
    return read_camera_file(source).camera


def read_camera_file(source: Source, camera_name: str | None = None) -> CameraFile:
    """Read a calibration file of any supported form (a path, bytes or an open handle).

    Parameters
    ----------
    source
        OpenCV FileStorage, ROS camera_info, Kalibr camchain, our own YAML, and all of `registry.FORMS`.
    camera_name
        Which camera to take from a file of several (`cam1`, `M2`); by default the first.

    Returns
    -------
    The camera, with the name of the form, the file's `target:`, remarks, and what looks wrong.

    Raises
    ------
    CalibrationError
        One sentence: the file, the key, what is expected and what to do.
    """
    try:
        return _read(source, camera_name)
    except CalibrationError as error:
        # A key or a file's name may hold what would steer a terminal, or a line end.
        raise CalibrationError(printable(str(error))) from None


def _read(source: Source, camera_name: str | None) -> CameraFile:
    document = read_document(source)
    form = form_of(document)
    entries, name = document.entries, document.name
    target = entries.get("target") if form.has_target else None
    if target is not None and not isinstance(target, Mapping):
        raise CalibrationError(f"{name}: target: expected a mapping such as {{radius_mm: 60}}, got {shown(target)}.")
    reading = form.read(document, camera_name)
    found = sorted(_doubts(reading, entries, camera_name, name), key=lambda doubt: not doubt.is_grave)
    shown_doubts = tuple(replace(each, about=printable(each.about), text=printable(each.text)) for each in found)
    notes = tuple(map(printable, reading.notes))
    own_name = printable(reading.name or camera_name or "")
    return CameraFile(reading.camera, form.name, Path(name), target, notes, shown_doubts, own_name)


def write_camera(camera: Camera, path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Write a camera as OpenCV FileStorage YAML, every float to the last bit.

    A skew is kept for `read_camera`; OpenCV's own functions pass over it. Other forms: `writers.conversion.convert`.

    Parameters
    ----------
    camera
        The camera, with its image size (px) and its sigma (px) where these are known.
    path
        The file to write.
    overwrite
        Whether to replace a file that circlepose did not write.

    Raises
    ------
    OutputError
        Where the file cannot be written, or exists and is not circlepose's.
    """
    with atomic_writer(path, overwrite=overwrite) as handle:
        handle.write(yaml_text(storage_entries(camera)))


def _doubts(reading: Reading, entries: _Entries, camera_name: str | None, where: str) -> Iterator[Doubt]:
    """Yield what looks wrong, under the keys that the file has for it."""
    errors_px = {
        key: numbers.number(value, where, key)
        for key, value in entries.items()
        if isinstance(value, int | float)
        and not isinstance(value, bool)
        and _REPROJECTION_ERROR.fullmatch(plain(key))
    }
    for key, error_px in {**errors_px, **reading.errors_px}.items():
        yield from (replace(doubt, about=key) for doubt in reprojection_doubts(error_px, reading.camera))
    for doubt in doubts(reading.camera):
        yield replace(doubt, about=reading.keys.get(doubt.about) or _own_key(entries, doubt.about, camera_name))


def _own_key(entries: _Entries, about: str, camera_name: str | None) -> str:
    """Return how the file calls a value, of several cameras that of the one which was asked for."""
    pattern = _KEYS.get(about)
    if pattern is None:
        return about
    inner = [(group, key) for group, value in entries.items() if isinstance(value, Mapping) for key in value]
    keys = [key for key in entries if pattern.fullmatch(plain(key))]
    keys += [f"{group}.{key}" for group, key in inner if pattern.fullmatch(plain(str(key)))]
    asked = [key for key in keys if camera_name is not None and camera_name.lower() in key.lower()]
    return next(iter((*asked, *keys)), about)
