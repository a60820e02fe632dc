"""The names that people and tools give to the parts of a calibration, whatever their spelling.

A key is compared in lower case without separators. Around it may stand which camera of several it belongs to: `M1`,
`cameraMatrixLeft`, `cam0_K`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from functools import lru_cache

from circlepose.io.calibration.lens_models import is_lens_model, plain
from circlepose.io.text.yaml import MatrixNode

COEFFICIENTS = ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6", "s1", "s2", "s3", "s4", "tau_x", "tau_y")
"""in OpenCV's order"""
DISTORTION_ROLES = ("distortion", "coefficient", "radial", "tangential")
FOCAL_ROLES = ("matrix", "fx", "focal")
SIZE_ROLES = ("size", "shape", "width", "height")
MODEL_ROLES = ("model", "fisheye")

_IMAGE = r"(?:calib(?:ration)?)?(?:image|img|im|frame)?s?"
_ROLES: Mapping[str, re.Pattern[str]] = {
    role: re.compile(pattern)
    for role, pattern in {
        "matrix": r"(?:camera|cam)?(?:intrinsics?)?(?:camera)?(?:matrix|mtx|mat)k?|k(?:matrix|mat)?|m|"
        r"(?:camera|cam)?intrinsics?(?:calibration|parameters?|params?)?|projectionparameters?",
        "fx": "fx|focalx|focallengthx|fu|flx|xfocal",
        "fy": "fy|focaly|focallengthy|fv|fly|yfocal",
        "cx": "cx|ppx|principalx|principalpointx|pointx|u0|cu|centerx|opticalcenterx",
        "cy": "cy|ppy|principaly|principalpointy|pointy|v0|cv|centery|opticalcentery",
        "focal": r"f|focal(?:length)?s?(?:px|pixels?|inpixels)?",
        "center": r"c|pp|principalpoint(?:px|pixels?)?|opticalcenter",
        "skew": "skew|s|cameraskew|skewness",
        "alpha": "alphac",
        "distortion": r"(?:lens|camera|cam)?(?:dist|distort|distortions?)(?:coeff?(?:icient)?s?)?"
        r"(?:parameters?|params?|vector|vec|array|matrix)?|d|coeff?(?:icient)?s?",
        "radial": r"radial(?:distortion)?(?:coeff?(?:icient)?s?)?",
        "tangential": r"tangential(?:distortion)?(?:coeff?(?:icient)?s?)?",
        "coefficient": r"(?:dist(?:ortion)?|radial|tangential|lens)?(?:k[1-6]|p[12]|s[1-4]|tau[xy])",
        "size": rf"(?:camera)?{_IMAGE}(?:size|resolution|dimensions?|dims?)(?:px|pixels?|wh)?|wh",
        "shape": rf"{_IMAGE}shape|{_IMAGE}sizehw",
        "width": rf"{_IMAGE}(?:width|w)(?:px|pixels?)?|resolutionx|xresolution|resx",
        "height": rf"{_IMAGE}(?:height|h)(?:px|pixels?)?|resolutiony|yresolution|resy",
        "model": r"(?:lens|camera|cam|distortion|dist|projection|calib(?:ration)?|intrinsics?)?(?:model|type)"
        r"(?:type|name)?|distortion|lens|projection",
        "fisheye": r"(?:is|use|has|b)?fisheye(?:model|lens|camera|cam)?|(?:lens|camera|distortion)?model",
        "deviation": "cameramatrixstddev",
        "focal_sigma": "focalsigmapx",
        "center_sigma": "centersigmapx",
        "error": r"(?:avg|mean|rms|total|overall)?(?:reproj(?:ection)?|calib(?:ration)?)(?:err(?:or)?|rms)"
        r"(?:px|pixels?)?|rms(?:err(?:or)?)?(?:px)?|(?:avg|mean)err(?:or)?|ret",
        "target": "target",
    }.items()
}
_ANY_ROLE = re.compile("|".join(f"(?:{pattern.pattern})" for pattern in _ROLES.values()))
_LONGEST = 60
_LONGEST_TEXT = 1000
_OF_ONE_CAMERA = ("matrix", "fx", "fy", "cx", "cy", "distortion", "size", "shape", "width", "height")
"""roles whose keys may say which camera they are of"""
_UNNAMED = re.compile("parameters?|params?|values?|vector|coeff?(?:icient)?s?|matrix|array|list|data")
_NUMBERS = ("fx", "fy", "cx", "cy", "skew", "alpha", "coefficient", "width", "height", "focal_sigma", "center_sigma")
_LOOSE_MODELS = re.compile(
    r"(?:camera|cam|lens)?type|(?:calib(?:ration)?|intrinsics?)(?:model|type)(?:type|name)?|lens|projection|distortion"
)
"""keys whose text is a lens model only if it is one that we know"""
_END = re.compile(r"(?P<stem>.+?)(?P<end>(?:cam(?:era)?)?[0-9]{1,2}|left|right|[lr])")
_BEGIN = re.compile(r"(?P<end>(?:cam(?:era)?)?[0-9]{1,2}|cam(?:era)?(?:left|right)|left|right)(?P<stem>.+)")
_ASIDE = re.compile(
    r".*(?:board|pattern|chess|checker|charuco|aruco|april|marker|square|undist|rectif|optimal|extrinsic|stddev|"
    r"covariance|screen).*|(?:orig|output)dimensions?|"
    r"(?:target|roi|crop|sensor|new.*|images|imu|header|stamp|pose|grid|views?|r|t|p|q|e|f)[0-9]?"
)
"""groups of keys about something else than the lens"""
_DISTORTS = re.compile(
    r".*(?:dist(?!ance|to)|coef|radial|tangential|aberr|thinprism).*|tau.*|xi|tilt[xy]|kc[0-9]?|kappas?[0-9]*|"
    r"lens(?:params?|parameters?)|(?:inv)?poly?(?:nomials?)?[0-9]*"
)
_NUMBERED = re.compile(r"[abdkprt][0-9]+|omega|beta|lambda")
_NO_LENS = re.compile(
    r"(?:undist|isdist|has|use|new|optimal|rect|std|sigma).*|"
    r".*(?:std|stddev|stdev|sigmas?|cov|covariance|errors?|limit)"
)
"""what looks like distortion, and is something about it"""
_NAMES = (
    *("model", "camera_matrix", "fx", "fy", "cx", "cy", "dist_coeffs", "image_size", "focal_sigma_px"),
    *("center_sigma_px", "target", "distortion_coefficients", "image_width", "image_height", "distortion_model"),
    *("camera_model", "fisheye_model", "width", "height", "intrinsics", "distortion"),
)
_FISHEYE = re.compile(r"(?<!undistorted)(?<!non)(?<!not)(?<!no)(?:fisheye|equidist|kannala)")
_YES = ("true", "yes", "on", "y", "1")
_NO = ("false", "no", "off", "n", "0", "none", "null", "")
_PAIR = re.compile(r"[\[(]?\s*(\d+)\s*[,x×* ]\s*(\d+)\s*[\])]?", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Field:
    """A value of a file, and what it is."""

    path: str
    """its key, in groups with theirs before it: `intrinsics.fx`"""
    role: str
    """one of the roles above; empty if it is no part of a camera"""
    end: str
    """which camera it belongs to, by its key; mostly empty"""
    value: object

    @property
    def name(self) -> str:
        """The key itself, as it is compared."""
        return plain(self.path.rpartition(".")[2])


def field_of(key: str, value: object, path: str, group: str = "") -> Field:
    """Return what a key and its value are; `parameters` and the like are what the `group` is that they stand in."""
    if group and _UNNAMED.fullmatch(plain(key)):
        field = field_of(group, value, path)
        if field.role:
            return field
    for role, stem, end in _meanings(plain(key)):
        if _fits(role, stem, value):
            return Field(path, role, end, value)
    return Field(path, "", "", value)


@lru_cache(maxsize=4096)
def _meanings(name: str) -> tuple[tuple[str, str, str], ...]:
    """Return what a key may mean: role, the key without the part that says of which camera, and that part."""
    return tuple(
        (role, stem, end)
        for stem, end in _splits(name)
        if len(stem) <= _LONGEST and _ANY_ROLE.fullmatch(stem)
        for role, pattern in _ROLES.items()
        if pattern.fullmatch(stem) and (not end or role in _OF_ONE_CAMERA)
    )


def is_matrix(value: object) -> bool:
    """Whether a value is a list, or a matrix of rows, cols and data."""
    return isinstance(value, MatrixNode | list) or (
        isinstance(value, Mapping) and "data" in value and not isinstance(value["data"], Mapping)
    )


def is_aside(key: str) -> bool:
    """Whether a group of this name is about something else than the lens."""
    return _ASIDE.fullmatch(plain(key)) is not None


def looks_like_distortion(field: Field) -> bool:
    """Whether a key that is not understood, or the group that it stands in, may be of the lens.

    P1 may, if it is one number and no matrix.
    """
    if _is_number(field.value) and _NUMBERED.fullmatch(field.name):
        return True
    names = [plain(part) for part in field.path.split(".")]
    return any(map(_DISTORTS.fullmatch, names)) and not any(map(_NO_LENS.fullmatch, names))


def is_neutral(value: object) -> bool:
    """Whether a value says nothing, no or 0, in whatever form."""
    if isinstance(value, Mapping):
        return all(is_neutral(each) for key, each in value.items() if key not in ("rows", "cols", "sizes", "dt"))
    if isinstance(value, list):
        return all(map(is_neutral, value))
    return value is None or value == 0 or truth(value) is False


def truth(value: object) -> bool | None:
    """Return what a text, a number or a bool says of yes and no; None where it says something else."""
    word = str(value).strip().lower() if isinstance(value, str) else None
    if value in (0, 1) or word in _YES or word in _NO:
        return word in _YES if word is not None else bool(value)
    return None


def is_in_fisheye_group(field: Field) -> bool:
    """Whether a key stands in a group that is called a fisheye's."""
    return any(_FISHEYE.search(plain(part)) for part in field.path.split(".")[:-1]) and not is_neutral(field.value)


def says_fisheye(field: Field) -> bool:
    """Whether a key, its group or its text states a fisheye lens."""
    if is_neutral(field.value):
        return False
    return _FISHEYE.search(plain(field.path)) is not None or any(
        _FISHEYE.search(plain(text)) for text in _texts(field.value)
    )


def _texts(value: object) -> list[str]:
    if isinstance(value, str):
        return [value[:_LONGEST_TEXT]]
    if isinstance(value, list):
        return [each[:_LONGEST_TEXT] for each in value[:_LONGEST_TEXT] if isinstance(each, str)]
    return []


def near_name(key: str, cutoff: float = 0.85) -> str | None:
    """Return the key that one which is not understood was probably meant for."""
    by_plain = {plain(name): name for name in _NAMES}
    near = get_close_matches(plain(key), by_plain, n=1, cutoff=cutoff)
    return by_plain[near[0]] if near else None


def pair_of(text: str) -> list[object] | None:
    """Return the two whole numbers of a text such as `640x480` or `(640, 480)`."""
    match = _PAIR.fullmatch(text.strip())
    return [int(match[1]), int(match[2])] if match and len(text) < 40 else None


def _splits(name: str) -> list[tuple[str, str]]:
    """Return the name as it is, and without the part that says of which camera."""
    found = [(name, "")]
    for pattern in (_END, _BEGIN):
        match = pattern.fullmatch(name)
        if match:
            end = re.sub("cam(?:era)?", "", match["end"])
            found.append((match["stem"], {"l": "left", "r": "right"}.get(end, end)))
    return found


def _fits(role: str, stem: str, value: object) -> bool:
    """Whether a value may be meant for a role; so that `size: 0.025` is no image size, nor `K1: 0.1` a matrix."""
    if value is None:
        return len(stem) > 1 or stem in ("k", "d")
    if role in ("matrix", "distortion", "radial", "tangential", "deviation", "shape"):
        return is_matrix(value)
    if role == "size":
        return is_matrix(value) or (isinstance(value, str) and pair_of(value) is not None)
    if role == "center":
        return _is_pair(value)
    if role == "focal":
        return _is_pair(value) or _is_number(value)
    if role == "model":
        return isinstance(value, str) and (not _LOOSE_MODELS.fullmatch(stem) or is_lens_model(value))
    if role == "fisheye":
        return isinstance(value, int | float) or ("fisheye" in stem and truth(value) is not None)
    if role == "error":
        return _is_number(value)
    if role in _NUMBERS:
        return not isinstance(value, Mapping | list)
    return True


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _is_pair(value: object) -> bool:
    return isinstance(value, list) and len(value) == 2
