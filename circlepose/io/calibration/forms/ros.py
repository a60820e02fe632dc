"""ROS camera_info: the YAML of camera_calibration, the message as `topic echo` prints it, and parameters of nodes.

The raw image's K and D are used; R and P belong to the rectified image.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from circlepose._arguments import shown
from circlepose.camera.camera import LensModel
from circlepose.camera.lens import PINHOLE_COUNTS
from circlepose.errors import CalibrationError
from circlepose.io.calibration import numbers
from circlepose.io.calibration.document import Document
from circlepose.io.calibration.form import Form, Reading, choose
from circlepose.io.calibration.leftovers import refuse_group, refuse_leftovers
from circlepose.io.calibration.lens_models import lens_model, plain
from circlepose.io.text.validation import some_keys
from circlepose.io.text.yaml import MatrixNode

_DEPTH = 6
_OWN_KEYS = (
    "distortion_coefficients",
    "distortion_model",
    "camera_name",
    "rectification_matrix",
    "projection_matrix",
)
_CHECKED = ("binning_x", "binning_y", "roi", "image_width", "image_height", "width", "height")
_FEW = 5
"""coefficients of plumb_bob; the rational models have more"""


def _recognizes(document: Document) -> bool:
    """Whether the entries are a camera_info: untagged matrices or the message's K, and a named lens model."""
    return bool(_infos(document.entries))


def _read(document: Document, camera_name: str | None) -> Reading:
    """Return the camera of a camera_info; `camera_name`, if given, must be the file's own."""
    where, infos = document.name, _infos(document.entries)
    notes: tuple[str, ...] = ()
    if len(infos) > 1:
        name, notes = choose(list(infos), camera_name, where)
        entries = infos[name]
    else:
        ((name, entries),) = infos.items()
        own = [each for each in (entries.get("camera_name"), name) if isinstance(each, str) and each]
        if camera_name is not None and camera_name not in own:
            only = some_keys(own[:1]) if own else "one without a name"
            raise CalibrationError(f"{where}: holds no camera {camera_name!r}, only {only}.")
    if document.messages > 1:
        notes += (f"the first of {document.messages} messages is taken",)
    inside = f"{where}: {name}" if name else where
    reading = read_info(entries, inside)
    refuse_group(name, inside, reading.camera)
    own_name = entries.get("camera_name")
    return Reading(reading.camera, notes + reading.notes, name=own_name if isinstance(own_name, str) else name)


def read_info(entries: Mapping[str, object], where: str) -> Reading:
    """Return the camera of the keys of one camera_info; raises `CalibrationError`."""
    _check_window(entries, where)
    matrix_key = _first(entries, ("camera_matrix", "K", "k"), where)
    dist_key = _first(entries, ("distortion_coefficients", "D", "d"), where)
    given = numbers.coefficients(entries[dist_key], where, dist_key)
    model, dist, notes = _lens(entries, given, dist_key, where)
    matrix, turned = numbers.turned_matrix(entries[matrix_key], where, matrix_key)
    camera = numbers.build_camera(where, (matrix_key, matrix), (dist_key, dist), _size(entries, where), model)
    used = {matrix_key, dist_key, "distortion_model", "camera_model", "header", *_CHECKED}
    refuse_leftovers(entries, used, where, camera, is_model_stated=_model_name(entries, where)[1] != "")
    return Reading(camera, turned + notes)


def _infos(entries: Mapping[str, object]) -> dict[str, Mapping[str, object]]:
    if _is_info(entries):
        return {"": entries}
    return dict(_nested(entries, "", 0, is_parameters=False))


def _nested(
    entries: Mapping[str, object], name: str, depth: int, *, is_parameters: bool
) -> Iterator[tuple[str, Mapping[str, object]]]:
    """Yield the camera_infos in groups: of a node's parameters, and of messages within other keys."""
    for key, value in entries.items():
        if not isinstance(value, Mapping) or isinstance(value, MatrixNode) or depth == _DEPTH:
            continue
        inside = is_parameters or key == "ros__parameters"
        # The names of nodes count, not `/**` nor the word that all have.
        own = name if key in ("ros__parameters", "/**") else f"{name}/{key}".lstrip("/")
        if _is_info(value) if inside else _is_message(value):
            yield own, value
        else:
            yield from _nested(value, own, depth + 1, is_parameters=inside)


def _is_info(entries: Mapping[str, object]) -> bool:
    matrix = entries.get("camera_matrix")
    if isinstance(matrix, Mapping) and not isinstance(matrix, MatrixNode) and ("data" in matrix or "rows" in matrix):
        return any(key in entries for key in _OWN_KEYS)
    return _is_message(entries)


def _is_message(entries: Mapping[str, object]) -> bool:
    return any(isinstance(entries.get(key), list) for key in ("K", "k")) and "distortion_model" in entries


def _first(entries: Mapping[str, object], keys: tuple[str, ...], where: str) -> str:
    for key in keys:
        if key in entries:
            return key
    raise CalibrationError(
        f"{where}: {keys[0]}: is missing from this camera_info; found {some_keys(map(str, entries))}."
    )


def _lens(
    entries: Mapping[str, object], dist: list[float], dist_key: str, where: str
) -> tuple[LensModel, list[float], tuple[str, ...]]:
    """Return the lens model, its coefficients and a remark where they are of another model than is named."""
    key, name = _model_name(entries, where)
    if name == "" and not any(dist):
        return "pinhole", dist, ()
    model = lens_model(name, where, key)
    if model == "fisheye":
        if len(dist) != 4:
            extra = " (a 0 after them may be removed)" if len(dist) > 4 and not any(dist[4:]) else ""
            raise CalibrationError(
                f"{where}: {dist_key}: the model {name} has 4 coefficients, got {len(dist)}{extra}; correct it, or "
                f"the {key}."
            )
        return model, dist, ()
    is_plumb_bob, is_rational = "plumb" in plain(name), "rational" in plain(name)
    counts = [each for each in PINHOLE_COUNTS if not is_rational or each > _FEW]
    if len(dist) not in counts:
        expected = ", ".join(map(str, counts[:3] if is_plumb_bob else counts))
        raise CalibrationError(
            f"{where}: {dist_key}: the model {name} has {expected} coefficients, got {len(dist)}; correct them, or "
            f"the {key}."
        )
    if is_plumb_bob and len(dist) > _FEW:
        if not any(dist[_FEW:]):
            return model, dist[:_FEW], ()
        note = f"{len(dist)} coefficients, so the lens model is rational_polynomial, not {name}"
        return model, dist, (note,)
    return model, dist, ()


def _model_name(entries: Mapping[str, object], where: str) -> tuple[str, str]:
    """Return the key of the lens model, and its name."""
    for key in ("distortion_model", "camera_model"):
        name = entries.get(key)
        if name is None:
            continue
        if not isinstance(name, str):
            raise CalibrationError(f"{where}: {key}: expected a name such as plumb_bob, got {shown(name)}.")
        return key, name
    raise CalibrationError(
        f"{where}: distortion_model: is missing; expected plumb_bob, rational_polynomial or equidistant."
    )


def _size(entries: Mapping[str, object], where: str) -> tuple[int, int] | None:
    found: list[tuple[str, tuple[int, int]]] = []
    for width, height in (("image_width", "image_height"), ("width", "height")):
        if width in entries and height in entries:
            if entries[width] == 0 and entries[height] == 0:
                continue
            key = f"{width}, {height}"
            found.append((key, numbers.image_size(entries[width], entries[height], where, key)))
    if len({size for _, size in found}) > 1:
        raise CalibrationError(f"{where}: {found[0][0]}, {found[1][0]}: contradict each other; keep the right ones.")
    return found[0][1] if found else None


def _check_window(entries: Mapping[str, object], where: str) -> None:
    """Refuse binning and a region of interest: K then belongs to another image than the one that is seen."""
    roi = entries.get("roi")
    window = {key: entries.get(key, 0) for key in ("binning_x", "binning_y")}
    if isinstance(roi, Mapping):
        window |= {f"roi.{key}": roi.get(key, 0) for key in ("x_offset", "y_offset")}
    for key, value in window.items():
        if value not in (0, 1) if key.startswith("binning") else value != 0:
            raise CalibrationError(
                f"{where}: {key}: is {shown(value)}; images that are binned or cut out are not supported, "
                "calibrate them as they are and leave this key at 0."
            )


FORM = Form("ROS camera_info", _recognizes, _read)
