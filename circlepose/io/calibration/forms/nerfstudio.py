"""transforms.json of nerfstudio and instant-ngp: one lens for all frames, or one with each frame.

The center of the top left pixel is (0.5, 0.5), as COLMAP has it, from which these files are made.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers, terms
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose, refuse_name
from circlepose.io.calibration.keys import truth
from circlepose.io.calibration.leftovers import refuse_leftovers
from circlepose.io.calibration.lens_models import lens_model

_PERSPECTIVE = ("PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV", "PERSPECTIVE")
_FOCAL = ("fl_x", "camera_angle_x")
_BEYOND = ("k5", "k6", "distortion_params", "ftheta_p0", "latlong")
"""terms of models that circlepose does not have"""
_HALF_PIXEL = "cx, cy moved by -0.5 px: the center of nerfstudio's top left pixel is (0.5, 0.5)"
_WIDEST = math.pi


def _recognizes(document: Document) -> bool:
    """Whether the entries hold frames, and a focal length above or within them."""
    frames = document.entries.get("frames")
    if not isinstance(frames, list):
        return False
    first = frames[0] if frames and isinstance(frames[0], Mapping) else {}
    return any(key in entries for key in _FOCAL for entries in (document.entries, first))


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera; where each frame has its own, that of the frame `camera_name` (its image) or the first."""
    where, entries = document.name, document.entries
    frames = entries["frames"]
    if any(key in entries for key in _FOCAL) or not isinstance(frames, list):
        refuse_name(camera_name, where)
        return _reading(entries, where, ())
    by_name: dict[str, Mapping[str, object]] = {}
    for number, frame in enumerate(frames):
        if not isinstance(frame, Mapping):
            raise CalibrationError(f"{where}: frames[{number}]: expected a frame, got {shown(frame)}.")
        by_name.setdefault(str(frame.get("file_path", number)), frame)
    lenses = {name: {**entries, **frame} for name, frame in by_name.items()}
    name, notes = choose(list(by_name), camera_name, where)
    return _reading(lenses[name], f"{where}: {name[:80]}", notes)


def _reading(entries: Mapping[str, object], where: str, notes: tuple[str, ...]) -> Reading:
    size = None
    if "w" in entries or "h" in entries:
        size = numbers.image_size(entries.get("w"), entries.get("h"), where, "w, h")
    for key in _BEYOND:
        if entries.get(key):
            raise CalibrationError(
                f"{where}: {key}: is a term of a lens model that circlepose does not have; write the file again with "
                "camera_model OPENCV or OPENCV_FISHEYE."
            )
    model = _model(entries, where)
    (fx, fy), focal_notes = _focal_lengths(entries, size, where)
    (cx, cy), center_notes = _center(entries, size, where)
    dist, dist_notes = _coefficients(entries, model, where)
    matrix = terms.rows(fx, fy, cx, cy)
    camera = numbers.build_camera(where, ("fl_x, fl_y, cx, cy", matrix), ("k1 to k4, p1, p2", dist), size, model)
    refuse_leftovers(entries, _KNOWN, where, camera, is_model_stated="camera_model" in entries)
    return Reading(camera, notes + focal_notes + center_notes + dist_notes)


def _model(entries: Mapping[str, object], where: str) -> LensModel:
    word = entries.get("camera_model")
    if word is None:
        return "fisheye" if truth(entries.get("is_fisheye")) else "pinhole"
    return "pinhole" if word in _PERSPECTIVE else lens_model(word, where, "camera_model")


def _focal_lengths(
    entries: Mapping[str, object], size: tuple[int, int] | None, where: str
) -> tuple[tuple[float, float], tuple[str, ...]]:
    if "fl_x" in entries:
        fx = numbers.number(entries["fl_x"], where, "fl_x")
        return (fx, numbers.number(entries.get("fl_y", fx), where, "fl_y")), ()
    if size is None:
        raise CalibrationError(
            f"{where}: w, h: are missing, so camera_angle_x gives no focal length; add fl_x in px."
        )
    fx = _from_angle(entries, "camera_angle_x", size[0], where)
    fy = _from_angle(entries, "camera_angle_y", size[1], where) if "camera_angle_y" in entries else fx
    return (fx, fy), ("fl_x is missing; the focal length comes from camera_angle_x",)


def _from_angle(entries: Mapping[str, object], key: str, length: int, where: str) -> float:
    angle = numbers.number(entries.get(key), where, key)
    if not 0.0 < angle < _WIDEST:
        raise CalibrationError(f"{where}: {key}: expected an angle of view between 0 and pi, in rad, got {angle:g}.")
    return 0.5 * length / math.tan(0.5 * angle)


def _center(
    entries: Mapping[str, object], size: tuple[int, int] | None, where: str
) -> tuple[tuple[float, float], tuple[str, ...]]:
    if "cx" in entries or "cy" in entries:
        cx, cy = (numbers.number(entries.get(key), where, key) for key in ("cx", "cy"))
        return (cx - 0.5, cy - 0.5), (_HALF_PIXEL,)
    if size is None:
        raise CalibrationError(f"{where}: cx, cy: are missing; add the principal point in px.")
    center = (0.5 * size[0] - 0.5, 0.5 * size[1] - 0.5)
    return center, ("cx, cy are missing; the principal point is taken at the image's center",)


def _coefficients(entries: Mapping[str, object], model: LensModel, where: str) -> tuple[list[float], tuple[str, ...]]:
    k1, k2, k3, k4, p1, p2 = (numbers.number(entries.get(key, 0.0), where, key) for key in _TERMS)
    if model == "fisheye":
        notes = ("p1, p2 are not used: OPENCV_FISHEYE has k1, k2, k3, k4",) if p1 or p2 else ()
        return [k1, k2, k3, k4], notes
    if k4:
        raise CalibrationError(
            f"{where}: k4: is {k4:g}, a term in r^8 that OpenCV's pinhole models do not have; estimate the lens "
            "again without k4, or set camera_model: OPENCV_FISHEYE if it is a fisheye lens."
        )
    return [k1, k2, p1, p2, k3], ()


_TERMS = ("k1", "k2", "k3", "k4", "p1", "p2")
_OF_SCENE = ("frames", "scale", "offset", "aabb_scale", "file_path", "mask_path", "depth_file_path", "ply_file_path")
_KNOWN = {*_TERMS, *_BEYOND, *_FOCAL, *_OF_SCENE, "fl_y", "camera_angle_y", "cx", "cy", "w", "h", "camera_model"}

FORM = Form("nerfstudio transforms", _recognizes, _read)
