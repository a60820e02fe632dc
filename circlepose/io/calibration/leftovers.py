"""Keys that nothing was done with, though they change the camera: they are refused by name.

Distortion, a lens model, a unit, a crop or scale, the place of pixel (0, 0), and the shape of a pixel. A value that
changes nothing passes: 0, a scale of 1, px.
"""

from __future__ import annotations

import math
import re
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace

from circlepose._arguments import shown
from circlepose.camera.camera import Camera
from circlepose.errors import CalibrationError
from circlepose.io.calibration.cameras import fields_of
from circlepose.io.calibration.keys import (
    COEFFICIENTS,
    DISTORTION_ROLES,
    Field,
    is_neutral,
    looks_like_distortion,
    says_fisheye,
    truth,
)
from circlepose.io.calibration.lens_models import is_lens_model, known_model, plain
from circlepose.io.text.validation import brief

_FISHEYE_ORDER = ("k1", "k2", "k3", "k4")
_MOST_OF_ORDER = 200
_COEFFICIENT = re.compile(r"(?<![a-z0-9])(?:k[1-9]|p[1-9]|s[1-4]|tau_?[xy])(?![a-z0-9])", re.IGNORECASE)
_NAME_OF = re.compile(
    r".*(?:name|frame|frameid|topic|file|path|url|uri|dir|folder|note|notes|comments?|description|title|label|id)s?|"
    r"serial.*"
)
"""keys whose text names something; a lens model that is stated elsewhere counts before it"""
_OF_LENS = r"(?:focal(?:length)?|camera|cam|image|pixels?|principalpoint|intrinsics?|matrix|calib(?:ration)?)?"
_UNIT = re.compile(_OF_LENS + r"(?:length)?units?")
_OF_UNIT = re.compile(r"focal.*|principal.*|intrinsic.*|camera.*|pixel.*|[fc][xy]|k")
_NORMALIZED = re.compile(r"(?:is|are)?normali[sz]ed(?:intrinsics?|focal(?:length)?|coordinates?|camera)?")
_SCALE = re.compile(
    r"(?:image|img|resolution|res|intrinsics?|focal(?:length)?|camera|cam|pixel|px|matrix|k|input|calib(?:ration)?)?"
    r"(?:scale|scaling|resize|rescale)(?:factor|ratio|[xy])?|(?:down|sub|up)(?:sampl|scal)(?:e|ed|ing)?(?:factor)?|"
    r"decimat(?:e|ion)(?:factor)?|(?:horizontal|vertical|sensor|pixel|[hvxy])?binning(?:factor|[xyhv])?|"
    r"bin[xyhv]|digitalzoom|(?:input)?(?:horizontal|vertical|[xy])stretch"
)
_LARGEST_SCALE = 64.0
"""beyond it, and below 1 / 64, a scale is one of depths or lengths"""
_WINDOW = re.compile(
    r"(?:image|sensor|cam(?:era)?)?(?:roi|aoi|crop(?:ping|rect|region|box|window|ped)?)"
    r"(?:x|y|left|top|x0|y0|xmin|ymin|offsetx?|offsety|xoffset|yoffset)?|(?:image|sensor)?(?:offset[xy]|[xy]offset)"
)
_CORNER = re.compile(r"(?:x|y|x0|y0|left|top|xmin|ymin|offsetx|offsety|xoffset|yoffset)")
_NEW_MATRIX = re.compile(r"(?:new|optimal|rect|undist).*")
"""beside these a region of interest is that of the undistorted image, as cv2.getOptimalNewCameraMatrix returns it"""
_ORIGIN = re.compile(
    r"(?:pixels?|px|coordinates?|subpixel)(?:origin|cent(?:er|re)|convention|index(?:ing)?|base|shift|offset)|"
    r"(?:image|img|principalpoint)(?:origin|offset|shift)|halfpixel.*|indexbase|onebased.*"
)
_ASPECT = re.compile(r"(?:pixel|px|image|img|focal|camera|sensor|fixed)?aspect(?:ratio)?|pixelratio")
_PLAIN_WORDS = {
    *("", "0", "1", "none", "no", "off", "false", "full", "1x1", "11", "null", "px", "pix", "pixel", "pixels"),
    *("center", "centre", "opencv", "integer", "zero", "topleft", "upperleft"),
}
"""texts that change nothing, as units, scales and origins"""


def refuse_leftovers(
    entries: Mapping[str, object],
    used: Container[str],
    where: str,
    camera: Camera,
    prefix: str = "",
    *,
    is_model_stated: bool = False,
) -> None:
    """Raise `CalibrationError` on a key not `used` that changes the camera.

    A form passes the keys that it has read, and those of its own that do not matter; `is_model_stated` where the
    file names its lens model, so that the name of a camera or of a file does not count.
    """
    rest = {key: value for key, value in entries.items() if key not in used}
    fields = (replace(each, path=prefix + each.path) for each in fields_of(rest))
    refuse_unused(tuple(fields), where, camera, is_model_stated=is_model_stated)


def refuse_group(name: str, where: str, camera: Camera) -> None:
    """Raise `CalibrationError` where the group of keys of a pinhole camera is called a fisheye's."""
    if camera.model == "pinhole" and says_fisheye(Field(name, "", "", True)):
        raise CalibrationError(
            f"{where}: the name of the group states a fisheye lens, but its keys a pinhole camera; correct the lens "
            "model, or rename the group."
        )


def refuse_unused(fields: Sequence[Field], where: str, camera: Camera, *, is_model_stated: bool) -> None:
    """Raise `CalibrationError` on the first of `fields`, of which nothing was used, that changes the camera."""
    is_new = any(_NEW_MATRIX.fullmatch(field.name) for field in fields)
    for field in fields:
        for why in _reasons(field, camera, is_model_stated, is_new):
            raise CalibrationError(f"{where}: {brief(field.path)}: {why}.")


def refuse_order(fields: Iterable[Field], where: str, camera: Camera) -> None:
    """Raise `CalibrationError` where names of coefficients stand in another order than OpenCV's."""
    for field in fields:
        names = _names_of(field)
        order = _FISHEYE_ORDER if camera.model == "fisheye" else tuple(map(plain, COEFFICIENTS))
        if names and tuple(names) != order[: len(names)]:
            raise CalibrationError(
                f"{where}: {brief(field.path)}: states the order {', '.join(names)}; the coefficients are read in "
                f"OpenCV's, {', '.join(order[:5])}; write them so."
            )


def _names_of(field: Field) -> list[str]:
    value = field.value
    if isinstance(value, list):
        if not value or not all(isinstance(each, str) for each in value[:_MOST_OF_ORDER]):
            return []
        value = " ".join(value[:_MOST_OF_ORDER])
    if not isinstance(value, str) or len(value) > _MOST_OF_ORDER:
        return []
    names = [plain(each) for each in _COEFFICIENT.findall(value)]
    is_only = not plain(_COEFFICIENT.sub("", value))
    return names if len(names) > 1 and (is_only or field.role == "model" or looks_like_distortion(field)) else []


def _reasons(field: Field, camera: Camera, is_model_stated: bool, is_new: bool) -> Iterator[str]:
    """Yield why a key that was not used matters, and what to do, as the end of a sentence."""
    value, name = field.value, field.name
    given = shown(value)
    is_distortion = field.role in (*DISTORTION_ROLES, "stray") or looks_like_distortion(field)
    if is_distortion and (is_something(value) or _is_table(field)):
        yield f"looks like distortion ({given}), and files of this form have it elsewhere; move it, or remove it"
    if field.role in ("skew", "alpha") and is_something(value):
        yield f"is a skew of {given}, which is not read from files of this form; give camera_matrix and dist_coeffs"
    if camera.model == "pinhole" and says_fisheye(field) and not (is_model_stated and _NAME_OF.fullmatch(name)):
        yield (
            f"states a fisheye lens ({given}), and the file was read as a pinhole camera; name the lens model "
            "(model: fisheye with K and D), or remove this key"
        )
    if _states_other_model(field, camera):
        yield f"states the lens model {given}, but the file was read as {camera.model}; correct it, or remove it"
    if _is_other_unit(field):
        yield f"states the unit {given}; expected fx, fy, cx, cy in px; convert them, or remove this key"
    if _SCALE.fullmatch(name) and _is_scale(value):
        yield f"is {given}; scaled or binned images are not supported; give the camera of the images as they are"
    if _WINDOW.fullmatch(name) and _is_window(value) and not (is_new and isinstance(value, list)):
        yield f"is {given}; images that are cut out are not supported; give the camera of the images as they are"
    if _ORIGIN.fullmatch(name) and _is_origin(value):
        yield (
            f"is {given}; expected cx, cy with (0, 0) at the center of the top left pixel; convert them, and remove "
            "this key"
        )
    if _ASPECT.fullmatch(name) and _is_aspect(name, value, camera):
        yield f"is {given}; expected square pixels, or fx and fy; give fx and fy in px, and remove this key"


def _is_table(field: Field) -> bool:
    """Whether a text may hold the distortion, as a table in base64 does; not the names of its parts, nor a file's."""
    value = field.value
    if not isinstance(value, str) or field.role == "model" or _names_of(field) or _NAME_OF.fullmatch(field.name):
        return False
    return not _is_plain(value) and truth(value) is None


def _states_other_model(field: Field, camera: Camera) -> bool:
    if field.role != "model" or not isinstance(field.value, str) or is_neutral(field.value):
        return False
    model = known_model(field.value)
    if model is not None:
        return model != camera.model
    # A camera model that is no lens model may be the name of a device.
    return "dist" in field.name or is_lens_model(field.value)


def _is_other_unit(field: Field) -> bool:
    *groups, _ = [plain(part) for part in field.path.split(".")]
    is_unit = _UNIT.fullmatch(field.name) or (
        any(map(_UNIT.fullmatch, groups[-1:])) and _OF_UNIT.fullmatch(field.name)
    )
    if is_unit:
        return not _is_plain(field.value)
    return _NORMALIZED.fullmatch(field.name) is not None and not is_neutral(field.value)


def _is_scale(value: object) -> bool:
    if isinstance(value, list):
        return any(map(_is_scale, value))
    number = _number(value)
    if number is None or number == 0.0:
        return isinstance(value, str) and not _is_plain(value)
    return number != 1.0 and 1.0 / _LARGEST_SCALE <= abs(number) <= _LARGEST_SCALE


def _is_window(value: object) -> bool:
    if isinstance(value, Mapping):
        return any(not is_neutral(each) for key, each in value.items() if _CORNER.fullmatch(plain(str(key))))
    if isinstance(value, list):
        return any(not is_neutral(each) for each in value[:2])
    return not is_neutral(value)


def _is_origin(value: object) -> bool:
    return not (is_neutral(value) or (isinstance(value, str) and _is_plain(value) and value.strip() != "1"))


def _is_aspect(name: str, value: object, camera: Camera) -> bool:
    """Whether the pixels are not square, and fx and fy do not show it."""
    if isinstance(value, str) and ":" in value:
        first, _, second = value.partition(":")
        sides = _number(first), _number(second)
        ratio = sides[0] / sides[1] if sides[0] and sides[1] else None
    else:
        ratio = _number(value)
    if not ratio or isinstance(value, bool):
        return isinstance(value, list | Mapping) and not is_neutral(value)
    fx, fy = float(camera.camera_matrix[0, 0]), float(camera.camera_matrix[1, 1])
    same = [1.0, fx / fy, fy / fx]
    if camera.image_size is not None and "pixel" not in name and name != "px":
        width, height = camera.image_size
        same += [width / height, height / width]
    return not any(math.isclose(ratio, each, rel_tol=1e-3) for each in same)


def _is_plain(value: object) -> bool:
    if isinstance(value, str):
        return plain(value) in _PLAIN_WORDS
    return is_neutral(value) or value == 1


def _number(value: object) -> float | None:
    if isinstance(value, bool):
        return None
    try:
        number = float(value) if isinstance(value, int | float | str) else math.nan
    except (ValueError, OverflowError):
        return None
    return number if math.isfinite(number) else None


def is_something(value: object) -> bool:
    """Whether a value holds a number other than 0, if in a text."""
    if isinstance(value, Mapping):
        return any(is_something(each) for key, each in value.items() if key not in ("rows", "cols", "sizes", "dt"))
    if isinstance(value, list):
        return any(map(is_something, value))
    if isinstance(value, float) and not math.isfinite(value):
        return True
    return bool(_number(value))
