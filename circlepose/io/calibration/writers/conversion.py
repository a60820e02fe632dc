"""A calibration that was read, as a file of another form: exactly, or refused with what would be lost."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from circlepose._typing import frozen
from circlepose.camera.camera import EXACT, Camera
from circlepose.errors import CalibrationError
from circlepose.io.calibration.reader import CameraFile
from circlepose.io.calibration.writers import WrittenForm
from circlepose.io.calibration.writers.lens_choice import exact_lens, refusal
from circlepose.io.calibration.writers.registry import WRITERS
from circlepose.io.calibration.writers.writer import NAME, SIGMA, TARGET, Contents, Lens, Writer
from circlepose.io.target_file import target_from_mapping, target_to_mapping
from circlepose.io.text.escaping import printable


@dataclass(frozen=True, slots=True)
class Conversion:
    """A calibration file to be written."""

    text: str
    """the whole file"""
    form: str
    """its name, as `circlepose camera` shows it"""
    lens: str
    """its lens model, as the form calls it"""
    remarks: tuple[str, ...]
    """for a person: what was converted or filled in, and what the form has no place for"""


def convert(camera_file: CameraFile, to: WrittenForm, ending: str = "") -> Conversion:
    """Return a calibration as a file of another form.

    Parameters
    ----------
    camera_file
        The calibration, as `read_camera_file` returns it.
    to
        The form, one of `registry.WRITERS`.
    ending
        Of the file's name, such as `.xml`: OpenCV has several syntaxes.

    Returns
    -------
    The text and what to say about it. Read back, it projects every point to the same pixel.

    Raises
    ------
    CalibrationError
        One sentence, where the form has no model that holds the camera exactly: how far its nearest is off (px), and
        which forms hold it; where the form needs an image size that the calibration does not state.
    TargetError
        Where the calibration's `target:` is none.
    """
    writer, camera = WRITERS[to], camera_file.camera
    where = printable(str(camera_file.path))
    if writer.needs_size and camera.image_size is None:
        raise CalibrationError(
            f"{where}: states no image size, which {writer.name} needs; convert it --to circlepose, add image_size: "
            "[width, height] to that file, and convert that one."
        )
    lens = exact_lens(camera, writer)
    if lens is None:
        raise refusal(camera, writer, WRITERS.values(), where)
    target = None
    if camera_file.target is not None and TARGET in writer.holds:
        target = target_to_mapping(target_from_mapping(camera_file.target, f"{where}: target"))
    contents = Contents(_fitted(camera, lens, writer), lens, camera_file.name, target, ending)
    reason = writer.refusal(contents)
    if reason is not None:
        raise CalibrationError(f"{where}: {writer.name} {reason}; give another form.")
    remarks = (*writer.remarks(contents), *_left_out(camera_file, writer))
    return Conversion(writer.text(contents), writer.name, lens.name, tuple(map(printable, remarks)))


def _fitted(camera: Camera, lens: Lens, writer: Writer) -> Camera:
    """Return the camera with as many coefficients as the lens model has."""
    coefficients = np.zeros(lens.count)
    kept = camera.dist_coeffs[: lens.count]
    coefficients[: len(kept)] = kept
    sigma = camera.sigma if SIGMA in writer.holds else EXACT
    return replace(camera, dist_coeffs=frozen(coefficients), sigma=sigma)


def _left_out(camera_file: CameraFile, writer: Writer) -> Iterator[str]:
    """Yield what the form has no place for, and what to do."""
    sigma = camera_file.camera.sigma
    if sigma != EXACT and SIGMA not in writer.holds:
        yield (
            f"not written: how well the camera is known ({sigma.focal_px:g} px, {sigma.center_px:g} px), for which "
            f"{writer.name} has no place; give estimate --camera-sigma {sigma.focal_px:g},{sigma.center_px:g}"
        )
    if camera_file.target is not None and TARGET not in writer.holds:
        yield f"not written: target, for which {writer.name} has no place; put it into a file for estimate --target"
    if camera_file.name and NAME not in writer.holds:
        yield f"not written: the camera's name {camera_file.name}, for which {writer.name} has no place"
