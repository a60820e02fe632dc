"""What a module of `forms/` has to offer, and what it gives."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from circlepose.camera.camera import Camera
from circlepose.errors import CalibrationError
from circlepose.io.calibration.document import Document
from circlepose.io.text.validation import some_keys


@dataclass(frozen=True, slots=True, eq=False)
class Reading:
    """The camera of a file, in circlepose's conventions."""

    camera: Camera
    notes: tuple[str, ...] = ()
    """remarks for a person: what was chosen, what was converted and by how much, what was not used"""
    keys: Mapping[str, str] = field(default_factory=dict)
    """how the file calls `camera_matrix` and `dist_coeffs`, for messages on their numbers"""
    errors_px: Mapping[str, float] = field(default_factory=dict)
    """the reprojection errors that the file states for this camera, by their keys"""
    name: str = ""
    """by which the camera was asked for, or could be; empty where it has no name"""


@dataclass(frozen=True, slots=True)
class Form:
    """One kind of calibration file."""

    name: str
    """as `circlepose camera` shows it"""
    recognizes: Callable[[Document], bool]
    """Whether a document is of this kind, right or wrong in detail. Quick, and raises nothing."""
    read: Callable[[Document, str | None], Reading]
    """Takes a document that is recognized, and the name of one of its cameras (None: the first).

    Raises `CalibrationError`: file, key or line, what was given, what is expected, what to do.
    """
    is_generic: bool = False
    """Whether other forms that recognize the document go first: those of keys that many tools share"""
    has_target: bool = True
    """Whether `target:` in its files is ours, to be measured"""


def choose(names: Sequence[str], camera_name: str | None, where: str) -> tuple[str, tuple[str, ...]]:
    """Return the name that is asked for, or else the first with a remark; raises `CalibrationError` on another."""
    if camera_name is None:
        several = len(names) > 1
        return names[0], (f"{names[0]} taken, of the {len(names)} cameras {some_keys(names)}",) if several else ()
    for name in names:
        if name.lower() == camera_name.lower():
            return name, ()
    raise CalibrationError(f"{where}: holds no camera {camera_name!r}; its cameras are {some_keys(names)}.")


def refuse_name(camera_name: str | None, where: str) -> None:
    """Raise `CalibrationError` where a camera is asked for by name, of a form without names."""
    if camera_name is not None:
        raise CalibrationError(f"{where}: holds one camera, without a name; leave out the name {camera_name!r}.")
